"""One state of a specimen: a network with its conductance, flow and permeability."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise

from fdnet.case.names import DEFAULT_LAW
from fdnet.network.flow.depth import Solved, depth_permeability
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.slabs import (
    SlabK,
    inplace_permeability,
    slab_permeability,
    whole_permeability,
)
from fdnet.network.laws.deposit_resistances import grain_resistances
from fdnet.network.network import Network
from fdnet.network.resolved.slab import Conduct, CutNetworks, slab_permeabilities
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

STAGES = ("tessellate", "occupancy", "conductance", "solve", "porosity")


@dataclass(slots=True)
class Log:
    """Seconds of each stage of an analysis, and warnings for the user."""

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    warnings: list[str] = field(default_factory=list)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Adds the seconds of its block to those of `stage`."""
        start = time.perf_counter()
        yield
        self.seconds[stage] += time.perf_counter() - start


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class State:
    """A network with the conductance (T,) m3 of its throats, its flow through the box and k, m2.

    `halves` (T, 2) 1/m3 are the clean resistances of the two halves of the throats, by which the
    pressure falls along them; None for laws that have none.
    """

    network: Network
    conductance: Array
    flow: Flow
    k: float
    halves: Array | None

    __repr__ = one_line


def make_state(
    network: Network, conductance: Array, log: Log, *, halves: Array | None = None
) -> State:
    """The state of a network with this conductance (T,) m3."""
    with log.timed("solve"):
        k, flow = whole_permeability(network, conductance)
    return State(network=network, conductance=conductance, flow=flow, k=k, halves=halves)


def solved(state: State) -> Solved | None:
    """The state as `depth` needs it; None for laws without halves."""
    if state.halves is None:
        return None
    return Solved(network=state.network, flow=state.flow, halves=state.halves)


def clean_halves(network: Network, law: str) -> Array | None:
    """Resistances (T, 2) 1/m3 of the halves of clean throats; None for laws that have none."""
    return grain_resistances(network) if law == DEFAULT_LAW else None


def state_slabs(
    state: State, edges: Array, log: Log, *, cut: tuple[CutNetworks, Conduct] | None
) -> SlabK:
    """Permeability of the slabs between `edges` (S+1,) m, cut out and in place.

    `cut` are the slabs' own networks and their conductance. Without it the throats of the whole
    network are cut at the planes (Shi 2011, section 3.3.1).
    """
    network = state.network
    with log.timed("solve"):
        if len(edges) == 2 and not network.periodic[0]:  # one slab is the whole box
            parts = [(state.k, state.flow)]
        elif cut is not None:
            parts = slab_permeabilities(*cut, (network, state.conductance))
        else:
            parts = [
                slab_permeability(network, state.conductance, (float(low), float(high)))
                for low, high in pairwise(edges)
            ]
        inplace = (
            inplace_permeability(network, state.flow, edges)
            if state.halves is None
            else depth_permeability(network, state.flow, state.halves, edges)
        )
    return SlabK(
        cut_out=frozen([k for k, _ in parts]),
        inplace=frozen(inplace),
        flows=tuple(flow for _, flow in parts),
    )
