"""What runs take against what `fdnet check` says: CPU seconds and memory, as a CSV.

.venv/bin/python scripts/cost_table.py --csv cost.csv well quick quick-specimen1 ...

Without names: all quick shipped cases. Each run is a process of its own, in a temporary folder.
"""

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from fdnet.case.file import case_path, read_case, shipped_cases
from fdnet.files import path_option
from fdnet.scales.cost import cost_of, peak_memory
from fdnet.scales.scales import scales_of

parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
parser.add_argument("names", nargs="*", help="shipped cases (default: the quick ones)")
parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
parser.add_argument("--csv", type=path_option, required=True)
COLUMNS = ("case", "changed", "expected_s", "cpu_s", "ratio", "expected_MB", "memory_MB")


def measured(path: Path, changed: list[str]) -> tuple[float, float]:
    """CPU seconds of a run with all its children, and the memory of the largest, bytes."""
    with tempfile.TemporaryDirectory() as folder:
        options = [word for one in changed for word in ("--set", one)]
        words = [sys.executable, "-m", "fdnet.cli", "run", str(path), "--quiet", *options]
        child = subprocess.Popen([*words, "--out", f"{folder}/run"], stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise SystemExit(f"{path}: the run ended with {child.returncode}")
    return usage.ru_utime + usage.ru_stime, 1024.0 * usage.ru_maxrss


def row(name: str, changed: list[str]) -> dict[str, str]:
    """The row of a shipped case."""
    case = read_case(case_path(name), assignments=changed)
    scales = scales_of(case)
    expected = cost_of(case, scales).seconds
    seconds, memory = measured(case_path(name), changed)
    values = (
        *(name, " ".join(changed), f"{expected:.0f}", f"{seconds:.0f}"),
        *(f"{expected / seconds:.2f}", f"{peak_memory(case, scales) / 1e6:.0f}"),
        f"{memory / 1e6:.0f}",
    )
    return dict(zip(COLUMNS, values, strict=True))


given = parser.parse_args()
names = given.names or [one.name for one in shipped_cases() if one.name.startswith("quick")]
there = given.csv.exists()
with given.csv.open("a", newline="", encoding="utf-8") as file:
    writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
    if not there:
        writer.writeheader()
    for one in names:
        writer.writerow(row(one, given.set))
        file.flush()
