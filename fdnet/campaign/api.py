"""Ensembles, sweeps and comparisons: run what is missing, gather, add seeds until it is enough."""

import contextlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from fdnet.campaign.engine import HowToRun, run_missing
from fdnet.campaign.page import pair_lines, ranking_lines, write_comparison
from fdnet.campaign.plan import (
    MOST_JOBS,
    RUNS,
    Plan,
    campaign_folder,
    ensemble_plan,
    extended,
    kept_plan,
    sweep_plan,
)
from fdnet.campaign.result import (
    RANKED_BY,
    SHARES,
    TABLE,
    Comparison,
    gather_plan,
    gather_runs,
    make_result_folder,
    refuse_unknown,
)
from fdnet.case.case import Case
from fdnet.case.file import read_case
from fdnet.errors import CaseError, FdnetError
from fdnet.files import expanded
from fdnet.names import STAGES
from fdnet.run.pipeline import refuse
from fdnet.run.records import RunOptions, cores
from fdnet.statistics.bands import seeds_for_width, student_band

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

        return read_table(self.path / TABLE, ("run", "variant", "seed", "status"))

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
    plan = ensemble_plan(given, seeds, **_of_plan(how))
    return _carried_out(expanded(out), plan, until, max_seeds, **how)


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
    plan = sweep_plan(path, **_of_plan(how))
    return _carried_out(expanded(out), plan, until, max_seeds, **how)


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
            ...
        fdnet.errors.CaseError: no/such/run: does not exist; ...
    """
    return _compared(gathered([expanded(run) for run in runs], expanded(out), ranked_by))


def gathered(runs: Sequence[Path], out: Path, ranked_by: str) -> Comparison:
    """The comparison of run folders, with the folder of its results made."""
    own = kept_plan(out) if [one.resolve() for one in runs] == [out.resolve()] else None
    if own is not None:
        comparison = gather_plan(out, own, ranked_by=ranked_by)
    else:
        comparison = gather_runs(runs, out, ranked_by=ranked_by)
    refuse_unknown(comparison, ranked_by, "--rank-by")
    if own is None:
        make_result_folder(out)
    return comparison


def _of_plan(how: dict[str, Any]) -> dict[str, Any]:
    """Takes what belongs to the plan out of `how`."""
    stages = tuple(how.pop("stages", STAGES))
    limit, ranks = how.pop("jobs_limit", MOST_JOBS), how.pop("ranks", 1)
    return {"limit": limit, "ranks": ranks, "stages": stages}


def _carried_out(
    path: Path,
    plan: Plan,
    until: str | None,
    max_seeds: int,
    *,
    ranked_by: str = RANKED_BY,
    jobs: int | None = None,
    progress: bool = False,
    **how: Any,
) -> Compared:
    running = HowToRun(
        jobs=max(1, cores() // plan.ranks) if jobs is None else jobs, quiet=not progress, **how
    )
    goal = None if until is None else parse_until(until)
    return _compared(carry_out(path, plan, running, goal, ranked_by, most_seeds=max_seeds))


def _compared(comparison: Comparison) -> Compared:
    return Compared(
        path=comparison.path,
        summary=write_comparison(comparison, {}),
        ranking=tuple(ranking_lines(comparison)),
        differences=tuple(pair_lines(comparison)),
    )


# ------------------------------------------------------------------------------------------------
# From a plan to its comparison.


FEWEST = 3
"""Seeds before a band is believed."""
_UNTIL = re.compile(r"\s*([\w.]+)\s*(?:±|\+-|\+/-)\s*([0-9.eE+-]+)\s*(%?)\s*")


class Until(NamedTuple):
    """How narrow the 95 % band of a quantity is to be: half of it, over the mean if `relative`,
    else in the quantity's unit."""

    quantity: str
    half_width: float
    relative: bool

    def allowed(self, values: Sequence[float]) -> float:
        """Half-width that is narrow enough, in the quantity's unit."""
        return self.half_width * (abs(sum(values) / len(values)) if self.relative else 1.0)


def parse_until(text: str) -> Until:
    """The goal that `--until` gives.

    Percent of a share (k_reduction, a porosity) are points: 45 % ± 5 % is 40 to 50 %. Percent of
    any other quantity are of its mean. Without percent the number has the quantity's unit.

    Raises CaseError for anything else.
    """
    match = _UNTIL.fullmatch(text)
    width = 0.0
    with contextlib.suppress(ValueError):
        width = float(match[2]) if match else 0.0
    if match is None or not 0 < width < float("inf"):
        raise CaseError(
            f"--until {text!r}: expected a quantity and the half of its band, e.g. "
            "'k_reduction ± 5 %' or 'k_damaged_m2 +- 10 %'"
        )
    percent = match[3] == "%"
    relative = percent and SHARES.search(match[1]) is None
    return Until(match[1], width / 100 if percent else width, relative)


def carry_out(
    path: Path,
    plan: Plan,
    how: HowToRun,
    until: Until | None,
    ranked_by: str,
    *,
    most_seeds: int = 32,
    run: bool = True,
) -> Comparison:
    """Run what is missing of the plan in the folder `path`; returns the comparison.

    With `until`, seeds are added, at most `most_seeds`. Without `run` it gathers what is there.

    Raises CaseError for a folder of another plan and for a quantity that the summaries do not
    have; the error of the first variant when no variant can be run at all, before anything is
    written.
    """
    if run:
        _refuse_hopeless(path, plan, how)
    with campaign_folder(path, plan) as (held, lock):
        while True:
            if run:
                run_missing(path, held, how, lock)
            comparison = gather_plan(path, held, ranked_by=ranked_by)
            refuse_unknown(comparison, ranked_by, "--rank-by")
            more = 0
            if until is not None and run and comparison.done:
                refuse_unknown(comparison, until.quantity, "--until")
                more = _seeds_to_add(until, comparison, len(held.seeds), most_seeds)
            if not more:
                return comparison
            how.say(f"{len(held.seeds)} seeds are not enough yet; {more} more")
            first = max(held.seeds) + 1
            held = extended(path, held, range(first, first + more))


def _refuse_hopeless(path: Path, plan: Plan, how: HowToRun) -> None:
    """Raise what stops every variant, before anything is written."""
    errors: list[FdnetError] = []
    program: dict[str, Any] = {
        "liggghts": how.liggghts,
        "launcher": how.launcher,
        "timeout": how.timeout,
    }
    for one in plan.variants:
        out = path / RUNS / f"{one.name}-seed-{one.case.seed}"
        try:
            refuse(one.case, RunOptions(out=out, ranks=plan.ranks, stages=plan.stages, **program))
            return
        except FdnetError as error:
            errors.append(error)
    raise errors[0]


def _seeds_to_add(until: Until, comparison: Comparison, have: int, most: int) -> int:
    """How many seeds more the spread so far asks for; 0 when every band is narrow enough.

    The whole bands are looked at, not what the bounds of the quantity leave of them. Seeds at most
    double at a time, because a spread of few seeds is itself uncertain.
    """
    needed = 0
    for name in comparison.variants:
        values = list(comparison.values(name, until.quantity).values())
        if 0 < len(values) < FEWEST:
            needed = max(needed, have + FEWEST - len(values))
        elif values and student_band(values).half_width > until.allowed(values):
            needed = max(needed, seeds_for_width(values, until.allowed(values), most), have + 1)
    return max(0, min(most, needed, 2 * have) - have)
