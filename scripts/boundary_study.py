#!/usr/bin/env python3
"""What walls and cut planes do to the permeability: a table for docs/accuracy.md.

    .venv/bin/python scripts/boundary_study.py tiled PACK.csv ... --csv boundary_tiled.csv
    .venv/bin/python scripts/boundary_study.py slabs PACK.csv ... --csv boundary_slabs.csv
    .venv/bin/python scripts/boundary_study.py walled --porosity 0.41 --csv boundary_walled.csv

The tables of the page lie in docs/validation. `walled` makes its packs with LIGGGHTS.
"""

import argparse

from fdnet.files.paths import path_option
from fdnet.studies.accuracy.boundaries import slab_rows, tiled_rows, walled_rows
from fdnet.studies.engine.csv_rows import write_as_they_come

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("study", choices=["tiled", "slabs", "walled"])
parser.add_argument("packs", nargs="*", type=path_option)
parser.add_argument("--tiles", type=int, default=3, help="tiled up to so many times")
parser.add_argument("--places", type=int, default=20, help="slabs of each thickness")
parser.add_argument("--grains", nargs="+", type=int, default=[200, 1000, 3000, 10000])
parser.add_argument("--rim", type=float, default=1.5, help="diameters left out at every side")
parser.add_argument("--porosity", type=float, default=0.40, help="of the whole walled pack")
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--csv", type=path_option, required=True)

if __name__ == "__main__":
    given = parser.parse_args()
    rows = {
        "tiled": lambda: tiled_rows(given.packs, given.tiles),
        "slabs": lambda: slab_rows(given.packs, given.places),
        "walled": lambda: walled_rows(
            given.grains, given.rim, porosity=given.porosity, seed=given.seed
        ),
    }
    for row in write_as_they_come(given.csv, rows[given.study]()):
        print(row, flush=True)
