#!/usr/bin/env python3
"""Every law against resolved Stokes flow: the tables and the figure of docs/accuracy.md.

    .venv/bin/python scripts/accuracy.py

computes every law on every pack and slab of known permeability (some ten minutes), writes
docs/validation/accuracy_packs.csv, accuracy_slabs.csv and accuracy.png, and prints the tables that
the page holds. A test fails until the page has them.

    .venv/bin/python scripts/accuracy.py --full-size RUN ...

writes docs/validation/accuracy_full_size.csv from finished runs: `section-archie` over
`all-spheres`, section by section.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from validation.accuracy import write_accuracy, write_full_size

VALIDATION = Path(__file__).resolve().parents[1] / "docs" / "validation"
parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--out", type=path_option, default=VALIDATION, help="where to write")
parser.add_argument("--full-size", type=path_option, nargs="+", metavar="RUN", help="runs alone")

if __name__ == "__main__":
    given = parser.parse_args()
    if given.full_size:
        print(write_full_size(given.full_size, given.out))
    else:
        print(write_accuracy(given.out))
