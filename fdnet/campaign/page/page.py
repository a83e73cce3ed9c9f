"""All results of a comparison, written to its folder: tables, summary and compare.html."""

import base64
import os
from collections.abc import Mapping, Sequence
from importlib import metadata, resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fdnet.campaign.page.figures import draw_figures
from fdnet.campaign.result.comparison import Comparison, described, is_number
from fdnet.campaign.result.entry import Entry
from fdnet.campaign.result.table import write_summary, write_table
from fdnet.campaign.result.words import (
    band_text,
    label,
    pair_lines,
    ranking_lines,
    value_text,
)
from fdnet.files import write_text

PAGE = "compare.html"
SHOWN = ("k_reduction", "k_damaged_m2", "invasion_depth_p95_m", "invaded_count", "passed_count")
"""Quantities of the tables of the page, after the ranked one."""
MOST_PAIRS = 60
"""Most differences that the page lists; summary.json has all."""


def write_comparison(
    comparison: Comparison, more: Mapping[str, Any], ranked: Sequence[str] = ()
) -> dict[str, Any]:
    """Write table.csv, table.parquet (with pyarrow), summary.json and compare.html.

    `more` are further keys of the summary, and `ranked` sentences above the ranking. Returns the
    summary.
    """
    write_table(comparison)
    summary = write_summary(comparison, more)
    write_text(comparison.path / PAGE, page_text(comparison, ranked))
    return summary


def page_text(comparison: Comparison, ranked: Sequence[str] = ()) -> str:
    """The page: one file with its figures inside; links to the runs are relative."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["link"] = quote
    text = resources.files("fdnet.campaign.page").joinpath("compare.html.j2").read_text("utf-8")
    columns = _columns(comparison)
    return environment.from_string(text).render(
        title=comparison.title,
        runs=len(comparison.entries),
        done=len(comparison.done),
        ranked=label(comparison.ranked_by),
        ranked_lines=ranked,
        ranking=[line.split(" ", 1)[1] for line in ranking_lines(comparison)],
        failures=[
            {
                "name": entry.name,
                "status": entry.status,
                "reason": entry.reason,
                "folder": _relative(comparison, entry.folder),
            }
            for entry in comparison.failed
        ],
        figures=[_figure(svg, caption) for svg, caption in draw_figures(comparison)],
        pairs=_pairs(comparison),
        columns=[label(name) for name in columns],
        variants=[_variant_row(comparison, name, columns) for name in comparison.ranking()],
        entries=[_entry_row(comparison, entry, columns) for entry in comparison.entries],
        version=metadata.version("fdnet"),
    )


def _columns(comparison: Comparison) -> list[str]:
    having = set(comparison.quantities)
    names = dict.fromkeys([comparison.ranked_by, *SHOWN])
    return [name for name in names if name in having]


def _pairs(comparison: Comparison) -> list[str]:
    lines = pair_lines(comparison)
    rest = len(lines) - MOST_PAIRS
    more = [f"{rest} further pairs are in summary.json."] if rest > 0 else []
    return [*lines[:MOST_PAIRS], *more]


def _variant_row(comparison: Comparison, name: str, columns: Sequence[str]) -> dict[str, Any]:
    return {
        "name": name,
        "held": described(comparison.keys_of(name)),
        "seeds": len([entry for entry in comparison.done if entry.variant == name]),
        "cells": [band_text(column, comparison.band(name, column)) for column in columns],
    }


def _entry_row(comparison: Comparison, entry: Entry, columns: Sequence[str]) -> dict[str, Any]:
    values: list[Any] = [entry.numbers.get(column) for column in columns]
    cells = zip(columns, values, strict=True)
    return {
        "name": entry.name,
        "seed": entry.seed,
        "status": entry.status,
        "link": _link(comparison, entry),
        "cells": [value_text(name, value) if is_number(value) else "–" for name, value in cells],
    }


def _link(comparison: Comparison, entry: Entry) -> str:
    """To the report of the run, or to its folder where there is none."""
    report = entry.folder / "report.html"
    return _relative(comparison, report if report.exists() else entry.folder)


def _relative(comparison: Comparison, path: Path) -> str:
    return Path(os.path.relpath(path, comparison.path)).as_posix()


def _figure(svg: str, caption: str) -> dict[str, str]:
    data = base64.b64encode(svg.encode()).decode("ascii")
    return {"uri": f"data:image/svg+xml;base64,{data}", "caption": caption}
