"""Gravity and buoyancy in the invasion deck: what acts on the fines, and on grains that move.

A sphere of mass m and density rho_p in a fluid of density rho_f at rest feels
m g (1 - rho_f / rho_p), gravity and Archimedes's buoyancy, in any direction of g. That is
LIGGGHTS's `fix gravity` with a magnitude for each group of equal density, and exact.
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
    groups = {"fines": case.fines.density_kg_m3}
    if case.grains.motion == "mobile":
        groups["grains"] = case.grains.density_kg_m3
    pulls = [
        _pull(name, scales.force_factor * share_of_gravity(density, case), vector)
        for name, density in groups.items()
    ]
    left_out = [] if case.gravity.buoyancy else [LeftOut(what="buoyancy", why="switched off")]
    return pulls, left_out


def share_of_gravity(density: float, case: InvasionCase) -> float:
    """1 - rho_f / rho_p of spheres of `density` kg/m3; below 0 they rise. 1 without buoyancy."""
    return 1 - case.fluid.density_kg_m3 / density * case.gravity.buoyancy


def _pull(group: str, share: float, vector: tuple[float, float, float]) -> dict[str, Any]:
    magnitude, turn = abs(share) * math.hypot(*vector), math.copysign(1.0, share)
    direction = " ".join(number(turn * one / math.hypot(*vector) + 0.0) for one in vector)
    return {"group": group, "magnitude": number(magnitude), "direction": direction}
