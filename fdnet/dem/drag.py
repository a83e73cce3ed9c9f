"""The fluid in the invasion deck: what each scheme of `drag.scheme` puts into `_drag.in.j2`.

The force of the pressure gradient is the same in all schemes: constant on each fine, and only
inside the pack. It acts on the fines alone, as the drag does.
"""

from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.deck import LeftOut, number
from fdnet.scales.forces.reynolds import COEFFICIENT, EXPONENT
from fdnet.scales.scales import InvasionScales

BELOW_ZERO = -5e-324
"""The largest number below 0: a region that ends here holds exactly x < 0."""


def drag_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any]:
    """Variables of the drag block: the scheme and, as text, the numbers that it needs."""
    if case.drag.coupled:
        hold = scales.hold_steps if scales.hold_steps > 1 else 0
        return {"coupled": True, "scheme": case.drag.scheme, "hold_steps": hold}
    coefficient = case.fluid.stokes_coefficient_Pa_s * case.drag.multiplier
    slower = scales.drive_velocity - scales.upstream_velocity
    own = (
        _viscous(case, scales, coefficient, slower)
        if case.drag.scheme == "viscous"
        else _by_radius(scales, slower)
    )
    return {
        "coupled": False,
        "scheme": case.drag.scheme,
        "coefficient": number(coefficient),
        "velocity": number(scales.drive_velocity),
        "gradient": _gradient(case, scales),
        **own,
    }


def _gradient(case: InvasionCase, scales: InvasionScales) -> dict[str, str] | None:
    """V (-grad p) inside the pack: one force, or a formula for fines of many sizes.

    Where all have one density V is taken from the mass, which is the cheaper formula.
    """
    push = scales.push
    if not push.gradient:
        return None
    end = number(np.nextafter(case.size_m[0], 0))
    densities = {one.density for one in case.fines.components}
    formula = (
        f"{number(push.gradient / min(densities))}*mass"
        if len(densities) == 1
        else f"{number(push.gradient_force(1.0))}*r*r*r"
    )
    one_size = case.fines.one_size
    return {
        "pores": f"0.0 {end} INF INF INF INF",
        "force": number(push.gradient_force(case.fines.mean_radius_m)) if one_size else "",
        "formula": "" if one_size else formula,
    }


def forces_left_out(case: InvasionCase) -> list[LeftOut]:
    """The forces of the fluid that the deck does without."""
    drag = case.drag
    return [
        LeftOut(what=what, why=why)
        for what, left, why in (
            ("force of the pressure gradient", not drag.pressure_gradient, "switched off"),
            (
                "force of the pressure gradient on the grains",
                drag.pressure_gradient and case.grains.motion == "mobile",
                "the fluid pushes the fines only",
            ),
            ("drag at finite Reynolds numbers", drag.inertia == "none", "not asked for"),
            ("drag in a crowd", drag.crowd == "none", "not asked for"),
        )
        if left
    ]


def _by_radius(scales: InvasionScales, slower: float) -> dict[str, Any]:
    """F = 6 pi mu M r (u - v), for each fine by its own radius r.

    mu is the viscosity, M the multiplier, u the fluid's and v the fine's velocity.
    """
    fluid = f"(f_uf[1]-(x<0.0)*{number(slower)})" if slower else "f_uf[1]"
    return {
        "fluid_x": fluid,
        "hold_steps": scales.hold_steps if scales.hold_steps > 1 else 0,
        "inertia": _inertia(scales) if scales.push.reynolds_slope else None,
    }


def _inertia(scales: InvasionScales) -> dict[str, str]:
    """Schiller and Naumann's factor."""
    return {
        "factor": number(COEFFICIENT),
        "exponent": number(EXPONENT),
        "reynolds": number(scales.push.reynolds_slope),
    }


def _viscous(
    case: InvasionCase, scales: InvasionScales, coefficient: float, slower: float
) -> dict[str, Any]:
    """The same force for fines of one radius, as a constant force and viscous damping.

    The constant force is 6 pi mu M r u, at x < 0 with the fluid's velocity upstream.
    """
    damping = coefficient * case.fines.mean_radius_m
    return {
        "damping": number(damping),
        "push": number(damping * scales.drive_velocity),
        "slower": number(-damping * slower) if slower else "",
        "face": number(BELOW_ZERO),
    }
