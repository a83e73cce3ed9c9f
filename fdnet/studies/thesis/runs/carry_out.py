"""Runs what is planned, several side by side, and keeps the state each ended in; goes on where it was cut."""

import multiprocessing as mp
import shutil
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError, FdnetError
from fdnet.run.pipeline import run_case
from fdnet.run.session import RunOptions
from fdnet.scales.cost import cost_of
from fdnet.scales.scales import scales_of
from fdnet.studies.engine.runner import eta
from fdnet.studies.thesis.runs.plan import Planned
from fdnet.studies.thesis.runs.state import State, read_state, state_of_run, write_state

Tell = Callable[[str], None]


def carry_out(
    plan: Sequence[Planned], out: Path, runs: Path, *, jobs: int, tell: Tell
) -> dict[Planned, str]:
    """Run all that has no state in `out` yet, the cheapest first; returns what failed, with the reason.

    A run folder in `runs` that was cut is continued, and removed once its state is kept. Two runs whose invasions are
    the same (Table 3 and specimen 7) are run once.
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
        [item for item in waiting if twins[item] is item], costs, out, runs, jobs=jobs, tell=tell
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
    tell: Tell,
) -> dict[Planned, str]:
    failed: dict[Planned, str] = {}
    left, done, start = sum(costs[item] for item in todo), 0.0, time.monotonic()
    context = mp.get_context("spawn")
    with ProcessPoolExecutor(max_workers=jobs, mp_context=context) as pool:
        futures = {pool.submit(run_one, item, out, runs): item for item in todo}
        for future in as_completed(futures):
            item, error = futures[future], _result(future)
            left, done = left - costs[item], done + costs[item]
            if error:
                failed[item] = error
            ahead = (time.monotonic() - start) * left / done if done else 0.0
            tell(f"{item.id}, seed {item.seed}: {error or 'done'}{eta(ahead)}")
    return failed


def _result(future: Future[str]) -> str:
    """What a run says, or how its process failed: the others go on."""
    try:
        return future.result()
    except Exception as error:
        return f"{type(error).__name__}: {error}"


def run_one(item: Planned, out: Path, runs: Path) -> str:
    """Run or continue one; returns "" or why it failed. Its run folder stays when it failed."""
    folder = runs / item.slug
    try:
        case = item.load()
        options = RunOptions(
            out=folder, resume=folder.exists(), stages=("pack", "invade"), show_progress=False
        )
        run_case(case, options)
        write_state(state_path(out, item), state_of_run(folder))
    except FdnetError as error:
        return str(error)
    shutil.rmtree(folder, ignore_errors=True)
    return ""


def state_path(out: Path, item: Planned) -> Path:
    """Where the state of a run is kept."""
    return out / f"{item.slug}.npz"


def find_state(out: Path, item: Planned, case: InvasionCase) -> State | None:
    """The kept state of a run, to be examined as the case now asks; None when there is none.

    Raises CaseError when it is broken or the state of another invasion.
    """
    path = state_path(out, item)
    if not path.exists():
        return None
    found = read_state(path)
    if found.case.digest("invade") != case.digest("invade"):
        raise CaseError(
            f"{path}: is the state of another case than {item.id}; remove it to run the case anew"
        )
    return replace(found, case=case)


def _adopt(source: Path, target: Path, case: InvasionCase) -> None:
    """The same invasion under another name."""
    write_state(target, replace(read_state(source), case=case))


def _expected(case: InvasionCase) -> float:
    return cost_of(case, scales_of(case)).invade_seconds
