"""States of a specimen: its network, flow and sections, without fines and with them.

A slab across the flow is a specimen of its own: what its two planes cut out of the spheres. The
planes are inlet and outlet: the pressure is held on them, and the fluid crosses them at right
angles. So the slab with its mirror image is a periodic pack, and its network is that of the
spheres in a box of this length (`tessellation.place_grains`). Cutting the throats of the whole
specimen at the planes instead leaves stumps of oblique throats, and misses that a pore which a
plane cuts is open to it.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import Doubt, FlowError, NetworkError
from fdnet.names import (
    ALL_SPHERES,
    AUTO,
    DEFAULT_LAW,
    MOST_SPHERES,
    SECTION_ARCHIE,
)
from fdnet.network.compiled import on_all_cores
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import (
    SlabK,
    inplace_permeability,
    slab_permeability,
    whole_permeability,
)
from fdnet.network.laws.damage import Damage, DamageLaw
from fdnet.network.laws.deposit_resistances import deposit_resistances, grain_resistances
from fdnet.network.laws.named import LAWS, damage_law
from fdnet.network.network import Network, build_network
from fdnet.network.specimen import Specimen
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line

Conduct = Callable[[Network], Array]
"""Conductance (T,) m3 of the throats of a network."""


SHALLOW = 1e-6
"""A cap of less height, in radii of its sphere, is none: its sphere touches the plane."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sides:
    """What the sides of a specimen are.

    Attributes:
        periodic: whether x, y and z repeat.
        walls: "slip" or "no-slip", for the y and z sides that do not.
    """

    periodic: tuple[bool, bool, bool]
    walls: str

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CutNetworks:
    """The networks of S slabs, each of its own spheres alone.

    Attributes:
        edges: (S+1,) m.
        networks: S networks; None where the spheres of a slab make none.
        refused: why not, one sentence for each of these.
    """

    edges: Array
    networks: tuple[Network | None, ...]
    refused: tuple[str, ...]

    __repr__ = one_line


def cut_out(spheres: Snapshot, span: tuple[float, float], periodic: Sequence[bool]) -> Snapshot:
    """The spheres that reach between the planes at `span` (low, high) m, in a box of that length.

    Where x is `periodic`, so do their images. Spheres that only touch a plane are left out.
    """
    box = spheres.box.copy()
    box[0] = span
    if periodic[0]:
        margin = np.array([float(spheres.radius.max()), np.nan, np.nan])
        images = make_images(
            spheres.position,
            spheres.box,
            periodic=(True, False, False),
            margin=margin,
            tolerance=0.0,
        )
        spheres = replace(spheres.where(images.owner), position=images.position)
    x, reach = spheres.position[:, 0], (1.0 - SHALLOW) * spheres.radius
    reaches = (x + reach > span[0]) & (x - reach < span[1])
    return replace(spheres.where(reaches), box=box)


def cut_networks(spheres: Snapshot, edges: Array, sides: Sides) -> CutNetworks:
    """The network of each slab between `edges` (S+1,) m, whose skeleton is all of `spheres`."""
    around = (False, *sides.periodic[1:])

    def cut(span: tuple[float, float]) -> Network | NetworkError:
        try:
            alone = cut_out(spheres, span, sides.periodic)
            return build_network(alone, periodic=around, walls=sides.walls)
        except NetworkError as error:
            return error

    results = on_all_cores(cut, pairwise(map(float, edges)))
    refused = [
        Doubt(
            "section-without-a-network",
            f"section {number + 1} is no specimen of its own, so it was cut out of the network of "
            f"the whole, which is less accurate: {error}",
        )
        for number, error in enumerate(results)
        if isinstance(error, NetworkError)
    ]
    networks = (None if isinstance(one, NetworkError) else one for one in results)
    return CutNetworks(edges=edges, networks=tuple(networks), refused=tuple(refused))


def slab_permeabilities(
    slabs: CutNetworks, conduct: Conduct, whole: tuple[Network, Array]
) -> list[tuple[float, Flow]]:
    """Permeability m2 of each of the S slabs cut out, and its flow.

    The throats of a slab have the conductance `conduct`. A slab without a network of its own is
    cut out of that of the `whole` specimen, which is given with its conductances (T,) m3.
    """

    def one(slab: tuple[Network | None, tuple[float, float]]) -> tuple[float, Flow]:
        network, span = slab
        if network is None:
            return slab_permeability(*whole, span)
        return whole_permeability(network, conduct(network))

    spans = pairwise(map(float, slabs.edges))
    return on_all_cores(one, zip(slabs.networks, spans, strict=True))


# ------------------------------------------------------------------------------------------------
# One state of a specimen: a network with its conductance, flow and permeability.


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

    `halves` (T, 2) 1/m3 are the resistances of the two halves of the throats, by which the
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


def clean_state(network: Network, law: str, log: Log) -> State:
    """The state of a network without fines by a conductance law."""
    with log.timed("conductance"):
        halves = grain_resistances(network) if law == DEFAULT_LAW else None
        conductance = LAWS[law](network) if halves is None else 1.0 / halves.sum(axis=1)
    return make_state(network, frozen(conductance), log, halves=halves)


def state_slabs(
    state: State, edges: Array, log: Log, *, cut: CutNetworks | None, conduct: Conduct
) -> SlabK:
    """Permeability of the slabs between `edges` (S+1,) m, cut out and in place.

    `cut` are the slabs' own networks, whose throats have the conductance `conduct`. Without it the
    throats of the whole network are cut at the planes (Shi 2011, section 3.3.1).
    """
    network = state.network
    with log.timed("solve"):
        if len(edges) == 2 and not network.periodic[0]:  # one slab is the whole box
            parts = [(state.k, state.flow)]
        elif cut is not None:
            parts = slab_permeabilities(cut, conduct, (network, state.conductance))
        else:
            parts = [
                slab_permeability(network, state.conductance, (float(low), float(high)))
                for low, high in pairwise(edges)
            ]
        inplace = inplace_permeability(network, state.flow, edges, state.halves)
    return SlabK(
        cut_out=frozen([k for k, _ in parts]),
        inplace=frozen(inplace),
        flows=tuple(flow for _, flow in parts),
    )


# ------------------------------------------------------------------------------------------------
# The damaged permeability from the network of all spheres, grains and fines alike.
#
# The power tessellation of grains and fines gives pores and throats at the scale of the fines, and
# the law `lubrication` gives their conductance, narrowed where no sphere of a facet reaches a
# section. No damage law is needed. Fines centred upstream whose bodies reach into the specimen
# count with what they have inside, as grains do.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class AllSpheres:
    """Permeability of grains and fines from the network of all spheres.

    Attributes:
        state: the network, its flow, and the resistances of its throats.
        k: m2, of the whole specimen.
        slabs: of each section, cut out and in place.
        refused: sections whose spheres make no network of their own, one sentence each.
    """

    state: State
    k: float
    slabs: SlabK
    refused: tuple[str, ...]

    __repr__ = one_line


def all_conductances(network: Network) -> Array:
    """Conductance (T,) m3 of the throats between spheres of any size."""
    return 1.0 / deposit_resistances(network).sum(axis=1)


def measure_all_spheres(spheres: Snapshot, edges: Array, *, sides: Sides, log: Log) -> AllSpheres:
    """Permeability of all `spheres` together, of the whole and of the slabs between `edges` m.

    Raises NetworkError where grains and fines make no network (`build_network`), and FlowError as
    `solve_flow` does.
    """
    with log.timed("tessellate"):
        try:
            network = build_network(spheres, periodic=sides.periodic, walls=sides.walls)
        except NetworkError as error:
            raise NetworkError(
                f"all-spheres: grains and fines together make no network: {error}; use "
                "analysis.damage_law = 'section-archie'"
            ) from error
    with log.timed("conductance"):
        halves = deposit_resistances(network)
    state, cut = make_state(network, 1.0 / halves.sum(axis=1), log, halves=halves), None
    if len(edges) > 2 or sides.periodic[0]:
        with log.timed("tessellate"):
            cut = cut_networks(spheres, edges, sides)
    return AllSpheres(
        state=state,
        k=state.k,
        slabs=state_slabs(state, edges, log, cut=cut, conduct=all_conductances),
        refused=() if cut is None else cut.refused,
    )


FEW_THROATS = 100
"""Number of throats that carry the flow of a section (`Flow.carrying_throats`) below which its
permeability with fines is off by 5 % (rms), above which by 3 % (docs/evidence/accuracy.md)."""


def at_most_the_grains(
    whole: AllSpheres, k_grains: float, grains: SlabK | None, edges: Array, empty: Array
) -> tuple[AllSpheres, dict[str, int]]:
    """The permeabilities with fines, at most those of the grains, and how many were above.

    Fines never raise the permeability. Where few of them make the network finer, its k may be
    above that of the grains by the difference of two errors; it is then set to that of the grains.

    Args:
        whole: the network of all spheres.
        k_grains: m2, of the grains where they ended.
        grains: of their sections; None where the invasion moved the grains.
        edges: (S+1,) m, of the sections.
        empty: (S,) whether no fine reaches into a section.
    """
    k, slabs, network = whole.k, whole.slabs, whole.state.network
    above, sections_above = int(k > k_grains), 0
    if grains is not None:
        cut = (slabs.cut_out > grains.cut_out) & ~empty
        sections_above = int(cut.sum())
        cut_out = frozen(np.where(empty | cut, grains.cut_out, slabs.cut_out))
        slabs = replace(slabs, cut_out=cut_out)
        if above:
            slabs = replace(slabs, inplace=frozen(np.minimum(slabs.inplace, grains.inplace)))
            thick = np.diff(edges)
            flows = np.all(slabs.inplace > 0.0)
            k = float(thick.sum() / np.sum(thick / slabs.inplace)) if flows else 0.0
    counts = {
        "all_spheres_pores": len(network.pore_radius),
        "all_spheres_throats": len(network.throat_radius),
        "all_spheres_hidden": network.counts["grains_hidden"],
        "all_spheres_above_grains": above,
        "all_spheres_sections_above_grains": sections_above,
    }
    return replace(whole, k=min(k, k_grains), slabs=slabs), counts


def few_throats(slabs: SlabK) -> Iterator[str]:
    """A warning on the sections whose flow few throats carry; none without any."""
    few = [
        f"{int(flow.carrying_throats)} in section {number + 1}"
        for number, flow in enumerate(slabs.flows)
        if 0.0 < flow.carrying_throats < FEW_THROATS
    ]
    if few:
        yield Doubt(
            "few-throats",
            f"few throats carry the flow with fines ({', '.join(few)}): with fewer than "
            f"{FEW_THROATS} the permeability of a section is off by some 5 % (rms), at worst by "
            "22 %; `fdnet stokes` gives the sections of a run by resolved flow",
        )


# ------------------------------------------------------------------------------------------------
# What the pairs of laws of one specimen share, each part computed once and when it is needed.


@dataclass(slots=True, eq=False, kw_only=True)
class Measured:
    """A specimen and what has been computed of it so far."""

    specimen: Specimen
    sides: Sides
    _first: dict[str, tuple[State, SlabK]] = field(default_factory=dict)
    _final: dict[str, State] = field(default_factory=dict)
    _cut: dict[bool, CutNetworks] = field(default_factory=dict)
    _all: AllSpheres | None = None
    _damaged: dict[tuple[str, str], tuple[State, Damage | None]] = field(default_factory=dict)

    __repr__ = one_line

    def clean(self, law: str, log: Log) -> tuple[State, SlabK]:
        """The first grains without fines by a conductance law, and its sections."""
        if law not in self._first:
            state = clean_state(self.specimen.first, law, log)
            cut = self._own_slabs(law, log, final=False)
            slabs = state_slabs(state, self.specimen.edges, log, cut=cut, conduct=LAWS[law])
            self._first[law] = state, slabs
        return self._first[law]

    def base(self, law: str, log: Log) -> State:
        """The grains where they ended, without fines."""
        if not self.specimen.moved:
            return self.clean(law, log)[0]
        if law not in self._final:
            self._final[law] = clean_state(self.specimen.network, law, log)
        return self._final[law]

    def damaged(
        self, choices: AnalysisChoices, name: str, log: Log
    ) -> tuple[State, Damage | None]:
        """The grains with fines by the damage law `name` of the network of the grains."""
        base, occupancy = self.base(choices.law, log), self.specimen.occupancy
        if occupancy is None:
            return base, None
        if (choices.law, name) not in self._damaged:
            with log.timed("conductance"):
                damage = _law(choices, name)(base.network, occupancy, base.conductance)
            state = make_state(base.network, damage.conductance, log, halves=base.halves)
            self._damaged[choices.law, name] = state, damage
        return self._damaged[choices.law, name]

    def damaged_slabs(self, state: State, choices: AnalysisChoices, name: str, log: Log) -> SlabK:
        """The sections of `damaged`; their own networks hold their own part of the fines."""
        fines = self.specimen.fines

        def conduct(network: Network) -> Array:
            assert fines is not None
            clean = LAWS[choices.law](network)
            occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
            return _law(choices, name)(network, occupancy, clean).conductance

        cut = self._own_slabs(choices.law, log, final=True)
        return state_slabs(state, self.specimen.edges, log, cut=cut, conduct=conduct)

    def all_spheres(self, choices: AnalysisChoices, log: Log) -> AllSpheres | None:
        """The network of grains and fines where the damage law asks for it, else None.

        "auto" asks for it up to `MOST_SPHERES` grains and fines, and goes without it, with a
        warning, where these make no network. Raises NetworkError and FlowError as
        `measure_all_spheres` does where "all-spheres" asks for it.
        """
        fines, name = self.specimen.fines, choices.damage_law
        if fines is None or not len(fines) or name not in (AUTO, ALL_SPHERES):
            return None
        count = len(fines) + len(self.specimen.grains[1])
        if name == AUTO and (choices.law != DEFAULT_LAW or count > MOST_SPHERES):
            return None
        try:
            if self._all is None:
                together, edges = self.specimen.grains[1].joined(fines), self.specimen.edges
                self._all = measure_all_spheres(together, edges, sides=self.sides, log=log)
        except (NetworkError, FlowError) as error:
            if name == ALL_SPHERES:
                raise
            log.warnings.append(
                Doubt("other-damage-law", f"the damage law {SECTION_ARCHIE} was taken: {error}")
            )
        return self._all

    def _own_slabs(self, law: str, log: Log, *, final: bool) -> CutNetworks | None:
        """The networks of the sections for the law `lubrication`; None for other laws.

        The other laws cut the throats of the whole network, as the thesis does, and one section
        of a box with an inlet and an outlet is the whole.
        """
        edges = self.specimen.edges
        if law != DEFAULT_LAW or (len(edges) == 2 and not self.sides.periodic[0]):
            return None
        final = final and self.specimen.moved
        if final not in self._cut:
            with log.timed("tessellate"):
                self._cut[final] = cut_networks(self.specimen.grains[final], edges, self.sides)
            log.warnings += self._cut[final].refused
        return self._cut[final]


def _law(choices: AnalysisChoices, name: str) -> DamageLaw:
    return damage_law(
        name,
        clogging_threshold=choices.clogging_threshold,
        middle_band=choices.middle_band,
    )
