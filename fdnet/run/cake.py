"""The external cake: porosity and permeability by depth, and its share of the resistance.

The resistance of a bed of thickness h and permeability k is h / k, 1/m; that of slices in series
is their sum. k comes from the network of the cake's own spheres where there are enough of them,
and from Carman's and Kozeny's eps^3 d^2 / (180 (1 - eps)^2) of each slice in any case.
"""

import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fdnet.errors import FlowError, NetworkError
from fdnet.network.fines.invaded import cake_of
from fdnet.network.resolved.all_spheres import measure_all_spheres
from fdnet.network.resolved.slab import Sides, cut_out
from fdnet.scales.darcy import carman_kozeny
from fdnet.spheres.arrays import one_line
from fdnet.spheres.porosity import measure_porosity
from fdnet.spheres.snapshot import Array, Snapshot

ENOUGH, THICK = 100, 3.0
"""Fewest spheres, and least thickness in mean diameters, of a cake that a network resolves."""
MOST = 20_000
"""Most spheres of a cake that is resolved: the network of more takes minutes."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Cake:
    """The cake in B slices of a mean diameter, from its front to the formation face.

    Attributes:
        edges: (B+1,) m, x; the last is the face.
        count: (B,) number of fines centred in the slice.
        porosity: (B,) void over volume.
        diameter: (B,) m, Sauter mean of these fines.
        k_kozeny: (B,) m2, by Carman and Kozeny; inf in an empty slice.
        k_network: (B,) m2, in place in the network of the cake; None where it is not resolved.
        unresolved: why not, in words; "" where it is.
    """

    edges: Array
    count: Array
    porosity: Array
    diameter: Array
    k_kozeny: Array
    k_network: Array | None
    unresolved: str

    __repr__ = one_line

    @property
    def thickness(self) -> float:
        """Of the whole cake, m."""
        return float(self.edges[-1] - self.edges[0])

    @property
    def best_resistance(self) -> float:
        """By the network where it is resolved, else by Carman and Kozeny, 1/m."""
        return self.resistance(self.k_kozeny if self.k_network is None else self.k_network)

    def resistance(self, permeability: Array) -> float:
        """Of the slices in series, 1/m."""
        with np.errstate(divide="ignore"):
            return float(np.sum(np.diff(self.edges) / permeability))


def measure_cake(spheres: Snapshot, sides: Sides) -> Cake | None:
    """The cake of `spheres`, grains and fines; None where no fine upstream touches the pack."""
    face = float(spheres.box[0, 0])
    cake = cake_of(spheres, sides.periodic)
    if not len(cake):
        return None
    thickness = face - float(np.min(cake.position[:, 0] - cake.radius))
    mean = 2.0 * float(np.mean(cake.radius))
    slices = max(1, math.ceil(thickness / mean - 0.5))
    edges = face - thickness * np.linspace(1.0, 0.0, slices + 1)
    edges[-1] = face
    bed = _bed(spheres, cake, (float(edges[0]), face), sides)
    porosity = measure_porosity(bed, periodic=sides.periodic, edges=edges).profile
    where = np.clip(np.searchsorted(edges, cake.position[:, 0], "right") - 1, 0, slices - 1)
    count = np.bincount(where, minlength=slices)
    diameter = _sauter(cake.radius, where, slices)
    resolved, unresolved = _resolved(bed, edges, sides, thickness / mean)
    return Cake(
        edges=edges,
        count=count,
        porosity=porosity,
        diameter=diameter,
        k_kozeny=np.array([_kozeny(*pair) for pair in zip(porosity, diameter, strict=True)]),
        k_network=resolved,
        unresolved=unresolved,
    )


def _bed(spheres: Snapshot, cake: Snapshot, span: tuple[float, float], sides: Sides) -> Snapshot:
    """The cake and what of the pack reaches out of its face, in a box of the cake's length."""
    pack = spheres.where(spheres.position[:, 0] >= span[1])
    return cut_out(pack.joined(cake), span, (False, *sides.periodic[1:]))


def _sauter(radius: Array, where: Array, slices: int) -> Array:
    """Sauter diameter (B,) m of the fines by slice, sum d^3 / sum d^2; of all in an empty one."""
    cube = np.bincount(where, radius**3, slices)
    square = np.bincount(where, radius**2, slices)
    whole = float(np.sum(radius**3) / np.sum(radius**2))
    return 2.0 * np.divide(cube, square, out=np.full(slices, whole), where=square > 0)


def _kozeny(porosity: float, diameter: float) -> float:
    return carman_kozeny(porosity, diameter) if porosity < 1.0 else math.inf


def _resolved(
    bed: Snapshot, edges: Array, sides: Sides, layers: float
) -> tuple[Array | None, str]:
    """Permeability (B,) m2 of the slices in place in the network of the bed, or why not."""
    if len(bed) < ENOUGH or layers < THICK:
        return None, (
            f"the cake has {len(bed)} spheres and is {layers:.1f} of their diameters thick; a "
            f"network needs {ENOUGH} and {THICK:g}"
        )
    if len(bed) > MOST:
        return None, f"the cake has {len(bed)} spheres, more than the {MOST} of a network"
    around = replace(sides, periodic=(False, *sides.periodic[1:]))
    try:
        whole = measure_all_spheres(
            bed, edges[[0, -1]], sides=around, timed=lambda _: nullcontext()
        )
    except (NetworkError, FlowError) as error:
        return None, f"the cake makes no network: {error}"
    from fdnet.network.flow.depth import depth_permeability

    one = whole.solved
    return depth_permeability(one.network, one.flow, one.halves, edges), ""


def cake_rows(cake: Cake) -> list[dict[str, Any]]:
    """The slices as cake.csv names their values, from the face outwards."""
    order = range(len(cake.count))[::-1]
    return [
        {
            "x_lo_m": float(cake.edges[i]),
            "x_hi_m": float(cake.edges[i + 1]),
            "fines_count": int(cake.count[i]),
            "porosity": float(cake.porosity[i]),
            "sauter_diameter_m": float(cake.diameter[i]),
            "k_kozeny_m2": float(cake.k_kozeny[i]) if math.isfinite(cake.k_kozeny[i]) else None,
            "k_network_m2": None if cake.k_network is None else float(cake.k_network[i]),
        }
        for i in order
    ]


def resistance_share(cake: float, pack: float) -> float:
    """R_cake / (R_cake + R_pack) of two beds in series; 0 where the pack lets nothing through."""
    return cake / (cake + pack) if math.isfinite(pack) else 0.0


def cake_summary(cake: Cake | None, pack: float, known: Sequence[str] = ()) -> Mapping[str, Any]:
    """The keys that the cake adds to summary.json; `pack` is the resistance of the pack, 1/m.

    The key `cake_resistance_share` is left out where it is `known` from the flow itself.
    """
    if cake is None:
        return {} if "cake_resistance_share" in known else {"cake_resistance_share": 0.0}
    kozeny = cake.resistance(cake.k_kozeny)
    network = None if cake.k_network is None else cake.resistance(cake.k_network)
    shares = {
        "share_kozeny": resistance_share(kozeny, pack),
        "share_network": None if network is None else resistance_share(network, pack),
    }
    best = resistance_share(cake.best_resistance, pack)
    table = {
        "fines": int(cake.count.sum()),
        "slices": len(cake.count),
        "porosity": float(np.average(cake.porosity, weights=np.diff(cake.edges))),
        "k_kozeny_m2": cake.thickness / kozeny if kozeny > 0 else None,
        "k_network_m2": cake.thickness / network if network else None,
        "resistance_kozeny_1_m": kozeny,
        "resistance_network_1_m": network,
        "resistance_pack_1_m": pack if math.isfinite(pack) else None,
        **shares,
        "unresolved": cake.unresolved,
    }
    own = {} if "cake_resistance_share" in known else {"cake_resistance_share": best}
    return own | {"cake_by_depth": table}
