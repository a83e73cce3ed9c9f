"""Gravity and buoyancy in the invasion deck: what acts on the fines, and on grains that move.

A sphere of mass m and density rho_p in a fluid of density rho_f at rest feels
m g (1 - rho_f / rho_p), gravity and Archimedes's buoyancy, in any direction of g. That is
LIGGGHTS's `fix gravity` with a magnitude for each group of equal density, and exact. Fines of
several densities have the whole of gravity, and buoyancy -rho_f g 4/3 pi r^3 as a force of its
own.
A simulation that is driven faster than the fluid multiplies it as all forces.
"""

import math
from typing import Any

from fdnet.case.case import InvasionCase
from fdnet.dem.deck import LeftOut, number
from fdnet.scales.scales import InvasionScales

WHAT = "gravity and buoyancy"


def gravity_variables(
    case: InvasionCase, scales: InvasionScales
) -> tuple[list[dict[str, Any]], list[LeftOut]]:
    """One `fix gravity` for each group that it moves, and what is left out of the deck."""
    mode, vector = case.gravity.mode, case.gravity.acceleration_m_s2
    if mode == "off" or math.hypot(*vector) == 0:
        return [], [LeftOut(what=WHAT, why="switched off")]
    if mode == "auto" and scales.gravity_over_drag < case.gravity.negligible_below:
        ratio, limit = scales.gravity_over_drag, case.gravity.negligible_below
        why = f"gravity is {ratio:.1e} of the drag, below {limit:g}"
        return [], [LeftOut(what=WHAT, why=why)]
    groups = {"fines": {one.density for one in case.fines.components}}
    if case.grains.motion == "mobile":
        groups["grains"] = {case.grains.density_kg_m3}
    pulls = []
    for name, densities in groups.items():
        mixed = len(densities) > 1
        share = 1.0 if mixed else share_of_gravity(min(densities), case)
        lift = _lift(case, scales) if mixed and case.gravity.buoyancy else []
        pulls.append(_pull(name, scales.force_factor * share, vector) | {"lift": lift})
    left_out = [] if case.gravity.buoyancy else [LeftOut(what="buoyancy", why="switched off")]
    return pulls, left_out


def share_of_gravity(density: float, case: InvasionCase) -> float:
    """1 - rho_f / rho_p of spheres of `density` kg/m3; below 0 they rise. 1 without buoyancy."""
    return 1 - case.fluid.density_kg_m3 / density * case.gravity.buoyancy


def _lift(case: InvasionCase, scales: InvasionScales) -> list[str]:
    """Buoyancy over the cube of the radius along x, y and z, N/m3, as simulated."""
    rate = 4 / 3 * math.pi * case.fluid.density_kg_m3 * scales.force_factor
    return [number(-rate * one + 0.0) for one in case.gravity.acceleration_m_s2]


def _pull(group: str, share: float, vector: tuple[float, float, float]) -> dict[str, Any]:
    magnitude, turn = abs(share) * math.hypot(*vector), math.copysign(1.0, share)
    direction = " ".join(number(turn * one / math.hypot(*vector) + 0.0) for one in vector)
    return {"group": group, "magnitude": number(magnitude), "direction": direction}
