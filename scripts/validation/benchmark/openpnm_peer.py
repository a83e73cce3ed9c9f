"""A program for a Python that has OpenPNM: it solves a network of given conductances there.

    python openpnm_peer.py NETWORK.npz {direct|cg}

`validation.benchmark.network` runs it. It prints one line `RESULT {json}`: seconds (CPU, wall),
inflow, peak memory. Building the network is part of the time.
"""

import json
import resource
import sys
import time

import numpy as np
import openpnm


def solve(data: dict[str, np.ndarray], solver: object) -> float:
    """Inflow for a pressure of 1 on the inlet pores and 0 on the outlet pores."""
    network = openpnm.network.Network(conns=data["pairs"], coords=data["position"])
    phase = openpnm.phase.Phase(network=network)
    phase["throat.hydraulic_conductance"] = data["conductance"]
    flow = openpnm.algorithms.StokesFlow(network=network, phase=phase)
    flow.set_value_BC(pores=np.flatnonzero(data["inlet"]), values=1.0)
    flow.set_value_BC(pores=np.flatnonzero(data["outlet"]), values=0.0)
    flow.run(solver=solver)
    pressure, pairs = flow["pore.pressure"], data["pairs"]
    flux = data["conductance"] * (pressure[pairs[:, 0]] - pressure[pairs[:, 1]])
    inlet = data["inlet"][pairs]
    return float(
        np.sum(flux[inlet[:, 0] & ~inlet[:, 1]]) - np.sum(flux[inlet[:, 1] & ~inlet[:, 0]])
    )


def main() -> None:
    """Solves the network of the command line."""
    data = dict(np.load(sys.argv[1]))
    solver = (
        openpnm.solvers.ScipyCG(tol=1e-10)
        if sys.argv[2] == "cg"
        else openpnm.solvers.PardisoSpsolve()
    )
    cpu, wall = time.process_time(), time.perf_counter()
    inflow = solve(data, solver)
    result = {
        "cpu_s": time.process_time() - cpu,
        "wall_s": time.perf_counter() - wall,
        "inflow": inflow,
        "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    print("RESULT", json.dumps(result))


if __name__ == "__main__":
    main()
