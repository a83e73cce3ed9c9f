#!/usr/bin/env python3
"""Which ratio of fine to throat clogs, of the throats that fines came to: several runs added up.

.venv/bin/python scripts/clogging.py runs/clogging/runs/* --csv clogging.csv --png clogging.png
"""

import argparse

from fdnet.files import path_option
from validation.dem.clogging import clogging_of_runs

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("runs", nargs="+", type=path_option, metavar="RUN_DIR")
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")
parser.add_argument("--png", type=path_option, required=True, help="draw the figure here")

if __name__ == "__main__":
    options = parser.parse_args()
    for row in clogging_of_runs(options.runs, options.csv, options.png):
        upper = "inf" if row["ratio_hi"] is None else f"{row['ratio_hi']:g}"
        print(
            f"{row['concentration']:.3g} by volume, {row['ratio_lo']:g} to {upper}: "
            f"{row['blocked']} of {row['met']} blocked, {row['share_blocked']:.2f} "
            f"({row['share_low']:.2f} to {row['share_high']:.2f}); {row['arrived_mean']:.3g} "
            "fines came to each"
        )
