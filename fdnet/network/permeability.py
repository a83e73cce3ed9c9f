"""Permeability of a pack before and after fines: the whole network analysis of one specimen."""

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, Unpack

import numpy as np

from fdnet.case.analysis import AnalysisChoices, AnalysisKeys, with_visible_choices
from fdnet.case.names import ALL_SPHERES, AUTO, SECTION_ARCHIE, law_pairs
from fdnet.network.analysis import Analysis, laws_apart, worst_solve
from fdnet.network.fines.occupancy import Occupancy
from fdnet.network.flow.depth import Layers, layer_edges, make_layers
from fdnet.network.flow.flow import Flow
from fdnet.network.flow.sections import Section, make_profile, make_sections, reduction, thin_slabs
from fdnet.network.laws.damage import CLEAN, Damage
from fdnet.network.laws.named import LAWS
from fdnet.network.resolved.all_spheres import AllSpheres, at_most_the_grains, few_throats
from fdnet.network.resolved.measured import Measured
from fdnet.network.resolved.slab import Sides
from fdnet.network.resolved.state import Log, State, solved
from fdnet.network.specimen.specimen import (
    Specimen,
    measure_specimen,
    require_snapshots,
    specimen_doubts,
)
from fdnet.spheres.directions import Directions, periodic_axes
from fdnet.spheres.snapshot import Snapshot, frozen


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
        >>> pairs = [("thesis", "thesis"), ("lubrication", "section-archie")]
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
        laws = law_pairs() if damaged is not None else list(product(LAWS, [base.damage_law]))
    chosen = [base.changed(law=law, damage_law=damage_law) for law, damage_law in laws]
    log = Log()
    specimen = measure_specimen(spheres, damaged, periodic=around, choices=base, timed=log.timed)
    measured = Measured(specimen=specimen, sides=Sides(periodic=around, walls=base.walls))
    for one in chosen:
        yield _analysis(measured, one, log)
        log = Log()


def _chosen(options: AnalysisChoices | None, choices: AnalysisKeys) -> AnalysisChoices:
    return AnalysisChoices.of_pack(**choices) if options is None else options.changed(**choices)


def _analysis(measured: Measured, options: AnalysisChoices, log: Log) -> Analysis:
    specimen, law, name = measured.specimen, options.law, options.damage_law
    clean, clean_slabs = measured.clean(law, log)
    base = measured.base(law, log)
    whole = measured.all_spheres(options, log)
    of_grains = SECTION_ARCHIE if name in (AUTO, ALL_SPHERES) else name
    final, damage = measured.damaged(options, of_grains, log)
    k, slabs, flow = clean.k, clean_slabs, final.flow
    counts: dict[str, int] = {}
    if whole is not None:
        log.warnings += [*whole.refused, *few_throats(whole.slabs)]
        grains = (base.k, None if specimen.moved else clean_slabs)
        empty = specimen.empty_sections()
        whole, counts = at_most_the_grains(whole, grains, specimen.edges, empty)
        k, slabs, flow = whole.k, whole.slabs, whole.solved.flow
        log.warnings += laws_apart((ALL_SPHERES, k), (of_grains, final.k))
    elif final is not clean:
        k, slabs = final.k, measured.damaged_slabs(final, options, of_grains, log)
    sections = make_sections(
        specimen.edges, specimen.porosity, (clean_slabs, slabs), specimen.depth
    )
    _warn(log, clean, flow, sections)
    log.warnings += specimen_doubts(specimen, clean.k, options.walls)
    law_used = np.full(len(final.conductance), CLEAN) if damage is None else damage.law_used
    flows = [clean.flow, base.flow, final.flow, flow, *clean_slabs.flows, *slabs.flows]
    return Analysis(
        network=base.network,
        occupancy=specimen.occupancy,
        law=law,
        damage_law=name,
        damage_law_used=_used(specimen, whole, of_grains),
        damage_law_other=None if whole is None else of_grains,
        k_damaged_other=None if whole is None else final.k,
        conductance_initial=base.conductance,
        conductance_damaged=final.conductance,
        law_used=frozen(law_used),
        flow_initial=base.flow,
        flow_damaged=final.flow,
        k_initial=clean.k,
        k_damaged=k,
        k_moved=base.k if specimen.moved else None,
        k_reduction=reduction(clean.k, k),
        sections=sections,
        layers=_layers(specimen, clean, whole),
        solver=worst_solve(flows),
        copies=specimen.copies,
        counts=_counts(base, specimen.occupancy, damage, final.flow)
        | {"spheres_dropped": specimen.inner.grains + specimen.inner.fines}
        | counts,
        warnings=tuple(log.warnings),
        seconds=log.seconds,
        **_without_laws(specimen),
    )


def _without_laws(specimen: Specimen) -> dict[str, Any]:
    """The values of an `Analysis` that depend on no law."""
    porosity, invaded = specimen.porosity, specimen.invaded
    return {
        "porosity_initial": porosity[0].mean,
        "porosity_initial_error": porosity[0].standard_error,
        "porosity_initial_sum": porosity[0].sum,
        "porosity_damaged": porosity[1].mean,
        "profile": make_profile(specimen.bins, porosity, specimen.depth),
        "invaded_count": invaded.count,
        "invaded_volume": invaded.volume,
        "invasion_depth": invaded.depth,
        "invasion_depth_p95": invaded.depth_p95,
        "cake_thickness": invaded.cake_thickness,
    }


def _used(specimen: Specimen, whole: AllSpheres | None, of_grains: str) -> str | None:
    if specimen.fines is None or not len(specimen.fines):
        return None
    return of_grains if whole is None else ALL_SPHERES


def _layers(specimen: Specimen, clean: State, whole: AllSpheres | None) -> Layers | None:
    """Layers of the mean diameter of a fine, from the network that resolves them."""
    initial, fines = solved(clean), specimen.fines
    if initial is None or fines is None or whole is None:
        return None
    edges = layer_edges(clean.network.box, 2.0 * float(fines.radius.mean()))
    return make_layers(initial, whole.solved, edges=edges, depth=specimen.depth)


def _warn(log: Log, clean: State, damaged: Flow, sections: tuple[Section, ...]) -> None:
    for name, flow in (("k_initial", clean.flow), ("k_damaged", damaged)):
        if flow.reason:
            log.warnings.append(f"{name} = 0: {flow.reason}")
    log.warnings += thin_slabs(sections, 2.0 * clean.network.grain_radius)


def _counts(
    base: State, occupancy: Occupancy | None, damage: Damage | None, flow: Flow
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
