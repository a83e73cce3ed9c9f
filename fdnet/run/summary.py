"""summary.json: the numbers of a run that a program reads."""

from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.checkpoint import Checkpoint
from fdnet.errors import by_importance, explained
from fdnet.report.tables import section_rows

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

SEEN = 5e-4
"""Least relative gain that counts: what a table in percent with one digit shows."""


def summarise(
    case: Case,
    analysis: "Analysis",
    *,
    pack: dict[str, Any],
    invasion: dict[str, Any] | None,
    last: Checkpoint | None,
    physical_time_s: float | None,
    sizes: dict[str, Any],
    seconds: dict[str, float],
    warnings: list[str],
) -> dict[str, Any]:
    """The mapping of summary.json.

    `pack` and `invasion` are the records of their stages, `last` is the last checkpoint and
    `physical_time_s` the time of the fluid then; those of the invasion are None without fines.
    `sizes` are those of measured curves, {} without them.
    """
    network, occupancy = analysis.network, analysis.occupancy
    moved = {} if analysis.k_moved is None else {"k_moved_m2": analysis.k_moved}
    stop = invasion["stop_reason"] if invasion else None
    left_out = [f"pack: {item}" for item in pack["left_out"]]
    if invasion is None:
        left_out.append("invade: the whole invasion (no fines in the case)")
    else:
        left_out += [f"invade: {item}" for item in invasion["left_out"]]
    return {
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
        "supplied_count": invasion["supplied"] if invasion else 0,
        "invaded_count": analysis.invaded_count,
        "passed_count": last.passed if last else 0,
        "upstream_count": last.upstream if last else 0,
        "invaded_volume_m3": analysis.invaded_volume,
        "invasion_depth_m": analysis.invasion_depth,
        "invasion_depth_p95_m": analysis.invasion_depth_p95,
        "cake_thickness_m": analysis.cake_thickness,
        "stop_reason": stop,
        "final": stop not in ("cap", "mud_cut_off", "unfinished") if invasion else None,
        **({"share_done": invasion["share_done"]} if stop == "unfinished" and invasion else {}),
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
        "ranks": {"pack": pack["ranks"], "invade": invasion["ranks"] if invasion else None},
        "dem_steps": pack["steps"] + (invasion["steps"] if invasion else 0),
        "dem_dt_s": (invasion or pack)["dt_s"],
        **(invasion or {}).get("springs", {}),
        "physical_time_s": physical_time_s,
        "seconds": seconds
        | {f"analyse_{name}": value for name, value in analysis.seconds.items()},
        "left_out": left_out,
        "warnings": by_importance(explained(one) for one in [*warnings, *analysis.warnings]),
    }


def _updates(invasion: dict[str, Any] | None) -> dict[str, Any]:
    """What a coupled invasion measured at its last update; nothing of one that is not coupled."""
    updates = (invasion or {}).get("updates")
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
