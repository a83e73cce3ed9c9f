#!/usr/bin/env python3
"""How far a network that is solved now and then lags behind one solved at every update.

    .venv/bin/python scripts/solve_lag.py cases/quick/specimen5.toml --work lag --csv lag.csv \\
        --set drag.field=network --set drag.upstream=darcy --set drag.scheme=implicit

The flow of the case must follow its deposit.
"""

import argparse

from fdnet.case.file import read_case
from fdnet.dem.liggghts import Launch
from fdnet.files import path_option
from fdnet.studies.dem.runs import grains_of, the_binary
from fdnet.studies.dem.solve_lag import lag_rows
from fdnet.studies.engine.csv_rows import write_as_they_come

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("case", type=path_option)
parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="keys")
parser.add_argument("--work", type=path_option, required=True, help="an empty folder for the run")
parser.add_argument("--csv", type=path_option, required=True, help="write the table here")

if __name__ == "__main__":
    options = parser.parse_args()
    case = read_case(options.case, assignments=options.keys)
    grains = grains_of(case, options.work)
    rows = lag_rows(case, grains, options.work / "invade", Launch(binary=the_binary()))
    for row in write_as_they_come(options.csv, rows):
        print(row, flush=True)
