#!/usr/bin/env python3
"""Time and peak memory of the network half, step by step against size, beside OpenPNM and Yade's flow engine.

    .venv/bin/python scripts/benchmark_network.py --openpnm-python ../peers/bin/python --csv docs/benchmark_network.csv

Packs: packH (40 grains, porosity 0.40) tiled, each grain shaken by 2 % of its radius; fines of a tenth of the radius at
random on the grains (they may overlap each other). Sides periodic, flow between planes across x. Every size and tool
has a process of its own with a time limit; imports, compiled kernels and file reading come before the clock. Peak
memory is that of the process during the step. OpenPNM solves the same networks: intact; stiff, that is spread over 12
decades; and clogged, a tenth of the throats closed besides. Yade tessellates the same grains, periodic and in a box of
walls. A tool that is not there is said to be missing and left out. The case `specimen` is 1400 grains with 200,000
fines. Truth: resolved Stokes flow, docs/validation/truth_own.csv; Yade tessellates fines like grains.
"""

import argparse
import csv
import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
STATES = {"intact": "solve", "stiff": "solve stiff", "clogged": "solve clogged"}
COLUMNS = (
    "tool",
    "case",
    "step",
    "grains",
    "fines",
    "pores",
    "cpu_s",
    "wall_s",
    "peak_MB",
    "growth",
    "k_over_truth",
    "flux_difference",
    "status",
)
Row = dict[str, Any]


def child(command: list[str], limit: float, **settings: str) -> Row:
    """The RESULT line of a child process, and `status`: ok, over the limit in CPU seconds, or how it ended.

    On a busy machine waiting does not count, but ten times the limit by the clock ends it too.
    """

    def set_limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(limit), math.ceil(limit) + 5))

    try:
        done = subprocess.run(
            ["nice", "-n", "5", *command],
            check=False,
            capture_output=True,
            text=True,
            timeout=10 * limit,
            preexec_fn=set_limit,
            env={**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", **settings},
        )
    except subprocess.TimeoutExpired:
        return {"status": f"stopped after {10 * limit:g} s by the clock"}
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return {
            "status": f"stopped after {limit:g} s"
            if done.returncode == -signal.SIGXCPU
            else "killed (memory?)"
        }
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if lines and done.returncode == 0:
        return {"status": "ok", **json.loads(lines[-1].removeprefix("RESULT "))}
    said = (done.stderr.strip() or done.stdout.strip() or "nothing said").splitlines()[-1]
    return {"status": f"exit {done.returncode}: {said[:80]}"}


def fdnet_rows(grains: int, fines: int, folder: Path, limit: float) -> list[Row]:
    """One row per step of fdnet; leaves the spheres and the network in `folder` for the others."""
    found = child(
        [sys.executable, str(HERE / "benchmark_fdnet.py"), str(grains), str(fines), str(folder)],
        limit,
    )
    common = {
        "tool": "fdnet",
        "case": "tiled",
        "grains": found.get("grains", grains),
        "fines": fines,
    }
    common |= {"status": found["status"], "pores": found.get("pores")}
    return [
        common | {"step": step} | values
        for step, values in found.get("steps", {"total": {}}).items()
    ]


def openpnm_rows(python: str, folder: Path, base: Row, limit: float) -> list[Row]:
    """OpenPNM on the networks of fdnet by Pardiso and by conjugate gradients."""
    rows = []
    for state, step in STATES.items():
        file = folder / f"{state}.npz"
        expected = json.loads((folder / "inflow.json").read_text())[state]
        for solver in ("direct", "cg"):
            found = child([python, str(HERE / "peer_openpnm.py"), str(file), solver], limit)
            row = base | {"tool": f"OpenPNM {solver}", "step": step}
            if "inflow" in found:
                found["flux_difference"] = (
                    abs(found["inflow"] / expected - 1.0) if expected else math.nan
                )
            rows.append(row | {name: value for name, value in found.items() if name in COLUMNS})
    return rows


def yade_row(spheres: Path, sides: str, base: Row, limit: float) -> Row:
    """Yade's flow engine on the spheres; `k` in mm2 rides along."""
    command = ["yade", "-j1", "-n", "-x", str(HERE / "peer_yade.py")]
    found = child(command, limit, BENCHMARK_SPHERES=str(spheres), BENCHMARK_SIDES=sides)
    return (
        base
        | {"tool": f"Yade {sides}", "step": "total", "pores": found.pop("cells", None)}
        | found
    )


def error_rows(data: Path, tools: dict[str, str | None], folder: Path, limit: float) -> list[Row]:
    """k over the Stokes truth of every pack in truth_own.csv, by fdnet and by Yade (fines tessellated like grains)."""
    rows: list[Row] = []
    with (HERE.parent / "docs" / "validation" / "truth_own.csv").open() as table:
        truths = [row for row in csv.DictReader(table) if row["axis"] == "x"]
    for truth in truths:
        pack = data / truth["file"]
        found = child(
            [sys.executable, str(HERE / "benchmark_fdnet.py"), "--pack", str(pack), str(folder)],
            limit,
        )
        case = {"case": truth["case"], "grains": found.get("grains"), "fines": found.get("fines")}
        ours = {"tool": "fdnet", "step": "error", **case} | {
            k: v for k, v in found.items() if k in (*COLUMNS, "k")
        }
        rows.append(ours)
        if tools["yade"] and "k" in found:
            rows.append(
                yade_row(folder / "spheres.npz", "periodic", case, limit) | {"step": "error"}
            )
        for row in rows[-2:]:
            if row["case"] == truth["case"] and "k" in row:
                row["k_over_truth"] = row["k"] / float(truth["k_mm2"])
    return rows


def set_growth(rows: list[Row]) -> None:
    """Exponent of CPU time against grains, by least squares over the sizes from 5000 grains on."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row["case"] == "tiled" and row.get("cpu_s") and (row["grains"] or 0) > 5000:
            groups.setdefault((row["tool"], row["step"]), []).append(row)
    for group in groups.values():
        x, y = ([math.log(row[name]) for row in group] for name in ("grains", "cpu_s"))
        spread = sum((a - sum(x) / len(x)) ** 2 for a in x)
        if spread > 0.1:
            slope = sum((a - sum(x) / len(x)) * b for a, b in zip(x, y, strict=True)) / spread
            for row in group:
                row["growth"] = slope


def text_of(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def show(rows: list[Row]) -> None:
    for row in rows:
        values = [text_of(row.get(name)) for name in COLUMNS]
        widths = (15, 24, 14, 8, 8, 8, 9, 9, 9, 7, 12, 15, 0)
        print(
            " ".join(f"{value:<{width}}" for value, width in zip(values, widths, strict=True)),
            flush=True,
        )


def find_tools(options: argparse.Namespace) -> dict[str, str | None]:
    """Where the peers are; says which are missing."""
    python = options.openpnm_python
    if (
        python is None
        or subprocess.run(
            [python, "-c", "import openpnm"], check=False, capture_output=True
        ).returncode
    ):
        print("OpenPNM: not found, left out (name a Python that has it with --openpnm-python)")
        python = None
    yade = shutil.which("yade")
    if yade is None:
        print("Yade: not found, left out (Debian: apt install yade)")
    return {"openpnm": python, "yade": yade}


def measure(options: argparse.Namespace) -> list[Row]:
    tools, rows = find_tools(options), []
    show([dict(zip(COLUMNS, COLUMNS, strict=True))])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows += error_rows(options.truth, tools, folder, options.limit)
        show(rows)
        runs = [(grains, round(grains * options.fines)) for grains in options.sizes]
        runs += [(options.largest, 0)] * bool(options.largest) + [(1400, 200_000)]
        for grains, fines in runs:
            new = fdnet_rows(
                grains, fines, folder, (10 if grains == options.largest else 5) * options.limit
            )
            base = {name: new[0][name] for name in ("case", "grains", "pores")}
            if new[0]["status"] == "ok" and grains in options.sizes:
                if tools["openpnm"]:
                    new += openpnm_rows(tools["openpnm"], folder, base, options.limit)
                for sides in ("periodic", "box") if tools["yade"] else ():
                    new.append(yade_row(folder / "spheres.npz", sides, base, options.limit))
            if grains == 1400:
                new = [row | {"case": "specimen"} for row in new]
            show(new)
            rows += new
    set_growth(rows)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument(
        "--sizes", type=int, nargs="+", default=[1000, 10_000, 100_000], metavar="GRAINS"
    )
    parser.add_argument("--fines", type=float, default=10.0, help="fines per grain (default 10)")
    parser.add_argument(
        "--largest",
        type=int,
        metavar="GRAINS",
        help="also this size, without fines and by fdnet only",
    )
    parser.add_argument(
        "--limit",
        type=float,
        default=600.0,
        help="CPU seconds a process of a peer may take (600), fdnet five, its largest ten times that",
    )
    parser.add_argument(
        "--truth",
        type=Path,
        default=HERE.parent / "tests" / "data" / "truth",
        help="packs with truth",
    )
    parser.add_argument("--openpnm-python", help="a Python that has OpenPNM")
    parser.add_argument("--csv", type=Path, help="also write the table here")
    options = parser.parse_args()
    rows = measure(options)
    print("\ngrowth exponents of CPU time")
    for tool, step, growth in sorted(
        {(r["tool"], r["step"], r["growth"]) for r in rows if r.get("growth")}
    ):
        print(f"  {tool:<16} {step:<14} {growth:.2f}")
    if options.csv:
        with options.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore")
            writer.writeheader()
            writer.writerows({name: text_of(row.get(name)) for name in COLUMNS} for row in rows)


if __name__ == "__main__":
    main()
