"""Permeability of a pack before and after fines: the whole network analysis of one specimen."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise, product
from typing import Unpack

import numpy as np

from fdnet.case.analysis import AnalysisChoices, AnalysisKeys, with_visible_choices
from fdnet.network.analysis import Analysis, worst_solve
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import Section, make_profile, make_sections, reduction, thin_slabs
from fdnet.network.flow.slabs import (
    SlabK,
    inplace_permeability,
    slab_permeability,
    whole_permeability,
)
from fdnet.network.laws.damage import CLEAN, Damage
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS, damage_law
from fdnet.network.network import Network
from fdnet.network.specimen.specimen import (
    Specimen,
    measure_specimen,
    require_snapshots,
    specimen_doubts,
)
from fdnet.spheres.directions import Directions, periodic_axes
from fdnet.spheres.snapshot import Array, Snapshot, frozen

STAGES = ("tessellate", "occupancy", "conductance", "solve", "porosity")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _State:
    """A network with its conductance, its flow through the whole box and its k."""

    network: Network
    conductance: Array
    flow: Flow
    k: float


@dataclass(slots=True)
class _Log:
    """Seconds of each stage, and warnings for the user."""

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))
    warnings: list[str] = field(default_factory=list)

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self.seconds[stage] += time.perf_counter() - start


@with_visible_choices
def analyse(
    spheres: Snapshot,
    damaged: Snapshot | None = None,
    *,
    periodic: Directions = "",
    options: AnalysisChoices | None = None,
    **choices: Unpack[AnalysisKeys],
) -> Analysis:
    """Permeability of a pack of grains along x, without and with the fines in it.

    Args:
        spheres: grains and fines, m. When `damaged` is given, its grains before the invasion.
        damaged: the same grains, moved or not, and all fines. Without it, `spheres` holds the
            fines, or there are none.
        periodic: sides that repeat, letters such as "yz" or three truth values (x, y, z). The
            other sides of the box are walls; along x they are the inlet and the outlet.
        options: choices of the analysis, for example `case.analysis`. Without it: one section,
            profile bins of a mean grain radius, fdnet's default laws.
        choices: single choices by name, in place of those of `options`: `sections` (a count, or
            edges in m), `law`, `damage_law`, `clogging_threshold`, `middle_band`,
            `throat_overlap`, `profile_bin_mm`, `walls`. The defaults shown are those that hold
            without `options`.

    Returns:
        Permeabilities (m2), porosities, sections, profile, network and flows. No open path is no
        error: the permeability is 0 and `warnings` gives the reason.

    Raises:
        CaseError: a choice is unknown or outside its range (the message names its key), or
            `spheres` is no Snapshot.
        NetworkError: the geometry is degenerate, or the grains of the two snapshots differ.
        FlowError: the solve fails its checks.

    Examples:
        A simple cubic lattice of touching spheres, diameter 1 mm (k = 0.00252 d^2, Zick and Homsy
        1982):

        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> result = fdnet.analyse(spheres, periodic="xyz")
        >>> print(f"{result.k_initial:.2g} m2, porosity {result.porosity_initial:.3f}")
        2.5e-09 m2, porosity 0.476

        Flow along y: turn the spheres so that y becomes the new x; `periodic` turns with them.

        >>> turned = fdnet.analyse(spheres.turned("y"), periodic="xyz")
        >>> print(f"{turned.k_initial:.2g} m2")
        2.5e-09 m2
    """
    chosen = _chosen(options, choices)
    pair = (chosen.law, chosen.damage_law)
    return next(compare(spheres, damaged, periodic=periodic, options=chosen, laws=[pair]))


@with_visible_choices
def compare(
    spheres: Snapshot,
    damaged: Snapshot | None = None,
    *,
    periodic: Directions = "",
    laws: Sequence[tuple[str, str]] | None = None,
    options: AnalysisChoices | None = None,
    **choices: Unpack[AnalysisKeys],
) -> Iterator[Analysis]:
    """The same pack under several pairs of laws; otherwise as `analyse`.

    What does not depend on the laws (tessellation, occupancy, porosity) is measured once, and the
    clean pack is solved once for each conductance law.

    Args:
        spheres: grains and fines, m, as for `analyse`.
        damaged: as for `analyse`.
        periodic: sides that repeat, as for `analyse`.
        laws: pairs (law, damage law). Without it every law with every damage law, or with the
            chosen one where there are no fines.
        options: choices of the analysis, as for `analyse`.
        choices: single choices by name, as for `analyse`.

    Yields:
        One `Analysis` (permeabilities in m2) for each pair, in their order; its `seconds` are
        those that this pair added.

    Raises:
        CaseError, NetworkError, FlowError: as `analyse`.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((3, 3, 3)).reshape(3, -1).T + 0.5)
        >>> spheres = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> pairs = [("thesis", "thesis"), ("lubrication", "side-kozeny")]
        >>> for result in fdnet.compare(spheres, periodic="xyz", laws=pairs):
        ...     print(f"{result.law}: {result.k_initial:.1e} m2")
        thesis: 1.4e-09 m2
        lubrication: 2.5e-09 m2
    """
    require_snapshots(spheres, damaged)
    base, around = _chosen(options, choices), periodic_axes(periodic)
    if damaged is None and len(spheres.fines()):
        damaged = spheres
    if laws is None:
        rules = DAMAGE_LAWS if damaged is not None else [base.damage_law]
        laws = list(product(LAWS, rules))
    chosen = [base.changed(law=law, damage_law=damage_law) for law, damage_law in laws]
    log = _Log()
    specimen = measure_specimen(spheres, damaged, periodic=around, choices=base, timed=log.timed)
    clean: dict[str, tuple[_State, SlabK]] = {}
    for one in chosen:
        yield _analysis(specimen, one, clean, log)
        log = _Log()


def _chosen(options: AnalysisChoices | None, choices: AnalysisKeys) -> AnalysisChoices:
    return AnalysisChoices.of_pack(**choices) if options is None else options.changed(**choices)


def _analysis(
    specimen: Specimen, options: AnalysisChoices, known: dict[str, tuple[_State, SlabK]], log: _Log
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
    _warn(log, (clean, final), sections)
    log.warnings += specimen_doubts(specimen, clean.k, options.walls)
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
        solver=worst_solve([clean.flow, base.flow, final.flow, *clean_slabs.flows, *slabs.flows]),
        counts=_counts(base, specimen.occupancy, damage, final.flow),
        warnings=tuple(log.warnings),
        seconds=log.seconds,
    )


def _clean_state(network: Network, options: AnalysisChoices, log: _Log) -> _State:
    with log.timed("conductance"):
        conductance = LAWS[options.law](network)
    return _state(network, frozen(conductance), log)


def _state(network: Network, conductance: Array, log: _Log) -> _State:
    with log.timed("solve"):
        k, flow = whole_permeability(network, conductance)
    return _State(network=network, conductance=conductance, flow=flow, k=k)


def _damage(
    base: _State, occupancy: Occupancy | None, options: AnalysisChoices, log: _Log
) -> Damage | None:
    if occupancy is None:
        return None
    with log.timed("conductance"):
        law = damage_law(
            options.damage_law,
            clogging_threshold=options.clogging_threshold,
            middle_band=options.middle_band,
        )
        return law(base.network, occupancy, base.conductance)


def _slab_k(state: _State, edges: Array, log: _Log) -> SlabK:
    network = state.network
    with log.timed("solve"):
        if len(edges) == 2 and not network.periodic[0]:  # one slab is the whole box
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


def _warn(log: _Log, states: tuple[_State, _State], sections: tuple[Section, ...]) -> None:
    for name, state in zip(("k_initial", "k_damaged"), states, strict=True):
        if state.flow.reason:
            log.warnings.append(f"{name} = 0: {state.flow.reason}")
    network = states[0].network
    log.warnings += thin_slabs(sections, 2.0 * network.grain_radius)


def _counts(
    base: _State, occupancy: Occupancy | None, damage: Damage | None, flow: Flow
) -> dict[str, int]:
    counts = dict(base.network.counts) | {
        "throats_not_conducting": int(np.sum(base.conductance == 0))
    }
    if occupancy is not None and damage is not None:
        counts |= {
            **occupancy.counts,
            **damage.counts,
            "throats_blocked": int(occupancy.blocked.sum()),
        }
    return counts | {"isolated_pores": flow.isolated_pores}
