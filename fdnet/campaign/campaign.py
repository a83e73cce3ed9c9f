"""A campaign from its plan to its comparison: run what is missing, gather, draw."""

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fdnet.campaign.engine.local import run_local
from fdnet.campaign.engine.slurm import write_slurm_scripts
from fdnet.campaign.engine.snakemake import run_snakemake
from fdnet.campaign.engine.tasks import HowToRun, Task, tasks_of
from fdnet.campaign.plan.folder import RUNS, campaign_folder, extended
from fdnet.campaign.plan.job import Plan
from fdnet.campaign.result.comparison import RANKED_BY, Comparison, refuse_unknown
from fdnet.campaign.result.gather import gather_plan
from fdnet.campaign.until import Until, is_reached, next_seed_count
from fdnet.errors import CaseError, FdnetError
from fdnet.run.pipeline import refuse
from fdnet.run.records import RunOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """What a campaign is carried out for.

    Attributes:
        ranked_by: quantity of the ranking.
        until: how narrow its band is to be; None: the seeds of the plan are all.
        most_seeds: seeds that may be spent on it.
        run: whether to run what is missing; False gathers what is there.
        scripts: whether to write scripts for Slurm instead of running.
    """

    ranked_by: str = RANKED_BY
    until: Until | None = None
    most_seeds: int = 32
    run: bool = True
    scripts: bool = False
    notes: dict[str, Any] = field(default_factory=dict)


def carry_out(path: Path, plan: Plan, how: HowToRun, goal: Goal) -> Comparison:
    """Run what is missing of the plan in the folder `path`; returns the comparison.

    Raises CaseError for a folder of another plan and for a quantity that the summaries do not
    have; the error of the first variant when no variant can be run at all, before anything is
    written.
    """
    _refuse_hopeless(path, plan, how, goal)
    with campaign_folder(path, plan) as held:
        while True:
            _run_missing(path, held, how, goal)
            comparison = gather_plan(path, held, ranked_by=goal.ranked_by)
            refuse_unknown(comparison, goal.ranked_by, "--rank-by")
            more = _more_seeds(held, comparison, goal)
            if not more:
                return comparison
            _say(how, f"{len(held.seeds)} seeds are not enough yet; {len(more)} more")
            held = extended(path, held, more)


def _refuse_hopeless(path: Path, plan: Plan, how: HowToRun, goal: Goal) -> None:
    """Raise what stops every variant, before anything is written."""
    if not goal.run or goal.scripts:
        return
    first: FdnetError | None = None
    for variant in plan.variants:
        options = RunOptions(
            out=path / RUNS / f"{variant.name}-seed-{variant.case.seed}",
            ranks=plan.ranks,
            stages=plan.stages,
            liggghts=how.liggghts,
            launcher=how.launcher,
            timeout=how.timeout,
        )
        try:
            refuse(variant.case, options)
            return
        except FdnetError as error:
            first = first or error
    if first is not None:
        raise first


def _more_seeds(plan: Plan, comparison: Comparison, goal: Goal) -> tuple[int, ...]:
    """Seeds to add, none when the goal is reached or the seeds are spent."""
    until, have = goal.until, len(plan.seeds)
    if until is None or not goal.run or goal.scripts or have >= goal.most_seeds:
        return ()
    if not comparison.done:
        return ()
    refuse_unknown(comparison, until.quantity, "--until")
    if is_reached(until, comparison):
        return ()
    first = max(plan.seeds) + 1
    count = next_seed_count(until, comparison, goal.most_seeds)
    return tuple(range(first, first + max(1, count - have)))


def _run_missing(path: Path, plan: Plan, how: HowToRun, goal: Goal) -> None:
    tasks = tasks_of(path, plan, how)
    if not tasks or not goal.run:
        return
    if goal.scripts:
        for script in write_slurm_scripts(path, plan.name, tasks, how, ranks=plan.ranks):
            _say(how, f"written: {script}")
        return
    _say(how, f"{len(plan.jobs)} runs, {_count(tasks)} of them to do")
    for task in tasks:
        (path / task.log).unlink(missing_ok=True)
    ended = _Ended(path, len(tasks), how)
    if how.engine == "local":
        run_local(path, tasks, jobs=how.jobs, ended=ended)
    else:
        run_snakemake(path, tasks, how, ranks=plan.ranks, ended=ended)


def _count(tasks: list[Task]) -> int:
    return sum(not task.name.startswith("pack-") for task in tasks)


class _Ended:
    """Says how far a campaign is."""

    def __init__(self, path: Path, total: int, how: HowToRun) -> None:
        self._path, self._total, self._how, self._count = path, total, how, 0

    def __call__(self, name: str, code: int) -> None:
        self._count += 1
        word = "done" if code == 0 else f"FAILED (exit code {code})"
        _say(self._how, f"{self._count} of {self._total}: {name} {word}")


def _say(how: HowToRun, text: str) -> None:
    if not how.quiet:
        print(f"fdnet: {text}", file=sys.stderr, flush=True)


def check_engine(how: HowToRun) -> None:
    """Raises CaseError on a number of jobs that means nothing."""
    if how.jobs < 1:
        raise CaseError(f"--jobs {how.jobs}: expected 1 or more")
