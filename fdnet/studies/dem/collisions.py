"""Two fines head on, and a shaken pack without damping: what a contact stiffness and a time step cost in accuracy."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdnet.scales.scales import scales_of
from fdnet.scales.springs import sphere_mass
from fdnet.spheres.snapshot import Kind, Snapshot, resting
from fdnet.studies.dem.closed import (
    Watch,
    closed_run,
    deepest_overlap_of,
    kinetic_energy,
    momentum,
    restitution_of,
    spring_energy,
)
from fdnet.studies.dem.runs import grains_of, slab_case
from fdnet.studies.engine.runner import child_core_seconds

SPEED = 5.0
"""Closing speed of the two fines, m/s: about the fluid's velocity in the studies' invasion."""


_CONTACT_SPAN = 7.0
"""Steps observed, in units of sqrt(m/k) of a fine: two steps' approach, contact (pi / sqrt 2 of it) and parting."""


def collision_run(
    work: Path, slug: str, *, stiffness: float, factor: float, phase: float, span: float
) -> dict[str, float]:
    """One collision, observed after every step: errors against the closed forms, overlap over diameter, momentum.

    `factor` is the step over sqrt(m/k) of the fine, `phase` (0 to 1) where within a step the fines meet, `span` the
    time the run goes on in all, s, so that its cost is one of equal time. "overlap_error" and "restitution_error" are
    relative to their exact values.
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
    """Two fines on one line closing at SPEED, and a grain out of their way, since LIGGGHTS wants an atom of type 1."""
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
    work: Path, slug: str, *, factor: float, seed: int, spans: float
) -> dict[str, float]:
    """A pack at porosity 0.30 without damping, between walls, its grains thrown at random: the worst drift of energy.

    `factor` is the step over sqrt(m/k) of a grain; it is followed for `spans` sqrt(m/k). "energy_drift" is the largest
    |E - E0| / E0 seen, "energy_gain" the largest (E - E0) / E0, E being kinetic plus spring energy.
    """
    pack = ("grains.count=90", "box.size_mm=[2.0,2.0,2.1]")
    case = slab_case(seed, *pack, "grains.damping_ratio=0.0", "grains.motion=mobile")
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
        "steps": float(steps),
        "core_s": core,
    }
