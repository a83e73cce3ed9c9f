"""What the pairs of laws of one specimen share, each part computed once and when it is needed."""

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from fdnet.case.analysis import AnalysisChoices
from fdnet.case.names import (
    ALL_SPHERES,
    AUTO,
    COMBINED,
    DEFAULT_LAW,
    MOST_SPHERES,
    SECTION_ARCHIE,
    UPSCALED,
)
from fdnet.errors import FlowError, NetworkError
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.slabs import SlabK
from fdnet.network.laws.damage import Damage, DamageLaw
from fdnet.network.laws.named import LAWS, damage_law
from fdnet.network.network import Network
from fdnet.network.resolved.all_spheres import AllSpheres, measure_all_spheres
from fdnet.network.resolved.coarse_flow import (
    WITH_FINES,
    WITHOUT_FINES,
    resolved_sections,
)
from fdnet.network.resolved.slab import CutNetworks, Sides, cut_networks, cut_out
from fdnet.network.resolved.state import Log, State, clean_halves, make_state, state_slabs
from fdnet.network.specimen.specimen import Specimen
from fdnet.network.upscaling.upscaled import upscaled_damage
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen


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
    _intact: tuple[Array, dict[int, str]] | None = None
    _resolved: dict[bytes, tuple[Array, dict[int, str]]] = field(default_factory=dict)

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
                if name == UPSCALED:
                    damage = self._upscaled(base.network, base.conductance)
                else:
                    damage = _law(choices, name)(base.network, occupancy, base.conductance)
            state = make_state(base.network, damage.conductance, log, halves=base.halves)
            self._damaged[choices.law, name] = state, damage
        return self._damaged[choices.law, name]

    def base_slabs(self, law: str, log: Log) -> SlabK:
        """The sections of `base`."""
        if not self.specimen.moved:
            return self.clean(law, log)[1]
        return self._clean_slabs(self.base(law, log), law, log, final=True)

    def intact(self, log: Log) -> tuple[Array, dict[int, str]]:
        """The sections (S,) without fines by resolved flow, m2, and why some could not be solved.

        They are not a number where that is dear, and where the invasion moved the grains.
        """
        if self.specimen.moved:
            return np.full(len(self.specimen.edges) - 1, np.nan), {}
        if self._intact is None:
            grains, edges = self.specimen.grains[0], self.specimen.edges
            every = np.ones(len(edges) - 1, bool)
            with log.timed("solve"):
                self._intact = resolved_sections(
                    grains, edges, self.sides, wanted=every, grids=WITHOUT_FINES
                )
        return self._intact

    def resolved(self, wanted: Array, log: Log) -> tuple[Array, dict[int, str]]:
        """The `wanted` (S,) sections with fines by resolved flow, as `intact`."""
        key = wanted.tobytes()
        if key not in self._resolved:
            with log.timed("solve"):
                self._resolved[key] = resolved_sections(
                    self._together(),
                    self.specimen.edges,
                    self.sides,
                    wanted=wanted,
                    grids=WITH_FINES,
                )
        return self._resolved[key]

    def damaged_slabs(self, state: State, choices: AnalysisChoices, name: str, log: Log) -> SlabK:
        """The sections of `damaged`; their own networks hold their own part of the fines."""
        cut = self._own_slabs(choices.law, log, final=True)
        parts = None if cut is None else (cut, partial(self._damaged_conductance, choices, name))
        return state_slabs(state, self.specimen.edges, log, cut=parts)

    def all_spheres(self, log: Log) -> AllSpheres:
        """Grains and fines together. Raises NetworkError and FlowError as its parts do."""
        if self._all is None:
            self._all = measure_all_spheres(
                self._together(),
                self.specimen.edges,
                sides=self.sides,
                timed=log.timed,
            )
        return self._all

    def wanted(self, choices: AnalysisChoices, log: Log) -> AllSpheres | None:
        """The network of all spheres where the damage law asks for it, else None.

        "auto" asks for it up to `MOST_SPHERES` grains and fines, and goes without it, with a
        warning, where these make no network.
        """
        fines, name = self.specimen.fines, choices.damage_law
        if fines is None or not len(fines) or name not in (AUTO, COMBINED, ALL_SPHERES):
            return None
        if name != AUTO:
            return self.all_spheres(log)
        if choices.law != DEFAULT_LAW or len(fines) + len(self.specimen.grains[1]) > MOST_SPHERES:
            return None
        try:
            return self.all_spheres(log)
        except (NetworkError, FlowError) as error:
            log.warnings.append(f"the damage law {SECTION_ARCHIE} was taken: {error}")
            return None

    def _damaged_conductance(self, choices: AnalysisChoices, name: str, network: Network) -> Array:
        """Conductance (T,) m3 of the throats of a slab's own network with its fines."""
        fines, clean = self.specimen.fines, LAWS[choices.law](network)
        assert fines is not None
        if name == UPSCALED:
            return self._upscaled(network, clean).conductance
        occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
        return _law(choices, name)(network, occupancy, clean).conductance

    def _upscaled(self, network: Network, clean: Array) -> Damage:
        """The damage law `upscaled` on a network of grains with its clean conductance (T,) m3."""
        spheres = self._together()
        if not network.periodic[0]:
            low, high = map(float, network.box[0])
            spheres = cut_out(spheres, (low, high), self.sides.periodic)
        return upscaled_damage(network, spheres, clean)

    def _together(self) -> Snapshot:
        """The grains where they ended and the fines."""
        fines = self.specimen.fines
        assert fines is not None
        return self.specimen.grains[1].joined(fines)

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
