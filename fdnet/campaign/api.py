"""Ensembles, sweeps and comparisons: run what is missing, and gather."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from fdnet.campaign import plan as plans
from fdnet.campaign import result as results
from fdnet.campaign.engine import HowToRun, run_missing
from fdnet.campaign.page import Compared, write_comparison
from fdnet.campaign.plan import Plan
from fdnet.campaign.result import RANKED_BY, Comparison
from fdnet.case.case import Case
from fdnet.case.file import case_from, put_keys, read_case
from fdnet.errors import FdnetError
from fdnet.files import expanded
from fdnet.names import STAGES
from fdnet.run.folder import is_run_folder
from fdnet.run.pipeline import refuse
from fdnet.run.records import RunOptions, cores


def ensemble(
    case: Case | str | Path, *, out: str | Path, seeds: int = 4, fast: bool = False, **how: Any
) -> Compared:
    """Run one case with several seeds, from its own seed on.

    Args:
        case: a `Case`, or the path of a case file.
        out: folder of the results; a second call runs only what is missing in it.
        seeds: number of seeds.
        fast: by the fast model (`invasion.method = "network"`).
        how: `jobs` at the same time, `ranks` of each, `stages`, `liggghts`, `launcher`, `timeout`
            (s), `engine` ("local" or "snakemake"), `ranked_by`, `progress` and `jobs_limit`.

    Returns:
        Means with their 95 % bands, and the table of all runs; lengths in m, k in m2.

    Raises:
        CaseError: the case, the folder or an option cannot be used.
        LiggghtsError: LIGGGHTS is missing. A run that fails is named in `summary["failures"]`.

    Examples:
        >>> import fdnet
        >>> fdnet.ensemble("cases/quick.toml", seeds=0, out="runs/none")
        Traceback (most recent call last):
        fdnet.errors.CaseError: seeds: 0, expected 1 or more, ...
    """
    given = case if isinstance(case, Case) else read_case(case, values=plans.FAST if fast else {})
    if fast and given is case:
        given = case_from(put_keys(dict(given.data()), plans.FAST))
    return _carried_out(partial(plans.ensemble_plan, given, seeds), out, **how)


def sweep(path: str | Path, *, out: str | Path, fast: bool = False, **how: Any) -> Compared:
    """Run every combination of the sweep file at `path`, and compare the variants.

    The other arguments, results (in SI: m, m2) and errors are those of `ensemble`.

    Examples:
        >>> import fdnet
        >>> fdnet.sweep("no-such-sweep.toml", out="runs/none")
        Traceback (most recent call last):
        fdnet.errors.CaseError: no-such-sweep.toml: cannot be read as a sweep file: ...
    """
    return _carried_out(partial(plans.sweep_plan, path, fast=fast), out, **how)


def compare_runs(
    runs: Sequence[str | Path], *, out: str | Path, ranked_by: str = RANKED_BY
) -> Compared:
    """Compare finished run folders; runs whose cases differ by the seed alone are one variant.

    The folder of a campaign stands for all its finished runs; where `out` is this folder, its
    own results are written anew. Lengths are in m and permeabilities in m2. Raises CaseError for
    a folder without a finished run, and for a run that would be counted twice.

    Examples:
        >>> import fdnet
        >>> fdnet.compare_runs(["no/such/run"], out="runs/compared")
        Traceback (most recent call last):
        fdnet.errors.CaseError: no/such/run: does not exist; ...
    """
    places = [expanded(run) for run in runs]
    return write_comparison(gathered(places, expanded(out), ranked_by), {})


def open_runs(runs: str | Path | Sequence[str | Path], *, ranked_by: str = RANKED_BY) -> Compared:
    """Finished runs as one object, with means and 95 % bands by quantity and by depth.

    Nothing is run or written. `runs` is the folder of an ensemble or a sweep, a folder that holds
    run folders, or a list of run folders. The object is that of `ensemble`: `table`, `mean`,
    `band`, `by_depth()`, `plot()`; lengths in m, k in m2. Raises CaseError where there is no
    finished run, or `ranked_by` is no quantity of its summary.

    Examples:
        >>> import fdnet
        >>> runs = fdnet.open_runs("runs")
        >>> runs.band.columns.tolist()
        ['mean', 'low', 'high', 'seeds']
        >>> 0 < float(runs.mean["k_reduction"]) < 1
        True
    """
    if not isinstance(runs, str | Path):
        folders, out = [expanded(run) for run in runs], Path()
        return Compared(results.gather_runs(folders, out, ranked_by=ranked_by))
    out = expanded(runs)
    plan = plans.kept_plan(out) if out.is_dir() and not is_run_folder(out) else None
    if plan is not None:
        return Compared(results.gather_plan(out, plan, ranked_by=ranked_by))
    within = [one for one in sorted(out.glob("*")) if is_run_folder(one)]
    return Compared(results.gather_runs(within or [out], out, ranked_by=ranked_by))


def gathered(runs: Sequence[Path], out: Path, ranked_by: str) -> Comparison:
    """The comparison of run folders, with the folder of its results made."""
    own = plans.kept_plan(out) if [one.resolve() for one in runs] == [out.resolve()] else None
    if own is not None:
        return results.gather_plan(out, own, ranked_by=ranked_by)
    comparison = results.gather_runs(runs, out, ranked_by=ranked_by)
    plans.refuse_foreign(out, (results.TABLE, results.SUMMARY, results.PAGE), "comparison")
    out.mkdir(parents=True, exist_ok=True)
    return comparison


def _carried_out(
    plan_of: Callable[..., Plan],
    out: str | Path,
    *,
    ranked_by: str = RANKED_BY,
    jobs: int | None = None,
    ranks: int = 1,
    stages: Sequence[str] = STAGES,
    jobs_limit: int = plans.MOST_JOBS,
    progress: bool = False,
    **how: Any,
) -> Compared:
    plan = plan_of(limit=jobs_limit, ranks=ranks, stages=tuple(stages))
    limits = results.read_targets(plan.targets)
    jobs = max(1, cores() // ranks) if jobs is None else jobs
    running, folder = HowToRun(jobs=jobs, quiet=not progress, **how), expanded(out)
    return write_comparison(carry_out(folder, plan, running, ranked_by), limits)


# ---- From a plan to its comparison.
def carry_out(
    path: Path, plan: Plan, how: HowToRun, ranked_by: str, *, run: bool = True
) -> Comparison:
    """Run what is missing of the plan in the folder `path`, or nothing; returns the comparison."""
    if run:
        _refuse_hopeless(path, plan, how)
    with plans.campaign_folder(path, plan) as (held, lock):
        if run:
            run_missing(path, held, how, lock)
        return results.gather_plan(path, held, ranked_by=ranked_by)


def _refuse_hopeless(path: Path, plan: Plan, how: HowToRun) -> None:
    """Raise what stops every variant, before anything is written."""
    how.refuse()
    errors: list[FdnetError] = []
    options: dict[str, Any] = {k: getattr(how, k) for k in ("liggghts", "launcher", "timeout")}
    options |= {"ranks": plan.ranks, "stages": plan.stages}
    for job in plan.jobs[: len(plan.variants)]:
        try:
            return refuse(job.case, RunOptions(out=path / plans.RUNS / job.name, **options))
        except FdnetError as error:
            errors.append(error)
    raise errors[0]
