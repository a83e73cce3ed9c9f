"""What fdnet and Yade hand each other: an invasion as a job, and the state that it ends in.

Both are .npz files, since Yade's Python has numpy but not fdnet. A job holds the spheres at the
start, the constants of their contacts and the fluid, in SI units.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.supply import place_fines
from fdnet.errors import CaseError
from fdnet.files.atomic import replacing
from fdnet.run.finished import FinishedRun
from fdnet.scales.scales import InvasionScales, scales_of
from fdnet.scales.springs import Contact, sphere_mass
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting

GRAIN, FINE = 0, 1
"""Kinds of a job's spheres, which are the numbers of their materials; walls are the third."""
ROOM = 1.2
"""Length behind the specimen, over what the fluid upstream travels in the whole run, so that no
fine gets to the wall there."""
HISTORY = ("step", "rate_m3_s", "invaded", "passed", "overlap", "cells", "cpu_s")
"""Columns of the history that comes back."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """What Yade is given.

    Attributes:
        position: (N, 3) centres of grains and fines, m.
        radius: (N,) m.
        kind: (N,) `GRAIN`, which is fixed, or `FINE`.
        materials: (3, 5) of grains, fines and walls: normal and shear stiffness, N/m, damping,
            kg/s, and friction, such that two in series are the contact, and density, kg/m3.
        box: (3, 2) where the six walls stand, m.
        length: of the specimen along x, m.
        pressure: drop along x, Pa.
        viscosity: Pa s.
        start_velocity: of the fines along x, m/s.
        time_step: s.
        steps: number of steps; 0 for the flow through the spheres as they stand.
        mesh_steps: steps between two meshes.
        limit_s: CPU seconds after which the job ends where it is.
    """

    position: Array
    radius: Array
    kind: Array
    materials: Array
    box: Array
    length: float
    pressure: float
    viscosity: float
    start_velocity: float
    time_step: float
    steps: int
    mesh_steps: int
    limit_s: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answer:
    """What Yade gives back.

    Attributes:
        history: (H, 7) rows with the columns `HISTORY`; the cells are those of the mesh.
        position: (F, 3) centres of the fines, m, in the order of the job.
        cells: of the last mesh.
        inflow: m3/s, through the wall upstream.
        outflow: m3/s, through the wall downstream.
        cpu_s: CPU seconds.
        wall_s: seconds by the clock.
        peak_MB: memory.
    """

    history: Array
    position: Array
    cells: int
    inflow: float
    outflow: float
    cpu_s: float
    wall_s: float
    peak_MB: float

    @property
    def steps(self) -> int:
        """Steps that were done."""
        return int(self.history[-1, 0])


def invasion_job(run: FinishedRun, *, limit_s: float, travel: float = 0.5) -> Job:
    """The invasion of a run, as Yade is to do it.

    Args:
        run: a flow-driven invasion between walls, its fines there from the start.
        limit_s: CPU seconds that Yade may take.
        travel: way of the undisturbed fluid between two meshes, in diameters of the smallest fine.

    Raises:
        CaseError: the run is none that Yade's flow engine can repeat.
    """
    case = checked_case(run)
    scales = scales_of(case)
    grains = run.spheres("initial")
    fines = place_fines(case, scales, grains)
    spheres = grains.joined(fines)
    record = run.manifest["invade"]
    way = travel * 2 * case.fines.radius_range_m[0]
    duration = record["steps"] * record["dt_s"]
    return Job(
        position=spheres.position,
        radius=spheres.radius,
        kind=np.where(spheres.kind == Kind.FINE, FINE, GRAIN),
        materials=materials_of(case, scales.contacts),
        box=_walls(case, scales, fines, duration),
        length=case.size_m[0],
        pressure=pressure_of(run, case),
        viscosity=case.fluid.viscosity_Pa_s,
        start_velocity=scales.upstream_velocity,
        time_step=record["dt_s"],
        steps=record["steps"],
        mesh_steps=max(round(way / (scales.drive_velocity * record["dt_s"])), 1),
        limit_s=limit_s,
    )


def checked_case(run: FinishedRun) -> InvasionCase:
    """The case of a run that Yade's flow engine can repeat.

    Raises:
        CaseError: one of its keys has no counterpart there; the message names it.
    """
    case = run.case
    if not isinstance(case, InvasionCase):
        raise CaseError(f"{run.path}: a run without fines; give the folder of an invasion")
    wanted = {
        "drag.field": (case.drag.field, "network"),
        "drag.drive": (case.drag.drive or "pressure", "pressure"),
        "box.sides": (case.box.sides, "walls"),
        "grains.motion": (case.grains.motion, "fixed"),
        "fines.supply": (case.fines.supply, "slab"),
        "contact.model": (case.contact.model, "hooke"),
    }
    for key, (value, other) in wanted.items():
        if value != other:
            raise CaseError(
                f"{run.path}: {key} = {value!r}, expected {other!r}, since Yade's flow engine is "
                f"given a box of walls, fixed grains, a pressure drop and all fines from the "
                f"start; run the case again with --set {key}={other}"
            )
    return case


def materials_of(case: InvasionCase, contacts: dict[str, Contact]) -> Array:
    """(3, 5) constants of grains, fines and walls whose pairs in series are fdnet's contacts.

    In series two constants a and b make a b / (a + b), so two fines have half of a fine's.

    Raises:
        CaseError: no constants of grains or walls make the contacts.
    """
    fine = case.fines.density_kg_m3
    mass = sphere_mass(case.fines.radius_range_m[0], fine)
    pairs = [contacts[name] for name in ("grain-fine", "fine-fine", "fine-wall")]
    masses = (mass, 0.5 * mass, mass)
    own = [
        (one.normal_stiffness, one.shear_stiffness, one.damping_rate * inertia)
        for one, inertia in zip(pairs, masses, strict=True)
    ]
    fines = 2 * np.array(own[1])
    others = []
    for pair, constants in zip((pairs[0], pairs[2]), (own[0], own[2]), strict=True):
        inverse = 1 / np.array(constants) - 1 / fines
        if np.any(inverse <= 0):
            raise CaseError(
                f"contact {pair.pair}: constants {constants} are above those of a fine, {fines}, "
                "in series with anything; expected stiffnesses and damping ratios of grains and "
                "fines that differ less"
            )
        others.append(1 / inverse)
    frictions = (pairs[0].friction, pairs[1].friction, pairs[2].friction)
    densities = (case.grains.density_kg_m3, fine, case.grains.density_kg_m3)
    return np.column_stack([[others[0], fines, others[1]], frictions, densities])


def pressure_of(run: FinishedRun, case: InvasionCase) -> float:
    """Drop of pressure over the intact pack at the start of the run, Pa.

    Raises:
        CaseError: part of the overbalance is lost beyond the specimen, where Yade has nothing.
    """
    if case.fluid.velocity_m_s is None:
        raise CaseError(
            f"{run.path}: fluid.velocity_m_s is not given, so the overbalance is lost beyond the "
            "specimen too; give the velocity, so that the specimen is all there is"
        )
    scales = scales_of(case)
    flux = scales.darcy_velocity
    return flux * case.fluid.viscosity_Pa_s * case.size_m[0] / run.summary["k_initial_m2"]


def _walls(case: InvasionCase, scales: InvasionScales, fines: Snapshot, duration: float) -> Array:
    """(3, 2) a box from just upstream of the fines to beyond what they may reach, m."""
    lowest = float(np.min(fines.position[:, 0] - fines.radius))
    beyond = ROOM * scales.upstream_velocity * duration + case.size_m[0]
    sides = [(0.0, side) for side in case.size_m[1:]]
    return np.array([(lowest - 0.1 * case.fines.radius_range_m[0], beyond), *sides])


def still_job(job: Job, spheres: Snapshot, *, limit_s: float) -> Job:
    """The flow through spheres that stand, by the fluid and pressure of a job.

    Fines count whose bodies reach into the specimen. The planes of pressure stand one grain radius
    off the specimen, so that no sphere lies in them. `limit_s` CPU seconds are allowed.
    """
    reach = (spheres.position[:, 0] + spheres.radius > 0) & (
        spheres.position[:, 0] - spheres.radius < job.length
    )
    kept = spheres.where(reach)
    box = job.box.copy()
    off = float(np.max(job.radius))
    box[0] = -off, job.length + off
    values = {one.name: getattr(job, one.name) for one in fields(Job)}
    values |= {
        "position": kept.position,
        "radius": kept.radius,
        "kind": np.where(kept.kind == Kind.FINE, FINE, GRAIN),
        "box": box,
        "start_velocity": 0.0,
        "steps": 0,
        "limit_s": limit_s,
    }
    return Job(**values)


def write_job(path: Path, job: Job) -> Path:
    """Write a job as .npz, whole or not at all."""
    with replacing(path) as part, part.open("wb") as file:
        np.savez(file, **{one.name: getattr(job, one.name) for one in fields(Job)})
    return path


def read_answer(path: Path) -> Answer:
    """What Yade gave back.

    Raises:
        CaseError: the file is missing or not an answer, or a fine has no place.
    """
    if not path.exists():
        raise CaseError(f"{path}: missing; Yade ended before it wrote a state, see its output")
    with np.load(path) as data:
        lacking = {one.name for one in fields(Answer)} - set(data.files)
        if lacking:
            raise CaseError(f"{path}: lacks {', '.join(sorted(lacking))}; run Yade again")
        arrays = {name: data[name] for name in ("history", "position")}
        numbers = {
            name: data[name].item()
            for name in ("cells", "inflow", "outflow", "cpu_s", "wall_s", "peak_MB")
        }
    if not np.all(np.isfinite(arrays["position"])):
        raise CaseError(f"{path}: a fine has no finite place; Yade's step was unstable")
    return Answer(**arrays, **numbers)


def end_state(job: Job, answer: Answer, box: Array) -> Snapshot:
    """Grains and fines where Yade left them; `box` (3, 2) of the specimen, m."""
    position = np.array(job.position)
    fines = job.kind == FINE
    position[fines] = answer.position
    kind = np.where(fines, Kind.FINE, Kind.GRAIN)
    return resting(position, job.radius, box, kind)
