"""Rebound in the liquid, rolling friction and cohesion on the real binary."""

import math
from dataclasses import replace

import numpy as np
import pytest
from builders import tiny
from cut_and_continue import cell_case, differences

from fdnet.dem.deck import contact_variables, number, render_text, wall_variables, write_data
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.dem.packing import make_pack
from fdnet.scales.contacts import pull_off
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import read_dump
from fdnet.spheres.snapshot import Kind, resting
from validation.dem.closed import Watch, closed_run
from validation.dem.runs import the_binary

pytestmark = pytest.mark.liggghts
WET, HERTZ = "contact.restitution=liquid", "contact.model=hertz"
FINE, DENSITY, SIDE = 5e-5, 2146.0, 2e-3
MASS = 4 / 3 * math.pi * FINE**3 * DENSITY
BOX = np.array([[0.0, SIDE]] * 3)


@pytest.mark.parametrize("model", ["hooke", "hertz"])
@pytest.mark.parametrize("stokes", [5.0, 60.0])
def test_a_fine_rebounds_from_a_wall_as_the_stokes_number_says(binary, tmp_path, model, stokes):
    """e = e_dry exp(-35 / St), and nothing rebounds at 5; LIGGGHTS's Hertz leaves 0.05."""
    speed = 2.0
    viscosity = 1e3 * 2 * FINE * DENSITY * speed / (9 * stokes)
    case = tiny(
        WET,
        f"contact.model={model}",
        f"fluid.velocity_m_s={speed}",
        f"fluid.viscosity_cP={viscosity!r}",
        "fines.damping_ratio=0.05",
        "run.stiffness_N_m=1e5",
    )
    contact = scales_of(case).contacts["fine-wall"]
    assert contact.stokes == pytest.approx(stokes)
    start = resting(
        np.array([[2.5e-4] * 3, [SIDE / 2, SIDE / 2, 1.01 * FINE]]),
        np.array([2.5e-4, FINE]),
        BOX,
        np.array([Kind.GRAIN, Kind.FINE]),
    )
    start = replace(start, velocity=np.array([[0.0, 0, 0], [0, 0, -speed]]))
    step = 0.1 * contact.step_limit
    end = closed_run(case, start, DENSITY, Watch(step=step, steps=2000, every=2000), tmp_path)[-1]
    dry = math.exp(-math.pi * 0.05 / math.sqrt(1 - 0.05**2))
    expected = dry * math.exp(-35 / stokes)
    if stokes < 10:
        expected = 0.0 if model == "hooke" else 0.0501
    assert end.fines().velocity[0, 2] / speed == pytest.approx(expected, abs=0.02)


def bench(case, place, commands, folder, *, step, steps, every):
    """Fines above the plane z = 0, friction on, under `commands`: the frames of their dump."""
    scales = scales_of(case)
    kinds = np.array([Kind.GRAIN] + [Kind.FINE] * len(place))
    radii = np.where(kinds == Kind.GRAIN, 2.5e-4, FINE)
    spheres = resting(np.array([[SIDE - 2.6e-4] * 3, *place]), radii, BOX, kinds)
    density = np.full(len(spheres), DENSITY)
    write_data(folder / "bench.data", spheres, bounds=BOX, density=density, types=3)
    walls = [wall for wall in wall_variables(case, "invade", friction=True) if wall["id"] == "wz0"]
    contacts = contact_variables(case, scales, "invade", friction=True)
    header = {"stage": "test", "case_name": "bench", "digest": "-", "left_out": []}
    text = render_text("_header.in.j2", header | {"boundary": "f f f", "processors": ""})
    text += f"read_data bench.data\nneighbor {number(FINE)} bin\nneigh_modify delay 0\n"
    text += "group fines type 2\n"
    text += render_text("_contacts.in.j2", {"contacts": contacts, "time_step": number(step)})
    text += render_text("_walls.in.j2", {"walls": walls})
    text += f"fix integ fines nve/sphere\n{commands}\n"
    text += f"dump d fines custom {every} d.dump id type x y z vx vy vz radius fz\n"
    text += f'dump_modify d sort id format "%d %d {" ".join(["%.17g"] * 8)}"\n'
    text += f'run {steps}\nprint "DECK_DONE"\n'
    (folder / "in.bench").write_text(text)
    run_deck(folder, "in.bench", Launch(binary=the_binary()))
    return list(read_dump(folder / "d.dump"))


@pytest.mark.parametrize("model", ["hooke", "hertz"])
@pytest.mark.parametrize("slope", [0.15, 0.25])
def test_a_fine_on_an_incline_rests_or_rolls(tmp_path, model, slope):
    """It rests if tan < mu_r, else rolls with 5/7 g cos (tan - mu_r)."""
    rolling, g, seconds = 0.2, 9.81, 0.02
    case = tiny(
        f"contact.model={model}",
        f"contact.rolling_friction={rolling}",
        "box.wall_friction=0.5",
        "run.stiffness_N_m=30.0",
        "fluid.velocity_m_s=1e-2",
        "box.size_mm=[2.0,2.0,2.0]",
    )
    contact = scales_of(case).contacts["fine-wall"]
    cos = 1 / math.hypot(1, slope)
    weight = MASS * g * cos
    depth = weight / contact.normal_stiffness
    if contact.elastic:
        depth = (0.75 * weight / (contact.elastic.modulus * math.sqrt(FINE))) ** (2 / 3)
    step = 0.1 * contact.step_limit
    half = round(seconds / step / 2)
    frames = bench(
        case,
        [[5e-4, 1e-3, FINE - depth]],
        f"fix g fines gravity {number(g)} vector {number(slope * cos)} 0 {number(-cos)}",
        tmp_path,
        step=step,
        steps=2 * half,
        every=half,
    )
    if slope < rolling:
        assert abs(frames[-1].column("x")[0] - 5e-4) < 0.01 * FINE
    else:
        middle, end = (frame.column("vx")[0] for frame in frames[1:])
        expected = 5 / 7 * g * cos * (slope - rolling)
        assert (end - middle) / (half * step) == pytest.approx(expected, rel=2e-3)


def test_the_force_of_a_cohesive_contact_is_that_of_the_formula(tmp_path):
    """4/3 E* sqrt(R*) delta^(3/2) - c A on a plane, A = pi (2 r delta - delta^2)."""
    cohesion = 5e6
    case = tiny(HERTZ, f"contact.cohesion_J_m3={cohesion}", "box.wall_friction=0.5")
    modulus = scales_of(case).contacts["fine-wall"].elastic.modulus
    between = scales_of(case).contacts["fine-fine"].elastic.modulus
    expected = pull_off(cohesion, modulus, FINE)
    depth = np.linspace(0.2, 3.0, 15) * expected.overlap
    place = [[2e-4 + 1.1e-4 * i, 4e-4, FINE - d] for i, d in enumerate(depth)]
    for i, d in enumerate(depth):
        place += [[2e-4 + 1.1e-4 * i, 8e-4, 5e-4], [2e-4 + 1.1e-4 * i, 8e-4, 5e-4 + 2 * FINE - d]]
    frame = bench(case, place, "", tmp_path, step=1e-12, steps=1, every=1)[0]
    force = frame.column("fz")
    wall = 4 / 3 * modulus * math.sqrt(FINE) * depth**1.5
    wall -= cohesion * math.pi * (2 * FINE * depth - depth**2)
    assert force[:15] == pytest.approx(wall, rel=1e-6, abs=1e-6 * expected.force)
    assert force[:15].min() == pytest.approx(-expected.force, rel=0.01)
    pair = 4 / 3 * between * math.sqrt(FINE / 2) * depth**1.5
    pair -= cohesion * math.pi * (FINE * depth - depth**2 / 4)
    assert force[16::2] == pytest.approx(pair, rel=1e-6, abs=1e-6 * expected.force)


@pytest.mark.parametrize(("pull", "parts"), [(0.97, False), (1.03, True)])
def test_a_fine_parts_from_a_plane_above_the_pull_off_force(tmp_path, pull, parts):
    cohesion = 5e6
    case = tiny(HERTZ, f"contact.cohesion_J_m3={cohesion}", "box.wall_friction=0.5")
    contact = scales_of(case).contacts["fine-wall"]
    expected = pull_off(cohesion, contact.elastic.modulus, FINE)
    step = 0.1 * contact.step_limit
    frames = bench(
        case,
        [[1e-3, 1e-3, FINE - expected.overlap]],
        f"fix pull fines addforce 0.0 0.0 {number(pull * expected.force)}",
        tmp_path,
        step=step,
        steps=20000,
        every=20000,
    )
    assert bool(frames[-1].column("z")[0] > FINE) is parts


def test_rolling_and_cohesive_contacts_continue_bit_for_bit(binary, tmp_path):
    case = cell_case(
        "walls",
        "mobile",
        "batches",
        "held",
        HERTZ,
        WET,
        "box.wall_friction=0.3",
        "contact.rolling_friction=0.2",
        "contact.cohesion_J_m3=1e6",
    )
    pack = make_pack(case, tmp_path / "pack", Launch(binary=binary))
    assert differences(case, pack.grains, tmp_path, binary) == []
