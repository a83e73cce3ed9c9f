#!/usr/bin/env python3
"""Which ratio of fine to throat blocks, at which concentration: several runs added up.

.venv/bin/python scripts/bridging.py runs/* --csv bridging.csv
"""

import argparse

from fdnet.files import path_option
from validation.dem.bridging import pooled_runs

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("runs", nargs="+", type=path_option, metavar="RUN_DIR")
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")

if __name__ == "__main__":
    options = parser.parse_args()
    for row in pooled_runs(options.runs, options.csv):
        upper = "inf" if row["ratio_hi"] is None else f"{row['ratio_hi']:g}"
        print(
            f"{row['concentration']:g} by volume, {row['ratio_lo']:g} to {upper}: "
            f"{row['closed']} of {row['throats']} closed, {row['share_closed']:.2f} "
            f"({row['share_low']:.2f} to {row['share_high']:.2f})"
        )
