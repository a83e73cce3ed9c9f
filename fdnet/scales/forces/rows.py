"""The forces on a fine as rows of the table of scales."""

from fdnet.scales.quantity import Quantity, quantity
from fdnet.scales.scales import InvasionScales


def force_rows(scales: InvasionScales) -> list[Quantity]:
    """Ratios of the forces on the largest fine, how fast it is and how deep it is pressed in."""
    return [
        quantity(
            "particle Reynolds number",
            "Re",
            scales.reynolds,
            "-",
            "rho_f u 2r / mu",
            "Stokes drag holds below about 1",
        ),
        quantity(
            "Stokes number",
            "St",
            scales.stokes,
            "-",
            "tau u / d_grain",
            "inertia over drag at a grain",
        ),
        quantity(
            "pressure gradient over drag",
            "P",
            scales.gradient_over_drag,
            "-",
            "2 r^2 phi / (9 k M)",
            "V (-grad p) over Stokes's drag at rest",
        ),
        quantity(
            "gravity over drag",
            "G",
            scales.gravity_over_drag,
            "-",
            "2 r^2 (rho - rho_f) g / (9 mu u M)",
            "force ratio",
        ),
        quantity(
            "velocity of a free fine",
            "w",
            scales.drift_velocity,
            "m/s",
            "u (1 + P) where the gradient acts",
            "balance of drag and gradient",
        ),
        *_overlap_rows(scales),
    ]


def _overlap_rows(scales: InvasionScales) -> list[Quantity]:
    return [
        quantity(
            "impact overlap over diameter",
            "delta/d",
            scales.impact_overlap,
            "-",
            "v sqrt(m/k) / 2r, v at most w",
            "linear spring",
        ),
        quantity(
            "drag overlap over diameter",
            "delta/d",
            scales.drag_overlap,
            "-",
            "drag and gradient / (2 k r)",
            "linear spring",
        ),
    ]
