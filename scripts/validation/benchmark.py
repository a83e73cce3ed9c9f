"""Time and memory against size: the chapter `benchmark`.

Pack H of the truth (40 grains, porosity 0.40) is tiled, each grain moved by up to 2 % of its
radius, with fines of a tenth of the radius at random on the grains. Sides y and z are periodic.
Every size has a process of its own, on one core. OpenPNM, where it is installed, solves the same
network; another checkout of fdnet measures the same spheres, in turn with this one.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from fdnet.case.file import case_path, read_case
from fdnet.errors import CaseError
from fdnet.files import path_option
from fdnet.run.progress import ONE_CORE
from fdnet.scales.cost import cost_of, peak_memory
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind, Snapshot, resting
from validation.benchmark_child import KEYS
from validation.truth import read_pack, tiled

ROOT = Path(__file__).resolve().parents[2]
CHILD = Path(__file__).with_name("benchmark_child.py")
SMALL = 1000
"""Grains of the pack on which all is compiled."""
FINE = 0.1
"""Radius of the fines over that of the grains."""
WHOLE_RUNS = ("quick", "quick-specimen1", "quick-specimen5")
Row = dict[str, Any]


def grains_of(count: int, rng: np.random.Generator) -> Snapshot:
    """About `count` grains of equal radius."""
    pack = read_pack("packH_40_eps40")
    across = max(round((count / len(pack)) ** (1 / 3)), 1)
    times = max(round(count / len(pack) / across**2), 1), across, across
    return tiled(pack, times, 0.02, rng)


def seated(grains: Snapshot, count: int, rng: np.random.Generator) -> Snapshot:
    """`count` fines on the surfaces of equal grains, in no other grain; they may overlap."""
    size, big = grains.box[:, 1], float(grains.radius.max())
    inside, small = size * (1 - 1e-15), FINE * big
    tree = cKDTree(np.minimum(grains.position, inside), boxsize=size)
    centres = np.zeros((0, 3))
    while len(centres) < count:
        host = rng.integers(len(grains), size=2 * (count - len(centres)) + 10)
        normal = rng.normal(size=(len(host), 3))
        normal *= (big + small) / np.linalg.norm(normal, axis=1)[:, None]
        place = np.minimum((grains.position[host] + normal) % size, inside)
        centres = np.concatenate([centres, place[tree.query(place)[0] > big + 0.999 * small]])
    return resting(centres[:count], small, grains.box, Kind.FINE)


def write_spheres(path: Path, count: int, fines_each: float) -> tuple[int, int]:
    """Writes the spheres of a size and the small ones; returns the numbers of grains and fines."""
    rng, arrays = np.random.default_rng(1), dict[str, Any]()
    for name, wanted in (("small", SMALL), ("large", count)):
        grains = grains_of(wanted, rng)
        fines = seated(grains, round(fines_each * len(grains)), rng)
        spheres = grains.joined(fines)
        values = spheres.position, spheres.radius, spheres.box, spheres.kind == Kind.FINE
        arrays |= {f"{name} {key}": one for key, one in zip(KEYS, values, strict=True)}
    np.savez(path, **arrays)
    return len(grains), len(fines)


def measured(words: Sequence[str], tree: Path, limit: float) -> list[Row]:
    """The rows that a child prints with fdnet of `tree`, or one row with how it ended."""
    path = os.pathsep.join([str(tree), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = {**os.environ, **ONE_CORE, "PYTHONPATH": path}
    command = [sys.executable, str(CHILD), *words]
    try:
        done = subprocess.run(
            command, check=False, capture_output=True, text=True, timeout=limit, env=environment
        )
    except subprocess.TimeoutExpired:
        return [{"step": "all", "status": f"stopped after {limit:g} s"}]
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if done.returncode or not lines:
        last = (done.stderr.strip() or "no message").splitlines()[-1]
        return [{"step": "all", "status": f"exit {done.returncode}: {last[:80]}"}]
    rows: list[Row] = json.loads(lines[-1].removeprefix("RESULT "))
    return [row | {"status": "ok"} for row in rows]


def network_rows(
    sizes: Sequence[int], fines_each: float, trees: Sequence[Path], limit: float
) -> Iterator[Row]:
    """The steps of every tree at every size, and OpenPNM on the network of the first tree."""
    peer = find_spec("openpnm") is not None
    with tempfile.TemporaryDirectory() as name:
        spheres, network = Path(name) / "spheres.npz", Path(name) / "network.npz"
        for size in sizes:
            grains, fines = write_spheres(spheres, size, fines_each)
            rows = []
            for tree in [*trees[1:], trees[0]]:
                words = ["fdnet", str(spheres), str(network)]
                rows += [{"tree": tree.name} | one for one in measured(words, tree, limit)]
            if peer and network.exists():
                words = ["openpnm", str(network)]
                rows += [{"tree": ""} | one for one in measured(words, trees[0], limit)]
            yield from ({"grains": grains, "fines": fines} | row for row in rows)


def show_growth(rows: pd.DataFrame, tree: str) -> None:
    """Prints the exponent of the CPU time against the number of grains, by step."""
    print("\nexponent of the CPU time")
    for step, of in rows[rows["tree"] == tree].groupby("step", sort=False):
        if len(of) > 1:
            exponent = np.polyfit(np.log(of["grains"]), np.log(of["cpu_s"]), 1)[0]
            print(f"{step:24} {exponent:.2f}")


def show_ratios(rows: pd.DataFrame, tree: str, other: str) -> None:
    """Prints CPU time and memory of `tree` over those of `other`, by size and step."""
    by = {name: of.set_index(["grains", "step"]) for name, of in rows.groupby("tree")}
    columns = ["cpu_s", "peak_MB"]
    print(f"\n{tree} over {other}\n{by[tree][columns] / by[other][columns]}")


def whole_run(name: str, changed: Sequence[str]) -> Row:
    """What a run of a shipped case takes against what `fdnet check` says: CPU seconds, memory."""
    path = case_path(name)
    case = read_case(path, assignments=list(changed))
    scales = scales_of(case)
    options = [word for one in changed for word in ("--set", one)]
    with tempfile.TemporaryDirectory() as folder:
        words = [
            "-m",
            "fdnet.cli",
            "run",
            str(path),
            "--quiet",
            *options,
            "--out",
            f"{folder}/run",
        ]
        child = subprocess.Popen([sys.executable, *words], stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise CaseError(f"{path}: the run ended with {child.returncode}")
    expected, seconds = cost_of(case, scales).seconds, usage.ru_utime + usage.ru_stime
    return {
        "case": name,
        "changed": " ".join(changed),
        "expected_s": round(expected),
        "cpu_s": round(seconds),
        "ratio": round(expected / seconds, 2),
        "expected_MB": round(peak_memory(case, scales) / 1e6),
        "memory_MB": round(1024.0 * usage.ru_maxrss / 1e6),
    }


def main(arguments: Sequence[str]) -> int:
    """The command `python scripts/validation.py benchmark`."""
    about = "Time and memory of the network by size, or of whole runs."
    parser = argparse.ArgumentParser("validation.py benchmark", description=about)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1000, 10_000], metavar="GRAINS")
    parser.add_argument("--fines", type=float, default=10.0, help="fines for each grain (10)")
    parser.add_argument("--against", type=path_option, help="another checkout of fdnet, in turn")
    parser.add_argument("--limit", type=float, default=3600.0, help="seconds for a process")
    parser.add_argument("--runs", nargs="*", metavar="CASE", help="whole runs instead")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--csv", type=path_option, help="also write the rows here")
    asked = parser.parse_args(arguments)
    trees = [ROOT, *([asked.against.resolve()] if asked.against else [])]
    made = network_rows(asked.sizes, asked.fines, trees, asked.limit)
    if asked.runs is not None:
        made = (whole_run(name, asked.set) for name in asked.runs or WHOLE_RUNS)
    rows = []
    for row in made:
        rows.append(row)
        print("  ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in row.values()))
        sys.stdout.flush()
    table = pd.DataFrame(rows)
    if asked.csv:
        table.to_csv(asked.csv, index=False, float_format="%.4g")
    if asked.runs is None and "cpu_s" in table:
        show_growth(table, ROOT.name)
        if asked.against:
            show_ratios(table, ROOT.name, trees[1].name)
    return 0
