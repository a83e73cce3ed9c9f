"""Two fines that collide head on, and a pack in motion without damping.

They show what a contact stiffness and a time step cost in accuracy.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind, Snapshot, resting
from validation.dem.closed import (
    Watch,
    closed_run,
    deepest_overlap_of,
    kinetic_energy,
    momentum,
    restitution_of,
    spring_energy,
)
from validation.dem.runs import child_core_seconds, grains_of, slab_case

SPEED = 5.0
"""Closing speed of the two fines, m/s: about the fluid's velocity in the studies' invasion."""
_CONTACT_SPAN = 7.0
"""Time that is observed, in sqrt(m/k) of a fine: approach, contact (pi / sqrt 2), and parting."""


def collision_run(
    work: Path, slug: str, *, stiffness: float, factor: float, phase: float, span: float
) -> dict[str, float]:
    """One collision, observed after every step, against the closed forms.

    Args:
        work: folder of the runs.
        slug: name of this run's folder.
        stiffness: of the contact, N/m.
        factor: time step over sqrt(m/k) of the fine.
        phase: where within a step the fines meet, 0 to 1.
        span: duration of the run, s, so that all costs are for the same duration.

    Returns:
        Overlap over the diameter, restitution, relative errors of both, momentum, costs.
    """
    case = slab_case(1, f"run.stiffness_N_m={stiffness!r}")
    contact = scales_of(case).contacts["fine-fine"]
    radius, density = case.fines.mean_radius_m, case.fines.density_kg_m3
    mass, zeta = sphere_mass(radius, density), case.fines.damping_ratio
    step = factor * math.sqrt(mass / contact.normal_stiffness)
    start = _facing(radius, gap=SPEED * step * (2 + phase))
    before = child_core_seconds()
    observed = math.ceil(_CONTACT_SPAN / factor)
    watch = Watch(step=step, steps=observed, rest=max(0, math.ceil(span / step) - observed))
    states = closed_run(case, start, density, watch, work / slug)
    core = child_core_seconds() - before
    pairs = [state.where(state.kind == Kind.FINE) for state in states]
    apart = np.array([pair.position[1, 0] - pair.position[0, 0] for pair in pairs])
    leaving = float(pairs[-1].velocity[1, 0] - pairs[-1].velocity[0, 0])
    deepest = deepest_overlap_of(zeta, SPEED, contact.normal_stiffness, mass / 2)
    overlap = float(2 * radius - apart.min())
    return {
        "overlap_over_diameter": overlap / (2 * radius),
        "overlap_error": overlap / deepest - 1,
        "restitution": leaving / SPEED,
        "restitution_error": leaving / SPEED / restitution_of(zeta) - 1,
        "momentum_error": float(np.max(np.abs(momentum(pairs[-1], density)))) / (mass * SPEED),
        "steps": float(watch.steps + watch.rest),
        "core_s": core,
    }


def _facing(radius: float, *, gap: float) -> Snapshot:
    """Two fines on one line that close at `SPEED`, and a grain elsewhere.

    LIGGGHTS needs an atom of type 1, hence the grain.
    """
    half, size = 0.5 * (2 * radius + gap), 40 * radius
    middle = 0.5 * size
    place = np.array(
        [[2 * radius] * 3, [middle - half, middle, middle], [middle + half, middle, middle]]
    )
    pair = resting(
        place, radius, np.array([[0.0, size]] * 3), np.array([Kind.GRAIN, Kind.FINE, Kind.FINE])
    )
    return replace(
        pair, velocity=np.array([[0.0, 0, 0], [0.5 * SPEED, 0, 0], [-0.5 * SPEED, 0, 0]])
    )


def energy_run(
    work: Path, slug: str, *, factor: float, seed: int, spans: float, damping: float = 0.0
) -> dict[str, float]:
    """A pack at porosity 0.30 between walls, its grains with random velocities.

    E is the sum of kinetic and spring energy; without damping it should stay E0.

    Args:
        work: folder of the runs.
        slug: name of this run's folder.
        factor: time step over sqrt(m/k) of a grain.
        seed: of the velocities.
        spans: duration of the run, sqrt(m/k).
        damping: ratio of damping in all contacts.

    Returns:
        "energy_drift", the largest |E - E0| / E0; "energy_gain", the largest (E - E0) / E0;
        "kinetic_left", the last kinetic energy over the first; costs.
    """
    pack = ("grains.count=90", "box.size_mm=[2.0,2.0,2.1]")
    damped = f"grains.damping_ratio={damping!r}"
    case = slab_case(seed, *pack, damped, "grains.motion=mobile")
    grains = grains_of(slab_case(seed, *pack), work)
    scales, density = scales_of(case), case.grains.density_kg_m3
    mass = sphere_mass(case.grains.mean_radius_m, density)
    time = math.sqrt(mass / scales.contacts["grain-grain"].normal_stiffness)
    speed = 0.01 * case.grains.mean_radius_m / time
    thrown = np.random.default_rng([seed, 3]).normal(0.0, speed, (len(grains), 3))
    start = replace(grains, velocity=thrown)
    steps = math.ceil(spans / factor)
    watch = Watch(step=factor * time, steps=steps, every=max(1, steps // 200))
    before = child_core_seconds()
    states = closed_run(case, start, density, watch, work / slug)
    core = child_core_seconds() - before
    energy = np.array(
        [kinetic_energy(state, density) + spring_energy(state, scales) for state in states]
    )
    drift = energy / energy[0] - 1
    return {
        "energy_drift": float(np.max(np.abs(drift))),
        "energy_gain": float(np.max(drift)),
        "kinetic_left": kinetic_energy(states[-1], density) / kinetic_energy(states[0], density),
        "steps": float(steps),
        "core_s": core,
    }
