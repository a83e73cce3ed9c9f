#!/usr/bin/env python3
"""Attacks on small real runs, or many runs under random kills.

    python scripts/chaos.py --attacks 1000 --seed 1 --record docs/validation/chaos.json
    python scripts/chaos.py --soak 100

Attack INDEX of a seed is always the same. Ends with 1 when there were faults.
"""

import argparse
import json
import math
import shlex
import sys
import tempfile
from pathlib import Path

from fdnet.cli import main
from fdnet.studies.chaos.chaos import chaos
from fdnet.studies.chaos.soak import soak

parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
parser.add_argument("--attacks", type=int, default=24)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--jobs", type=int, default=1, help="attacks at the same time (default 1)")
parser.add_argument("--seconds", type=float, default=math.inf, help="begin no attack after this")
parser.add_argument("--only", type=int, metavar="INDEX", help="this attack alone")
parser.add_argument("--soak", type=int, metavar="N", help="N runs under random kills instead")
parser.add_argument("--record", type=Path, metavar="FILE.json")

if __name__ == "__main__":
    given = parser.parse_args()
    one = given.only
    indices = range(given.attacks) if one is None else range(one, one + 1)
    with tempfile.TemporaryDirectory(prefix="fdnet-chaos-") as place:
        record = (
            soak(Path(place), main, runs=given.soak, seed=given.seed)
            if given.soak
            else chaos(
                Path(place),
                seed=given.seed,
                indices=indices,
                jobs=given.jobs,
                seconds=given.seconds,
                report=lambda line: print(line, file=sys.stderr, flush=True),
            )
        )
    command = shlex.join(["python", "scripts/chaos.py", *sys.argv[1:]])
    text = json.dumps({"command": command} | record, indent=1) + "\n"
    if given.record:
        given.record.write_text(text, encoding="utf-8")
    print(text, end="")
    sys.exit(1 if record["faults"] else 0)
