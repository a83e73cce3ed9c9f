"""Write the tables of the study and draw its figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from validation.engine.csv_rows import write_csv
from validation.thesis.collection import RESULTS, StudyResults, groups_to_draw
from validation.thesis.compare.trends import Comparison, compare_trends, write_trends
from validation.thesis.numbers.deposition import deposition, write_deposition
from validation.thesis.numbers.examine import THESIS_PAIR
from validation.thesis.numbers.results import write_results
from validation.thesis.numbers.statistics import statistics, write_statistics
from validation.thesis.numbers.tetrahedra import count_tetrahedra, write_tetrahedra
from validation.thesis.numbers.values import thesis_values
from validation.thesis.runs.growth import GROWTH, read_growth
from validation.thesis.runs.plan import BASE_VALUES, Planned

if TYPE_CHECKING:
    from validation.thesis.figures.tables import FigureTables, ScanRow

STATISTICS, DEPOSITION, TETRAHEDRA = "statistics.csv", "deposition.csv", "tetrahedra.csv"
TRENDS, CAPTIONS = "trends.csv", "captions.csv"


def write_outputs(
    results: StudyResults, plan: Sequence[Planned], out: Path, states: Path
) -> list[Comparison]:
    """Write all tables and figures into `out`; returns the comparisons of the trends."""
    runs = [run for seeds in results.examined.values() for run in seeds]
    write_results(out / RESULTS, results.rows)
    write_statistics(out / STATISTICS, [row for run in runs for row in statistics(run)])
    write_deposition(out / DEPOSITION, [row for run in runs for row in deposition(run)])
    write_tetrahedra(out / TETRAHEDRA, [count_tetrahedra(run) for run in runs])
    comparisons = compare_trends(results.rows)
    write_trends(out / TRENDS, comparisons)
    _draw(results, plan, out, states / GROWTH)
    return comparisons


def _draw(results: StudyResults, plan: Sequence[Planned], out: Path, growth: Path) -> None:
    from validation.thesis.figures.draw_all import draw_all

    quick = groups_to_draw(plan) == ("quick",)
    drawn = draw_all(
        results.examined,
        out,
        thesis={} if quick else thesis_values().by_case,
        tables=_figure_tables(results, plan, growth),
    )
    start = "Quick forms. " if quick else ""
    lines = [(one.name, start + one.caption, "; ".join(one.missing)) for one in drawn]
    write_csv(out / CAPTIONS, ("figure", "caption", "missing"), lines)


def _figure_tables(results: StudyResults, plan: Sequence[Planned], growth: Path) -> "FigureTables":
    from validation.thesis.figures.tables import (
        FigureTables,
        distances_by_class,
        tetrahedra_counted,
    )

    examined = results.examined
    first = next(iter(examined.get("specimen1", ())), None)
    counted = {name: examined[name] for name in ("specimen1", "specimen5") if name in examined}
    return FigureTables(
        drag=_scan(results, plan, "drag"),
        friction=_scan(results, plan, "friction"),
        supply=_scan(results, plan, "supply"),
        tetrahedra=tetrahedra_counted(counted),
        distances=distances_by_class(examined.get("specimen5", ())),
        growth=()
        if first is None or not growth.exists()
        else read_growth(growth, first.state.case),
    )


def _scan(results: StudyResults, plan: Sequence[Planned], group: str) -> "list[ScanRow]":
    """Rows of a scan, among them those of the unchanged case at its own value."""
    from validation.thesis.figures.tables import scan_row

    scanned = [item for item in plan if item.group == group]
    values, seeds = {item.id: item.value for item in scanned}, {item.seed for item in scanned}
    for case in dict.fromkeys(item.case for item in scanned):
        values[case] = BASE_VALUES[group]
    return [
        scan_row(row.id.split(" ")[0], values[row.id], row)
        for row in results.rows
        if row.id in values and row.seed in seeds and (row.law, row.damage_law) == THESIS_PAIR
    ]
