#!/usr/bin/env python3
"""Time and peak memory of grains in a box of walls and of all spheres, next to Yade.

.venv/bin/python scripts/benchmark_walled.py --csv docs/benchmark_walled.csv
"""

import argparse

from fdnet.files import path_option
from validation.benchmark.network import show_growth, write_table
from validation.benchmark.walled import measure_walled

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
number = {"type": int, "nargs": "*", "metavar": "COUNT"}
parser.add_argument("--sizes", default=[10_000, 100_000], help="grains between walls", **number)
parser.add_argument("--spheres", default=[10_000, 100_000], help="grains and fines", **number)
parser.add_argument("--limit", type=float, default=600.0, help="CPU seconds a process (600)")
parser.add_argument("--peer-up-to", type=int, default=200_000, help="most spheres for Yade")
parser.add_argument("--csv", type=path_option, help="also write the table here")

if __name__ == "__main__":
    options = vars(parser.parse_args())
    path = options.pop("csv")
    rows = measure_walled(**options)
    show_growth(rows)
    if path:
        write_table(rows, path)
