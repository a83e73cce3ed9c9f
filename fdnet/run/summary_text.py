"""A run in lines of text: the end of `fdnet run`, `print(run)`, and the same in a notebook."""

import textwrap
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from fdnet.case.stages import STAGES
from fdnet.report.units import AGREES, SHOWS, in_millidarcy, millimetres, percent, two_digits

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
