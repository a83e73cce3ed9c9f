#!/usr/bin/env python3
"""The thesis's trends in a flow that follows the deposit: quick forms, five seeds each.

    .venv/bin/python scripts/followed_trends.py --csv docs/thesis/followed_trends.csv

The state in which each run ended is kept below --out, so the command can be repeated.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from fdnet.files import path_option
from fdnet.studies.dem.followed import FLOW
from fdnet.studies.thesis.collection import collect
from fdnet.studies.thesis.numbers.results import write_results
from fdnet.studies.thesis.runs.carry_out import carry_out
from fdnet.studies.thesis.runs.plan import Planned, planned

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--out", type=path_option, default=Path("runs/followed-trends"))
parser.add_argument("--jobs", type=int, default=1, help="runs at the same time (default: 1)")
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")


def followed_plan() -> list[Planned]:
    """The quick forms and their scans of the drag, with the settings of `FLOW`.

    Names, seeds and numbers of fines are those of the study of the thesis, so that its trends can
    be computed from these runs too.
    """
    return [
        replace(item, consequences=FLOW)
        for item in planned(quick=False)
        if item.group in ("quick", "drag")
    ]


def report(line: str) -> None:
    """Print a line on the progress."""
    print(line, file=sys.stderr, flush=True)


if __name__ == "__main__":
    options = parser.parse_args()
    plan, states = followed_plan(), options.out / "states"
    failed = carry_out(plan, states, options.out / "runs", jobs=options.jobs, report=report)
    results = collect(plan, options.out, states, report=report)
    write_results(options.csv, results.rows)
    for item, why in failed.items():
        report(f"{item.id}, seed {item.seed} failed: {why}")
    sys.exit(1 if failed else 0)
