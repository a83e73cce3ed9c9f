"""Seconds inside and outside LIGGGHTS for whole runs, one row a case.

"outside" is the wall time of the whole command less the time of all LIGGGHTS processes; the time
that went into rejected packs has a column of its own.
"""

import json
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from validation.engine.csv_rows import write_named

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
    """The row of one case, which is run in a fresh folder below `out`."""
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


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Prints the rows as a table."""
    print("  ".join(f"{name:>16}" for name in COLUMNS))
    for row in rows:
        cells = (f"{v:>16.3f}" if isinstance(v, float) else f"{v:>16}" for v in row.values())
        print("  ".join(cells))


def write_table(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """The rows as CSV, numbers with three decimals."""
    text = [
        {name: f"{v:.3f}" if isinstance(v, float) else v for name, v in row.items()}
        for row in rows
    ]
    write_named(path, text, columns=COLUMNS)
