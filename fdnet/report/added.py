"""A result that only some runs have: its table, its figure, its part of the summary and page."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fdnet.report.figures import draw
from fdnet.report.tables import write_rows


@dataclass(frozen=True, slots=True, kw_only=True)
class PageTable:
    """A table of the page report.html.

    Attributes:
        title: heading of its part of the page.
        columns: key, heading, unit, and factor to that unit (None: as it is).
        rows: with these keys, SI.
        note: what the reader must know.
    """

    title: str
    columns: Sequence[tuple[str, str, str, float | None]]
    rows: Sequence[Mapping[str, Any]]
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Added:
    """One added result.

    Attributes:
        name: stem of its CSV file and of its figure.
        rows: of the CSV file, SI; without any there is no file.
        summary: its keys in summary.json.
        fill: draws its figure; None without one.
        caption: of the figure.
        page: its table in the page; None without one.
    """

    name: str
    rows: Sequence[Mapping[str, Any]] = ()
    summary: Mapping[str, Any] = field(default_factory=dict)
    fill: Callable[[Any], None] | None = None
    caption: str = ""
    page: PageTable | None = None


def write_added(folder: Path, added: Sequence[Added]) -> None:
    """The CSV files, NAME.csv in `folder`."""
    for one in added:
        if one.rows:
            write_rows(folder / f"{one.name}.csv", one.rows)


def draw_added(folder: Path, added: Sequence[Added]) -> list[tuple[Path, str]]:
    """The figures, NAME.png in `folder`, with their captions."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        (draw(folder / f"{one.name}.png", one.fill), one.caption)
        for one in added
        if one.fill is not None
    ]
