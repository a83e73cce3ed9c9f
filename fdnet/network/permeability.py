"""Permeability of a pack before and after fines: the whole network analysis of one specimen."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import (
    Profile,
    Section,
    SlabK,
    make_profile,
    make_sections,
    reduction,
)
from fdnet.network.flow.slabs import inplace_permeability, slab_permeability, whole_permeability
from fdnet.network.laws.damage import CLEAN, Damage
from fdnet.network.laws.named import (
    DAMAGE_LAWS,
    DEFAULT_DAMAGE_LAW,
    DEFAULT_LAW,
    LAWS,
    damage_law,
)
from fdnet.network.network import WALLS, Network
from fdnet.network.specimen import Specimen, measure_specimen
from fdnet.spheres.snapshot import Array, Snapshot, frozen

__all__ = ["Analysis", "AnalysisOptions", "Profile", "Section", "analyse", "compare"]

STAGES = ("tessellate", "occupancy", "conductance", "solve", "porosity")


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysisOptions:
    """Choices of an analysis: `sections` count or edges (m), laws by name, `threshold` of the thesis law (None: the
    law's own), `middle_band` "threshold" or "position", `overlap` "exact" or "two-plane", `profile_bin` m; `walls`
    "no-slip" or "slip", what side walls do to the fluid."""

    sections: int | Sequence[float] = 1
    law: str = DEFAULT_LAW
    damage_law: str = DEFAULT_DAMAGE_LAW
    threshold: float | None = None
    middle_band: str = "threshold"
    overlap: str = "exact"
    profile_bin: float | None = None
    walls: str = "no-slip"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Analysis:
    """Everything the report writes; SI units.

    `network` and all that goes by pore or throat (occupancy, conductances, flows) are of the final grain positions;
    when the grains moved, `k_initial` and the sections' initial values are of the first positions, `k_moved` is
    `network` without fines and `flow_initial` its flow. `solver` holds the worst of all solves.
    """

    network: Network
    occupancy: Occupancy | None
    law: str
    damage_law: str
    conductance_initial: Array
    conductance_damaged: Array
    law_used: Array
    flow_initial: Flow
    flow_damaged: Flow
    k_initial: float
    k_damaged: float
    k_moved: float | None
    k_reduction: float | None
    porosity_initial: float
    porosity_initial_error: float
    porosity_initial_sum: float
    porosity_damaged: float
    sections: tuple[Section, ...]
    profile: Profile
    invaded_count: int
    invaded_volume: float
    invasion_depth: float
    invasion_depth_p95: float
    cake_thickness: float
    solver: Mapping[str, str | float | None]
    counts: Mapping[str, int]
    warnings: tuple[str, ...]
    seconds: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _State:
    """A network with its conductance, its flow through the whole box and its k."""

    network: Network
    conductance: Array
    flow: Flow
    k: float


@dataclass(slots=True)
class _Log:
    """Seconds per stage, and what to tell the user."""

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    warnings: list[str] = field(default_factory=list)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[stage] += time.perf_counter() - start


def analyse(
    initial: Snapshot,
    damaged: Snapshot | None,
    *,
    periodic: tuple[bool, bool, bool],
    options: AnalysisOptions,
) -> Analysis:
    """Permeability of the grains of `initial`, and with the fines of `damaged` (grains, moved or not, and all fines).

    `damaged` None: an intact pack. Raises CaseError on unknown laws or wrong section edges, NetworkError on grains that
    differ between the two and on degenerate geometry, FlowError on a solve that fails its checks; no open path is k = 0
    with the reason in `warnings`.
    """
    pair = (options.law, options.damage_law)
    return next(compare(initial, damaged, periodic=periodic, options=options, laws=[pair]))


def compare(
    initial: Snapshot,
    damaged: Snapshot | None,
    *,
    periodic: tuple[bool, bool, bool],
    options: AnalysisOptions,
    laws: Sequence[tuple[str, str]],
) -> Iterator[Analysis]:
    """The same as `analyse` for each pair of (law, damage law) in `laws`; what does not depend on them (tessellation,
    occupancy, porosity) is measured once, the clean pack solved once for each law. Seconds are of what each added."""
    chosen = [replace(options, law=law, damage_law=damage_law) for law, damage_law in laws]
    for one in chosen:
        _check_names(one)
    log = _Log()
    specimen = measure_specimen(
        initial,
        damaged,
        periodic=periodic,
        walls=options.walls,
        sections=options.sections,
        profile_bin=options.profile_bin,
        overlap=options.overlap,
        timed=log.timed,
    )
    clean: dict[str, tuple[_State, SlabK]] = {}
    for one in chosen:
        yield _analysis(specimen, one, clean, log)
        log = _Log()


def _analysis(
    specimen: Specimen, options: AnalysisOptions, known: dict[str, tuple[_State, SlabK]], log: _Log
) -> Analysis:
    if options.law not in known:
        state = _clean_state(specimen.first, options, log)
        known[options.law] = state, _slab_k(state, specimen.edges, log)
    clean, clean_slabs = known[options.law]
    base = _clean_state(specimen.network, options, log) if specimen.moved else clean
    damage = _damage(base, specimen.occupancy, options, log)
    final = base if damage is None else _state(base.network, damage.conductance, log)
    slabs = clean_slabs if final is clean else _slab_k(final, specimen.edges, log)
    sections = make_sections(
        specimen.edges, specimen.porosity, (clean_slabs, slabs), specimen.depth
    )
    porosity, invaded = specimen.porosity, specimen.invaded
    _warn(log, (clean, final), sections, specimen.occupancy)
    law_used = np.full(len(final.conductance), CLEAN) if damage is None else damage.law_used
    return Analysis(
        network=base.network,
        occupancy=specimen.occupancy,
        law=options.law,
        damage_law=options.damage_law,
        conductance_initial=base.conductance,
        conductance_damaged=final.conductance,
        law_used=frozen(law_used),
        flow_initial=base.flow,
        flow_damaged=final.flow,
        k_initial=clean.k,
        k_damaged=final.k,
        k_moved=base.k if specimen.moved else None,
        k_reduction=reduction(clean.k, final.k),
        porosity_initial=porosity[0].mean,
        porosity_initial_error=porosity[0].standard_error,
        porosity_initial_sum=porosity[0].sum,
        porosity_damaged=porosity[1].mean,
        sections=sections,
        profile=make_profile(specimen.bins, porosity, specimen.depth),
        invaded_count=invaded.count,
        invaded_volume=invaded.volume,
        invasion_depth=invaded.depth,
        invasion_depth_p95=invaded.depth_p95,
        cake_thickness=invaded.cake_thickness,
        solver=_worst([clean.flow, base.flow, final.flow, *clean_slabs.flows, *slabs.flows]),
        counts=_counts(base, specimen.occupancy, damage, final.flow),
        warnings=tuple(log.warnings),
        seconds=log.seconds,
    )


def _check_names(options: AnalysisOptions) -> None:
    for key, value, known in (
        ("law", options.law, LAWS),
        ("damage_law", options.damage_law, DAMAGE_LAWS),
        ("walls", options.walls, WALLS),
    ):
        if value not in known:
            raise CaseError(
                f"analysis.{key}: {value!r} is not known; choose one of {sorted(known)}"
            )


def _clean_state(network: Network, options: AnalysisOptions, log: _Log) -> _State:
    with log.timed("conductance"):
        conductance = LAWS[options.law](network)
    return _state(network, frozen(conductance), log)


def _state(network: Network, conductance: Array, log: _Log) -> _State:
    with log.timed("solve"):
        k, flow = whole_permeability(network, conductance)
    return _State(network=network, conductance=conductance, flow=flow, k=k)


def _damage(
    base: _State, occupancy: Occupancy | None, options: AnalysisOptions, log: _Log
) -> Damage | None:
    if occupancy is None:
        return None
    with log.timed("conductance"):
        law = damage_law(
            options.damage_law,
            clogging_threshold=options.threshold,
            middle_band=options.middle_band,
        )
        return law(base.network, occupancy, base.conductance)


def _slab_k(state: _State, edges: Array, log: _Log) -> SlabK:
    network = state.network
    with log.timed("solve"):
        if len(edges) == 2 and not network.periodic[0]:
            # one slab is the whole box
            solved = [(state.k, state.flow)]
        else:
            solved = [
                slab_permeability(network, state.conductance, (float(low), float(high)))
                for low, high in pairwise(edges)
            ]
        inplace = inplace_permeability(network, state.flow, edges)
    return SlabK(
        cut_out=frozen([k for k, _ in solved]),
        inplace=frozen(inplace),
        flows=tuple(flow for _, flow in solved),
    )


def _warn(
    log: _Log,
    states: tuple[_State, _State],
    sections: tuple[Section, ...],
    occupancy: Occupancy | None,
) -> None:
    for name, state in zip(("k_initial", "k_damaged"), states, strict=True):
        if state.flow.reason:
            log.warnings.append(f"{name} = 0: {state.flow.reason}")
    network = states[0].network
    thin = [one.section for one in sections if one.x_hi - one.x_lo < 2.0 * network.grain_radius]
    if thin:
        log.warnings.append(
            f"sections {thin} are thinner than a grain diameter ({2 * network.grain_radius:.3g} m): "
            "their k is of single throats"
        )
    if network.counts["grains_outside_box"]:
        log.warnings.append(
            f"{network.counts['grains_outside_box']} grains lie outside the box and play no part"
        )
    if (
        occupancy is not None
        and occupancy.counts["fines_outside_box"]
        and not occupancy.pore_solid_volume.any()
    ):
        log.warnings.append(
            f"none of the {occupancy.counts['fines_outside_box']} fines is centred in the box: "
            "no pore holds any; check the box if some should"
        )


def _worst(flows: list[Flow]) -> dict[str, str | float | None]:
    balances = [flow.mass_balance for flow in flows if flow.mass_balance is not None]
    return {
        "method": flows[0].method,
        "residual": max(flow.residual for flow in flows),
        "mass_balance": max(balances) if balances else None,
    }


def _counts(
    base: _State, occupancy: Occupancy | None, damage: Damage | None, flow: Flow
) -> dict[str, int]:
    found = dict(base.network.counts) | {
        "throats_not_conducting": int(np.sum(base.conductance == 0))
    }
    if occupancy is not None and damage is not None:
        found |= {
            **occupancy.counts,
            **damage.counts,
            "throats_blocked": int(occupancy.blocked.sum()),
        }
    return found | {"isolated_pores": flow.isolated_pores}
