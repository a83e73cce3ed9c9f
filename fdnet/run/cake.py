"""The external cake: its fines, its porosity by depth, and its share of the resistance.

The resistance of a bed of thickness h and permeability k is h / k, 1/m; that of layers in series
is their sum. Each fine of a cake at rest resists the superficial velocity U by its drag,

    F_i = 6 pi mu r_i Y_i F(phi_i) / phi_i U,    R = sum(F_i) / (mu U A),

by the law of Beetstra, van der Hoef and Kuipers (`fdnet.scales.drag`), with the porosity phi_i of
the pack and the cake around it. The flow that follows the deposit takes the same sum. It is
8 to 17 % above resolved flow (docs/physics_network.md, section 10).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fdnet.network.fines.crowding import REACH, local_porosity
from fdnet.network.specimen import cake_of, cake_thickness
from fdnet.scales.drag import crowd_drag_factor
from fdnet.spheres.geometry import measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot, one_line

THICK = 3.0  # Least thickness in mean diameters of a cake that has a permeability
PACKED = 0.7  # Porosity up to which a slice is packed: looser ones are the heaps on top of a cake
LAW = "beetstra"  # The law of a cake's resistance, as summary.json names it


class Standing(NamedTuple):
    """The fines of a cake, and what each resists."""

    fines: Snapshot  # N fines
    resistance: Array  # (N,) 1/m of each; of the cake it is their sum
    thickness: float  # m, from the face to the foremost fine


def standing_cake(spheres: Snapshot, periodic: Sequence[bool]) -> Standing:
    """The fines of `spheres` that stand before the face, and their resistance."""
    low, fines = float(spheres.box[0, 0]), cake_of(spheres, periodic)
    if not len(fines):
        return Standing(fines, np.zeros(0), 0.0)
    reach = REACH * float(fines.radius.max()) + float(spheres.radius.max())
    x = spheres.position[:, 0]
    around = spheres.where((x >= low) & (x < low + reach)).joined(fines)
    near = local_porosity(around, (False, bool(periodic[1]), bool(periodic[2])))
    own = slice(len(near.porosity) - len(fines), None)
    porosity = near.porosity[own]
    factor = crowd_drag_factor(porosity, near.size_ratio[own])
    drag = 6.0 * np.pi * fines.radius * factor / porosity
    area = float(np.prod(np.ptp(spheres.box[1:], axis=1)))
    return Standing(fines, drag / area, cake_thickness(fines))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cake:
    """The cake in B slices of a mean diameter, from its front to the formation face."""

    edges: Array  # (B+1,) m, x; the last is the face
    count: Array  # (B,) number of fines centred in the slice
    porosity: Array  # (B,) void over volume
    diameter: Array  # (B,) m, Sauter mean of these fines
    resistance: Array  # (B,) 1/m

    __repr__ = one_line

    @property
    def thickness(self) -> float:
        """Of the whole cake, m."""
        return float(self.edges[-1] - self.edges[0])

    @property
    def packed(self) -> Array:
        """(B,) whether the slice is packed."""
        return self.porosity <= PACKED

    @property
    def packed_thickness(self) -> float:
        """Of the packed slices together, m."""
        return float(np.sum(np.diff(self.edges)[self.packed]))

    @property
    def packed_porosity(self) -> float:
        """Of the packed slices together; of all where none is."""
        which = self.packed if self.packed.any() else np.ones(len(self.count), bool)
        return float(np.average(self.porosity[which], weights=np.diff(self.edges)[which]))

    @property
    def permeability(self) -> float | None:
        """Of the packed slices in series, m2; None where there is `no_cake_yet`."""
        if self.no_cake_yet:
            return None
        return self.packed_thickness / float(np.sum(self.resistance[self.packed]))

    @property
    def no_cake_yet(self) -> str:
        """Why these fines are no cake with a permeability of its own; "" where they are."""
        layers = self.packed_thickness / float(np.average(self.diameter, weights=self.count))
        if layers >= THICK:
            return ""
        if not self.packed.any():
            return f"no cake yet: loose all through, at a porosity of {self.packed_porosity:.2f}"
        return f"no cake yet: packed for {layers:.1f} diameters of a fine, {THICK:g} are needed"


def measure_cake(spheres: Snapshot, periodic: Sequence[bool]) -> Cake | None:
    """The cake of `spheres`, grains and fines; None where no fine stands before the face."""
    face = float(spheres.box[0, 0])
    cake, resistance, thickness = standing_cake(spheres, periodic)
    if not len(cake):
        return None
    slices = max(1, math.ceil(thickness / (2.0 * float(np.mean(cake.radius))) - 0.5))
    edges = face - thickness * np.linspace(1.0, 0.0, slices + 1)
    edges[-1] = face
    bed = spheres.where(spheres.position[:, 0] >= face).joined(cake)
    bed = replace(bed, box=np.array([edges[[0, -1]], *bed.box[1:]]))
    sides = (False, bool(periodic[1]), bool(periodic[2]))
    where = np.clip(np.searchsorted(edges, cake.position[:, 0], "right") - 1, 0, slices - 1)
    cube, square = (np.bincount(where, cake.radius**power, slices) for power in (3, 2))
    diameter = np.full(slices, float(np.sum(cake.radius**3) / np.sum(cake.radius**2)))
    return Cake(
        edges=edges,
        count=np.bincount(where, minlength=slices),
        porosity=measure_porosity(bed, periodic=sides, edges=edges).profile,
        diameter=2.0 * np.divide(cube, square, out=diameter, where=square > 0),
        resistance=np.bincount(where, resistance, slices),
    )


def cake_rows(cake: Cake) -> list[dict[str, Any]]:
    """The slices as cake.csv names their values, from the face outwards."""
    width = np.diff(cake.edges)
    return [
        {
            "x_lo_m": float(cake.edges[i]),
            "x_hi_m": float(cake.edges[i + 1]),
            "fines_count": int(cake.count[i]),
            "porosity": float(cake.porosity[i]),
            "sauter_diameter_m": float(cake.diameter[i]),
            "k_m2": float(width[i] / cake.resistance[i]) if cake.count[i] else None,
        }
        for i in reversed(range(len(cake.count)))
    ]


def cake_summary(cake: Cake | None, pack: float, finer: float = 0.0) -> Mapping[str, Any]:
    """The keys that the cake adds to summary.json; `pack` is the resistance of the pack, 1/m.

    Classes of `finer` solids lie in series with it, 1/m.
    """
    if cake is None:
        return {"cake_resistance_share": finer / (finer + pack), "cake": None}
    own, k = float(cake.resistance.sum()), cake.permeability
    return {
        "cake_resistance_share": (own + finer) / (own + finer + pack),
        "cake": {
            "fines": int(cake.count.sum()),
            "thickness_m": cake.thickness,
            "packed_thickness_m": cake.packed_thickness,
            "porosity": cake.packed_porosity,
            "k_m2": k,
            "law": LAW,
            "resistance_1_m": own,
            "resistance_pack_1_m": pack if math.isfinite(pack) else None,
            "no_cake_yet": cake.no_cake_yet,
        },
    }
