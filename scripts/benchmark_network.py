#!/usr/bin/env python3
"""Time and peak memory of the network half against size, next to OpenPNM and Yade.

    .venv/bin/python scripts/benchmark_network.py --openpnm-python ../peers/bin/python \\
        --csv docs/benchmark_network.csv

A tool that is not installed is named and left out.
"""

import argparse

from fdnet.files import path_option
from validation.benchmark.network import Options, measure, show_growth, write_table
from validation.truth.packs import DATA

LIMIT = (
    "CPU seconds for a process of a peer (600); fdnet has 5 times, its largest size 10 times that"
)
parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
number = {"type": int, "metavar": "GRAINS"}
parser.add_argument("--sizes", nargs="+", default=[1000, 10_000, 100_000], **number)
parser.add_argument("--fines", type=float, default=10.0, help="fines per grain (default 10)")
parser.add_argument("--largest", help="also this size, without fines and by fdnet only", **number)
parser.add_argument("--limit", type=float, default=600.0, help=LIMIT)
parser.add_argument("--truth", type=path_option, default=DATA, help="packs with truth")
parser.add_argument("--openpnm-python", help="a Python that has OpenPNM")
parser.add_argument("--csv", type=path_option, help="also write the table here")

if __name__ == "__main__":
    options = vars(parser.parse_args())
    path = options.pop("csv")
    rows = measure(Options(**options))
    show_growth(rows)
    if path:
        write_table(rows, path)
