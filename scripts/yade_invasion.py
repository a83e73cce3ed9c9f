#!/usr/bin/env python3
"""The same invasion by fdnet and by Yade's flow engine: deposit, k/k0, time and memory.

    .venv/bin/python scripts/yade_invasion.py cases/quick/specimen5.toml --fines 2000 \\
        --out runs/yade --csv docs/validation/yade_invasion_2000.csv \\
        --figure docs/validation/yade_invasion_2000.png

Yade must be installed (Debian: apt install yade). Every number of fines and seed has a folder
below --out; what is finished there is read, so the command can be cut and repeated. Yade ends
after --limit CPU seconds at the latest, and the table then says which share it did.
"""

import argparse
from itertools import chain
from pathlib import Path

from fdnet.errors import FdnetError
from fdnet.files.paths import path_option
from fdnet.studies.benchmark.yade_invasion import make_pair
from fdnet.studies.benchmark.yade_invasion_figure import draw_pair
from fdnet.studies.benchmark.yade_invasion_rows import comparison_table, rows_of, write_rows

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("case", type=path_option, metavar="CASE.toml")
parser.add_argument("--fines", type=int, nargs="+", default=[2000], help="default 2000")
parser.add_argument("--seeds", type=int, nargs="+", default=[1], help="default 1")
parser.add_argument("--limit", type=float, default=1500.0, help="CPU seconds of Yade (1500)")
parser.add_argument("--travel", type=float, default=0.5, help="way between meshes (0.5 diameters)")
parser.add_argument("--out", type=path_option, default=Path("runs/yade"))
parser.add_argument("--csv", type=path_option, help="also write the table here")
parser.add_argument("--figure", type=path_option, help="draw the first invasion here")

if __name__ == "__main__":
    options = parser.parse_args()
    limits = {"limit_s": options.limit, "travel": options.travel}
    try:
        pairs = [
            make_pair(options.case, fines, seed, options.out, **limits)
            for fines in options.fines
            for seed in options.seeds
        ]
        rows = list(chain.from_iterable(rows_of(pair) for pair in pairs))
    except FdnetError as error:
        parser.exit(error.exit_code, f"yade_invasion: {error}\n")
    print(comparison_table(rows))
    if options.csv:
        write_rows(options.csv, rows)
    if options.figure:
        draw_pair(pairs[0], options.figure)
