"""Points that are no invasions: collisions, an undamped pack and falling fines, by closed forms.

They run fdnet's own decks on the real LIGGGHTS, with the contacts of the studies' invasion.
"""

import math
import resource
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fdnet.case.case import Case, InvasionCase, with_fines
from fdnet.case.file import read_case
from fdnet.dem.checkpoint import state_at
from fdnet.dem.deck import (
    contact_variables,
    header_variables,
    number,
    render_text,
    snapshot_of,
    specimen_box,
    wall_variables,
    write_data,
)
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.files import write_text
from fdnet.scales.clock import relaxation_time
from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import Scales, invasion_scales, scales_of
from fdnet.spheres.dump import COLUMNS, read_dump
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Kind, Snapshot, resting
from validation.comparisons import packed, the_binary
from validation.study import FOLDER, Point

TEMPLATES = Path(__file__).with_name("templates")
EXACT = "%d %d " + " ".join(["%.17g"] * 7)
SPEED = 5.0
"""Closing speed of two fines, m/s: about the fluid's velocity in the studies' invasion."""
CONTACT_SPAN = 7.0
"""Time that is observed, in sqrt(m/k) of a fine: approach, contact (pi / sqrt 2), and parting."""
SPAN, SPANS = 1e-5, 300.0
"""Duration of collisions, s, and of the undamped pack, sqrt(m/k): costs are for the same time."""
LOOKS = (1.0, 0.5, 2.0)
"""Times, in tau, at which a falling fine is looked at, as far as `looks` of them are asked for."""
HELD_STEPS = 20
"""Steps for which held drag is held."""


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """The errors of one small system, and its costs."""
    system, value = str(point.settings["system"]), float(point.value)
    folder = work / f"{point.series}-{value:g}-{point.seed}".replace(" ", "_")
    shutil.rmtree(folder, ignore_errors=True)
    before = _child_seconds()
    if system == "collision":
        numbers = collision(folder, stiffness=value, factor=0.1, phase=0.5)
    elif system == "four collisions":
        numbers = _worst_collision(folder, value)
    elif system == "undamped pack":
        numbers = thrown_pack(folder, factor=value, seed=int(point.seed), spans=SPANS)
    else:
        scheme = str(point.settings.get("scheme", "every step"))
        numbers = _fall(folder, scheme, value, int(point.settings.get("looks", 0)))
    return numbers | {"core_s": _child_seconds() - before}


def _child_seconds() -> float:
    """CPU seconds, user and system, of the children this process has waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def slab_case(seed: int, *assignments: str) -> InvasionCase:
    """The studies' invasion with other settings, "key=value"."""
    path = FOLDER / "slab.toml"
    return with_fines(read_case(path, assignments=[f"seed={seed}", *assignments]))


# ---- Closed systems: spheres with a case's contacts, without fluid, gravity or friction.
class Watch(NamedTuple):
    """How long to follow a closed system.

    A step lasts `step` s; `steps` of them are observed at every `every`-th one, and `rest` further
    ones are not.
    """

    step: float
    steps: int
    every: int = 1
    rest: int = 0


def closed_run(
    case: Case, start: Snapshot, density: float, watch: Watch, folder: Path
) -> list[Snapshot]:
    """The spheres at every observation, the start included; walls enclose grains and fines.

    `start` has their velocities, and `density` (kg/m3) is that of all.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path, densities = folder / "closed.data", np.full(len(start), density)
    write_data(path, start, bounds=start.box, density=densities, types=3)
    rows = [
        f"{atom} " + " ".join(number(v) for v in velocity) + " 0.0 0.0 0.0"
        for atom, velocity in zip(start.id, start.velocity, strict=True)
    ]
    write_text(path, path.read_text() + "\nVelocities\n\n" + "\n".join(rows) + "\n")
    walls = [wall | {"group": "all"} for wall in wall_variables(case, "invade", friction=False)]
    own = {
        "skin": number(float(start.radius.min())),
        "contacts": contact_variables(case, scales_of(case), "invade", friction=False),
        "walls": walls,
        "time_step": number(watch.step),
        "steps": watch.steps,
        "every": watch.every,
        "rest": watch.rest,
        "dump_columns": COLUMNS,
        "dump_format": EXACT,
    }
    header = header_variables(case, "invade", [], 1)
    write_text(folder / "in.closed", render_text("closed.in.j2", header | own, folder=TEMPLATES))
    run_deck(folder, "in.closed", Launch(binary=the_binary()))
    return [
        snapshot_of(frame, case, time_s=frame.step * watch.step)
        for frame in read_dump(folder / "motion.dump")
    ]


def collision(folder: Path, *, stiffness: float, factor: float, phase: float) -> dict[str, float]:
    """Errors of one collision of two fines at a stiffness, N/m.

    The step is `factor` sqrt(m/k); the fines meet at `phase` (0 to 1) within a step.
    """
    case = slab_case(1, f"run.stiffness_N_m={stiffness!r}")
    pair = scales_of(case).contacts["fine-fine"].normal_stiffness
    radius, density = case.fines.mean_radius_m, case.fines.density_kg_m3
    mass, zeta = sphere_mass(radius, density), case.fines.damping_ratio
    step, observed = factor * math.sqrt(mass / pair), math.ceil(CONTACT_SPAN / factor)
    rest = max(0, math.ceil(SPAN / step) - observed)
    start = _facing(radius, gap=SPEED * step * (2 + phase))
    states = closed_run(case, start, density, Watch(step, observed, rest=rest), folder)
    pairs = [state.where(state.kind == Kind.FINE) for state in states]
    nearest = min(float(one.position[1, 0] - one.position[0, 0]) for one in pairs)
    leaving = float(pairs[-1].velocity[1, 0] - pairs[-1].velocity[0, 0])
    overlap = 2 * radius - nearest
    return {
        "overlap_over_diameter": overlap / (2 * radius),
        "overlap_error": overlap / deepest_overlap_of(zeta, SPEED, pair, mass / 2) - 1,
        "restitution_error": leaving / SPEED / restitution_of(zeta) - 1,
        "steps": float(observed + rest),
    }


def _facing(radius: float, *, gap: float) -> Snapshot:
    """Two fines on one line that close at `SPEED`; LIGGGHTS needs an atom of type 1, a grain."""
    half, size = 0.5 * (2 * radius + gap), 40 * radius
    middle = 0.5 * size
    place = [[2 * radius] * 3, [middle - half, middle, middle], [middle + half, middle, middle]]
    kinds = np.array([Kind.GRAIN, Kind.FINE, Kind.FINE])
    pair = resting(np.array(place), radius, np.array([[0.0, size]] * 3), kinds)
    velocity = np.array([[0.0, 0, 0], [0.5 * SPEED, 0, 0], [-0.5 * SPEED, 0, 0]])
    return replace(pair, velocity=velocity)


def _worst_collision(folder: Path, factor: float) -> dict[str, float]:
    """Largest errors of four collisions that begin at four places within a step."""
    runs = [
        collision(folder / f"{phase}", stiffness=1e4, factor=factor, phase=phase)
        for phase in (0.125, 0.375, 0.625, 0.875)
    ]
    worst = {
        name: max(abs(run[name]) for run in runs)
        for name in ("overlap_error", "restitution_error")
    }
    return worst | {"steps": runs[0]["steps"]}


def thrown_pack(
    folder: Path, *, factor: float, seed: int, spans: float, damping: float = 0.0
) -> dict[str, float]:
    """A pack at porosity 0.30 between walls, thrown about: E is kinetic and spring energy.

    The step is `factor` sqrt(m/k), the duration `spans` sqrt(m/k). Without damping E stays E0:
    "energy_drift" is the largest |E - E0| / E0, "energy_gain" the largest (E - E0) / E0, and
    "kinetic_left" the last kinetic energy over the first.
    """
    keys = ("grains.count=90", "box.size_mm=[2.0,2.0,2.1]", "grains.motion=mobile")
    case = slab_case(seed, *keys, f"grains.damping_ratio={damping!r}")
    grains = packed(slab_case(seed, *keys[:2]), folder.parent)
    scales, density = scales_of(case), case.grains.density_kg_m3
    mass = sphere_mass(case.grains.mean_radius_m, density)
    time = math.sqrt(mass / scales.contacts["grain-grain"].normal_stiffness)
    speed = 0.01 * case.grains.mean_radius_m / time
    thrown = np.random.default_rng([seed, 3]).normal(0.0, speed, (len(grains), 3))
    steps = math.ceil(spans / factor)
    watch = Watch(factor * time, steps, every=max(1, steps // 200))
    states = closed_run(case, replace(grains, velocity=thrown), density, watch, folder)
    kinetic = np.array([kinetic_energy(state, density) for state in states])
    total = kinetic + [spring_energy(state, scales) for state in states]
    drift = total / total[0] - 1
    return {
        "energy_drift": float(np.max(np.abs(drift))),
        "energy_gain": float(np.max(drift)),
        "kinetic_left": float(kinetic[-1] / kinetic[0]),
        "steps": float(steps),
    }


def kinetic_energy(spheres: Snapshot, density: float) -> float:
    """Sum of m v^2 / 2, J; frictionless spheres do not spin."""
    mass = 4 / 3 * np.pi * spheres.radius**3 * density
    return float(0.5 * np.sum(mass * np.sum(spheres.velocity**2, axis=1)))


def spring_energy(spheres: Snapshot, scales: Scales) -> float:
    """Sum of k delta^2 / 2, J, over grains in contact with each other or with one of six walls."""
    assert np.all(spheres.kind == Kind.GRAIN)
    _, overlap = touching_pairs(spheres, (False, False, False))
    below = spheres.radius[:, None] - (spheres.position - spheres.box[:, 0])
    above = spheres.radius[:, None] - (spheres.box[:, 1] - spheres.position)
    at_walls = np.sum(np.maximum(below, 0.0) ** 2) + np.sum(np.maximum(above, 0.0) ** 2)
    between = scales.contacts["grain-grain"].normal_stiffness * np.sum(overlap**2)
    return float(0.5 * (between + scales.contacts["grain-wall"].normal_stiffness * at_walls))


def restitution_of(damping_ratio: float) -> float:
    """Coefficient of restitution of a damped linear contact that ends at zero force.

    exp(-z/s (pi - atan2(2 s z, 1 - 2 z^2))) with s^2 = 1 - z^2, for a damping ratio z below
    1/sqrt(2) (Schwager and Poeschel 2007, eq. 20).
    """
    z, s = damping_ratio, math.sqrt(1 - damping_ratio**2)
    return math.exp(-z / s * (math.pi - math.atan2(2 * z * s, 1 - 2 * z**2)))


def deepest_overlap_of(damping_ratio: float, speed: float, stiffness: float, mass: float) -> float:
    """Largest overlap of that contact, m: v / w exp(-z/s atan(s/z)) with w = sqrt(k/m).

    Without damping it is v / w. `speed` in m/s, `stiffness` in N/m, `mass` in kg.
    """
    frequency = math.sqrt(stiffness / mass)
    if damping_ratio == 0:
        return speed / frequency
    s = math.sqrt(1 - damping_ratio**2)
    return speed / frequency * math.exp(-damping_ratio / s * math.atan2(s, damping_ratio))


# ---- A free fine that falls.
def _fall(folder: Path, scheme: str, interval: float, looks: int) -> dict[str, float]:
    """Largest error of a falling fine; each of `looks` ends a run of its own, "steps" of drag."""
    keys = ["drag.refresh_steps=1" if scheme == "every step" else f"drag.scheme={scheme}"]
    if not looks:
        error, steps = _fallen(folder, *keys, over_tau=interval, spans=3.0, chunk=0.25)
        return {"relaxation_error": error, "steps": steps}
    counts = {max(least, round(time / interval)) for least, time in enumerate(LOOKS[:looks], 1)}
    errors = [
        _fallen(
            folder / f"{n}",
            *keys,
            over_tau=interval,
            spans=n * interval,
            chunk=1.001 * n * interval,
        )[0]
        for n in sorted(counts)
    ]
    return {"relaxation_error": max(errors), "steps": 3.0 / interval}


def _fallen(
    folder: Path, *keys: str, over_tau: float, spans: float, chunk: float
) -> tuple[float, float]:
    """Largest error of the velocity of one free fine, over its terminal velocity v_T, and steps.

    The exact velocity is v_T (1 - exp(-t / tau)) with the relaxation time tau (Stokes 1851). The
    step is `over_tau` tau, or a twentieth of it where drag is held so long. The duration is
    `spans` tau, and the fine is looked at after every `chunk` tau.
    """
    radius, density, viscosity = 0.05e-3, 2146.0, 0.05
    tau = relaxation_time(radius, density, viscosity)
    held = "drag.scheme=held" in keys
    step = over_tau * tau / (HELD_STEPS if held else 1)
    stiffness = sphere_mass(radius, density) * (0.1 / step) ** 2
    gravity = -0.005 / tau
    case = slab_case(
        1,
        "fines.count=1",
        "fluid.velocity_m_s=1e-6",
        "gravity.mode=on",
        "gravity.buoyancy=false",
        f"gravity.acceleration_m_s2=[0.0,0.0,{gravity!r}]",
        f"run.stiffness_N_m={stiffness!r}",
        f"run.time_step_s={step!r}",
        f"run.duration_ms={1e3 * spans * tau!r}",
        f"run.checkpoint_ms={1e3 * chunk * tau!r}",
        *([f"drag.refresh_steps={HELD_STEPS}"] if held else []),
        *keys,
    )
    scales, terminal = invasion_scales(case), gravity * tau
    far = resting(np.array([[3.5e-3, 1.4e-3, 1.4e-3]]), 2.5e-4, specimen_box(case), Kind.GRAIN)
    history = invade(case, scales, far, folder, Launch(binary=the_binary())).history
    errors = []
    for row in history:
        velocity = state_at(folder, row, case, scales, far).fines().velocity[0, 2]
        exact = terminal * (1 - math.exp(-row.step * scales.time_step / tau))
        errors.append(abs(velocity - exact) / abs(terminal))
    return max(errors), float(history[-1].step)
