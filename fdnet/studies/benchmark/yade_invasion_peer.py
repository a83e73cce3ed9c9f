"""A program to run inside Yade (`yade -j1 -n -x`): an invasion in its pore-scale flow engine.

`fdnet.studies.benchmark.yade_invasion` runs it. The environment names the job (INVASION_JOB, an
.npz file of `yade_exchange`) and the answer (INVASION_ANSWER, another one). A job without steps is
a permeability: the flow through its spheres as they stand. A job ends after its steps or after its
CPU seconds, whichever comes first. Making the bodies is part of the time.

The fluid is incompressible. Its conductances are not clamped to multiples of their mean, which is
Yade's default: in a box of walls that mean is so large that the clamp lets 4 to 46 times as much
through. Walls slip, as is Yade's default: with fdnet's small specimen that gives 1.04 times the
permeability of fdnet's walls that hold the fluid, and Yade's walls that hold it 0.56 times.
"""

import math
import os
import resource
import time
from typing import Any

import numpy as np
from yade import (
    Bo1_Box_Aabb,
    Bo1_Sphere_Aabb,
    FlowEngine,
    ForceResetter,
    Ig2_Box_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_ViscElMat_ViscElMat_ViscElPhys,
    Law2_ScGeom_ViscElPhys_Basic,
    NewtonIntegrator,
    O,
    Vector3,
    ViscElMat,
)
from yade.utils import aabbWalls, sphere

GRAIN, FINE, WALL = 0, 1, 2
Job = dict[str, Any]
"""Arrays and numbers by name, as `yade_exchange.Job` has them."""
Row = tuple[float, ...]
"""A row of the history, as `yade_exchange.HISTORY` has it."""
FIXED, MOVING = 3, 1
"""Groups: two bodies of the group FIXED do not touch, all others do."""


def make_bodies(job: Job) -> tuple[list[int], list[int]]:
    """Six walls and all spheres; returns the ids of the walls and of the fines."""
    for stiffness, shear, damping, friction, density in job["materials"]:
        O.materials.append(
            ViscElMat(
                kn=stiffness,
                ks=shear,
                cn=damping,
                cs=0.0,
                frictionAngle=math.atan(friction),
                density=density,
            )
        )
    low, high = job["box"].T
    walls = O.bodies.append(
        aabbWalls([Vector3(*low), Vector3(*high)], thickness=0, oversizeFactor=1.5, material=WALL)
    )
    first = len(O.bodies)
    for place, radius, kind in zip(job["position"], job["radius"], job["kind"], strict=True):
        fine = kind == FINE
        O.bodies.append(
            sphere(
                Vector3(*place),
                radius,
                material=int(kind),
                fixed=not fine,
                mask=MOVING if fine else FIXED,
            )
        )
    for wall in walls:
        O.bodies[wall].mask = FIXED
    fines = [first + int(number) for number in np.flatnonzero(job["kind"] == FINE)]
    for body in fines:
        O.bodies[body].state.vel = Vector3(float(job["start_velocity"]), 0, 0)
    return walls, fines


def flow_between(walls: list[int], job: Job) -> Any:
    """The flow engine with its pressure drop along x; it meshes anew only when asked."""
    return FlowEngine(
        useSolver=3,  # CHOLMOD
        defTolerance=-1,
        meshUpdateInterval=1_000_000_000,
        permeabilityFactor=1,
        viscosity=float(job["viscosity"]),
        fluidBulkModulus=0.0,
        clampKValues=False,
        slipBoundary=True,
        wallIds=walls,
        boundaryUseMaxMin=[0] * 6,
        bndCondIsPressure=[1, 1, 0, 0, 0, 0],
        bndCondValue=[float(job["pressure"]), 0, 0, 0, 0, 0],
        numSolveThreads=1,
        numFactorizeThreads=1,
    )


def engines(flow: Any) -> list[Any]:
    """One step: contacts, flow, motion."""
    return [
        ForceResetter(),
        InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Box_Aabb()], avoidSelfInteractionMask=2),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(), Ig2_Box_Sphere_ScGeom()],
            [Ip2_ViscElMat_ViscElMat_ViscElPhys()],
            [Law2_ScGeom_ViscElPhys_Basic()],
        ),
        flow,
        NewtonIntegrator(damping=0.0, gravity=Vector3(0, 0, 0)),
    ]


def deepest(fines: list[int]) -> float:
    """Largest overlap of a fine with anything, over its diameter."""
    radius = {body: O.bodies[body].shape.radius for body in fines}
    depth = 0.0
    for contact in O.interactions:
        if contact.isReal:
            own = [radius[body] for body in (contact.id1, contact.id2) if body in radius]
            if own:
                depth = max(depth, contact.geom.penetrationDepth / (2 * min(own)))
    return depth


def places(fines: list[int]) -> Any:
    """Centres (F, 3) of the fines, m."""
    return np.array([O.bodies[body].state.pos for body in fines]).reshape(-1, 3)


def write_answer(
    history: list[Row], fines: list[int], walls: list[int], flow: Any, clock: tuple[float, float]
) -> None:
    """The state and what it cost so far, whole or not at all."""
    path = os.environ["INVASION_ANSWER"]
    with open(path + ".part", "wb") as file:
        np.savez(
            file,
            history=np.array(history),
            position=places(fines),
            cells=flow.nCells(),
            inflow=abs(flow.getBoundaryFlux(walls[0])),
            outflow=abs(flow.getBoundaryFlux(walls[1])),
            cpu_s=time.process_time() - clock[0],
            wall_s=time.perf_counter() - clock[1],
            peak_MB=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        )
    os.replace(path + ".part", path)


def row_now(
    job: Job, fines: list[int], walls: list[int], flow: Any, clock: tuple[float, float]
) -> Row:
    """The row of the history at this step."""
    depth = places(fines)[:, 0]
    return (
        O.iter,
        abs(flow.getBoundaryFlux(walls[1])),
        float(np.sum((depth >= 0) & (depth < job["length"]))),
        float(np.sum(depth >= job["length"])),
        deepest(fines),
        flow.nCells(),
        time.process_time() - clock[0],
    )


def run(job: Job) -> None:
    """Runs the job; the answer is written ten times on the way and at the end."""
    clock = time.process_time(), time.perf_counter()
    walls, fines = make_bodies(job)
    flow = flow_between(walls, job)
    O.engines, O.dt = engines(flow), float(job["time_step"])
    steps, interval = int(job["steps"]), int(job["mesh_steps"])
    history: list[Row] = []
    O.run(1, True)
    while True:
        history.append(row_now(job, fines, walls, flow, clock))
        lost = not np.all(np.isfinite(places(fines)))
        ended = steps <= O.iter or history[-1][-1] > float(job["limit_s"]) or lost
        if ended or len(history) % max(steps // interval // 10, 1) == 0:
            write_answer(history, fines, walls, flow, clock)
        if ended:
            break
        flow.updateTriangulation = True
        O.run(min(interval, steps - O.iter), True)


if __name__ == "__main__":
    run(dict(np.load(os.environ["INVASION_JOB"])))
    os._exit(0)
