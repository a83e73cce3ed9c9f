#!/usr/bin/env python3
"""Walls that hold the fluid against resolved Stokes flow: a table for docs/accuracy.md.

.venv/bin/python scripts/wall_truth.py --csv docs/validation/wall_truth.csv
"""

import argparse

from fdnet.files.paths import path_option
from fdnet.studies.accuracy.walls import wall_rows
from fdnet.studies.engine.csv_rows import write_as_they_come

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--csv", type=path_option, required=True)
parser.add_argument(
    "--grids", type=int, nargs=2, default=[72, 96], help="cells along x, the second finer"
)
parser.add_argument("--seed", type=int, default=1)

if __name__ == "__main__":
    given = parser.parse_args()
    for row in write_as_they_come(given.csv, wall_rows(given.seed, given.grids)):
        print(row, flush=True)
