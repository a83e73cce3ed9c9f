"""What one process of the benchmark measures, by public names alone, so that any version can run.

    benchmark_child.py fdnet SPHERES.npz NETWORK.npz
    benchmark_child.py openpnm NETWORK.npz

Spheres come in m, a few of them first, on which all is compiled and loaded. The network goes to
a file for OpenPNM. It prints a line `RESULT {json}`, the rows of the steps.
"""

import json
import resource
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

Row = dict[str, Any]
KEYS = ("position", "radius", "box", "fine")


def timed(step: str, work: Callable[[], Any]) -> tuple[Row, Any]:
    """CPU and clock seconds of `work` and the peak memory of the process meanwhile; its result."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # Linux forgets the peak so far
    cpu, wall = time.process_time(), time.perf_counter()
    result = work()
    row = {"step": step, "cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall}
    try:
        peak = int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])
    except (OSError, IndexError):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return row | {"peak_MB": peak / 1024}, result


def run_fdnet(data: dict[str, Any], name: str, network_file: Path) -> list[Row]:
    """The steps of the network of the grains, and whole analyses without and with the fines."""
    import fdnet

    place, radius, box, fine = (data[f"{name} {key}"] for key in KEYS)
    kind = np.where(fine, "fine", "grain")
    spheres = fdnet.Snapshot.from_arrays(place, radius, box=box, kind=kind)
    grains, rows = spheres.grains(), list[Row]()
    sides: dict[str, Any] = {"periodic": "yz"}

    def do(step: str, work: Callable[[], Any]) -> Any:
        row, result = timed(step, work)
        rows.append(row)
        return result

    network = do("tessellate", lambda: fdnet.build_network(grains, walls="slip", **sides))
    conductance = do("conductance", partial(fdnet.LAWS["lubrication"], network))
    flow = do("solve", partial(fdnet.solve_flow, network, conductance))
    x, (low, high) = network.pore_position[:, 0], network.box[0]
    near = 1e-9 * (high - low)
    np.savez(
        network_file,
        pairs=network.throat_pores,
        position=network.pore_position,
        conductance=conductance * network.throat_share * 1e9,
        inlet=x <= low + near,
        outlet=x >= high - near,
        inflow=flow.inflow * 1e9,
    )
    network = flow = conductance = None
    do("whole, grains alone", lambda: fdnet.analyse(grains, **sides))
    for law in ("section-archie", "all-spheres"):
        do(f"whole, {law}", partial(fdnet.analyse, spheres, damage_law=law, **sides))
    return rows


def run_openpnm(data: dict[str, Any]) -> list[Row]:
    """OpenPNM on the network of fdnet, by its direct solver and by conjugate gradients."""
    import openpnm

    def solve(solver: Any) -> float:
        network = openpnm.network.Network(conns=data["pairs"], coords=data["position"])
        phase = openpnm.phase.Phase(network=network)
        phase["throat.hydraulic_conductance"] = data["conductance"]
        flow = openpnm.algorithms.StokesFlow(network=network, phase=phase)
        flow.set_value_BC(pores=np.flatnonzero(data["inlet"]), values=1.0)
        flow.set_value_BC(pores=np.flatnonzero(data["outlet"]), values=0.0)
        flow.run(solver=solver)
        drop = flow["pore.pressure"][data["pairs"]]
        first = data["inlet"][data["pairs"]]
        out_of = first[:, 0].astype(int) - first[:, 1].astype(int)
        return float(np.sum(out_of * data["conductance"] * (drop[:, 0] - drop[:, 1])))

    solvers = {"direct": openpnm.solvers.ScipySpsolve()}
    solvers |= {"conjugate gradients": openpnm.solvers.ScipyCG(tol=1e-10)}
    rows = []
    for name, solver in solvers.items():
        row, inflow = timed(f"OpenPNM {name}", partial(solve, solver))
        rows.append(row | {"difference": abs(inflow / float(data["inflow"]) - 1.0)})
    return rows


def main() -> None:
    """Measures what the command line names."""
    tool, file, *more = sys.argv[1:]
    with np.load(file) as stored:
        data = dict(stored)
    rows = run_openpnm(data) if tool == "openpnm" else []
    for name in ("small", "large") if more else ():
        rows = run_fdnet(data, name, Path(more[0]))
    print("RESULT", json.dumps(rows))


if __name__ == "__main__":
    main()
