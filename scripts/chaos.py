#!/usr/bin/env python3
"""Attacks on small real runs, or many runs under random kills.

    python scripts/chaos.py --attacks 1000 --seed 1 --record docs/validation/chaos.json
    python scripts/chaos.py --soak 100

Attack INDEX of a seed is always the same. With --progress FILE a session that was cut goes on.
Ends with 1 when there were faults.
"""

import argparse
import json
import math
import shlex
import sys
import tempfile
from pathlib import Path
from typing import Any

from fdnet.cli import main
from fdnet.files import path_option
from validation.chaos.chaos import chaos, prepared_runs
from validation.chaos.soak import soak

parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
parser.add_argument("--attacks", type=int, default=24)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--jobs", type=int, default=1, help="attacks at the same time (default 1)")
parser.add_argument("--seconds", type=float, default=math.inf, help="begin no attack after this")
parser.add_argument("--only", type=int, metavar="INDEX", help="this attack alone")
parser.add_argument("--soak", type=int, metavar="N", help="N runs under random kills instead")
parser.add_argument("--record", type=path_option, metavar="FILE.json")
parser.add_argument("--progress", type=path_option, metavar="FILE.jsonl", help="kept outcomes")


def attack(given: argparse.Namespace, place: Path) -> dict[str, Any]:
    """The attacks that were asked for."""
    one = given.only
    with prepared_runs(place) as prepared:
        return chaos(
            prepared,
            seed=given.seed,
            indices=range(given.attacks) if one is None else range(one, one + 1),
            jobs=given.jobs,
            seconds=given.seconds,
            progress=given.progress,
            report=lambda line: print(line, file=sys.stderr, flush=True),
        )


if __name__ == "__main__":
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fdnet-chaos-") as place:
        record = (
            soak(Path(place), main, runs=given.soak, seed=given.seed)
            if given.soak
            else attack(given, Path(place))
        )
    command = shlex.join(["python", "scripts/chaos.py", *sys.argv[1:]])
    text = json.dumps({"command": command} | record, indent=1) + "\n"
    if given.record:
        given.record.write_text(text, encoding="utf-8")
    print(text, end="")
    sys.exit(1 if record["faults"] else 0)
