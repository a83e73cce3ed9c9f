"""Contacts on the real binary against closed forms: collisions, rolling, cohesion, energy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from bench import bench
from builders import tiny

from fdnet.case.spheres import SHEAR_RATIO
from fdnet.dem.deck import number
from fdnet.scales.clock import largest_factor
from fdnet.scales.contacts import (
    MOST_FALSE_FORCE,
    collision_time,
    fall_velocity,
    false_force,
    groove_slope,
    overlap_of_impact,
    pair_elastic,
    pull_off,
    sphere_mass,
)
from fdnet.scales.scales import scales_of
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Kind, Snapshot, resting

pytestmark = pytest.mark.liggghts
HERTZ = "contact.model=hertz"
FINE, GRAIN, DENSITY, SIDE = 5e-5, 2.5e-4, 2146.0, 2e-3
MASS = 4 / 3 * math.pi * FINE**3 * DENSITY
BOX = np.array([[0.0, SIDE]] * 3)
SIDES = ("wy0", "wy1", "wz0", "wz1")


def spheres_at(place, *, velocity=None) -> Snapshot:
    """Fines at `place` (N, 3) m with `velocity`, after a grain apart: a type 1 is needed."""
    place = np.array([[1.74e-3, 1.2e-3, 1.2e-3], *place])
    kinds = np.array([Kind.GRAIN] + [Kind.FINE] * (len(place) - 1))
    still = resting(place, np.where(kinds == Kind.GRAIN, GRAIN, FINE), BOX, kinds)
    return still if velocity is None else replace(still, velocity=np.array([[0.0] * 3, *velocity]))


def thrown(case, partner: str, speed: float, folder) -> tuple[float, float, float]:
    """A fine thrown at a fine or a wall: largest overlap, m, restitution, and duration, s."""
    step = 0.02 * scales_of(case).contacts[f"fine-{partner}"].step_limit
    middle, gap = SIDE / 2, 2.5 * speed * step
    place, velocity = [[middle, middle, FINE + gap]], [[0.0, 0, -speed]]
    if partner == "fine":
        place = [[middle] * 3, [middle, middle, middle - 2 * FINE - gap]]
        velocity = [[0, 0, -speed / 2], [0, 0, speed / 2]]
    start = spheres_at(place, velocity=velocity)
    run = {"step": step, "steps": 600, "every": 1, "walls": SIDES}
    frames = bench(case, start, folder, density=DENSITY, **run)
    z, vz = (np.array([frame.column(name)[1:] for frame in frames]) for name in ("z", "vz"))
    depth = 2 * FINE - np.abs(z[:, 0] - z[:, 1]) if partner == "fine" else FINE - z[:, 0]
    apart = np.ptp(vz[-1]) if partner == "fine" else vz[-1, 0]
    return float(depth.max()), float(apart / speed), step * np.count_nonzero(depth > 0)


def released(zeta: float) -> float:
    """Restitution of a damped linear contact that ends at zero force (limitForce on).

    Schwager and Poeschel (2007), eq. 20, with s^2 = 1 - zeta^2.
    """
    s = math.sqrt(1 - zeta**2)
    return math.exp(-zeta / s * (math.pi - math.atan2(2 * zeta * s, 1 - 2 * zeta**2)))


def test_a_linear_collision_has_the_spring_and_the_restitution_of_the_case(tmp_path):
    """The overlap without damping is v sqrt(m_eff/k); with damping the restitution is known."""
    case = tiny("fines.damping_ratio=0.0", "grains.damping_ratio=0.0")
    stiffness = scales_of(case).contacts["fine-fine"].normal_stiffness
    overlap, restitution, _ = thrown(case, "fine", 1.0, tmp_path / "undamped")
    assert overlap == pytest.approx(math.sqrt(MASS / 2 / stiffness), rel=0.01)
    assert restitution == pytest.approx(1.0, abs=0.01)
    damped = tiny("fines.damping_ratio=0.2")
    assert thrown(damped, "fine", 1.0, tmp_path)[1] == pytest.approx(released(0.2), abs=0.01)


def test_a_hertz_collision_is_that_of_the_closed_form(tmp_path):
    """Overlap (15 m v^2 / (16 E* sqrt(R*)))^(2/5), duration 2.87 (m^2 / (R* E*^2 v))^(1/5).

    Damped, delta^(5/4) moves as a linear oscillator, which gives overlap and restitution.
    """
    for partner, damping, near in (("fine", 0.0, 1e-3), ("wall", 0.0, 1e-3), ("fine", 0.3, 5e-3)):
        case = tiny(HERTZ, *(f"{part}.damping_ratio={damping}" for part in ("fines", "grains")))
        modulus = pair_elastic(case, ("fine", partner), scales_of(case).stiffness_factor).modulus
        mass, radius = (MASS / 2, FINE / 2) if partner == "fine" else (MASS, FINE)
        overlap, restitution, time = thrown(case, partner, 1.0, tmp_path / f"{partner}{damping}")
        deepest = overlap_of_impact(mass, 1.0, modulus, radius, damping=damping)
        assert overlap == pytest.approx(deepest, rel=near), (partner, damping)
        assert restitution == pytest.approx(released(damping), abs=near), (partner, damping)
        if damping == 0:
            expected = collision_time(mass, 1.0, modulus, radius)
            assert time == pytest.approx(expected, rel=5e-3), partner


def test_a_fine_rebounds_from_a_wall_as_the_stokes_number_says(tmp_path):
    """e = e_dry exp(-35 / St), and nothing rebounds at 5; LIGGGHTS's Hertz leaves 0.05."""
    speed = 2.0
    for model, stokes in (("hooke", 5.0), ("hooke", 60.0), ("hertz", 5.0), ("hertz", 60.0)):
        viscosity = 1e3 * 2 * FINE * DENSITY * speed / (9 * stokes)
        keys = ("contact.restitution=liquid", "fines.damping_ratio=0.05", "run.stiffness_N_m=1e5")
        fluid = (f"fluid.velocity_m_s={speed}", f"fluid.viscosity_cP={viscosity!r}")
        case = tiny(f"contact.model={model}", *keys, *fluid)
        contact = scales_of(case).contacts["fine-wall"]
        assert contact.stokes == pytest.approx(stokes)
        start = spheres_at([[SIDE / 2, SIDE / 2, 1.01 * FINE]], velocity=[[0, 0, -speed]])
        run = {"step": 0.1 * contact.step_limit, "steps": 2000, "every": 2000, "walls": SIDES}
        end = bench(case, start, tmp_path / f"{model}{stokes}", density=DENSITY, **run)[-1]
        dry = math.exp(-math.pi * 0.05 / math.sqrt(1 - 0.05**2))
        expected = dry * math.exp(-35 / stokes)
        if stokes < 10:
            expected = 0.0 if model == "hooke" else 0.0501
        said = f"{model} at a Stokes number of {stokes}"
        assert end.column("vz")[1] / speed == pytest.approx(expected, abs=0.02), said


def on_a_plane(case, place, folder, commands="", **run):
    """Frames of fines above the plane z = 0, with friction, under `commands`."""
    run |= {"density": DENSITY, "walls": ("wz0",), "friction": True, "moving": "fines"}
    return bench(case, spheres_at(place), folder, commands=commands, **run)


@pytest.mark.parametrize("model", ["hooke", "hertz"])
@pytest.mark.parametrize("slope", [0.15, 0.25])
def test_a_fine_on_an_incline_rests_or_rolls(tmp_path, model, slope):
    """It rests if tan < mu_r, else rolls with 5/7 g cos (tan - mu_r)."""
    rolling, g = 0.2, 9.81
    keys = ("box.size_mm=[2.0,2.0,2.0]", "run.stiffness_N_m=30.0", "fluid.velocity_m_s=1e-2")
    rough = ("box.wall_friction=0.5", f"contact.rolling_friction={rolling}")
    case = tiny(f"contact.model={model}", *rough, *keys)
    contact = scales_of(case).contacts["fine-wall"]
    cos = 1 / math.hypot(1, slope)
    depth = MASS * g * cos / contact.normal_stiffness
    if contact.elastic:
        lasting = contact.elastic.modulus * math.sqrt(FINE)
        depth = (0.75 * MASS * g * cos / lasting) ** (2 / 3)
    step = 0.1 * contact.step_limit
    half = round(0.02 / step / 2)
    pull = f"fix g fines gravity {number(g)} vector {number(slope * cos)} 0 {number(-cos)}"
    place = [[5e-4, 1e-3, FINE - depth]]
    frames = on_a_plane(case, place, tmp_path, pull, step=step, steps=2 * half, every=half)
    if slope < rolling:
        assert abs(frames[-1].column("x")[1] - 5e-4) < 0.01 * FINE
    else:
        middle, end = (frame.column("vx")[1] for frame in frames[1:])
        expected = 5 / 7 * g * cos * (slope - rolling)
        assert (end - middle) / (half * step) == pytest.approx(expected, rel=2e-3)


COHESIVE = tiny(HERTZ, "contact.cohesion_J_m3=5e6", "box.wall_friction=0.5")


def test_the_force_of_a_cohesive_contact_is_that_of_the_formula(tmp_path):
    """4/3 E* sqrt(R*) delta^(3/2) - c A on a plane, A = pi (2 r delta - delta^2)."""
    cohesion, contacts = 5e6, scales_of(COHESIVE).contacts
    modulus, between = (contacts[name].elastic.modulus for name in ("fine-wall", "fine-fine"))
    expected = pull_off(cohesion, modulus, FINE)
    depth = np.linspace(0.2, 3.0, 15) * expected.overlap
    place = [[2e-4 + 1.1e-4 * i, 4e-4, FINE - d] for i, d in enumerate(depth)]
    for i, d in enumerate(depth):
        place += [[2e-4 + 1.1e-4 * i, 8e-4, 5e-4], [2e-4 + 1.1e-4 * i, 8e-4, 5e-4 + 2 * FINE - d]]
    force = on_a_plane(COHESIVE, place, tmp_path, step=1e-12, steps=1, every=1)[0].column("fz")[1:]
    wall = 4 / 3 * modulus * math.sqrt(FINE) * depth**1.5
    wall -= cohesion * math.pi * (2 * FINE * depth - depth**2)
    assert force[:15] == pytest.approx(wall, rel=1e-6, abs=1e-6 * expected.force)
    assert force[:15].min() == pytest.approx(-expected.force, rel=0.01)
    pair = 4 / 3 * between * math.sqrt(FINE / 2) * depth**1.5
    pair -= cohesion * math.pi * (FINE * depth - depth**2 / 4)
    assert force[16::2] == pytest.approx(pair, rel=1e-6, abs=1e-6 * expected.force)


def test_a_fine_parts_from_a_plane_above_the_pull_off_force(tmp_path):
    contact = scales_of(COHESIVE).contacts["fine-wall"]
    expected = pull_off(5e6, contact.elastic.modulus, FINE)
    place, run = [[1e-3, 1e-3, FINE - expected.overlap]], {"steps": 20000, "every": 20000}
    for pull, parts in ((0.97, False), (1.03, True)):
        up = f"fix pull fines addforce 0.0 0.0 {number(pull * expected.force)}"
        step = 0.1 * contact.step_limit
        frames = on_a_plane(COHESIVE, place, tmp_path / str(pull), up, step=step, **run)
        assert bool(frames[-1].column("z")[1] > FINE) is parts, pull


# ---- Energy and momentum of closed systems.
def gas(count_a_side: int, edge: float, speed: float) -> Snapshot:
    """Fines on a grid of a periodic box, no net momentum, the first of type 1."""
    place = (np.indices((count_a_side,) * 3).reshape(3, -1).T + 0.5) * edge / count_a_side
    kind = np.where(np.arange(len(place)) == 0, Kind.GRAIN, Kind.FINE)
    velocity = np.random.default_rng(1).normal(0.0, speed, place.shape)
    still = resting(place, FINE, np.array([[0.0, edge]] * 3), kind)
    return replace(still, velocity=velocity - velocity.mean(axis=0))


@pytest.mark.parametrize(("factor", "bound"), [(0.1, 0.006), (0.2, 0.02), (0.3, 0.054)])
def test_an_undamped_closed_system_gains_no_energy(tmp_path, factor, bound):
    """Velocity Verlet on linear springs keeps energy to (w dt)^2 / 8 of what a contact holds.

    w^2 = 2 k / m. The errors of the contacts add up like a random walk, here over 40,000 steps.
    """
    same = ("normal_stiffness_N_m=63e9", "shear_stiffness_N_m=26e9", "density_kg_m3=2146.0")
    keys = [f"{part}.{k}" for part in ("grains", "fines") for k in (*same, "damping_ratio=0.0")]
    case = tiny(*keys, "run.stiffness_N_m=1e4")
    contact = scales_of(case).contacts["fine-fine"]
    run = {"step": factor * contact.step_limit, "steps": 40_000, "every": 400}
    frames = bench(case, gas(4, 0.6e-3, 1.0), tmp_path, density=DENSITY, boundary="p p p", **run)
    assert len(frames) == 101
    velocity = np.array([[frame.column(f"v{axis}") for axis in "xyz"] for frame in frames])
    place = np.array([[frame.column(axis) for axis in "xyz"] for frame in frames])
    energies = []
    for at, going, frame in zip(place, velocity, frames, strict=True):
        overlap = touching_pairs(resting(at.T, FINE, frame.box), (True,) * 3)[1]
        springs = 0.5 * contact.normal_stiffness * np.sum(overlap**2)
        energies.append(0.5 * MASS * np.sum(going**2) + springs)
    turned = velocity[-1, 0] - velocity[0, 0]
    assert np.mean(np.abs(turned) > 0.1) > 0.9  # nearly all have collided
    assert np.max(np.abs(np.array(energies) / energies[0] - 1.0)) < bound
    drift = np.abs(velocity.sum(axis=2)).max(axis=0)
    assert np.all(drift < 1e-10 * np.abs(velocity[0]).sum(axis=1))


@pytest.mark.parametrize("damping", [0.5, 0.7])
def test_a_damped_pack_rests_up_to_the_largest_step_not_far_above(grains_of, tmp_path, damping):
    """Grains with 6 to 8 contacts each, at porosity 0.30; the bound is that of 12."""
    dense = ("grains={radius_mm=0.25, count=90, motion='mobile'}", "box.size_mm=[2.0,2.0,2.1]")
    case = tiny(*dense, *(f"{part}.damping_ratio={damping}" for part in ("grains", "fines")))
    contacts, grains = scales_of(case).contacts, grains_of(tiny(*dense))
    factor, stiffness = largest_factor(case, contacts), contacts["grain-grain"].normal_stiffness
    time = math.sqrt(sphere_mass(GRAIN, 2650.0) / stiffness)
    thrown = np.random.default_rng([1, 3]).normal(0.0, 0.01 * GRAIN / time, (len(grains), 3))
    start, left = replace(grains, velocity=thrown), []
    for share in (1.0, 1.5):
        steps = math.ceil(150 / (share * factor))
        run = {"step": share * factor * time, "steps": steps, "every": max(1, steps // 200)}
        walls, folder = ("wx0", "wx1", *SIDES), tmp_path / str(share)
        frames = bench(case, start, folder, density=2650.0, walls=walls, **run)
        speeds = np.array([[frame.column(f"v{axis}") for axis in "xyz"] for frame in frames])
        left.append(np.sum(speeds[-1] ** 2) / np.sum(speeds[0] ** 2))
    assert left[0] < 1e-6
    assert left[1] > 1e-4


# ---- Fines that lock between two grains.
def leaving_time(stiffness: float, ratio: float, step: float, folder) -> tuple[float, float]:
    """When a fine that falls around the neck of two grains leaves it, s, and the false force.

    LAMMPS's examples/granular/in.sync_verlet (Vyas and others, Comput. Phys. Commun. 310, 109524).
    Infinite when the fine is held for 0.2 s; the false force is over the pull.
    """
    grain, fine, density, pull = 5e-3, 2.5e-4, 2500.0, 9.81
    fall, mass = -math.log(0.5), sphere_mass(fine, density)
    material = f"friction=0.5, damping_ratio={fall / math.hypot(math.pi, fall)!r}, "
    material += f"normal_stiffness_N_m={2 * stiffness!r}, "
    material += f"shear_stiffness_N_m={2 * ratio * stiffness!r}"
    case = tiny(
        *("box.size_mm=[50.0,50.0,50.0]", "fluid.velocity_m_s=1e-3"),
        f"grains={{radius_mm=5.0, count=2, {material}}}",
        f"fines={{radius_mm=0.25, count=1, density_kg_m3={density}, {material}}}",
        f"run.stiffness_N_m={stiffness!r}",
    )
    height, start = groove_slope(fine / grain) * grain, math.radians(1.0)
    place = np.array([[-grain, 0, 0], [grain, 0, 0], [0, math.sin(start), math.cos(start)]])
    place[2] *= height
    bounds = np.array([[-3 * grain, 3 * grain]] * 3)
    bounds[2, 0] -= 0.5 * pull * 0.2**2
    kinds = np.array([Kind.GRAIN, Kind.GRAIN, Kind.FINE])
    three = resting(place, np.array([grain, grain, fine]), bounds, kinds)
    steps = math.ceil(0.2 / step)
    run = {"density": density, "step": step, "steps": steps, "every": max(1, steps // 400)}
    text = f"fix still grains freeze\nfix pull fines addforce 0 0 {number(-mass * pull)}"
    frames = bench(case, three, folder, commands=text, moving="fines", friction=True, **run)
    off = [math.hypot(frame.column("y")[2], frame.column("z")[2]) for frame in frames]
    gone = np.flatnonzero(np.array(off) > 1.02 * height)
    rolling = fall_velocity(mass * pull, mass, height)
    false = false_force(ratio * stiffness, rolling, step) / (mass * pull)
    return (frames[gone[0]].step * step if len(gone) else math.inf), false


def test_fdnets_contacts_let_a_fine_leave_the_neck_in_time_and_lammps_own_hold_it(tmp_path):
    """Without the integrator's error it leaves after 0.145 s (LAMMPS's own example)."""
    stiffness = 12.5
    for factor in (0.1, 0.05):
        step = factor * math.sqrt(sphere_mass(2.5e-4, 2500.0) / stiffness)
        time, false = leaving_time(stiffness, SHEAR_RATIO, step, tmp_path / str(factor))
        assert false <= MOST_FALSE_FORCE
        assert time == pytest.approx(0.145, rel=0.2)
    time, false = leaving_time(1e4, 0.8235, 1e-6, tmp_path / "held")
    assert false > 100 * MOST_FALSE_FORCE
    assert time == math.inf
