#!/usr/bin/env python3
"""The same invasion in different fluids: what a coupled drag changes, and what it costs.

    .venv/bin/python scripts/coupling.py cases/quick/specimen5.toml --csv coupling.csv

Every fluid and seed is a run in its own folder below --out; finished ones are read, so the command
can be repeated. CPU seconds are known of runs that this call makes.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from fdnet.studies.dem.coupling import FLUIDS, coupling_rows, write_rows

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("case", type=path_option, metavar="CASE.toml")
parser.add_argument("--fluids", nargs="+", choices=list(FLUIDS), default=list(FLUIDS))
parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
parser.add_argument("--out", type=path_option, default=Path("runs/coupling"))
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")

if __name__ == "__main__":
    options = parser.parse_args()
    write_rows(
        options.csv, coupling_rows(options.case, options.fluids, options.seeds, options.out)
    )
