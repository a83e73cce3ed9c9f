"""States of a specimen: its network, flow and sections, without fines and with them.

A slab across the flow is a specimen of its own: what its two planes cut out of the spheres. The
pressure is held on the planes, and the fluid crosses them at right angles. So the slab with its
mirror image is a periodic pack, and its network is that of the spheres in a box of this length
(`tessellation.place_grains`). Cutting the throats of the whole specimen at the planes instead
leaves stumps of oblique throats, and misses that a pore which a plane cuts is open to it.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from fdnet.case.tables import AnalysisChoices
from fdnet.errors import Doubt, FlowError, NetworkError
from fdnet.names import ALL_SPHERES, AUTO, DEFAULT_LAW, MOST_SPHERES, SECTION_ARCHIE
from fdnet.network.compiled import on_all_cores
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow import sections
from fdnet.network.flow.flow import Flow
from fdnet.network.laws.damage import Damage, DamageLaw
from fdnet.network.laws.deposit_resistances import deposit_resistances, grain_resistances
from fdnet.network.laws.named import LAWS, damage_law
from fdnet.network.network import Network, build_network
from fdnet.network.specimen import Specimen
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line

Conduct = Callable[[Network], Array]  # Conductance (T,) m3 of the throats of a network
Kept = TypeVar("Kept")
Cut = list[Network | NetworkError]
"""The networks of S slabs, each of its own spheres alone, or why these make none."""

SHALLOW = 1e-6
"""A cap of less height, in radii of its sphere, is none: its sphere touches the plane."""


def cut_out(spheres: Snapshot, span: tuple[float, float], periodic: Sequence[bool]) -> Snapshot:
    """The spheres that reach between the planes at `span` (low, high) m, in a box of that length.

    Where x is `periodic`, so do their images. Spheres that only touch a plane are left out.
    """
    box = spheres.box.copy()
    box[0] = span
    if periodic[0]:
        images = make_images(
            spheres.position,
            spheres.box,
            periodic=(True, False, False),
            margin=np.array([float(spheres.radius.max()), np.nan, np.nan]),
            tolerance=0.0,
        )
        spheres = replace(spheres.where(images.owner), position=images.position)
    x, reach = spheres.position[:, 0], (1.0 - SHALLOW) * spheres.radius
    reaches = (x + reach > span[0]) & (x - reach < span[1])
    return replace(spheres.where(reaches), box=box)


def cut_networks(spheres: Snapshot, edges: Array, like: Network) -> Cut:
    """The network of each slab between `edges` (S+1,) m, whose skeleton is all of `spheres`.

    Its sides y and z are those of the network `like`.
    """

    def cut(span: tuple[float, float]) -> Network | NetworkError:
        try:
            alone = cut_out(spheres, span, like.periodic)
            return build_network(alone, periodic=(False, *like.periodic[1:]), walls=like.walls)
        except NetworkError as error:
            return error

    return on_all_cores(cut, pairwise(map(float, edges)))


def refused_slabs(cut: Cut) -> tuple[str, ...]:
    """A warning for each slab whose spheres make no network."""
    return tuple(
        Doubt(
            "section-without-a-network",
            f"section {number} is no specimen of its own, so it was cut out of the network of "
            f"the whole, which is less accurate: {error}",
        )
        for number, error in enumerate(cut, start=1)
        if isinstance(error, NetworkError)
    )


# ---- One state of a specimen: a network with its conductance, flow and permeability.
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


NO_SLABS = sections.SlabK(cut_out=frozen([]), inplace=frozen([]), flows=())


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class State:
    """A network with the conductance of its throats, its flow and its permeability."""

    network: Network  # pores and throats
    conductance: Array  # (T,) m3
    flow: Flow  # through the box
    k: float  # m2, of the whole specimen
    halves: Array | None
    """(T, 2) 1/m3, resistances of the two halves of the throats, by which the pressure falls along
    them; None for laws that have none."""
    slabs: sections.SlabK = NO_SLABS
    """Permeability of the sections, cut out and in place; of none where nobody asked."""
    refused: tuple[str, ...] = ()
    """Sections whose spheres make no network of their own, one sentence each."""

    __repr__ = one_line


def make_state(network: Network, conductance: Array, halves: Array | None, log: Log) -> State:
    """The state of a network with this conductance (T,) m3, without its sections."""
    with log.timed("solve"):
        k, flow = sections.whole_permeability(network, conductance)
    return State(network=network, conductance=conductance, flow=flow, k=k, halves=halves)


def clean_state(network: Network, law: str, log: Log) -> State:
    """The state of a network without fines by a conductance law."""
    with log.timed("conductance"):
        halves = grain_resistances(network) if law == DEFAULT_LAW else None
        conductance = LAWS[law](network) if halves is None else 1.0 / halves.sum(axis=1)
    return make_state(network, frozen(conductance), halves, log)


def with_slabs(state: State, edges: Array, cut: Cut | None, conduct: Conduct, log: Log) -> State:
    """The state with its slabs between `edges` (S+1,) m, cut out and in place.

    `cut` are the slabs' own networks, whose throats have the conductance `conduct`. Without it,
    and for a slab that makes none, the throats of the whole network are cut at the planes (Shi
    2011, section 3.3.1).
    """
    network, spans = state.network, [*pairwise(map(float, edges))]

    def one(slab: tuple[object, tuple[float, float]]) -> tuple[float, Flow]:
        alone, span = slab
        if isinstance(alone, Network):
            return sections.whole_permeability(alone, conduct(alone))
        return sections.slab_permeability(network, state.conductance, span)

    with log.timed("solve"):
        if len(spans) == 1 and not network.periodic[0]:  # one slab is the whole box
            parts = [(state.k, state.flow)]
        else:
            networks: Sequence[object] = cut or [None] * len(spans)
            parts = on_all_cores(one, zip(networks, spans, strict=True))
        inplace = sections.inplace_permeability(network, state.flow, edges, state.halves)
    slabs = sections.SlabK(
        cut_out=frozen([k for k, _ in parts]),
        inplace=frozen(inplace),
        flows=tuple(flow for _, flow in parts),
    )
    return replace(state, slabs=slabs)


# ------------------------------------------------------------------------------------------------
# The damaged permeability from the network of all spheres, grains and fines alike.
#
# The power tessellation of grains and fines gives pores and throats at the scale of the fines, and
# the law `lubrication` their conductance, narrowed where no sphere of a facet reaches a section.
# No damage law is needed. Of fines centred upstream counts what they have inside, as of grains.


def all_conductances(network: Network) -> Array:
    """Conductance (T,) m3 of the throats between spheres of any size."""
    return 1.0 / deposit_resistances(network).sum(axis=1)


def all_spheres_state(spheres: Snapshot, edges: Array, like: Network, log: Log) -> State:
    """The state of all `spheres` together, with the slabs between `edges` m.

    The sides are those of the network `like`. Raises NetworkError where grains and fines make no
    network (`build_network`), and FlowError as `solve_flow` does.
    """
    with log.timed("tessellate"):
        try:
            network = build_network(spheres, periodic=like.periodic, walls=like.walls)
        except NetworkError as error:
            raise NetworkError(
                f"all-spheres: grains and fines together make no network: {error}; use "
                "analysis.damage_law = 'section-archie'"
            ) from error
    with log.timed("conductance"):
        halves = deposit_resistances(network)
    state, cut = make_state(network, 1.0 / halves.sum(axis=1), halves, log), None
    if len(edges) > 2 or like.periodic[0]:
        with log.timed("tessellate"):
            cut = cut_networks(spheres, edges, like)
    state = with_slabs(state, edges, cut, all_conductances, log)
    return replace(state, refused=refused_slabs(cut or []))


FEW_THROATS = 100
"""Number of throats that carry the flow of a section (`Flow.carrying_throats`) below which its
permeability with fines is off by 5 % (rms), above which by 3 % (docs/evidence/accuracy.md)."""


def at_most_the_grains(
    whole: State, k_grains: float, grains: sections.SlabK | None, edges: Array, empty: Array
) -> tuple[State, dict[str, int]]:
    """The permeabilities with fines, at most those of the grains, and how many were above.

    Fines never raise the permeability. Where few of them make the network finer, the k of the
    network `whole` of all spheres may be above that of the grains by the difference of two errors;
    it is then set to that of the grains where they ended, `k_grains` m2. `grains` are their
    sections, between `edges` (S+1,) m; None where the invasion moved them. No fine reaches into
    the `empty` (S,) ones.
    """
    k, slabs, network = whole.k, whole.slabs, whole.network
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


def make_layers(initial: State, damaged: State, thickness: float, depth: Array) -> sections.Layers:
    """Layers of `thickness` m of a specimen before and after; `depth` (F,) m of its fines."""
    edges = sections.layer_edges(initial.network.box, thickness)

    def drop(state: State) -> Array:
        if not state.flow.inflow:
            return frozen(np.full(len(edges) - 1, np.nan))
        return frozen(
            -np.diff(sections.plane_pressures(state.network, state.flow, edges, state.halves))
        )

    def k(state: State) -> Array:
        return frozen(
            sections.inplace_permeability(state.network, state.flow, edges, state.halves)
        )

    return sections.Layers(
        edges=frozen(edges),
        k_initial=k(initial),
        k_damaged=k(damaged),
        drop_initial=drop(initial),
        drop_damaged=drop(damaged),
        fines_count=frozen(np.histogram(depth, edges)[0]),
    )


def few_throats(flows: Sequence[Flow]) -> Iterator[str]:
    """A warning on the sections whose flow few throats carry; none without any."""
    few = [
        f"{int(flow.carrying_throats)} in section {number}"
        for number, flow in enumerate(flows, start=1)
        if 0.0 < flow.carrying_throats < FEW_THROATS
    ]
    if few:
        yield Doubt(
            "few-throats",
            f"few throats carry the flow with fines ({', '.join(few)}): with fewer than "
            f"{FEW_THROATS} the permeability of a section is off by some 5 % (rms), at worst by "
            "22 %; `fdnet stokes` gives the sections of a run by resolved flow",
        )


# ---- What the pairs of laws of one specimen share, each part computed once and when it is needed.
@dataclass(slots=True, eq=False, kw_only=True)
class Measured:
    """A specimen, what has been computed of it so far, and the log of the present pair."""

    specimen: Specimen
    log: Log
    _kept: dict[tuple[object, ...], Any] = field(default_factory=dict)

    __repr__ = one_line

    def _once(self, make: Callable[[], Kept], *key: object) -> Kept:
        if key not in self._kept:
            self._kept[key] = make()
        kept: Kept = self._kept[key]
        return kept

    def clean(self, law: str) -> State:
        """The first grains without fines by a conductance law, with their sections."""

        def make() -> State:
            state = clean_state(self.specimen.first, law, self.log)
            return self._with_slabs(state, law, LAWS[law], final=False)

        return self._once(make, "clean", law)

    def base(self, law: str) -> State:
        """The grains where they ended, without fines."""
        if not self.specimen.moved:
            return self.clean(law)
        network, log = self.specimen.network, self.log
        return self._once(lambda: clean_state(network, law, log), "base", law)

    def damaged(self, choices: AnalysisChoices, name: str) -> tuple[State, Damage | None]:
        """The grains with fines by the damage law `name` of the network of the grains."""
        base, occupancy = self.base(choices.law), self.specimen.occupancy
        if occupancy is None:
            return base, None

        def make() -> tuple[State, Damage]:
            with self.log.timed("conductance"):
                damage = _law(choices, name)(base.network, occupancy, base.conductance)
            return make_state(base.network, damage.conductance, base.halves, self.log), damage

        return self._once(make, choices.law, name)

    def with_fines_slabs(self, state: State, choices: AnalysisChoices, name: str) -> State:
        """A `damaged` state with its sections, whose networks hold their own part of the fines."""
        fines = self.specimen.fines

        def conduct(network: Network) -> Array:
            assert fines is not None
            clean = LAWS[choices.law](network)
            occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
            return _law(choices, name)(network, occupancy, clean).conductance

        return self._with_slabs(state, choices.law, conduct, final=True)

    def all_spheres(self, choices: AnalysisChoices) -> State | None:
        """The network of grains and fines where the damage law asks for it, else None.

        "auto" asks for it up to `MOST_SPHERES` spheres, and goes without it, with a warning, where
        these make no network or flow. "all-spheres" then raises as `all_spheres_state` does.
        """
        specimen, fines, name = self.specimen, self.specimen.fines, choices.damage_law
        if fines is None or not len(fines) or name not in (AUTO, ALL_SPHERES):
            return None
        grains = specimen.grains[1]
        count = len(fines) + len(grains)
        if name == AUTO and (choices.law != DEFAULT_LAW or count > MOST_SPHERES):
            return None

        def make() -> State:
            together = grains.joined(fines)
            return all_spheres_state(together, specimen.edges, specimen.first, self.log)

        try:
            return self._once(make, "all-spheres")
        except (NetworkError, FlowError) as error:
            if name == ALL_SPHERES:
                raise
            self.log.warnings.append(
                Doubt("other-damage-law", f"the damage law {SECTION_ARCHIE} was taken: {error}")
            )
        return None

    def _with_slabs(self, state: State, law: str, conduct: Conduct, *, final: bool) -> State:
        """The state with its sections, by their own networks for the law `lubrication`.

        The other laws cut the throats of the whole network, as the thesis does.
        """
        specimen, edges, cut = self.specimen, self.specimen.edges, None
        if law == DEFAULT_LAW and (len(edges) > 2 or specimen.first.periodic[0]):
            final = final and specimen.moved

            def make() -> Cut:
                with self.log.timed("tessellate"):
                    networks = cut_networks(specimen.grains[final], edges, specimen.first)
                self.log.warnings += refused_slabs(networks)
                return networks

            cut = self._once(make, "cut", final)
        return with_slabs(state, edges, cut, conduct, self.log)


def _law(choices: AnalysisChoices, name: str) -> DamageLaw:
    threshold, band = choices.clogging_threshold, choices.middle_band
    return damage_law(name, clogging_threshold=threshold, middle_band=band)
