#!/usr/bin/env python3
"""Every law against resolved Stokes flow: docs/accuracy.md with its tables and figure.

    .venv/bin/python scripts/accuracy.py [--more DIR]

Computes every law on every pack of known permeability (some five minutes), writes the tables
docs/validation/accuracy_*.csv and accuracy.png, and the page from docs/accuracy.md.in. The tables
of walls and of other tools are read from their files. Rows of the truth whose pack is in neither
--packs nor --more are named on the page and left out.

    .venv/bin/python scripts/accuracy.py --slabs yes no

prints instead what the laws make of the slabs of deposits that LIGGGHTS made: of those whose truth
was known before the laws were shaped ("yes"), and of those put aside ("no" and "later").

    .venv/bin/python scripts/accuracy.py --full-size RUN ...

writes docs/validation/accuracy_full_size.csv: the laws of the network of the grains over the
network of all spheres, in finished runs.
"""

import argparse
from pathlib import Path

from fdnet.files.paths import path_option
from fdnet.studies.accuracy.full_size import write_full_size
from fdnet.studies.accuracy.page import write_accuracy
from fdnet.studies.accuracy.slabs import slab_rows, slab_summary
from fdnet.studies.truth.packs import DATA, OWN_TRUTH
from fdnet.studies.truth.slabs import LATER, NO, SLAB_FOLDER, YES

KNOWN = (YES, NO, LATER)
DOCS = Path(__file__).resolve().parents[1] / "docs"
parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--packs", type=path_option, default=DATA, help="packs and truth.csv")
parser.add_argument(
    "--more", type=path_option, nargs="*", default=[], metavar="DIR", help="more packs"
)
parser.add_argument("--own", type=path_option, default=DATA / OWN_TRUTH, help="fdnet's own truth")
parser.add_argument("--benchmark", type=path_option, default=DOCS / "benchmark_network.csv")
parser.add_argument("--docs", type=path_option, default=DOCS, help="where to write")
parser.add_argument("--slabs", nargs="+", choices=KNOWN, help="print the slabs alone")
parser.add_argument("--full-size", type=path_option, nargs="+", metavar="RUN", help="runs alone")

if __name__ == "__main__":
    given = vars(parser.parse_args())
    known, runs = given.pop("slabs"), given.pop("full_size")
    if known:
        print(slab_summary(slab_rows(SLAB_FOLDER, known)))
    elif runs:
        print(write_full_size(runs, given["docs"] / "validation"))
    else:
        print(write_accuracy(**given))
