"""The damaged permeability from the network of all spheres, grains and fines alike.

The power tessellation of grains and fines gives pores and throats at the scale of the fines, and
the law `lubrication` gives their conductance, narrowed where a fourth sphere reaches into a
section. No damage law is needed. Fines centred upstream whose bodies reach into the specimen count
with what they have inside, as grains do.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.flow.depth import Solved, depth_permeability
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.slabs import SlabK, whole_permeability
from fdnet.network.laws.deposit_resistances import deposit_resistances
from fdnet.network.network import Network, build_network
from fdnet.network.resolved.slab import Sides, cut_networks, slab_permeabilities
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen

Timed = Callable[[str], AbstractContextManager[None]]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AllSpheres:
    """Permeability of grains and fines from the network of all spheres.

    Attributes:
        solved: the network, its flow, and the resistances of its throats.
        k: m2, of the whole specimen.
        slabs: of each section, cut out and in place.
        refused: sections whose spheres make no network of their own, one sentence each.
    """

    solved: Solved
    k: float
    slabs: SlabK
    refused: tuple[str, ...]

    __repr__ = one_line


def all_conductances(network: Network) -> Array:
    """Conductance (T,) m3 of the throats between spheres of any size."""
    return 1.0 / deposit_resistances(network).sum(axis=1)


def measure_all_spheres(
    spheres: Snapshot, edges: Array, *, sides: Sides, timed: Timed
) -> AllSpheres:
    """Permeability of all `spheres` together, of the whole and of the slabs between `edges` m.

    `timed` takes the name of the stage that its block belongs to. Raises NetworkError where grains
    and fines make no network (`build_network`), and FlowError as `solve_flow` does.
    """
    with timed("tessellate"):
        try:
            network = build_network(spheres, periodic=sides.periodic, walls=sides.walls)
        except NetworkError as error:
            raise NetworkError(
                f"all-spheres: grains and fines together make no network: {error}; use "
                "analysis.damage_law = 'section-archie'"
            ) from error
    with timed("conductance"):
        halves = deposit_resistances(network)
    conductance = 1.0 / halves.sum(axis=1)
    with timed("solve"):
        k, flow = whole_permeability(network, conductance)
        inplace = depth_permeability(network, flow, halves, edges)
    parts: list[tuple[float, Flow]] = [(k, flow)]
    refused: tuple[str, ...] = ()
    if len(edges) > 2 or sides.periodic[0]:  # else one slab is the whole box
        with timed("tessellate"):
            slabs = cut_networks(spheres, edges, sides)
        with timed("solve"):
            parts = slab_permeabilities(slabs, all_conductances, (network, conductance))
        refused = slabs.refused
    return AllSpheres(
        solved=Solved(network=network, flow=flow, halves=halves),
        k=k,
        slabs=SlabK(
            cut_out=frozen([one for one, _ in parts]),
            inplace=frozen(inplace),
            flows=tuple(one for _, one in parts),
        ),
        refused=refused,
    )


FEW_THROATS = 100
"""Number of throats that carry the flow of a section (`Flow.carrying_throats`) below which its
permeability with fines is off by 5 % (rms), above which by 2 % (docs/accuracy.md)."""


def at_most_the_grains(
    whole: AllSpheres, grains: tuple[float, SlabK | None], edges: Array, empty: Array
) -> tuple[AllSpheres, dict[str, int]]:
    """The permeabilities with fines, at most those of the grains, and how many were above.

    Fines never raise the permeability. Where few of them make the network finer, its k may be
    above that of the grains by the difference of two errors; it is then set to that of the grains.

    Args:
        whole: the network of all spheres.
        grains: k (m2) of the grains where they ended, and of their sections; None for these where
            the invasion moved the grains.
        edges: (S+1,) m, of the sections.
        empty: (S,) whether no fine reaches into a section.
    """
    (most, clean), k, slabs = grains, whole.k, whole.slabs
    network, above, sections_above = whole.solved.network, int(k > most), 0
    if clean is not None:
        cut = (slabs.cut_out > clean.cut_out) & ~empty
        sections_above = int(cut.sum())
        slabs = replace(slabs, cut_out=frozen(np.where(empty | cut, clean.cut_out, slabs.cut_out)))
        if above:
            slabs = replace(slabs, inplace=frozen(np.minimum(slabs.inplace, clean.inplace)))
            k = in_series(slabs.inplace, edges)
    counts = {
        "all_spheres_pores": len(network.pore_radius),
        "all_spheres_throats": len(network.throat_radius),
        "all_spheres_hidden": network.counts["grains_hidden"],
        "all_spheres_above_grains": above,
        "all_spheres_sections_above_grains": sections_above,
    }
    return replace(whole, k=min(k, most), slabs=slabs), counts


def in_series(inplace: Array, edges: Array) -> float:
    """Permeability m2 of the whole between `edges` (S+1,) m, from its sections (S,) in place."""
    thick = np.diff(edges)
    return float(thick.sum() / np.sum(thick / inplace)) if np.all(inplace > 0.0) else 0.0


def few_throats(slabs: SlabK) -> Iterator[str]:
    """A warning on the sections whose flow few throats carry; none without any."""
    few = [
        f"{int(flow.carrying_throats)} in section {number + 1}"
        for number, flow in enumerate(slabs.flows)
        if 0.0 < flow.carrying_throats < FEW_THROATS
    ]
    if few:
        yield (
            f"few throats carry the flow with fines ({', '.join(few)}): with fewer than "
            f"{FEW_THROATS} the permeability of a section is off by some 5 % (rms), at worst by "
            "20 %; `fdnet stokes` gives the sections of a run by resolved flow"
        )
