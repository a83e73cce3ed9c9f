#!/usr/bin/env python3
"""What a deposit takes of the drop of pressure, by the network and by resolved Stokes flow.

    .venv/bin/python scripts/pressure_share.py runs/coupling/specimen5-network-* --csv share.csv

It checks the forces of `drag.field = "network"`. The runs must be finished.
"""

import argparse

from fdnet.files import path_option
from fdnet.studies.dem.pressure_share import share_rows
from fdnet.studies.engine.csv_rows import write_as_they_come

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("runs", nargs="+", type=path_option, metavar="RUN")
parser.add_argument("--cells", nargs="+", type=float, default=[12.0, 18.0], help="across a grain")
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")

if __name__ == "__main__":
    options = parser.parse_args()
    for row in write_as_they_come(options.csv, share_rows(options.runs, options.cells)):
        print(row, flush=True)
