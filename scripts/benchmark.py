#!/usr/bin/env python3
"""Seconds inside and outside LIGGGHTS for whole runs.

    .venv/bin/python scripts/benchmark.py cases/specimen1.toml cases/specimen5.toml --csv benchmark.csv

Every case is run anew in its own folder below --out. "outside" is the wall time of the whole command less the time of
all LIGGGHTS processes; how much of that went into rejected packs is listed too.
"""

import argparse
import csv
import json
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

COLUMNS = (
    "case",
    "grains",
    "fines",
    "wall_s",
    "liggghts_s",
    "rejected_packs_s",
    "outside_s",
    "outside_share",
    "network_and_laws_s",
    "analyse_s",
    "report_s",
    "peak_memory_MB",
)


def measure(case: Path, out: Path) -> dict[str, Any]:
    """Run one case in a fresh folder and return its row."""
    folder = out / case.stem
    if folder.exists():
        if not (folder / "case.toml").exists():
            sys.exit(f"benchmark: {folder} is not an fdnet run; give another --out")
        shutil.rmtree(folder)
    start = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "fdnet.cli", "run", str(case), "--out", str(folder), "--json"],
        check=False,
        text=True,
        stdout=subprocess.PIPE,
    )
    wall = time.monotonic() - start
    if done.returncode:
        sys.exit(f"benchmark: {case} ended with {done.returncode}")
    return row_of(
        json.loads(done.stdout), json.loads((folder / "manifest.json").read_text()), wall
    )


def row_of(summary: dict[str, Any], manifest: dict[str, Any], wall: float) -> dict[str, Any]:
    """The row of one run from its summary, manifest and wall time."""
    seconds = summary["seconds"]
    attempts = manifest["pack"]["attempts"]
    rejected = sum(attempt["liggghts_s"] for attempt in attempts[:-1])
    outside = wall - seconds["liggghts"]
    network = sum(
        seconds[f"analyse_{part}"] for part in ("tessellate", "occupancy", "conductance", "solve")
    )
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    values = (
        summary["case"],
        attempts[-1]["grains"],
        summary["supplied_count"],
        wall,
        seconds["liggghts"],
        rejected,
        outside,
        outside / wall,
        network,
        seconds["analyse"],
        seconds["report"],
        peak,
    )
    return dict(zip(COLUMNS, values, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("cases", type=Path, nargs="+", metavar="CASE.toml")
    parser.add_argument("--out", type=Path, default=Path("runs/benchmark"))
    parser.add_argument("--csv", type=Path, help="also write the table here")
    options = parser.parse_args()
    rows = [measure(case, options.out) for case in options.cases]
    print("  ".join(f"{name:>16}" for name in COLUMNS))
    for row in rows:
        print(
            "  ".join(
                f"{value:>16.3f}" if isinstance(value, float) else f"{value:>16}"
                for value in row.values()
            )
        )
    if options.csv:
        with options.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(
                {k: f"{v:.3f}" if isinstance(v, float) else v for k, v in row.items()}
                for row in rows
            )


if __name__ == "__main__":
    main()
