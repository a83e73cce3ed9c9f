"""The summary of a run, as numbers and as text.

summary.json: the numbers a program reads.
"""

import textwrap
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.checkpoint import Checkpoint
from fdnet.errors import explained
from fdnet.names import STAGES
from fdnet.report.tables import (
    AGREES,
    SHOWS,
    in_millidarcy,
    millimetres,
    percent,
    section_rows,
    two_digits,
)
from fdnet.run.records import ranks_of

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


# ------------------------------------------------------------------------------------------------
# A run in lines of text: the end of `fdnet run`, `print(run)`, and the same in a notebook.


WIDTH = 96
"""Letters in a line of running text."""
_HEAD = (
    "depth mm", "porosity", "with fines", "k mD", "with fines", "lost %", "in place %", "fines"
)  # fmt: skip


def summary_lines(summary: Mapping[str, Any]) -> Iterator[str]:
    """The answer, headline numbers, the table of sections, rules of thumb, warnings."""
    for text in _said(summary):
        yield from textwrap.wrap(text, WIDTH)
    yield ""
    for name, value in facts(summary):
        yield from textwrap.wrap(f"{name:<14}{value}", WIDTH, subsequent_indent=14 * " ")
    yield ""
    yield _row(_HEAD)
    yield from (_row(section_cells(row)) for row in summary["sections"])
    yield from textwrap.wrap(summary.get("words", {}).get("in_place", ""), WIDTH)
    yield ""
    yield from _rules(summary)
    seconds = summary["seconds"]
    outside = sum(seconds.get(stage, 0.0) for stage in STAGES) - seconds["liggghts"]
    yield f"seconds       {seconds['liggghts']:.1f} in LIGGGHTS, {outside:.1f} outside"
    yield from (f"warning: {warning}" for warning in summary["warnings"])


def text_lines(path: Path, summary: Mapping[str, Any]) -> Iterator[str]:
    """The same of a finished run in the folder `path`."""
    yield f"fdnet run {summary['case']} in {path}"
    yield from summary_lines(summary)


def html_lines(path: Path, summary: Mapping[str, Any]) -> Iterator[str]:
    """The answer, headline numbers and the table of sections for a notebook."""
    yield f"<p><b>fdnet run {escape(str(summary['case']))}</b> in {escape(str(path))}</p>"
    yield from (f"<p>{escape(text)}</p>" for text in _said(summary))
    yield "<table>"
    for name, value in facts(summary):
        yield f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>"
    yield "</table><table>"
    yield "<tr>" + "".join(f"<th>{escape(name)}</th>" for name in _HEAD) + "</tr>"
    for row in summary["sections"]:
        yield "<tr>" + "".join(f"<td>{cell}</td>" for cell in section_cells(row)) + "</tr>"
    yield "</table>"


def _said(summary: Mapping[str, Any]) -> Iterator[str]:
    yield from filter(None, (summary.get("answer"), *summary.get("certainty", ())))


def facts(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The headline numbers of a run: name and value with units."""
    before, after = summary["k_initial_m2"], summary["k_damaged_m2"]
    yield (
        "permeability",
        f"{in_millidarcy(before)} -> {in_millidarcy(after)} mD ({before:.3g} -> {after:.3g} m2), "
        f"{percent(summary['k_reduction'])} % lost",
    )
    other = summary.get("k_damaged_other_m2")
    if other is not None:
        law = summary["damage_law_other"]
        yield "other law", f"{in_millidarcy(other)} mD ({other:.3g} m2) with fines by {law}"
    yield (
        "porosity",
        f"{summary['porosity_initial']:.4f} -> {summary['porosity_damaged']:.4f}",
    )
    if summary["supplied_count"]:
        yield from _of_the_fines(summary)
    else:
        yield "fines", "none supplied"
    used = summary.get("damage_law_used") or summary["damage_law"]
    yield "laws", f"{summary['law']} and {used} (damage); seed {summary['seed']}"


def _of_the_fines(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    words, damage = summary.get("words", {}), summary.get("damage")
    yield (
        "fines",
        f"{summary['invaded_count']} invaded, {summary['passed_count']} passed, "
        f"{summary['upstream_count']} upstream of {summary['supplied_count']} supplied",
    )
    yield "end", words.get("end") or str(summary["stop_reason"])
    yield (
        "depth",
        f"95 % above {millimetres(summary['invasion_depth_p95_m'])}, "
        f"deepest {millimetres(summary['invasion_depth_m'])}",
    )
    if damage and damage["zone_depth_m"]:
        yield (
            "damaged zone",
            f"{millimetres(damage['zone_depth_m'])}, which keeps "
            f"{percent(damage['zone_k_over_k0'])} % of its permeability",
        )
    if "skin" in summary:
        skin = "infinite" if summary["skin"] is None else f"{summary['skin']:.2g}"
        yield (
            "skin",
            f"{skin}, costs {two_digits(summary['skin_flow_lost'])} of the flow of a well of "
            f"{millimetres(summary['skin_well_radius_m'])} radius",
        )
    yield (
        "cake",
        f"{millimetres(summary['cake_thickness_m'])}: {words.get('cake', '')}".rstrip(": "),
    )


def section_cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """A section as the cells of `_HEAD`."""
    before, after = row["k_initial_inplace_m2"], row["k_damaged_inplace_m2"]
    return (
        f"{1e3 * row['x_lo_m']:.2f}-{1e3 * row['x_hi_m']:.2f}",
        f"{row['porosity_initial']:.4f}",
        f"{row['porosity_damaged']:.4f}",
        in_millidarcy(row["k_initial_m2"]),
        in_millidarcy(row["k_damaged_m2"]),
        percent(row["k_reduction"]),
        percent(1 - after / before if before else None),
        str(row["fines_count"]),
    )


def _row(cells: tuple[str, ...]) -> str:
    return " ".join(f"{cell:>11}" for cell in cells)


def _rules(summary: Mapping[str, Any]) -> Iterator[str]:
    """What rules of thumb say of the sizes, and whether the run shows the same."""
    rules = summary.get("rules")
    if not rules:
        return
    yield f"rules of thumb (the run {SHOWS[summary['run_shows']]}):"
    for rule in rules:
        author = rule["source"].split(",")[0]
        agrees = AGREES[rule["agrees"]]
        yield (
            f"  {author:<22} {rule['value']:>6.3g}  {rule['says']:<8} {agrees:<12} "
            f"({rule['limit']})"
        )
    yield ""
