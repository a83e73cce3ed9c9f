"""`fdnet study thesis`: run or resume what is planned, then write tables and figures."""

import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.dem.liggghts import Launch, find_binary
from fdnet.errors import CaseError, LiggghtsError
from fdnet.studies.thesis.compare.trend_table import trends_table
from fdnet.studies.thesis.findings import collect, write_findings
from fdnet.studies.thesis.runs.carry_out import Tell, carry_out
from fdnet.studies.thesis.runs.growth import GROWTH, grow, write_growth
from fdnet.studies.thesis.runs.plan import Planned, planned

STATES = "states"


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisOptions:
    """`out` gets the results, its folder STATES the states; `runs` the run folders while they are needed."""

    out: Path
    runs: Path
    quick: bool = False
    jobs: int = 1
    redraw: bool = False
    show: bool = True


def run_thesis(options: ThesisOptions) -> str:
    """Run or continue the study, write its tables and figures into `out`; returns the trends as text.

    Raises LiggghtsError when runs failed, after the results of all others are written; CaseError when there is nothing
    to draw.
    """
    plan, states, tell = planned(quick=options.quick), options.out / STATES, _teller(options.show)
    failed = {} if options.redraw else _run(plan, options, states, tell)
    findings = collect(plan, options.out, states, tell=tell)
    if not findings.rows:
        raise CaseError(
            f"{options.out}: holds no state and no results of this study; leave out --redraw to run it"
        )
    comparisons = write_findings(findings, plan, options.out, states)
    if failed:
        lines = "; ".join(f"{item.id} seed {item.seed}: {why}" for item, why in failed.items())
        raise LiggghtsError(
            f"{len(failed)} of {len(plan)} runs failed, run the study again to continue: {lines}"
        )
    text = trends_table(comparisons)
    if findings.missing:
        text += f"\n\n{len(findings.missing)} of {len(plan)} runs are missing: leave out --redraw to run them"
    return text


def _run(
    plan: Sequence[Planned], options: ThesisOptions, states: Path, tell: Tell
) -> dict[Planned, str]:
    binary = find_binary()
    if not options.quick and not (states / GROWTH).exists():
        keep_growth(states / GROWTH, options.runs / "growth", Launch(binary=binary))
    return carry_out(plan, states, options.runs, jobs=options.jobs, tell=tell)


def keep_growth(path: Path, folder: Path, launch: Launch) -> None:
    """Pack the thesis's 1,410 grains (Figure 9) once more, its states on the way kept at `path`."""
    case = Planned(case="specimen1-1410", group="variant").load()
    assert case.grains.count is not None
    shutil.rmtree(folder, ignore_errors=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_growth(path, grow(case, folder, launch, count=case.grains.count))
    shutil.rmtree(folder)


def _teller(show: bool) -> Tell:
    def tell(line: str) -> None:
        if show:
            print(f"thesis: {line}", file=sys.stderr, flush=True)

    return tell
