"""A finished run as a few lines for a person, in the units of the field."""

import textwrap
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from fdnet.report.units import in_millidarcy

_HEAD = ("depth (mm)", "porosity", "with fines", "k (mD)", "with fines", "lost (%)", "fines")


def text_lines(path: Path, summary: Mapping[str, Any]) -> Iterator[str]:
    """The result and its table of sections."""
    yield f"fdnet run {summary['case']} in {path}"
    for text in filter(None, (summary.get("answer"), *summary.get("certainty", ()))):
        yield from textwrap.wrap(text, 96)
    for name, value in _facts(summary):
        yield f"{name:<14}{value}"
    yield ""
    yield " ".join(f"{name:>11}" for name in _HEAD)
    for row in summary["sections"]:
        yield " ".join(f"{cell:>11}" for cell in _cells(row))
    for warning in summary["warnings"]:
        yield f"warning: {warning}"


def html_lines(path: Path, summary: Mapping[str, Any]) -> Iterator[str]:
    """The same as a small table for a notebook."""
    yield f"<p><b>fdnet run {escape(str(summary['case']))}</b> in {escape(str(path))}</p>"
    for text in filter(None, (summary.get("answer"), *summary.get("certainty", ()))):
        yield f"<p>{escape(text)}</p>"
    yield "<table>"
    for name, value in _facts(summary):
        yield f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>"
    yield "</table><table>"
    yield "<tr>" + "".join(f"<th>{escape(name)}</th>" for name in _HEAD) + "</tr>"
    for row in summary["sections"]:
        yield "<tr>" + "".join(f"<td>{cell}</td>" for cell in _cells(row)) + "</tr>"
    yield "</table>"


def _facts(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    before, after = summary["k_initial_m2"], summary["k_damaged_m2"]
    yield (
        "permeability",
        f"{in_millidarcy(before)} -> {in_millidarcy(after)} mD ({before:.3g} -> {after:.3g} m2), "
        f"{_lost(summary['k_reduction'])} % lost",
    )
    yield (
        "porosity",
        f"{100 * summary['porosity_initial']:.2f} -> {100 * summary['porosity_damaged']:.2f} %",
    )
    if summary["supplied_count"]:
        yield (
            "fines",
            f"{summary['invaded_count']} of {summary['supplied_count']} invaded, "
            f"{summary['passed_count']} passed through; stopped: {summary['stop_reason']}",
        )
        yield (
            "depth",
            f"95 % above {1e3 * summary['invasion_depth_p95_m']:.2f} mm, "
            f"deepest {1e3 * summary['invasion_depth_m']:.2f} mm; "
            f"cake {1e3 * summary['cake_thickness_m']:.2f} mm",
        )
    else:
        yield "fines", "none supplied"
    used = summary.get("damage_law_used") or summary["damage_law"]
    yield "laws", f"{summary['law']} and {used} (damage)"
    if summary.get("k_damaged_other_m2") is not None:
        after = summary["k_damaged_other_m2"]
        yield (
            "other law",
            f"{in_millidarcy(after)} mD ({after:.3g} m2) with fines by "
            f"{summary['damage_law_other']}",
        )


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    return (
        f"{1e3 * row['x_lo_m']:.2f}-{1e3 * row['x_hi_m']:.2f}",
        f"{row['porosity_initial']:.4f}",
        f"{row['porosity_damaged']:.4f}",
        in_millidarcy(row["k_initial_m2"]),
        in_millidarcy(row["k_damaged_m2"]),
        _lost(row["k_reduction"]),
        str(row["fines_count"]),
    )


def _lost(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:z.1f}"
