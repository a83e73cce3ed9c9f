"""Run what is planned, several runs at the same time, and keep the state in which each ended.

A run that was cut is continued.
"""

import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError, FdnetError
from fdnet.run.pipeline import run_stages
from fdnet.run.records import RunOptions
from fdnet.scales.cost import cost_of
from fdnet.scales.scales import scales_of
from validation.engine.children import Send, answers_of
from validation.engine.runner import eta
from validation.thesis.runs.plan import Planned
from validation.thesis.runs.state import State, read_state, state_of_run, write_state

Report = Callable[[str], None]
"""Takes a line on the progress."""


def carry_out(
    plan: Sequence[Planned], out: Path, runs: Path, *, jobs: int, report: Report
) -> dict[Planned, str]:
    """Run everything that has no state yet, the cheapest first.

    A run folder that was cut is continued, and removed once its state is kept. Two runs with the
    same invasion (Table 3 and specimen 7) are run once.

    Args:
        plan: the runs of the study.
        out: folder of the states.
        runs: folder of the run folders.
        jobs: number of runs at the same time.
        report: takes a line on the progress.

    Returns:
        The runs that failed, with the reason.
    """
    out.mkdir(parents=True, exist_ok=True)
    cases = {item: item.load() for item in plan}
    costs = {item: _expected(case) for item, case in cases.items()}
    done = [item for item in plan if find_state(out, item, cases[item]) is not None]
    waiting = sorted(set(plan) - set(done), key=lambda item: (costs[item], item.slug))
    first: dict[str, Planned] = {}
    twins = {
        item: first.setdefault(cases[item].digest("invade"), item) for item in [*done, *waiting]
    }
    failed = _run_all(
        [item for item in waiting if twins[item] is item],
        costs,
        out,
        runs,
        jobs=jobs,
        report=report,
    )
    for item in waiting:
        if twins[item] is not item and twins[item] not in failed:
            _adopt(state_path(out, twins[item]), state_path(out, item), cases[item])
    return failed


def _run_all(
    todo: Sequence[Planned],
    costs: dict[Planned, float],
    out: Path,
    runs: Path,
    *,
    jobs: int,
    report: Report,
) -> dict[Planned, str]:
    failed: dict[Planned, str] = {}
    left, done, start = sum(costs[item] for item in todo), 0.0, time.monotonic()
    tasks = {item: (item, out, runs) for item in todo}
    with closing(answers_of(_run_and_send, tasks, jobs=jobs)) as answers:
        for item, error in answers:
            left, done = left - costs[item], done + costs[item]
            if error:
                failed[item] = str(error)
            ahead = (time.monotonic() - start) * left / done if done else 0.0
            report(f"{item.id}, seed {item.seed}: {error or 'done'}{eta(ahead)}")
    return failed


def _run_and_send(item: Planned, out: Path, runs: Path, send: Send) -> None:
    """Send why the run failed ("" when it did not), also when fdnet itself is at fault."""
    try:
        error = run_one(item, out, runs)
    except Exception as fault:
        error = f"{type(fault).__name__}: {fault}"
    send(error)


def run_one(item: Planned, out: Path, runs: Path) -> str:
    """Run or continue one run; returns "" or why it failed.

    The run folder of a failed run stays.
    """
    folder = runs / item.slug
    try:
        case = item.load()
        options = RunOptions(
            out=folder, resume=folder.exists(), stages=("pack", "invade"), show_progress=False
        )
        run_stages(case, options)
        write_state(state_path(out, item), state_of_run(folder))
    except FdnetError as error:
        return str(error)
    shutil.rmtree(folder, ignore_errors=True)
    return ""


def state_path(out: Path, item: Planned) -> Path:
    """The file in which the state of a run is kept."""
    return out / f"{item.slug}.npz"


def find_state(out: Path, item: Planned, case: InvasionCase) -> State | None:
    """The kept state of a run, with the analysis options of the given case.

    Returns None when there is no such state. Raises CaseError when the state is broken or that of
    another invasion.
    """
    path = state_path(out, item)
    if not path.exists():
        return None
    state = read_state(path)
    if state.case.digest("invade") != case.digest("invade"):
        raise CaseError(
            f"{path}: is the state of another case than {item.id}; remove it to run the case anew"
        )
    return replace(state, case=case)


def _adopt(source: Path, target: Path, case: InvasionCase) -> None:
    """Keep the state of the same invasion under another name."""
    write_state(target, replace(read_state(source), case=case))


def _expected(case: InvasionCase) -> float:
    return cost_of(case, scales_of(case)).invade_seconds
