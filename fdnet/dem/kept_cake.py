"""A cake that stays slows the fluid of a clean-up down while it stands, and no longer.

Each fine upstream of the face takes its share of the cake's resistance by its mass. What the fluid
loses there follows from where these fines are and how fast they move, so a clean-up that was cut
goes on with the same rate.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fdnet.dem.deck import number
from fdnet.scales.clean_up import BackFlow, InSeries, in_series
from fdnet.spheres.snapshot import Array, Snapshot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptCake:
    """A cake that stays.

    Attributes:
        series: the cake in series with the rest of the way.
        whole: mass of the fines upstream of the face when the clean-up begins, kg.
        velocity: of the fluid upstream without a cake, m/s as simulated; below 0.
        face: x (m) upstream of which a fine has come out.
        mass: (N,) kg, of all fines in the order of their ids.
        first: id of the first fine.
    """

    series: InSeries
    whole: float
    velocity: float
    face: float
    mass: Array
    first: int

    def rate(self, spheres: Snapshot) -> float:
        """Rate of the fluid over that without a cake.

        Fines that still come in count as standing, those that outrun the fluid as carried.
        """
        fines = spheres.fines()
        x, mass = fines.position[:, 0], self.mass[fines.id.astype(int) - self.first]
        ahead = (x >= self.face) & (x < 0)
        there = float(mass[ahead].sum()) / self.whole
        going = float(mass[ahead] @ fines.velocity[ahead, 0]) / self.whole / self.velocity
        return self.series.rate(there, min(max(going, 0.0), there))


def kept_cake(
    flow: BackFlow, spheres: Snapshot, face: float, resistance: float, *, density: Array
) -> KeptCake | None:
    """The cake of `spheres`, grains and fines, that begin; None where it does not resist.

    Args:
        flow: of the clean-up.
        spheres: at the end of the invasion.
        face: x (m) upstream of which a fine has come out; 0 without a cake that stays.
        resistance: of the cake, 1/m.
        density: (N,) kg/m3, of all fines in the order of their ids.
    """
    if face >= 0 or resistance <= 0:
        return None
    first = int(spheres.grains().id.max()) + 1
    fines = spheres.fines()
    x, index = fines.position[:, 0], fines.id.astype(int) - first
    mass = np.zeros(len(density))
    mass[index] = density[index] * 4.0 / 3.0 * np.pi * fines.radius**3
    ahead = (x >= face) & (x < 0)
    return KeptCake(
        series=in_series(flow, resistance),
        whole=float(mass[index[ahead]].sum()),
        velocity=-flow.scales.upstream_velocity,
        face=face,
        mass=mass,
        first=first,
    )


def slowed_variables(cake: KeptCake) -> dict[str, str]:
    """The numbers of the cake in a deck."""
    return {
        "whole": number(cake.whole),
        "velocity": number(cake.velocity),
        "series": number(cake.series.cake),
        "viscous": number(cake.series.viscous),
        "inertia": number(cake.series.inertia),
    }


def slowed_drag(drag: dict[str, Any]) -> dict[str, Any]:
    """The variables of `_drag.in.j2` for a fluid slowed down by the deck's variable `rate`.

    Forces that do not depend on the velocity of a fine become variables of the deck, whose
    formulas are in "slowed". The implicit scheme keeps one velocity a fine, so it gets the force
    "back" of the velocity that is missing.
    """
    if drag["coupled"]:
        return drag
    slowed = {name: f"v_rate*{drag[name]}" for name in ("push", "slower") if drag.get(name)}
    changed = {name: f"v_{name}" for name in slowed}
    if drag.get("fluid_x"):
        changed["fluid_x"] = f"v_rate*{drag['fluid_x']}"
    if pull := drag["gradient"]:
        name = "formula" if pull["formula"] else "force"
        if name == "force":
            slowed["pull"] = f"v_rate*{pull['force']}"
        formula = "v_pull" if name == "force" else f"v_rate*{pull['formula']}"
        changed["gradient"] = pull | {name: formula}
    back = f"(v_rate-1.0)*{drag['coefficient']}*r*{drag['velocity']}"
    implicit = drag["scheme"] == "implicit"
    return drag | changed | {"slowed": slowed, "back": back if implicit else ""}
