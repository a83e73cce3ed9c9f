#!/usr/bin/env python3
"""Stokes truth: make packs and deposits and compute their permeability, extrapolated from grids.

    .venv/bin/python scripts/stokes_truth.py make
    .venv/bin/python scripts/stokes_truth.py solve PACK.csv --cells 128 192 --axis x
    .venv/bin/python scripts/stokes_truth.py make-slabs
    .venv/bin/python scripts/stokes_truth.py solve-slabs
    .venv/bin/python scripts/stokes_truth.py list-slabs
    .venv/bin/python scripts/stokes_truth.py two-grids

`make [NAME ...]` writes periodic packs from their seeds. `solve` runs pack files grid by grid: a
finished grid is a row of --grids and is not run again. `make-slabs [NAME ...]` lets LIGGGHTS make
the specimens of the slabs and keeps their run folders in --runs; `solve-slabs [NAME ...]` solves
the slabs cut from them, grid by grid too; `list-slabs` prints what they are, and
`two-grids` how far the error of `fdnet stokes` holds on them. Method and checks:
docs/stokes.md.
"""

import argparse
import logging
import shlex
import sys
from pathlib import Path

from fdnet.files import path_option
from validation.truth.grids import Solve, make, solve
from validation.truth.made_packs import PACKS
from validation.truth.made_slabs import SLABS, make_specimens
from validation.truth.packs import DATA, OWN_GRIDS, OWN_TRUTH
from validation.truth.slab_grids import slab_table, solve_slabs
from validation.truth.slabs import SLAB_FOLDER
from validation.truth.specimens import SPECIMENS
from validation.truth.two_grids import two_grids_table

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
slab_maker = verbs.add_parser("make-slabs", help="run LIGGGHTS and write the slabs' specimens")
slab_maker.add_argument("names", nargs="*", choices=[[], *SPECIMENS], metavar="NAME")
slab_maker.add_argument("--runs", type=path_option, default=Path("runs"))
slab_maker.add_argument("--slabs", type=path_option, default=SLAB_FOLDER)
slab_solver = verbs.add_parser("solve-slabs", help="permeability of slabs with and without fines")
slab_solver.add_argument("names", nargs="*", choices=[[], *SLABS], metavar="NAME")
slab_solver.add_argument("--cells", nargs="+", type=int, default=[])
slab_solver.add_argument("--slabs", type=path_option, default=SLAB_FOLDER)
slab_lister = verbs.add_parser("list-slabs", help="what the slabs are, as a Markdown table")
slab_lister.add_argument("--slabs", type=path_option, default=SLAB_FOLDER)
pair_lister = verbs.add_parser("two-grids", help="errors of two grids, as a Markdown table")
pair_lister.add_argument("--slabs", type=path_option, default=SLAB_FOLDER)

if __name__ == "__main__":
    given = vars(parser.parse_args())
    logging.basicConfig(level=logging.INFO, format="  %(message)s")
    verb = given.pop("verb")
    if verb == "make":
        make(given["names"], given["packs"])
    elif verb == "make-slabs":
        make_specimens(given["names"], given["runs"], given["slabs"])
    elif verb == "solve-slabs":
        solve_slabs(given["names"], given["slabs"], given["cells"])
    elif verb == "list-slabs":
        print(slab_table(given["slabs"]))
    elif verb == "two-grids":
        print(two_grids_table(given["slabs"]))
    else:
        command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
        for path in given.pop("files"):
            solve(path, Solve(**given, command=command))
