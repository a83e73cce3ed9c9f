"""Time and peak memory of the network half against size, next to OpenPNM and Yade's flow engine.

Packs: pack H (40 grains, porosity 0.40) tiled, each grain moved by up to 2 % of its radius; fines
of a tenth of the radius at random on the grains (they may overlap each other). Sides are periodic,
and the flow goes between planes across x. The case `walled` is the same grains alone in a box of
walls that hold the fluid. Every size and tool has a process of its own with a time limit; imports,
compiled kernels and file reading come before the clock starts. Peak memory is that of the process
during the step. OpenPNM solves the same networks: intact; stiff, that is with conductances spread
over 12 decades; and clogged, with a tenth of the throats closed as well. Yade tessellates the same
grains, periodic and in a box of walls, and treats fines like grains. The case `specimen` is 1400
grains with 200,000 fines. Truth is resolved Stokes flow. The module `walled` has the case
`spheres`, the network of grains and fines together.
"""

import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.run.progress import ONE_CORE
from validation.engine.csv_rows import read_named, write_named
from validation.truth.packs import DATA, OWN_TRUTH

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
SPECIMEN = (1400, 200_000)
"""Grains and fines of the case `specimen`."""
SIZED = ("tiled", "walled", "spheres")
"""Cases that come in several sizes."""
OWN_LIMIT, LARGEST_LIMIT = 5, 10
"""Limits of fdnet's own processes over those of the peers, and of its largest size."""
Row = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What is measured.

    Attributes:
        sizes: numbers of grains.
        fines: fines for each grain.
        largest: another size, without fines and by fdnet alone; None for none.
        limit: CPU seconds that a process of a peer may take.
        truth: folder of the packs of known permeability.
        openpnm_python: a Python that has OpenPNM; None without one.
    """

    sizes: Sequence[int]
    fines: float
    largest: int | None
    limit: float
    truth: Path = DATA
    openpnm_python: str | None = None


def child(command: list[str], limit: float, **settings: str) -> Row:
    """The RESULT line of a child process, and its `status`: "ok" or how it ended.

    The limit is in CPU seconds, so that waiting on a busy machine does not count; ten times the
    limit by the clock ends the process too. `settings` are added to its environment.
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
            env={**os.environ, **ONE_CORE, **settings},
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
    last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
    return {"status": f"exit {done.returncode}: {last[:80]}"}


def fdnet_rows(grains: int, fines: int, folder: Path, limit: float) -> list[Row]:
    """One row for each step of fdnet; spheres and network go to `folder` for the others."""
    program = [sys.executable, str(HERE / "steps.py"), str(grains), str(fines), str(folder)]
    result = child(program, limit)
    common = {
        "tool": "fdnet",
        "case": "tiled",
        "grains": result.get("grains", grains),
        "fines": fines,
        "status": result["status"],
        "pores": result.get("pores"),
    }
    steps = result.get("steps", {"total": {}})
    rows = [common | {"step": step} | values for step, values in steps.items()]
    walled = {"case": "walled", "fines": 0, "pores": None}
    return rows + [
        common | walled | {"step": step} | values
        for step, values in result.get("walled", {}).items()
    ]


def openpnm_rows(python: str, folder: Path, base: Row, limit: float) -> list[Row]:
    """OpenPNM on the networks of fdnet by Pardiso and by conjugate gradients."""
    rows = []
    for state, step in STATES.items():
        file = folder / f"{state}.npz"
        expected = json.loads((folder / "inflow.json").read_text())[state]
        for solver in ("direct", "cg"):
            result = child([python, str(HERE / "openpnm_peer.py"), str(file), solver], limit)
            row = base | {"tool": f"OpenPNM {solver}", "step": step}
            if "inflow" in result:
                result["flux_difference"] = (
                    abs(result["inflow"] / expected - 1.0) if expected else math.nan
                )
            rows.append(row | {name: value for name, value in result.items() if name in COLUMNS})
    return rows


def yade_row(spheres: Path, sides: str, base: Row, limit: float) -> Row:
    """Yade's flow engine on the spheres; the row holds `k` in mm2 as well."""
    command = ["yade", "-j1", "-n", "-x", str(HERE / "yade_peer.py")]
    result = child(command, limit, BENCHMARK_SPHERES=str(spheres), BENCHMARK_SIDES=sides)
    pores = result.pop("cells", None)
    return base | {"tool": f"Yade {sides}", "step": "total", "pores": pores} | result


def error_rows(
    data: Path, folder: Path, limit: float, *, with_yade: bool, truth: Path
) -> list[Row]:
    """k over the Stokes truth of every pack in the table `truth` with flow along x."""
    rows: list[Row] = []
    for known in (row for row in read_named(truth) if row["axis"] == "x"):
        pack = data / known["file"]
        program = [sys.executable, str(HERE / "steps.py"), "--pack", str(pack), str(folder)]
        result = child(program, limit)
        case = {"case": known["case"]} | {name: result.get(name) for name in ("grains", "fines")}
        own = {name: value for name, value in result.items() if name in (*COLUMNS, "k")}
        new: list[Row] = [{"tool": "fdnet", "step": "error", **case} | own]
        if with_yade and "k" in result:
            spheres = folder / "spheres.npz"
            new.append(yade_row(spheres, "periodic", case, limit) | {"step": "error"})
        for row in new:
            if "k" in row:
                row["k_over_truth"] = row["k"] / float(known["k_mm2"])
        rows += new
    return rows


def set_growth(rows: list[Row]) -> None:
    """Exponent of CPU time against size, by least squares over the sizes from 5000 grains on.

    The size of the case `spheres` is the number of spheres.
    """
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        spheres = (row["grains"] or 0) + (row.get("fines") or 0) * (row["case"] == "spheres")
        if row["case"] in SIZED and row.get("cpu_s") and spheres > 5000:
            groups.setdefault((row["tool"], row["case"], row["step"]), []).append(row)
    for group in groups.values():
        x, y = ([math.log(row[name]) for row in group] for name in ("grains", "cpu_s"))
        spread = sum((a - sum(x) / len(x)) ** 2 for a in x)
        if spread > 0.1:
            slope = sum((a - sum(x) / len(x)) * b for a, b in zip(x, y, strict=True)) / spread
            for row in group:
                row["growth"] = slope


def text_of(value: Any) -> str:
    """A value as it is printed and written."""
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def show(rows: list[Row]) -> None:
    """Prints the rows as a table."""
    for row in rows:
        values = [text_of(row.get(name)) for name in COLUMNS]
        widths = (15, 24, 14, 8, 8, 8, 9, 9, 9, 7, 12, 15, 0)
        print(
            " ".join(f"{value:<{width}}" for value, width in zip(values, widths, strict=True)),
            flush=True,
        )


def find_openpnm(python: str | None) -> str | None:
    """The Python that has OpenPNM, or None, which is printed."""
    test = [python or "", "-c", "import openpnm"]
    if python and not subprocess.run(test, check=False, capture_output=True).returncode:
        return python
    print("OpenPNM: not found, left out (name a Python that has it with --openpnm-python)")
    return None


def find_yade() -> bool:
    """Whether Yade is installed; without it, that is printed."""
    if shutil.which("yade"):
        return True
    print("Yade: not found, left out (Debian: apt install yade)")
    return False


def measure(options: Options) -> list[Row]:
    """All rows, printed as they come."""
    openpnm, with_yade = find_openpnm(options.openpnm_python), find_yade()
    show([dict(zip(COLUMNS, COLUMNS, strict=True))])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = error_rows(
            options.truth, folder, options.limit, with_yade=with_yade, truth=DATA / OWN_TRUTH
        )
        show(rows)
        runs = [(grains, round(grains * options.fines)) for grains in options.sizes]
        runs += [(options.largest, 0)] if options.largest else []
        for grains, fines in [*runs, SPECIMEN]:
            most = LARGEST_LIMIT if grains == options.largest else OWN_LIMIT
            new = fdnet_rows(grains, fines, folder, most * options.limit)
            base = {name: new[0][name] for name in ("case", "grains", "pores")}
            if new[0]["status"] == "ok" and grains in options.sizes:
                if openpnm:
                    new += openpnm_rows(openpnm, folder, base, options.limit)
                for sides in ("periodic", "box") if with_yade else ():
                    new.append(yade_row(folder / "spheres.npz", sides, base, options.limit))
            if grains == SPECIMEN[0]:
                new = [row | {"case": "specimen"} for row in new if row["case"] == "tiled"]
            show(new)
            rows += new
    set_growth(rows)
    return rows


def show_growth(rows: list[Row]) -> None:
    """Prints the exponents of the CPU time."""
    print("\ngrowth exponents of CPU time")
    growths = {(r["tool"], r["case"], r["step"], r["growth"]) for r in rows if r.get("growth")}
    for tool, case, step, growth in sorted(growths):
        print(f"  {tool:<16} {case:<8} {step:<14} {growth:.2f}")


def write_table(rows: list[Row], path: Path) -> None:
    """The rows as CSV."""
    text = [{name: text_of(row.get(name)) for name in COLUMNS} for row in rows]
    write_named(path, text, columns=COLUMNS)
