"""What the runs came to: their states examined, tables written, figures drawn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fdnet.studies.thesis.compare.trends import Comparison, compare_trends, write_trends
from fdnet.studies.thesis.numbers.counts import count_tetrahedra, write_counts
from fdnet.studies.thesis.numbers.deposition import deposition, write_deposition
from fdnet.studies.thesis.numbers.examine import THESIS_PAIR, Examined, examine
from fdnet.studies.thesis.numbers.results import (
    ResultRow,
    read_results,
    result_rows,
    write_results,
)
from fdnet.studies.thesis.numbers.statistics import statistics, write_statistics
from fdnet.studies.thesis.numbers.values import thesis_values
from fdnet.studies.thesis.runs.carry_out import find_state
from fdnet.studies.thesis.runs.plan import BASE_VALUES, QUICK, Planned

if TYPE_CHECKING:
    from fdnet.studies.thesis.figures.canvas import ScanRow

RESULTS, STATISTICS, DEPOSITION, TETRAHEDRA, TRENDS, CAPTIONS = (
    "results.csv",
    "statistics.csv",
    "deposition.csv",
    "tetrahedra.csv",
    "trends.csv",
    "captions.csv",
)
KEPT = ("specimen", "variant")
"""Groups whose runs are drawn one by one; of the others only the rows are needed, unless there is nothing else."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Findings:
    """`rows` of all runs, two a run; `examined` runs to draw by specimen or variant, one a seed; `missing` ones had
    neither a state nor rows of an earlier time."""

    rows: tuple[ResultRow, ...]
    examined: Mapping[str, Sequence[Examined]]
    missing: tuple[Planned, ...]


def collect(
    plan: Sequence[Planned], out: Path, states: Path, *, tell: Callable[[str], None]
) -> Findings:
    """Examine every state there is; of a run without one take the rows that results.csv in `out` has already, if they
    are of the same case.

    Raises CaseError on a broken state or table or a state of another case, NetworkError and FlowError as `examine`
    does.
    """
    known = _known(out / RESULTS)
    kept = KEPT if any(item.group in KEPT for item in plan) else ("quick",)
    rows: list[ResultRow] = []
    examined: dict[str, list[Examined]] = {}
    missing = []
    for number, item in enumerate(plan, 1):
        case = item.load()
        state, key = find_state(states, item, case), (item.id, item.seed, case.digest())
        if state is not None:
            found = examine(item.id, state)
            rows += result_rows(found)
            if item.group in kept:
                examined.setdefault(item.id.removeprefix(QUICK), []).append(found)
        elif key in known:
            rows += known[key]
        else:
            missing.append(item)
        if number % 20 == 0:
            tell(f"examined {number} of {len(plan)}")
    return Findings(rows=tuple(rows), examined=examined, missing=tuple(missing))


def _known(path: Path) -> dict[tuple[str, int, str], list[ResultRow]]:
    found: dict[tuple[str, int, str], list[ResultRow]] = {}
    for row in read_results(path) if path.exists() else []:
        found.setdefault((row.id, row.seed, row.digest), []).append(row)
    return found


def write_findings(
    findings: Findings, plan: Sequence[Planned], out: Path, states: Path
) -> list[Comparison]:
    """All tables and figures into `out`; returns the comparisons of the trends."""
    runs = [run for seeds in findings.examined.values() for run in seeds]
    write_results(out / RESULTS, findings.rows)
    write_statistics(out / STATISTICS, [row for run in runs for row in statistics(run)])
    write_deposition(out / DEPOSITION, [row for run in runs for row in deposition(run)])
    write_counts(out / TETRAHEDRA, [count_tetrahedra(run) for run in runs])
    comparisons = compare_trends(findings.rows)
    write_trends(out / TRENDS, comparisons)
    _draw(findings, plan, out, states)
    return comparisons


def _draw(findings: Findings, plan: Sequence[Planned], out: Path, states: Path) -> None:
    from fdnet.studies.engine.csv_rows import write_csv
    from fdnet.studies.thesis.figures.canvas import Tables
    from fdnet.studies.thesis.figures.draw_all import draw_all
    from fdnet.studies.thesis.figures.tables import distances_found, tetrahedra_counted
    from fdnet.studies.thesis.figures.thesis_marks import thesis_marks
    from fdnet.studies.thesis.runs.growth import GROWTH, read_growth

    examined = findings.examined
    first = next(iter(examined.get("specimen1", ())), None)
    growth = states / GROWTH
    tables = Tables(
        drag=_scan(findings, plan, "drag"),
        friction=_scan(findings, plan, "friction"),
        supply=_scan(findings, plan, "supply"),
        tetrahedra=tetrahedra_counted(
            {name: examined[name] for name in ("specimen1", "specimen5") if name in examined}
        ),
        distances=distances_found(examined.get("specimen5", ())),
        growth=read_growth(growth, first.state.case)
        if first is not None and growth.exists()
        else (),
    )
    quick = not any(item.group in KEPT for item in plan)
    drawn = draw_all(
        examined, out, thesis={} if quick else thesis_marks(thesis_values()), tables=tables
    )
    start = "Quick forms. " if quick else ""
    lines = [(one.name, start + one.caption, "; ".join(one.missing)) for one in drawn]
    write_csv(out / CAPTIONS, ("figure", "caption", "missing"), lines)


def _scan(findings: Findings, plan: Sequence[Planned], group: str) -> "list[ScanRow]":
    """Rows of a scan, with those of the case itself at its own value of the knob."""
    from fdnet.studies.thesis.figures.tables import scan_row

    scanned = [item for item in plan if item.group == group]
    values, seeds = {item.id: item.value for item in scanned}, {item.seed for item in scanned}
    for case in dict.fromkeys(item.case for item in scanned):
        values[case] = BASE_VALUES[group]
    return [
        scan_row(row.id.split(" ")[0], values[row.id], row)
        for row in findings.rows
        if row.id in values and row.seed in seeds and (row.law, row.damage_law) == THESIS_PAIR
    ]
