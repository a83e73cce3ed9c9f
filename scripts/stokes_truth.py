#!/usr/bin/env python3
"""Stokes truth: make periodic packs and compute their permeability on two grids, extrapolated.

    .venv/bin/python scripts/stokes_truth.py make
    .venv/bin/python scripts/stokes_truth.py solve PACK.csv --cells 128 192 --axis x

`make [NAME ...]` writes packs from their seeds. `solve` runs pack files grid by grid: a finished
grid is a row of --grids and is not run again. Method and checks: docs/stokes.md.
"""

import argparse
import logging
import shlex
import sys
from pathlib import Path

from fdnet.files.paths import path_option
from fdnet.studies.truth.grids import Solve, make, solve
from fdnet.studies.truth.made_packs import PACKS
from fdnet.studies.truth.packs import DATA, OWN_GRIDS, OWN_TRUTH

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
verbs = parser.add_subparsers(dest="verb", required=True)
maker = verbs.add_parser("make", help="write the packs")
maker.add_argument("names", nargs="*", choices=[[], *PACKS], metavar="NAME")
maker.add_argument("--packs", type=path_option, default=DATA)
solver = verbs.add_parser("solve", help="permeability of pack files")
solver.add_argument("files", nargs="+", type=path_option, metavar="FILE.csv")
solver.add_argument("--cells", nargs="+", type=int, default=[128, 192])
solver.add_argument("--axis", choices="xyz", default="x")
solver.add_argument("--tolerance", type=float, default=1e-4)
solver.add_argument("--grids", type=path_option, default=DATA / OWN_GRIDS)
solver.add_argument("--csv", dest="table", type=path_option, default=DATA / OWN_TRUTH)

if __name__ == "__main__":
    given = vars(parser.parse_args())
    logging.basicConfig(level=logging.INFO, format="  %(message)s")
    if given.pop("verb") == "make":
        make(given["names"], given["packs"])
    else:
        command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
        for path in given.pop("files"):
            solve(path, Solve(**given, command=command))
