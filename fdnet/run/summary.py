"""summary.json: the numbers of a run that a program reads."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.errors import by_importance, explained
from fdnet.names import LIGGGHTS_STAGES
from fdnet.report.tables import section_rows
from fdnet.run.answer import with_answer
from fdnet.run.dem_stages import file_warnings
from fdnet.run.outputs import Results, size_numbers
from fdnet.run.records import Session, record_warnings, stage_costs
from fdnet.scales.check import every_finding

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

SEEN = 5e-4  # Least relative gain that counts: what a table in percent with one digit shows


def summarise(
    session: Session, results: Results, records: Mapping[str, dict[str, Any] | None]
) -> dict[str, Any]:
    """The mapping of summary.json; `records` are those of the stages of LIGGGHTS."""
    case, analysis, history = session.case, results.analysis, results.history_rows
    pack, invasion, cleaned = (records.get(stage) or {} for stage in LIGGGHTS_STAGES)
    last = results.invasion.history[-1] if results.invasion else None
    warnings = [
        *(one.sentence for one in every_finding(case, session.scales)),
        *record_warnings(case, pack, invasion),
        *cleaned.get("warnings", []),
        *file_warnings(session),
        *analysis.warnings,
    ]
    sizes = {one.name: size_numbers(one) for one in results.sizes}
    network, occupancy = analysis.network, analysis.occupancy
    moved = {} if analysis.k_moved is None else {"k_moved_m2": analysis.k_moved}
    stop = invasion.get("stop_reason")
    left_out = [f"pack: {item}" for item in pack["left_out"]]
    none = ["the whole invasion (no fines in the case)"]
    left_out += [f"invade: {item}" for item in invasion.get("left_out", none)]
    summary = {
        "case": case.name,
        "seed": case.seed,
        "law": analysis.law,
        "damage_law": analysis.damage_law,
        "damage_law_used": analysis.damage_law_used,
        "porosity_initial": analysis.porosity_initial,
        "porosity_initial_error": analysis.porosity_initial_error,
        "porosity_damaged": analysis.porosity_damaged,
        "porosity_initial_sum": analysis.porosity_initial_sum,
        "k_initial_m2": analysis.k_initial,
        "k_damaged_m2": analysis.k_damaged,
        "k_reduction": analysis.k_reduction,
        "damage_law_other": analysis.damage_law_other,
        "k_damaged_other_m2": analysis.k_damaged_other,
        **moved,
        "supplied_count": invasion.get("supplied", 0),
        "invaded_count": analysis.invaded_count,
        "passed_count": last.passed if last else 0,
        "upstream_count": last.upstream if last else 0,
        "invaded_volume_m3": analysis.invaded_volume,
        "invasion_depth_m": analysis.invasion_depth,
        "invasion_depth_p95_m": analysis.invasion_depth_p95,
        "cake_thickness_m": analysis.cake_thickness,
        "stop_reason": stop,
        "final": stop not in ("cap", "mud_cut_off", "unfinished") if invasion else None,
        **({"share_done": invasion["share_done"]} if stop == "unfinished" else {}),
        "sections": section_rows(analysis),
        "pores": len(network.pore_radius),
        "throats": len(network.throat_radius),
        "throats_blocked": 0 if occupancy is None else int(occupancy.blocked.sum()),
        "network_counts": {**analysis.counts, **above_intact(analysis)},
        **_updates(invasion),
        "solver": analysis.solver,
        **({"sizes": sizes} if sizes else {}),
        "max_overlap_fraction": (invasion or pack)["max_overlap"],
        "grain_overlap_fraction": pack["max_overlap"],
        "ranks": {"pack": pack["ranks"], "invade": invasion.get("ranks")},
        "dem_steps": pack["steps"] + (invasion["steps"] if invasion.get("dt_s") else 0),
        "dem_dt_s": (invasion or pack)["dt_s"] or None,
        **invasion.get("springs", {}),
        "physical_time_s": history[-1]["physical_time_s"] if history else None,
        **stage_costs(records, session),
        "left_out": left_out,
        "warnings": by_importance(map(explained, warnings)),
        **results.numbers,
    }
    for one in results.added:
        summary |= one.summary
    return with_answer(summary, case, analysis, results.shown)


def _updates(invasion: Mapping[str, Any]) -> dict[str, Any]:
    """What a coupled invasion measured at its last update; nothing of one that is not coupled."""
    updates = invasion.get("updates")
    if updates is None:
        return {}
    last = updates["last"]
    result = {"drag_updates": updates["count"], "drag_last_update": last}
    if "rate_over_initial" in last:
        result |= {name: last[name] for name in ("rate_over_initial", "filtrate_m3")}
        result["momentum_defect_most"] = updates["momentum_defect_most"]
    return result


def above_intact(analysis: "Analysis") -> dict[str, int]:
    """Where a value in place is higher with the fines than without: they turn the flow aside."""
    layers = analysis.layers
    return {
        "sections_inplace_above_intact": sum(
            s.k_damaged_inplace > s.k_initial_inplace * (1 + SEEN) for s in analysis.sections
        ),
        "layers_above_intact": 0
        if layers is None
        else int(np.sum(layers.k_damaged > layers.k_initial * (1 + SEEN))),
    }
