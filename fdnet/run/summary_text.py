"""The summary of a run as lines for a terminal, permeability in mD and m2."""

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from fdnet.case.stages import STAGES
from fdnet.report.resolved_words import resolved_words
from fdnet.report.units import in_millidarcy

WIDTH = 96
"""Letters in a line of running text."""


def summary_lines(summary: dict[str, Any]) -> list[str]:
    """The answer, headline numbers, the table of sections, rules of thumb, warnings."""
    lines = [*_answer(summary), *_headline(summary), *_well(summary), "", *_table(summary)]
    seconds = summary["seconds"]
    outside = sum(seconds.get(stage, 0.0) for stage in STAGES) - seconds["liggghts"]
    lines += [*_rules(summary), ""]
    lines += [f"seconds       {seconds['liggghts']:.1f} in LIGGGHTS, {outside:.1f} outside"]
    return lines + [f"warning: {warning}" for warning in summary["warnings"]]


def _answer(summary: Mapping[str, Any]) -> Iterator[str]:
    for text in filter(None, (summary.get("answer"), *summary.get("certainty", ()))):
        yield from textwrap.wrap(text, WIDTH)
    if summary.get("answer"):
        yield ""


def _headline(summary: dict[str, Any]) -> list[str]:
    stopped = summary["stop_reason"] or "no invasion"
    depth, depth_p95 = 1e3 * summary["invasion_depth_m"], 1e3 * summary["invasion_depth_p95_m"]
    before, after = summary["k_initial_m2"], summary["k_damaged_m2"]
    return [
        f"case {summary['case']}, seed {summary['seed']}, laws {summary['law']} / "
        f"{summary['damage_law_used'] or summary['damage_law']}",
        f"depth         95 % above {depth_p95:.2f} mm, deepest {depth:.2f} mm, "
        f"cake {1e3 * summary['cake_thickness_m']:.2f} mm",
        f"permeability  {in_millidarcy(before)} -> {in_millidarcy(after)} mD  "
        f"({before:.4g} -> {after:.4g} m2, reduction {_share(summary['k_reduction'])})",
        *_other(summary),
        f"porosity      {summary['porosity_initial']:.4f} -> {summary['porosity_damaged']:.4f}",
        f"fines         {summary['invaded_count']} invaded, {summary['passed_count']} passed, "
        f"{summary['upstream_count']} upstream of {summary['supplied_count']} supplied; "
        f"stopped: {stopped}",
    ]


def _other(summary: dict[str, Any]) -> list[str]:
    """The damaged permeability by the other law, as a measure of the error."""
    if summary["k_damaged_other_m2"] is None:
        return []
    after = summary["k_damaged_other_m2"]
    return [
        f"              by {summary['damage_law_other']}: {in_millidarcy(after)} mD "
        f"({after:.4g} m2) with fines"
    ]


def _well(summary: Mapping[str, Any]) -> Iterator[str]:
    """Damaged zone, skin and cake, where there are fines."""
    damage, cake = summary.get("damage"), summary.get("cake")
    if damage and damage["zone_depth_m"]:
        yield (
            f"damaged zone  {1e3 * damage['zone_depth_m']:.2f} mm, which keeps "
            f"{_share(damage['zone_k_over_k0'])} of its permeability"
        )
    if "skin" in summary:
        skin = "infinite" if summary["skin"] is None else f"{summary['skin']:.3g}"
        yield (
            f"skin          {skin}, costs {100 * summary['skin_flow_lost']:.2g} % of the flow of "
            f"a well of {1e3 * summary['skin_well_radius_m']:.0f} mm radius"
        )
    if cake:
        yield (
            f"cake          {in_millidarcy(cake['k_carman_kozeny_m2'])} mD by Carman and Kozeny, "
            f"resistance {cake['resistance_1_m']:.3g} 1/m"
        )


def _table(summary: Mapping[str, Any]) -> Iterator[str]:
    yield (
        f"{'depth mm':>11} {'porosity':>8} {'damaged':>8} {'k mD':>10} {'damaged':>10} "
        f"{'k m2':>10} {'damaged':>10} {'loss':>7} {'in place':>8} {'fines':>6}"
    )
    for row in summary["sections"]:
        yield _section(row)
    yield from filter(None, [resolved_words(summary["sections"])])


def _section(row: dict[str, Any]) -> str:
    inplace = (
        1 - row["k_damaged_inplace_m2"] / row["k_initial_inplace_m2"]
        if row["k_initial_inplace_m2"]
        else None
    )
    return (
        f"{1e3 * row['x_lo_m']:>5.2f}-{1e3 * row['x_hi_m']:<5.2f} "
        f"{row['porosity_initial']:>8.4f} {row['porosity_damaged']:>8.4f} "
        f"{in_millidarcy(row['k_initial_m2']):>10} {in_millidarcy(row['k_damaged_m2']):>10} "
        f"{row['k_initial_m2']:>10.3g} {row['k_damaged_m2']:>10.3g} "
        f"{_share(row['k_reduction']):>7} {_share(inplace):>8} {row['fines_count']:>6}"
    )


def _rules(summary: Mapping[str, Any]) -> Iterator[str]:
    """What rules of thumb say of the sizes, and whether the run shows the same."""
    rules = summary.get("rules")
    if not rules:
        return
    yield ""
    yield f"rules of thumb (the run {_shows(summary['run_shows'])}):"
    for rule in rules:
        agrees = {True: "agrees", False: "disagrees", None: "not decided"}[rule["agrees"]]
        author = rule["source"].split(",")[0]
        yield (
            f"  {author:<22} {rule['value']:>6.3g}  {rule['says']:<8} {agrees:<12} "
            f"({rule['limit']})"
        )


def _shows(shows: str) -> str:
    return {
        "bridges": "holds the fines",
        "passes": "lets the fines pass",
        "undecided": "ended before that could be seen",
    }[shows]


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:z.1f} %"
