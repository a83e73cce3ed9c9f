#!/usr/bin/env python3
"""docs/thesis.md from docs/thesis.md.in and what `fdnet study thesis` left in docs/thesis.

    .venv/bin/python scripts/thesis.py [--docs docs]

Runs nothing and draws nothing, so it takes a second.
"""

import argparse
import csv
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from string import Template

from fdnet.scales.scales import scales_of
from fdnet.studies.engine.bands import Sample, band
from fdnet.studies.engine.markdown import figure, markdown_table, with_band
from fdnet.studies.thesis.collection import RESULTS
from fdnet.studies.thesis.compare.tables import thesis_tables
from fdnet.studies.thesis.compare.trend_quantities import known, runs_of
from fdnet.studies.thesis.compare.trend_table import caveats, trends_table
from fdnet.studies.thesis.compare.trends import compare_trends
from fdnet.studies.thesis.numbers.examine import DEFAULT_PAIR
from fdnet.studies.thesis.numbers.results import ResultRow, read_results
from fdnet.studies.thesis.numbers.statistics import ALONE, CUT, WHOLE
from fdnet.studies.thesis.numbers.values import thesis_of
from fdnet.studies.thesis.outputs import CAPTIONS, DEPOSITION, STATISTICS, TETRAHEDRA
from fdnet.studies.thesis.runs.plan import (
    REASONS,
    SCAN_SEEDS,
    SPECIMENS,
    VARIANTS,
    Planned,
    planned,
)

ROOT = Path(__file__).resolve().parents[1]
Rows = Sequence[ResultRow]
Pick = Callable[[ResultRow], float]
COLUMNS: Mapping[str, tuple[float, Pick]] = {
    "invaded": (1, lambda row: row.invaded_count),
    "in the first mm": (1, lambda row: row.count_first_mm),
    "passed": (1, lambda row: row.passed_count),
    "porosity lost, first mm, points": (100, lambda row: row.porosity_loss_first_mm),
    "mean depth, mm": (1, lambda row: row.mean_depth_mm),
    "95 % above, mm": (1, lambda row: row.invasion_depth_p95_mm),
}


def mean(found: Rows, pick: Pick, scale: float = 1) -> str:
    """Mean over seeds, with its 95 % band from three on."""
    return with_band(band(Sample(values=known([scale * pick(row) for row in found]))))


def compared(rows: Rows, runs: Iterable[tuple[str, str]]) -> str:
    """A line for each (run, words): counts, depths and the first section's reduction by both pairs of laws."""
    header = ["", "seeds", *COLUMNS, "k lost, first mm, %", "by fdnet's laws", "ended"]
    lines = []
    for run, words in runs:
        found, other = runs_of(rows, run), runs_of(rows, run, DEFAULT_PAIR)
        if not found:
            continue
        numbers = [mean(found, pick, scale) for scale, pick in COLUMNS.values()]
        k = [mean(some, lambda row: row.k_reductions[0], 100) for some in (found, other)]
        ended = ", ".join(dict.fromkeys(row.stop_reason for row in found))
        lines.append([words, str(len(found)), *numbers, *k, ended])
    return markdown_table(header, lines)


def costs(rows: Rows) -> str:
    """Supply, simulated time and seconds of the full-scale runs."""
    header = (
        "run",
        "seed",
        "supplied",
        "invaded",
        "passed",
        "ended",
        "simulated, ms",
        "way of the fluid, mm",
    )
    header += ("beyond 1 mm and near a wall, %", "invasion, s", "pack, s", "largest overlap, %")
    lines = []
    for run in (*SPECIMENS, *VARIANTS):
        velocity = scales_of(Planned(case=run, group="").load()).interstitial_velocity
        for row in runs_of(rows, run):
            counts = (row.seed, row.supplied_count, row.invaded_count, row.passed_count)
            numbers = [row.time_ms, row.time_ms * velocity, 100 * row.fraction_deep_near_wall]
            numbers += [row.seconds, row.pack_seconds, 100 * row.max_overlap]
            lines.append([run, *map(str, counts), row.stop_reason, *map(figure, numbers)])
    return markdown_table(header, lines)


def overview(rows: Rows) -> str:
    """The specimens in one table: counts, depth, porosity and the first section's permeability."""
    header = [
        "specimen",
        "invaded",
        "95 % above, mm",
        "points of porosity lost, first mm",
        "whole",
        "thesis, whole",
    ]
    header += ["k lost, first mm: thesis", "by its laws, %", "by fdnet's, %", "ended"]
    lines = []
    for run in SPECIMENS:
        found, other, thesis = runs_of(rows, run), runs_of(rows, run, DEFAULT_PAIR), thesis_of(run)
        assert thesis is not None
        told = thesis.reductions[:1]
        lines.append(
            [run.removeprefix("specimen")]
            + [
                mean(found, pick)
                for pick in (lambda row: row.invaded_count, lambda row: row.invasion_depth_p95_mm)
            ]
            + [mean(found, lambda row: row.porosity_loss_first_mm, 100)]
            + [mean(found, lambda row: row.porosity_initial - row.porosity_damaged, 100)]
            + [figure(100 * (thesis.porosity - thesis.damaged_porosity[0]), digits=1)]
            + [f"{100 * told[0]:.0f}" if told else "–"]
            + [mean(some, lambda row: row.k_reductions[0], 100) for some in (found, other)]
            + [", ".join(dict.fromkeys(row.stop_reason for row in found))]
        )
    return markdown_table(header, lines)


def scan(rows: Rows, group: str) -> str:
    """The runs of a scan by case and value, each case's own value among them."""
    items = {item.id: item for item in planned(quick=False) if item.group == group}
    rows = [row for row in rows if row.seed <= SCAN_SEEDS]
    runs: list[tuple[str, str]] = []
    for case in dict.fromkeys(item.case for item in items.values()):
        own = [item for item in items.values() if item.case == case]
        runs += [(case, f"{case}, its own"), *((item.id, item.id) for item in own)]
    return compared(rows, runs)


def reasons(rows: Rows) -> str:
    """Specimen 1 and what might let more fines in."""
    settings = [("specimen1", "specimen 1"), *((f"specimen1 {one}", one) for one in REASONS)]
    return compared(
        rows,
        [
            *settings,
            ("specimen1-7to8", "radii 0.07 to 0.08 mm"),
            ("specimen1-1410", "1,410 grains"),
        ],
    )


def table_of(
    path: Path, columns: Mapping[str, str], keep: Callable[[dict[str, str]], bool] = lambda _: True
) -> str:
    """A CSV as Markdown, its `columns` under other names."""
    rows = [row for row in _read(path) if keep(row)]
    return markdown_table(
        list(columns.values()), [[_cell(row[name]) for name in columns] for row in rows]
    )


def _cell(text: str) -> str:
    try:
        return figure(float(text)) if text else "-"
    except ValueError:
        return text


def statistics_table(path: Path) -> str:
    """What the thesis tells of the first section, beside each reading of which pores and throats belong to it."""
    found: dict[tuple[str, ...], dict[str, str]] = {}
    for row in _read(path):
        if row["seed"] == "1" and row["thesis"] and row["id"] in SPECIMENS:
            key = (
                row["id"],
                row["source"],
                row["quantity"],
                f"{row['sense']} {_cell(row['thesis'])}",
            )
            found.setdefault(key, {})[row["note"].split("; ")[0]] = _cell(row["ours"])
    readings = {WHOLE: "whole pores", CUT: "and cut ones", ALONE: "the section alone"}
    lines = [[*key, *(ours.get(note, "-") for note in readings)] for key, ours in found.items()]
    return markdown_table(["run", "thesis", "quantity", "thesis's", *readings.values()], lines)


def _read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def figures(path: Path) -> str:
    """Every figure with its caption."""
    rows = _read(path)
    drawn = [
        f"![{row['caption']}](thesis/{row['figure']})\n\n*{row['caption']}*"
        for row in rows
        if not row["missing"]
    ]
    left = [f"{row['figure']} (needs {row['missing']})" for row in rows if row["missing"]]
    return "\n\n".join(drawn + (["Not drawn: " + ", ".join(left) + "."] if left else []))


def document(docs: Path) -> str:
    """The text of docs/thesis.md. Raises FileNotFoundError where the study's tables are missing."""
    thesis = docs / "thesis"
    rows = read_results(thesis / RESULTS)
    comparisons = compare_trends(rows)
    parts = {
        "overview": overview(rows),
        "costs": costs(rows),
        "tables": thesis_tables(rows),
        "trends": trends_table(comparisons),
        "caveats": "\n".join(f"- {line}" for line in caveats(comparisons)),
        "friction": scan(rows, "friction"),
        "drag": scan(rows, "drag"),
        "supply": scan(rows, "supply"),
        "reasons": reasons(rows),
        "quick": compared(rows, [(f"quick-{run}", run) for run in (*SPECIMENS, *VARIANTS)]),
        "statistics": statistics_table(thesis / STATISTICS),
        "deposition": table_of(
            thesis / DEPOSITION,
            {
                "id": "run",
                "low": "porosity from",
                "high": "to",
                "throats": "throats",
                "fines": "fines",
            }
            | {"nearer_axis": "nearer axis", "nearer_wall": "nearer wall", "beyond_wall": "beyond"}
            | {
                "wall_low": "wall, 95 % from",
                "wall_high": "to ",
                "law": "law",
                "decided": "decided",
            },
            lambda row: row["seed"] == "1" and row["id"] in SPECIMENS,
        ),
        "tetrahedra": table_of(
            thesis / TETRAHEDRA,
            {
                "id": "run",
                "grains": "grains",
                "fines": "fines",
                "tetrahedra_all": "tetrahedra of all spheres",
            }
            | {"tetrahedra_grains": "of the grains", "ratio": "ratio"},
            lambda row: row["seed"] == "1" and row["id"] in SPECIMENS,
        ),
        "figures": figures(thesis / CAPTIONS),
    }
    text = Template((docs / "thesis.md.in").read_text(encoding="utf-8")).substitute(parts)
    assert not re.search(r"(?m)^[A-Z]{5,}$", text), "docs/thesis.md.in: a part is not written yet"
    return text


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="where to read and write")
    docs = parser.parse_args().docs
    (docs / "thesis.md").write_text(document(docs), encoding="utf-8")
    print(docs / "thesis.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
