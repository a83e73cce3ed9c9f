"""Ensembles, sweeps and comparisons from Python."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.campaign.campaign import Goal, carry_out
from fdnet.campaign.engine.tasks import HowToRun
from fdnet.campaign.page.page import write_comparison
from fdnet.campaign.plan.ensemble import ensemble_plan
from fdnet.campaign.plan.job import Plan
from fdnet.campaign.plan.sweep import MOST_JOBS, plan_of, read_sweep
from fdnet.campaign.result.comparison import RANKED_BY, Comparison, refuse_unknown
from fdnet.campaign.result.gather import gather_runs, result_folder
from fdnet.campaign.result.table import TABLE
from fdnet.campaign.result.words import pair_lines, ranking_lines
from fdnet.campaign.until import parse_until
from fdnet.case.case import Case
from fdnet.case.file import read_case
from fdnet.files import expanded
from fdnet.names import STAGES
from fdnet.run.records import cores

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, kw_only=True)
class Compared:
    """Runs and what they say together. It prints its ranking.

    Attributes:
        path: folder with table.csv, summary.json and compare.html.
        summary: what summary.json holds: `runs`, `failed`, and by quantity `mean`, `low`, `high`.
        ranking: one sentence for each variant.
        differences: one sentence for each two variants.
    """

    path: Path
    summary: Mapping[str, Any]
    ranking: tuple[str, ...]
    differences: tuple[str, ...]

    @property
    def table(self) -> "pd.DataFrame":
        """table.csv: one row for each run, lengths in m and permeabilities in m2."""
        from fdnet.report.tables import read_table

        return read_table(self.path / TABLE, ("run", "variant", "seed", "status"), texts=None)

    def __str__(self) -> str:
        """The ranking and the differences."""
        return "\n".join([*self.ranking, *self.differences])


def ensemble(
    case: Case | str | Path,
    *,
    out: str | Path,
    seeds: int = 4,
    until: str | None = None,
    max_seeds: int = 32,
    **how: Any,
) -> Compared:
    """Run one case with several seeds, from its own seed on.

    Args:
        case: a `Case`, or the path of a case file.
        out: folder of the results; a second call runs only what is missing in it.
        seeds: number of seeds.
        until: how narrow a band is to be, as "k_reduction ± 5 %"; seeds are added until it is.
        max_seeds: most seeds that `until` may spend.
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
            ...
        fdnet.errors.CaseError: seeds: 0, expected 1 or more, ...
    """
    given = case if isinstance(case, Case) else read_case(case)
    plan = ensemble_plan(given, seeds, **_plan_options(how))
    return _carried_out(expanded(out), plan, how, until, max_seeds)


def sweep(
    path: str | Path,
    *,
    out: str | Path,
    until: str | None = None,
    max_seeds: int = 32,
    **how: Any,
) -> Compared:
    """Run every combination of the sweep file at `path`, and compare the variants.

    The other arguments, results (in SI: m, m2) and errors are those of `ensemble`.

    Examples:
        >>> import fdnet
        >>> fdnet.sweep("no-such-sweep.toml", out="runs/none")
        Traceback (most recent call last):
            ...
        fdnet.errors.CaseError: no-such-sweep.toml: cannot be read as a sweep file: ...
    """
    plan = plan_of(read_sweep(path), **_plan_options(how))
    return _carried_out(expanded(out), plan, how, until, max_seeds)


def compare_runs(
    runs: Sequence[str | Path], *, out: str | Path, ranked_by: str = RANKED_BY
) -> Compared:
    """Compare finished run folders; runs whose cases differ by the seed alone are one variant.

    Lengths are in m and permeabilities in m2. Raises CaseError for a folder without a finished
    run, and for a run that would be counted twice.

    Examples:
        >>> import fdnet
        >>> fdnet.compare_runs(["no/such/run"], out="runs/compared")
        Traceback (most recent call last):
            ...
        fdnet.errors.CaseError: no/such/run: does not exist; ...
    """
    folder = expanded(out)
    comparison = gather_runs([expanded(run) for run in runs], folder, ranked_by=ranked_by)
    refuse_unknown(comparison, ranked_by, "ranked_by")
    with result_folder(folder):
        return _compared(comparison)


def _plan_options(how: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "limit": how.get("jobs_limit", MOST_JOBS),
        "ranks": how.get("ranks", 1),
        "stages": tuple(how.get("stages", STAGES)),
    }


_HOW = {"jobs", "ranks", "stages", "liggghts", "launcher", "timeout", "engine", "ranked_by"}


def _carried_out(
    path: Path, plan: Plan, how: Mapping[str, Any], until: str | None, max_seeds: int
) -> Compared:
    unknown = how.keys() - _HOW - {"progress", "jobs_limit"}
    if unknown:
        raise TypeError(f"unexpected arguments: {', '.join(sorted(unknown))}")
    running = HowToRun(
        jobs=how.get("jobs") or max(1, cores() // plan.ranks),
        liggghts=how.get("liggghts"),
        launcher=how.get("launcher"),
        timeout=how.get("timeout"),
        engine=how.get("engine", "local"),
        quiet=not how.get("progress", False),
    )
    goal = Goal(
        ranked_by=how.get("ranked_by", RANKED_BY),
        until=None if until is None else parse_until(until),
        most_seeds=max_seeds,
    )
    return _compared(carry_out(path, plan, running, goal))


def _compared(comparison: Comparison) -> Compared:
    return Compared(
        path=comparison.path,
        summary=write_comparison(comparison, {}),
        ranking=tuple(ranking_lines(comparison)),
        differences=tuple(pair_lines(comparison)),
    )
