"""The forces on a fine as rows of the table of scales."""

from fdnet.scales.forces.throat import MOST_RATIO, held_factor
from fdnet.scales.quantity import Quantity, row
from fdnet.scales.scales import InvasionScales


def force_rows(scales: InvasionScales) -> list[Quantity]:
    """Ratios of the forces on the largest fine, and how fast it is."""
    return [
        row(
            "particle Reynolds number",
            "Re",
            scales.reynolds,
            "-",
            "rho_f u 2r / mu",
            "Stokes drag holds below about 1",
        ),
        row(
            "Stokes number",
            "St",
            scales.stokes,
            "-",
            "tau u / d_grain, as simulated",
            "inertia over drag at a grain",
        ),
        row(
            "impact Stokes number",
            "St_i",
            scales.impact_stokes,
            "-",
            "tau w / r, as simulated",
            "Joseph 2001; inertia does not matter well below 1",
        ),
        row(
            "pressure gradient over drag",
            "P",
            scales.gradient_over_drag,
            "-",
            "2 r^2 phi / (9 k M)",
            "V (-grad p) over Stokes's drag at rest",
        ),
        row(
            "gravity over drag",
            "G",
            scales.gravity_over_drag,
            "-",
            "2 r^2 (rho - rho_f) g / (9 mu u M)",
            "force ratio",
        ),
        row(
            "velocity of a free fine",
            "w",
            scales.drift_velocity,
            "m/s",
            "u (1 + P) where the gradient acts, as simulated",
            "balance of drag and gradient",
        ),
        *_throat_rows(scales),
    ]


def _throat_rows(scales: InvasionScales) -> list[Quantity]:
    """The walls of the throats; no factor for a fine that closes them."""
    rows = [
        row(
            "largest fine over throat",
            "d/D",
            scales.throat_ratio,
            "-",
            "2r / sqrt(32 k / phi)",
            "tubes of the pack's permeability",
        )
    ]
    if scales.throat_ratio <= MOST_RATIO:
        rows.append(
            row(
                "drag in a throat over a lone sphere's",
                "K",
                held_factor(scales.throat_ratio),
                "-",
                "at rest on the axis",
                "Haberman & Sayre 1958, solved anew",
            )
        )
    return rows
