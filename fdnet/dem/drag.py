"""Stokes drag in the invasion deck: what each scheme of `drag.scheme` puts into `_drag.in.j2`."""

from typing import Any

from fdnet.case.case import InvasionCase
from fdnet.dem.deck import number
from fdnet.scales.scales import InvasionScales

BELOW_ZERO = -5e-324
"""The largest number below 0: a region that ends here holds exactly x < 0."""


def drag_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any]:
    """Variables of the drag block: the scheme and, as text, the numbers that it needs."""
    if case.drag.driven:
        hold = scales.hold_steps if scales.hold_steps > 1 else 0
        return {"driven": True, "scheme": case.drag.scheme, "hold_steps": hold}
    coefficient = case.fluid.stokes_coefficient_Pa_s * case.drag.multiplier
    slower = scales.interstitial_velocity - scales.upstream_velocity
    own = (
        _viscous(case, scales, coefficient, slower)
        if case.drag.scheme == "viscous"
        else _by_radius(scales, slower)
    )
    return {
        "driven": False,
        "scheme": case.drag.scheme,
        "coefficient": number(coefficient),
        "velocity": number(scales.interstitial_velocity),
        **own,
    }


def _by_radius(scales: InvasionScales, slower: float) -> dict[str, Any]:
    """F = 6 pi mu M r (u - v), for each fine by its own radius r.

    mu is the viscosity, M the multiplier, u the fluid's and v the fine's velocity.
    """
    fluid = f"(f_uf[1]-(x<0.0)*{number(slower)})" if slower else "f_uf[1]"
    return {"fluid_x": fluid, "hold_steps": scales.hold_steps if scales.hold_steps > 1 else 0}


def _viscous(
    case: InvasionCase, scales: InvasionScales, coefficient: float, slower: float
) -> dict[str, Any]:
    """The same force for fines of one radius, as a constant force and viscous damping.

    The constant force is 6 pi mu M r u, at x < 0 with the fluid's velocity upstream.
    """
    damping = coefficient * case.fines.mean_radius_m
    return {
        "damping": number(damping),
        "push": number(damping * scales.interstitial_velocity),
        "slower": number(-damping * slower) if slower else "",
        "face": number(BELOW_ZERO),
    }
