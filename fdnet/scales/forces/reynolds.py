"""Drag of a lone sphere at a finite Reynolds number, by Schiller and Naumann.

L. Schiller and A. Naumann, Z. Ver. Dtsch. Ing. 77 (1933) 318-320. The Reynolds number is that of
the slip: rho_f |u - v| 2r / mu.
"""

import math

from fdnet.errors import CaseError

COEFFICIENT, EXPONENT = 0.15, 0.687
MOST_REYNOLDS = 800.0
"""Reynolds number up to which the correlation holds."""


def drag_factor(reynolds: float) -> float:
    """Drag over Stokes's, 1 + 0.15 Re^0.687. Raises CaseError outside of 0 to `MOST_REYNOLDS`."""
    if not 0 <= reynolds <= MOST_REYNOLDS:
        raise CaseError(
            f"particle Reynolds number {reynolds:.4g}: the drag of Schiller and Naumann holds "
            f"from 0 to {MOST_REYNOLDS:g}; check fluid.velocity_m_s, fluid.viscosity_cP and "
            'fines.radius_mm, or set drag.inertia = "none"'
        )
    return 1 + COEFFICIENT * reynolds**EXPONENT


def slope_factor(reynolds: float) -> float:
    """Change of drag with slip over Stokes's, 1 + 0.15 (1 + 0.687) Re^0.687.

    It shortens the time in which a fine relaxes, and so the longest stable explicit step.
    """
    return 1 + COEFFICIENT * (1 + EXPONENT) * reynolds**EXPONENT


def balanced_slip(stokes_slip: float, reynolds: float) -> float:
    """Slip at which this drag is the Stokes drag of `stokes_slip`, in the unit of it.

    `reynolds` is the Reynolds number of `stokes_slip`. Newton's method on the convex function
    s f(Re s / s0) - s0, from s0 down, whose iterates fall to the only root.
    """
    slip = 1.0
    for _ in range(_MOST_ITERATIONS):
        excess = slip * (1 + COEFFICIENT * (reynolds * slip) ** EXPONENT) - 1
        step = excess / slope_factor(reynolds * slip)
        slip -= step
        if math.isclose(slip, slip + step, rel_tol=1e-13):
            break
    return slip * stokes_slip


_MOST_ITERATIONS = 60
