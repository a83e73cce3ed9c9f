#!/usr/bin/env python3
"""Specimens of the thesis in a flow that follows the deposit, next to their uniform runs.

    .venv/bin/python scripts/followed.py --csv docs/thesis/followed.csv

Every specimen and seed is a run in its own folder below --out; finished ones are read, so the
command can be repeated. The uniform runs are read from the table of `fdnet study thesis`.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from fdnet.studies.dem.followed import SUPPLIED, followed_rows, uniform_rows, write_followed

TABLE = Path(__file__).resolve().parents[1] / "docs" / "thesis" / "results.csv"
parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("specimens", nargs="*", metavar="SPECIMEN", help=f"of {', '.join(SUPPLIED)}")
parser.add_argument("--seeds", type=int, nargs="+", help="of each (default: 1, or 1 to 3)")
parser.add_argument("--out", type=path_option, default=Path("runs/followed"))
parser.add_argument("--uniform", type=path_option, default=TABLE, help="table of the thesis study")
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")

if __name__ == "__main__":
    options = parser.parse_args()
    names = options.specimens or list(SUPPLIED)
    rows = followed_rows(names, options.seeds, options.out)
    write_followed(options.csv, [*uniform_rows(options.uniform, names), *rows])
