"""Run or continue the planned runs of the thesis, then write tables and figures."""

import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.dem.liggghts import Launch, find_binary
from fdnet.errors import CaseError, LiggghtsError
from fdnet.run.folder import is_run_folder, is_unused, mark_folder
from validation.thesis.collection import collect
from validation.thesis.compare.trend_table import trends_table
from validation.thesis.outputs import write_outputs
from validation.thesis.runs.carry_out import Report, carry_out
from validation.thesis.runs.growth import GROWTH, grow, write_growth
from validation.thesis.runs.plan import Planned, planned

STATES = "states"


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisOptions:
    """Options of the study.

    Attributes:
        out: folder of the tables and figures; its folder STATES holds the states.
        runs: folder of the run folders while they are needed.
        quick: run the quick forms only.
        jobs: number of runs at the same time.
        redraw: run nothing, and make tables and figures from the kept states.
        show: report the progress on stderr.
    """

    out: Path
    runs: Path
    quick: bool = False
    jobs: int = 1
    redraw: bool = False
    show: bool = True


def run_thesis(options: ThesisOptions) -> str:
    """Run or continue the study and write its tables and figures; returns the trends as text.

    Raises LiggghtsError when runs failed, after the results of all others are written, and
    CaseError when there is nothing to draw.
    """
    plan, states = planned(quick=options.quick), options.out / STATES
    report = _reporter(options.show)
    failed = {} if options.redraw else _run(plan, options, states, report)
    results = collect(plan, options.out, states, report=report)
    if not results.rows:
        raise CaseError(
            f"{options.out}: the folder holds no state and no results of this study; leave out "
            "--redraw to run it"
        )
    comparisons = write_outputs(results, plan, options.out, states)
    if failed:
        lines = "; ".join(f"{item.id} seed {item.seed}: {why}" for item, why in failed.items())
        raise LiggghtsError(
            f"{len(failed)} of {len(plan)} runs failed, run the study again to continue: {lines}"
        )
    text = trends_table(comparisons)
    if results.missing:
        text += (
            f"\n\n{len(results.missing)} of {len(plan)} runs are missing; leave out --redraw to "
            "run them"
        )
    return text


def _run(
    plan: Sequence[Planned], options: ThesisOptions, states: Path, report: Report
) -> dict[Planned, str]:
    binary = find_binary()
    if not options.quick and not (states / GROWTH).exists():
        keep_growth(states / GROWTH, options.runs / "growth", Launch(binary=binary))
    return carry_out(plan, states, options.runs, jobs=options.jobs, report=report)


def keep_growth(path: Path, folder: Path, launch: Launch) -> None:
    """Pack the thesis's 1,410 grains (Figure 9) once more, and keep stages of the growth.

    Args:
        path: file of the stages.
        folder: run folder, removed at the end.
        launch: how LIGGGHTS is started.
    """
    case = Planned(case="specimen1-1410", group="variant").load()
    assert case.grains.count is not None
    if folder.exists() and not (folder.is_dir() and (is_run_folder(folder) or is_unused(folder))):
        raise CaseError(
            f"{folder}: holds files that fdnet did not write; give another --runs (nothing was "
            "changed)"
        )
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    mark_folder(folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_growth(path, grow(case, folder, launch, count=case.grains.count))
    shutil.rmtree(folder)


def _reporter(show: bool) -> Report:
    def report(line: str) -> None:
        if show:
            print(f"thesis: {line}", file=sys.stderr, flush=True)

    return report
