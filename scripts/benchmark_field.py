#!/usr/bin/env python3
"""CPU seconds and memory of the velocity field of a finished run's pack.

.venv/bin/python scripts/benchmark_field.py runs/specimen5 --points 200000
"""

import argparse

from fdnet.files import path_option
from validation.benchmark.field import measure_field

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("run", type=path_option, metavar="RUN")
parser.add_argument("--cells", type=float, default=10.0, help="across a mean grain (default 10)")
parser.add_argument("--points", type=int, default=200_000, help="places (default 200000)")

if __name__ == "__main__":
    options = vars(parser.parse_args())
    for name, value in measure_field(options.pop("run"), **options).items():
        print(f"{name:<12} {value:.3g}")
