#!/usr/bin/env python3
"""Mutated case files, dumps and sphere tables through fdnet's real entries.

    python scripts/fuzz.py --inputs 10500 --seed 1 --record docs/validation/fuzz.json

Input INDEX of a seed is always the same. Ends with 1 when there were faults.
"""

import argparse
import json
import resource
import sys
from pathlib import Path

from fdnet.cli import main
from fdnet.files import path_option
from validation.fuzz.fuzz import fuzz

MEMORY_BYTES = 6 << 30
ROOT = Path(__file__).resolve().parents[1]
parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
parser.add_argument("--inputs", type=int, default=10_500)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--only", type=int, metavar="INDEX", help="this input alone")
parser.add_argument("--record", type=path_option, metavar="FILE.json")
parser.add_argument("--keep", type=path_option, metavar="DIR", help="inputs that made faults")

if __name__ == "__main__":
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
    one = given.only
    indices = range(given.inputs) if one is None else range(one, one + 1)
    record = fuzz(ROOT, main, seed=given.seed, indices=indices, keep=given.keep)
    text = json.dumps(record, indent=1) + "\n"
    if given.record:
        given.record.write_text(text, encoding="utf-8")
    print(text, end="")
    sys.exit(1 if record["faults"] else 0)
