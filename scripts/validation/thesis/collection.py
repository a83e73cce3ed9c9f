"""Examine the kept states of the planned runs, or take their rows from an earlier results.csv."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from validation.thesis.numbers.examine import Examined, examine
from validation.thesis.numbers.results import ResultRow, read_results, result_rows
from validation.thesis.runs.carry_out import find_state
from validation.thesis.runs.plan import QUICK, Planned

RESULTS = "results.csv"
DRAWN_GROUPS = ("specimen", "variant")
"""Groups whose runs are drawn one by one.

Of the other groups only the rows are needed, unless the plan holds no run of these groups.
"""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StudyResults:
    """The results of all runs of the study.

    Attributes:
        rows: result rows, two a run.
        examined: runs to draw by specimen or variant, one a seed.
        missing: runs that have neither a state nor rows of an earlier time.
    """

    rows: tuple[ResultRow, ...]
    examined: Mapping[str, Sequence[Examined]]
    missing: tuple[Planned, ...]


def collect(
    plan: Sequence[Planned], out: Path, states: Path, *, report: Callable[[str], None]
) -> StudyResults:
    """Examine every state of the plan.

    A run without a state takes its rows from the results.csv in `out`, if they are of the same
    case.

    Args:
        plan: the runs of the study.
        out: folder of results.csv.
        states: folder of the kept states.
        report: takes a line on the progress.

    Raises:
        CaseError: a state or the table is broken, or a state is of another case.
        NetworkError, FlowError: as `examine` does.
    """
    earlier = _earlier_rows(out / RESULTS)
    drawn = groups_to_draw(plan)
    rows: list[ResultRow] = []
    examined: dict[str, list[Examined]] = {}
    missing = []
    for number, item in enumerate(plan, 1):
        case = item.load()
        state, key = find_state(states, item, case), (item.id, item.seed, case.digest())
        if state is not None:
            run = examine(item.id, state)
            rows += result_rows(run)
            if item.group in drawn:
                examined.setdefault(item.id.removeprefix(QUICK), []).append(run)
        elif key in earlier:
            rows += earlier[key]
        else:
            missing.append(item)
        if number % 20 == 0:
            report(f"examined {number} of {len(plan)}")
    return StudyResults(rows=tuple(rows), examined=examined, missing=tuple(missing))


def groups_to_draw(plan: Sequence[Planned]) -> tuple[str, ...]:
    """The groups whose runs are drawn: DRAWN_GROUPS, or the quick forms when there are no such."""
    full_scale = any(item.group in DRAWN_GROUPS for item in plan)
    return DRAWN_GROUPS if full_scale else ("quick",)


def _earlier_rows(path: Path) -> dict[tuple[str, int, str], list[ResultRow]]:
    """Rows of an earlier results.csv by id, seed and digest; none when there is no such file."""
    rows: dict[tuple[str, int, str], list[ResultRow]] = {}
    for row in read_results(path) if path.exists() else []:
        rows.setdefault((row.id, row.seed, row.digest), []).append(row)
    return rows
