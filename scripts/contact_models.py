#!/usr/bin/env python3
"""Contact models and options on the quick specimens: a table for docs/physics.md.

.venv/bin/python scripts/contact_models.py --csv docs/validation/contact_models.csv

Rows that the table already holds are not run again.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from fdnet.studies.dem.contact_models import rows, summary
from fdnet.studies.engine.csv_rows import read_named, write_named

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--csv", type=path_option, required=True)
parser.add_argument("--runs", type=path_option, default=Path("runs/contact_models"))

if __name__ == "__main__":
    given = parser.parse_args()
    done = read_named(given.csv) if given.csv.exists() else []
    table = []
    for row in rows(Path(__file__).parents[1] / "cases", given.runs, done):
        table.append(row)
        if len(table) > len(done):
            write_named(given.csv, table)
            print(row, flush=True)
    print(summary(table))
