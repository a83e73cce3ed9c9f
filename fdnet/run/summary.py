"""summary.json: the numbers a program reads."""

from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.checkpoint import Checkpoint
from fdnet.report.tables import section_rows
from fdnet.run.records import ranks_of
from fdnet.scales.check.catalogue import explained

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

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
    result = {
        "case": case.name,
        "seed": case.seed,
        "law": analysis.law,
        "damage_law": analysis.damage_law,
        "damage_law_used": analysis.damage_law_used,
        **_porosities(analysis),
        **_permeabilities(analysis),
        **_counts(analysis, last, invasion),
        "stop_reason": invasion["stop_reason"] if invasion else None,
        "final": invasion["stop_reason"] != "cap" if invasion else None,
        "sections": section_rows(analysis),
        **_network(analysis),
        **_updates(invasion),
        "solver": analysis.solver,
        **({"sizes": sizes} if sizes else {}),
        "max_overlap_fraction": invasion["max_overlap"] if invasion else pack["max_overlap"],
        "grain_overlap_fraction": pack["max_overlap"],
        "ranks": {"pack": ranks_of(pack), "invade": ranks_of(invasion) if invasion else None},
        "dem_steps": pack["steps"] + (invasion["steps"] if invasion else 0),
        "dem_dt_s": invasion["dt_s"] if invasion else pack["dt_s"],
        "physical_time_s": physical_time_s,
        "seconds": seconds
        | {f"analyse_{name}": value for name, value in analysis.seconds.items()},
        "left_out": _left_out(pack, invasion),
        "warnings": [explained(one) for one in [*warnings, *analysis.warnings]],
    }
    return result


def _porosities(analysis: "Analysis") -> dict[str, Any]:
    return {
        "porosity_initial": analysis.porosity_initial,
        "porosity_initial_error": analysis.porosity_initial_error,
        "porosity_damaged": analysis.porosity_damaged,
        "porosity_initial_sum": analysis.porosity_initial_sum,
    }


def _permeabilities(analysis: "Analysis") -> dict[str, Any]:
    moved = {} if analysis.k_moved is None else {"k_moved_m2": analysis.k_moved}
    return {
        "k_initial_m2": analysis.k_initial,
        "k_damaged_m2": analysis.k_damaged,
        "k_reduction": analysis.k_reduction,
        "damage_law_other": analysis.damage_law_other,
        "k_damaged_other_m2": analysis.k_damaged_other,
        **moved,
    }


def _counts(
    analysis: "Analysis", last: Checkpoint | None, invasion: dict[str, Any] | None
) -> dict[str, Any]:
    passed, upstream = (last.passed, last.upstream) if last else (0, 0)
    return {
        "supplied_count": invasion["supplied"] if invasion else 0,
        "invaded_count": analysis.invaded_count,
        "passed_count": passed,
        "upstream_count": upstream,
        "invaded_volume_m3": analysis.invaded_volume,
        "invasion_depth_m": analysis.invasion_depth,
        "invasion_depth_p95_m": analysis.invasion_depth_p95,
        "cake_thickness_m": analysis.cake_thickness,
    }


def _updates(invasion: dict[str, Any] | None) -> dict[str, Any]:
    """What a coupled invasion measured at its last update; nothing of one that is not coupled."""
    updates = (invasion or {}).get("updates")
    if invasion is None or updates is None:
        return {}
    last = updates["last"]
    common = {"drag_updates": updates["count"], "drag_last_update": last}
    if "rate_over_initial" not in last:
        return common
    return common | {
        "rate_over_initial": last["rate_over_initial"],
        "filtrate_m3": last["filtrate_m3"],
        "momentum_defect_most": updates["momentum_defect_most"],
    }


def _network(analysis: "Analysis") -> dict[str, Any]:
    blocked = 0 if analysis.occupancy is None else int(analysis.occupancy.blocked.sum())
    return {
        "pores": len(analysis.network.pore_radius),
        "throats": len(analysis.network.throat_radius),
        "throats_blocked": blocked,
        "network_counts": {**analysis.counts, **above_intact(analysis)},
    }


def above_intact(analysis: "Analysis") -> dict[str, int]:
    """Where a value in place is higher with the fines than without: they turn the flow aside."""
    sections, layers = analysis.sections, analysis.layers
    return {
        "sections_inplace_above_intact": sum(
            s.k_damaged_inplace > s.k_initial_inplace * (1 + SEEN) for s in sections
        ),
        "layers_above_intact": 0
        if layers is None
        else int(np.sum(layers.k_damaged > layers.k_initial * (1 + SEEN))),
    }


def _left_out(pack: dict[str, Any], invasion: dict[str, Any] | None) -> list[str]:
    left_out = [f"pack: {item}" for item in pack["left_out"]]
    if invasion is None:
        return [*left_out, "invade: the whole invasion (no fines in the case)"]
    return left_out + [f"invade: {item}" for item in invasion["left_out"]]
