#!/usr/bin/env python3
"""docs/validation.md from docs/validation.md.in and the committed tables in docs/validation.

    .venv/bin/python scripts/validation.py [--docs docs] [--redraw]

It runs no study, so it takes a second. `fdnet study NAME --out DIR` makes NAME.csv, .png and .md,
which are then copied to docs/validation; --redraw makes the last two anew from the first.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from fdnet.studies.pages.validation import redraw, write_page

DOCS = Path(__file__).resolve().parents[1] / "docs"
parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--docs", type=path_option, default=DOCS, help="where to read and write")
parser.add_argument("--redraw", action="store_true", help="figures and texts of the studies too")

if __name__ == "__main__":
    given = parser.parse_args()
    if given.redraw:
        redraw(given.docs / "validation")
    print(write_page(given.docs))
