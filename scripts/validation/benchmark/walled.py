"""Time and peak memory against size, of fdnet and of Yade on the same spheres, in one run.

The case `walled` are the equal grains of `network` in a box of walls that hold the fluid. The case
`spheres` is the network of all spheres, grains and fines alike (the law `all-spheres`): pack H
with 1083 fines of a fifth of the radius, tiled in the same way; y and z are periodic in fdnet.
Yade meshes the same spheres in a box of walls. Every size and tool has a process of its own.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from validation.benchmark.network import (
    COLUMNS,
    HERE,
    Row,
    child,
    find_yade,
    set_growth,
    show,
    yade_row,
)

TOTALS = {"walled": "total intact", "spheres": "total spheres"}


def own_rows(case: str, wanted: int, folder: Path, limit: float) -> list[Row]:
    """One row for each step of fdnet on some `wanted` spheres, which go to `folder`."""
    program = [sys.executable, str(HERE / "steps.py"), f"--{case}", str(wanted), str(folder)]
    result = child(program, limit)
    counts = {name: result.get(name) for name in ("grains", "fines", "pores")}
    common = {"tool": "fdnet", "case": case, "status": result["status"], **counts}
    steps = result.get("steps", {TOTALS[case]: {}})
    return [common | {"step": step} | values for step, values in steps.items()]


def measure_walled(
    sizes: Sequence[int], spheres: Sequence[int], *, limit: float, peer_up_to: int
) -> list[Row]:
    """The rows of both cases at these numbers of spheres, printed as they come.

    A process may take `limit` CPU seconds. Yade is run on up to `peer_up_to` spheres.
    """
    with_yade = find_yade()
    show([dict(zip(COLUMNS, COLUMNS, strict=True))])
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        jobs = [("walled", size) for size in sizes] + [("spheres", size) for size in spheres]
        for case, size in jobs:
            new = own_rows(case, size, folder, limit)
            base = {key: new[0][key] for key in ("case", "grains", "fines")}
            if with_yade and new[0]["status"] == "ok" and size <= peer_up_to:
                new.append(yade_row(folder / "spheres.npz", "box", base, limit))
            show(new)
            rows += new
    set_growth(rows)
    return rows
