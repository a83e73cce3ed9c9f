"""Tables and figures of the page on the thesis that are made from the study's CSV files."""

import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from validation.engine.markdown import NONE, figure, markdown_table, wrapped
from validation.thesis.numbers.statistics import ALONE, CUT, WHOLE
from validation.thesis.runs.plan import SPECIMENS

DEPOSITION_COLUMNS = {
    "id": "run",
    "low": "throat porosity from",
    "high": "to",
    "throats": "throats with fines",
    "fines": "fines",
    "nearer_axis": "nearer the axis",
    "nearer_wall": "nearer the wall",
    "beyond_wall": "beyond the wall",
    "wall_low": "wall and beyond, 95 % from",
    "wall_high": "to",
    "law": "law by the thesis's rule",
    "decided": "decided",
}
TETRAHEDRA_COLUMNS = {
    "id": "run",
    "grains": "grains",
    "fines": "fines",
    "tetrahedra_all": "tetrahedra of all spheres",
    "tetrahedra_grains": "of the grains alone",
    "ratio": "ratio",
}
FOLLOWED_COLUMNS = {
    ("invaded", 1.0): "fines inside",
    ("first_mm", 1.0): "in the first mm",
    ("mean_depth_mm", 1.0): "mean depth, mm",
    ("p95_depth_mm", 1.0): "depth of 95 %, mm",
    ("porosity_loss_first_mm", 100.0): "porosity lost, first mm, points",
    ("k_lost_1", 100.0): "k lost, first mm, %",
    ("k_lost_2", 100.0): "second mm, %",
    ("k_lost", 100.0): "whole, %",
    ("rate", 1.0): "last rate over first",
    ("overlap", 100.0): "overlap, %",
}
READINGS = {WHOLE: "whole pores", CUT: "and cut ones", ALONE: "the section alone"}


def deposition_table(path: Path) -> str:
    """Where the fines sit in the throats, of the specimens' first seed."""
    return _table(path, DEPOSITION_COLUMNS)


def tetrahedra_table(path: Path) -> str:
    """Tetrahedra with and without the fines, of the specimens' first seed."""
    return _table(path, TETRAHEDRA_COLUMNS)


def statistics_table(path: Path) -> str:
    """The thesis's numbers on the first section, with ours by each reading of what belongs to it.

    The rows are those of the specimens' first seed for which the thesis has a number.
    """
    by_quantity: dict[tuple[str, ...], dict[str, str]] = {}
    for row in _rows(path, _first_seed):
        if row["thesis"]:
            thesis = f"{row['sense']} {_cell(row['thesis'])}"
            key = (row["id"], row["source"], row["quantity"], thesis)
            by_quantity.setdefault(key, {})[row["note"].split("; ")[0]] = _cell(row["ours"])
    lines = [
        [*key, *(ours.get(reading, NONE) for reading in READINGS)]
        for key, ours in by_quantity.items()
    ]
    header = ["run", "where in the thesis", "quantity", "thesis", *READINGS.values()]
    return markdown_table(header, lines)


def followed_table(path: Path) -> str:
    """Specimens in the uniform flow and in one that follows the deposit; ranges over the seeds."""
    rows = _rows(path)
    names = dict.fromkeys((row["specimen"], row["flow"]) for row in rows)
    lines = []
    for specimen, flow in sorted(names, key=lambda name: name[0]):
        runs = [row for row in rows if (row["specimen"], row["flow"]) == (specimen, flow)]
        cells = [_range([row[name] for row in runs], scale) for name, scale in FOLLOWED_COLUMNS]
        ends = ", ".join(dict.fromkeys(row["stop_reason"].replace("_", " ") for row in runs))
        lines.append([specimen.removeprefix("specimen"), flow, str(len(runs)), *cells, ends])
    header = ["specimen", "flow", "seeds", *FOLLOWED_COLUMNS.values(), "ended by"]
    return markdown_table(header, lines)


def _range(texts: Sequence[str], scale: float) -> str:
    """The least and the greatest of some numbers, or the one number."""
    ends = sorted(scale * float(text) for text in texts)
    return figure(ends[0]) if len(ends) == 1 else f"{figure(ends[0])} to {figure(ends[-1])}"


def figures(path: Path) -> str:
    """Every figure with its caption, from captions.csv."""
    rows = _rows(path)
    drawn = [_figure(row["figure"], row["caption"]) for row in rows if not row["missing"]]
    left = [f"{row['figure']} (needs {row['missing']})" for row in rows if row["missing"]]
    if left:
        drawn.append(wrapped("Not drawn: " + ", ".join(left) + "."))
    return "\n\n".join(drawn)


def _figure(name: str, caption: str) -> str:
    """An image with its caption below; the alternative text is the caption's head."""
    head = caption.split(":", maxsplit=1)[0]
    return f"![{head}](thesis/{name})\n\n" + wrapped(f"*{caption}*")


def _table(path: Path, columns: Mapping[str, str]) -> str:
    """The specimens' first seed in a CSV as Markdown, with other names for its columns."""
    lines = [[_cell(row[name]) for name in columns] for row in _rows(path, _first_seed)]
    return markdown_table(list(columns.values()), lines)


def _first_seed(row: Mapping[str, str]) -> bool:
    return row["seed"] == "1" and row["id"] in SPECIMENS


def _rows(
    path: Path, keep: Callable[[Mapping[str, str]], bool] = lambda _: True
) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if keep(row)]


def _cell(text: str) -> str:
    """A number with three digits, a word as it is, and a dash for an empty cell."""
    if text in ("True", "False"):
        return "yes" if text == "True" else "no"
    try:
        return figure(float(text)) if text else NONE
    except ValueError:
        return text
