#!/usr/bin/env python3
"""First sections of finished runs by resolved Stokes flow and by the network, as one table.

    .venv/bin/python scripts/stokes_sections.py runs/walls1 runs/periodic1 --csv FILE.csv

What a run keeps in its folder is not solved again (docs/how-to/check_the_face.md).
"""

import argparse

import fdnet
from fdnet.files import path_option
from fdnet.run.stokes_sections import ACROSS_A_FINE, stokes_sections
from validation.engine.csv_rows import write_named

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("runs", nargs="+", type=path_option)
parser.add_argument("--across", type=float, default=ACROSS_A_FINE)
parser.add_argument("--csv", type=path_option, required=True)

if __name__ == "__main__":
    options = parser.parse_args()
    rows = []
    for folder in options.runs:
        run = fdnet.open_run(folder)
        (section,) = stokes_sections(folder, across=options.across, follow=print)
        named = {"case": run.case.name, "seed": run.case.seed, "sides": run.case.box.sides}
        rows.append(named | section)
    write_named(options.csv, rows)
