"""`fdnet study thesis`: run or resume what is planned, then write tables and figures."""

import sys
from dataclasses import dataclass
from pathlib import Path

from fdnet.dem.liggghts import find_binary
from fdnet.errors import LiggghtsError
from fdnet.studies.thesis.plan import Planned, planned
from fdnet.studies.thesis.runs import Tell, carry_out

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
    """Run or continue the study; returns what it found, as text.

    Raises LiggghtsError when runs failed, after the results of all others are written.
    """
    plan, failed = planned(quick=options.quick), dict[Planned, str]()
    if not options.redraw:
        find_binary()
        failed = carry_out(plan, options.out / STATES, options.runs, jobs=options.jobs, tell=_teller(options.show))
    if failed:
        lines = "; ".join(f"{item.id} seed {item.seed}: {why}" for item, why in failed.items())
        raise LiggghtsError(f"{len(failed)} of {len(plan)} runs failed, run the study again to continue: {lines}")
    return ""


def _teller(show: bool) -> Tell:
    def tell(line: str) -> None:
        if show:
            print(f"thesis: {line}", file=sys.stderr, flush=True)

    return tell
