#!/usr/bin/env python3
"""What the forces of the fluid (docs/physics.md, section 3) change and cost.

    .venv/bin/python scripts/forces.py effect cases/quick/specimen1.toml ... --csv effect.csv
    .venv/bin/python scripts/forces.py cost --csv cost.csv

Both need LIGGGHTS. `effect` keeps finished runs below --out and continues cut ones.
"""

import argparse
from pathlib import Path

from fdnet.files import path_option
from fdnet.studies.dem.forces import cost_rows, effect_rows
from fdnet.studies.engine.csv_rows import write_as_they_come

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("study", choices=["effect", "cost"])
parser.add_argument("cases", nargs="*", type=path_option, metavar="CASE.toml")
parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3])
parser.add_argument("--fines", nargs="+", type=int, default=[5_000, 50_000])
parser.add_argument("--fine-steps", type=float, default=2.5e5, help="steps times fines of a turn")
parser.add_argument("--rounds", type=int, default=40, help="turns of each force")
parser.add_argument("--out", type=path_option, default=Path("runs/forces"))
parser.add_argument("--csv", type=path_option, required=True)

if __name__ == "__main__":
    given = parser.parse_args()
    rows = (
        effect_rows(given.cases, given.seeds, given.out)
        if given.study == "effect"
        else cost_rows(given.fines, given.fine_steps, given.rounds, given.out)
    )
    for row in write_as_they_come(given.csv, rows):
        print(row, flush=True)
