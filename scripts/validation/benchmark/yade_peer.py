"""A program to run inside Yade (`yade -j1 -n -x`): its pore-scale flow engine on given spheres.

`validation.benchmark.network` runs it. The environment names the spheres (BENCHMARK_SPHERES, an
.npz file) and the boundary (BENCHMARK_SIDES, periodic or box). It prints one line `RESULT {json}`:
seconds (CPU, wall) of the first step (tessellation, conductances, factorisation and solve), k,
cells, peak memory. Making the bodies is not part of the time.
"""

import json
import os
import resource
import time

import numpy as np
from yade import FlowEngine, ForceResetter, FrictMat, Matrix3, O, PeriodicFlowEngine, Vector3
from yade.utils import aabbWalls, sphere

COMMON = {
    "useSolver": 3,  # CHOLMOD
    "defTolerance": -1,
    "meshUpdateInterval": 1_000_000,
    "permeabilityFactor": 1,
    "viscosity": 1,
    "fluidBulkModulus": 0.0,
    "numSolveThreads": 1,
    "numFactorizeThreads": 1,
}
data = np.load(os.environ["BENCHMARK_SPHERES"])
size, radius = data["size"], data["radius"]
O.materials.append(FrictMat())
if os.environ["BENCHMARK_SIDES"] == "periodic":
    O.periodic = True
    O.cell.hSize = Matrix3(size[0], 0, 0, 0, size[1], 0, 0, 0, size[2])
    # spheres nearer than this to a side are copied across;
    # less than two diameters breaks its periodicity
    reach = 4.0 * float(radius.max())
    sides = {
        "wallIds": [-1] * 6,
        "bndCondIsPressure": [0] * 6,
        "duplicateThreshold": reach,
        "gradP": Vector3(1, 0, 0),
    }
    flow = PeriodicFlowEngine(**COMMON, **sides)
else:
    walls = O.bodies.append(
        aabbWalls([Vector3(0, 0, 0), Vector3(*size)], thickness=0, oversizeFactor=1.5)
    )
    sides = {
        "wallIds": walls,
        "bndCondIsPressure": [1, 1, 0, 0, 0, 0],
        "bndCondValue": [1, 0, 0, 0, 0, 0],
    }
    flow = FlowEngine(boundaryUseMaxMin=[0] * 6, **COMMON, **sides)
for place, r in zip(data["position"], radius, strict=True):
    O.bodies.append(sphere(Vector3(*place), r))
O.engines = [ForceResetter(), flow]
O.dt = 1e-9
cpu, wall = time.process_time(), time.perf_counter()
O.step()
seconds = {"cpu_s": time.process_time() - cpu, "wall_s": time.perf_counter() - wall}
if O.periodic:
    k = abs(flow.averageVelocity()[0])
else:
    k = abs(flow.getBoundaryFlux(walls[0])) * size[0] / (size[1] * size[2])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(
    "RESULT", json.dumps({**seconds, "k": k, "cells": flow.nCells(), "peak_MB": peak}), flush=True
)
os._exit(0)
