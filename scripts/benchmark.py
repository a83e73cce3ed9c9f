#!/usr/bin/env python3
"""Seconds inside and outside LIGGGHTS for whole runs.

    .venv/bin/python scripts/benchmark.py cases/specimen1.toml --csv benchmark.csv

Every case is run anew in its own folder below --out.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from validation.benchmark.whole_runs import measure, show, write_table

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("cases", type=path_option, nargs="+", metavar="CASE.toml")
parser.add_argument("--out", type=path_option, default=Path("runs/benchmark"))
parser.add_argument("--csv", type=path_option, help="also write the table here")

if __name__ == "__main__":
    options = parser.parse_args()
    rows = [measure(case, options.out) for case in options.cases]
    show(rows)
    if options.csv:
        write_table(rows, options.csv)
