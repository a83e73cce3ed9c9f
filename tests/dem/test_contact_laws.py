"""Contact laws on the real binary, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import tiny
from cut_and_continue import cell_case, differences

from fdnet.case.case import with_fines
from fdnet.case.file import case_from, read_case
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.scales.contacts import collision_time, overlap_of_impact, pair_elastic
from fdnet.scales.scales import scales_of
from fdnet.spheres.geometry import max_overlap, touching_pairs
from fdnet.spheres.snapshot import Kind, resting
from validation.dem.closed import Watch, closed_run, kinetic_energy, restitution_of
from validation.dem.runs import SLAB, window_run

pytestmark = pytest.mark.liggghts
HERTZ = "contact.model=hertz"
FINE, GRAIN, DENSITY = 5e-5, 2.5e-4, 2146.0
MASS = 4 / 3 * math.pi * FINE**3 * DENSITY
SPEED = 1.0


def thrown(partner: str, damping: float, folder) -> tuple[float, float, float]:
    """A fine thrown at a fine or a side wall: overlap, m, restitution, and duration, s."""
    case = tiny(HERTZ, f"fines.damping_ratio={damping}", f"grains.damping_ratio={damping}")
    step = 0.02 * scales_of(case).contacts[f"fine-{partner}"].step_limit
    size, gap = 2e-3, 2.5 * SPEED * step
    place = [[GRAIN, GRAIN, GRAIN], [size / 2, size / 2, FINE + gap]]
    velocity = [[0.0, 0, 0], [0, 0, -SPEED]]
    if partner == "fine":
        place = [place[0], [size / 2, size / 2, size / 2]]
        place.append([size / 2, size / 2, size / 2 - 2 * FINE - gap])
        velocity = [[0.0, 0, 0], [0, 0, -SPEED / 2], [0, 0, SPEED / 2]]
    kinds = np.array([Kind.GRAIN] + [Kind.FINE] * (len(place) - 1))
    radii = np.where(kinds == Kind.GRAIN, GRAIN, FINE)
    box = np.array([[0.0, size]] * 3)
    start = replace(resting(np.array(place), radii, box, kinds), velocity=np.array(velocity))
    states = closed_run(case, start, DENSITY, Watch(step=step, steps=1500), folder)
    z = np.array([state.fines().position[:, 2] for state in states])
    depth = 2 * FINE - np.abs(z[:, 0] - z[:, 1]) if partner == "fine" else FINE - z[:, 0]
    speed = (
        np.ptp(states[-1].fines().velocity[:, 2])
        if partner == "fine"
        else np.abs(states[-1].fines().velocity[0, 2])
    )
    return float(depth.max()), float(speed / SPEED), step * np.count_nonzero(depth > 0)


@pytest.mark.parametrize("partner", ["fine", "wall"])
def test_an_undamped_collision_is_hertz_s(binary, tmp_path, partner):
    """Overlap (15 m v^2 / (16 E* sqrt(R*)))^(2/5), duration 2.87 (m^2 / (R* E*^2 v))^(1/5)."""
    case = tiny(HERTZ)
    factor = scales_of(case).stiffness_factor
    modulus = pair_elastic(case, ("fine", partner), factor).modulus
    mass, radius = (MASS / 2, FINE / 2) if partner == "fine" else (MASS, FINE)
    overlap, restitution, duration = thrown(partner, 0.0, tmp_path)
    assert overlap == pytest.approx(overlap_of_impact(mass, SPEED, modulus, radius), rel=1e-3)
    assert duration == pytest.approx(collision_time(mass, SPEED, modulus, radius), rel=5e-3)
    assert restitution == pytest.approx(1.0, abs=1e-3)


def test_a_damped_collision_has_the_overlap_and_restitution_of_the_ratio(binary, tmp_path):
    """delta^(5/4) moves as a linear oscillator, which gives both in closed form."""
    case = tiny(HERTZ, "fines.damping_ratio=0.3")
    modulus = pair_elastic(case, ("fine", "fine"), scales_of(case).stiffness_factor).modulus
    overlap, restitution, _ = thrown("fine", 0.3, tmp_path)
    deepest = overlap_of_impact(MASS / 2, SPEED, modulus, FINE / 2, damping=0.3)
    assert overlap == pytest.approx(deepest, rel=5e-3)
    assert restitution == pytest.approx(restitution_of(0.3), abs=5e-3)


@pytest.mark.parametrize(
    "cell", [("walls", "mobile", "batches", "held"), ("periodic", "fixed", "slab", "viscous")]
)
def test_a_hertz_specimen_is_packed_invaded_and_continued(binary, tmp_path, cell):
    """Walls with friction, mobile grains: a continued invasion is the uncut one, bit for bit."""
    case = cell_case(*cell, HERTZ, "box.wall_friction=0.3")
    pack = make_pack(case, scales_of(case), tmp_path / "pack", Launch(binary=binary))
    assert len(pack.grains) == 15
    assert differences(case, pack.grains, tmp_path, binary) == []


def test_a_dense_hertz_pack_meets_its_porosity_at_rest(binary, tmp_path):
    keys = ("box.size_mm=[5.0,3.0,3.0]", "grains={radius_mm=0.25, porosity=0.36}")
    case = tiny(HERTZ, *keys)
    scales = scales_of(case)
    pack = make_pack(case, scales, tmp_path, Launch(binary=binary))
    assert abs(pack.porosity - 0.36) <= 0.003
    mass = 2650 * 4 / 3 * math.pi * GRAIN**3
    natural = math.sqrt(scales.contacts["grain-grain"].normal_stiffness / mass)
    assert np.max(np.abs(pack.grains.velocity)) < 1e-6 * 2 * GRAIN * natural


def hertz_energy(spheres, contacts) -> float:
    """Kinetic energy and 8/15 E* sqrt(R*) delta^(5/2) of grains and their six walls, J."""
    _, depth = touching_pairs(spheres, (False, False, False))
    below = spheres.radius[:, None] - (spheres.position - spheres.box[:, 0])
    above = spheres.radius[:, None] - (spheres.box[:, 1] - spheres.position)
    at_walls = sum(np.sum(np.maximum(side, 0.0) ** 2.5) for side in (below, above))
    between = contacts["grain-grain"].elastic.modulus * math.sqrt(GRAIN / 2) * np.sum(depth**2.5)
    walls = contacts["grain-wall"].elastic.modulus * math.sqrt(GRAIN) * at_walls
    return float(8 / 15 * (between + walls) + kinetic_energy(spheres, 2650.0))


def test_an_undamped_dense_pack_keeps_its_energy_at_the_largest_step(binary, tmp_path):
    """Contacts reach 13 % of a diameter here, three times what the step is made for."""
    case = tiny(
        HERTZ,
        "grains={radius_mm=0.25, count=90, damping_ratio=0.0, motion='mobile'}",
        "box.size_mm=[2.0,2.0,2.1]",
    )
    scales = scales_of(case)
    grains = make_pack(case, scales, tmp_path / "pack", Launch(binary=binary)).grains
    assert max_overlap(grains, (False, False, False)) > 0.1
    step = 0.2 * min(scales.contacts[f"grain-{other}"].step_limit for other in ("grain", "wall"))
    thrown_at = np.random.default_rng(3).normal(0.0, 0.002 * GRAIN / step, (len(grains), 3))
    start = replace(grains, velocity=thrown_at)
    watch = Watch(step=step, steps=1500, every=15)
    states = closed_run(case, start, 2650.0, watch, tmp_path / "run")
    energy = np.array([hertz_energy(state, scales.contacts) for state in states])
    assert np.max(np.abs(energy - energy[0])) < 0.05 * kinetic_energy(start, 2650.0)
    assert np.max(np.abs(energy / energy[0] - 1)) < 2e-4


def held_of_sixty(friction: float, folder) -> float:
    """Dilute fines of 1/20 of a grain that the pack of the study `size-ratio` holds."""
    data = read_case(SLAB.with_name("ratio.toml"), assignments=["run.time_step_factor=0.2"]).data()
    for name in ("grains", "fines"):
        del data[name]["normal_stiffness_N_m"]
    data["fines"]["friction"] = friction
    data["contact"] = {"model": "hertz"}
    data["run"]["stiffness_N_m"] = 3e2
    case = with_fines(case_from(data))
    warned = any("may lock between grains" in text for text in scales_of(case).warnings)
    assert warned is (friction > 0.32)
    return window_run(case, folder, f"friction_{friction}")["invaded"]


def test_hertz_contacts_lock_small_fines_with_friction_as_the_warning_says(binary, tmp_path):
    """The groove has a slope of 0.32 for them; no geometry of this pack holds such a fine."""
    assert held_of_sixty(0.55, tmp_path) > 5
    assert held_of_sixty(0.2, tmp_path) == 0
