"""What the pairs of laws of one specimen share, each part computed once and when it is needed."""

from dataclasses import dataclass, field
from functools import partial

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.names import (
    ALL_SPHERES,
    AUTO,
    DEFAULT_LAW,
    MOST_SPHERES,
    SECTION_ARCHIE,
)
from fdnet.errors import FlowError, NetworkError
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.slabs import SlabK
from fdnet.network.laws.damage import Damage, DamageLaw
from fdnet.network.laws.named import LAWS, damage_law
from fdnet.network.network import Network
from fdnet.network.resolved.all_spheres import AllSpheres, measure_all_spheres
from fdnet.network.resolved.slab import CutNetworks, Sides, cut_networks
from fdnet.network.resolved.state import Log, State, clean_halves, make_state, state_slabs
from fdnet.network.specimen.specimen import Specimen
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen


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
            state = _clean_state(self.specimen.first, law, log)
            self._first[law] = state, self._clean_slabs(state, law, log, final=False)
        return self._first[law]

    def base(self, law: str, log: Log) -> State:
        """The grains where they ended, without fines."""
        if not self.specimen.moved:
            return self.clean(law, log)[0]
        if law not in self._final:
            self._final[law] = _clean_state(self.specimen.network, law, log)
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
        cut = self._own_slabs(choices.law, log, final=True)
        parts = None if cut is None else (cut, partial(self._damaged_conductance, choices, name))
        return state_slabs(state, self.specimen.edges, log, cut=parts)

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
                self._all = measure_all_spheres(together, edges, sides=self.sides, timed=log.timed)
        except (NetworkError, FlowError) as error:
            if name == ALL_SPHERES:
                raise
            log.warnings.append(f"the damage law {SECTION_ARCHIE} was taken: {error}")
        return self._all

    def _damaged_conductance(self, choices: AnalysisChoices, name: str, network: Network) -> Array:
        """Conductance (T,) m3 of the throats of a slab's own network with its fines."""
        fines, clean = self.specimen.fines, LAWS[choices.law](network)
        assert fines is not None
        occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
        return _law(choices, name)(network, occupancy, clean).conductance

    def _clean_slabs(self, state: State, law: str, log: Log, *, final: bool) -> SlabK:
        """The sections of the grains without fines, as they were or where they ended."""
        cut = self._own_slabs(law, log, final=final)
        parts = None if cut is None else (cut, LAWS[law])
        return state_slabs(state, self.specimen.edges, log, cut=parts)

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


def _clean_state(network: Network, law: str, log: Log) -> State:
    with log.timed("conductance"):
        halves = clean_halves(network, law)
        conductance = LAWS[law](network) if halves is None else 1.0 / halves.sum(axis=1)
    return make_state(network, frozen(conductance), log, halves=halves)
