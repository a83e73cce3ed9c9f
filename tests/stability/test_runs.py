"""Extreme whole runs on the real binary: right counts and bounds, or one clear error."""

import contextlib
import copy
import io
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from builders import TINY, tiny

from fdnet.case.case import Case
from fdnet.case.file import read_case, set_keys
from fdnet.cli import main
from fdnet.dem.deck import contact_variables, number, render_text, write_data
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.scales.clock import largest_factor
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import Frame, read_dump
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Kind, Snapshot, resting
from validation.small_systems import thrown_pack

pytestmark = pytest.mark.liggghts
RADIUS = 0.05e-3


def run(folder: Path, *assignments: str, without: str = "") -> tuple[int, dict[str, Any], str]:
    """The tiny case with `assignments` through the command line: exit code, summary, message."""
    data = set_keys(
        copy.deepcopy(TINY), ["run.cap_ms=0.1", "fluid.velocity_m_s=2.0", *assignments]
    )
    data.pop(without, None)
    (folder / "case.toml").write_text(tomli_w.dumps(data))
    out, err = io.StringIO(), io.StringIO()
    stages = ["--stages", "pack,invade,analyse", "--json", "--quiet"]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["run", str(folder / "case.toml"), "--out", str(folder / "run"), *stages])
    return code, json.loads(out.getvalue()) if code == 0 else {}, err.getvalue()


def check_bounds(folder: Path, summary: dict[str, Any]) -> None:
    """What holds for every run: fines are conserved and never raise k, and numbers are finite.

    They add at most their own volume of solid, those upstream up to half of it.
    """
    case = read_case(folder / "case.toml")
    counts = [summary[f"{name}_count"] for name in ("invaded", "passed", "upstream")]
    assert sum(counts) == summary["supplied_count"]
    assert (
        sum(section["fines_count"] for section in summary["sections"]) == summary["invaded_count"]
    )
    assert 0 <= summary["k_damaged_m2"] <= summary["k_initial_m2"] < 1e-6
    assert 0 <= summary["porosity_damaged"] <= summary["porosity_initial"] <= 1
    solid = (
        summary["invaded_volume_m3"] + 0.5 * summary["upstream_count"] * case.fines.mean_volume_m3
    )
    assert (
        summary["porosity_initial"] - summary["porosity_damaged"]
        <= solid / math.prod(case.size_m) + 1e-3
    )
    assert math.isfinite(summary["max_overlap_fraction"])
    assert summary["solver"]["residual"] <= 1e-6


@pytest.mark.parametrize(
    ("name", "assignments"),
    [
        ("porosity 0.30", ["grains.count=85"]),
        ("porosity 0.60", ["grains.count=47"]),
        ("radii 1:4", ["grains.radius_mm=[0.1, 0.4]", "grains.count=50", "fines.radius_mm=0.04"]),
        ("inviscid", ["fluid.viscosity_cP=1e-12"]),
        ("the contact bound", ["run.time_step_factor=0.3"]),
        ("mobile grains", ["grains.motion='mobile'", "fines.count=100"]),
        (
            "supply of more than the void",
            ["fines.radius_mm=0.09", "fines.count=1200", "fines.concentration=0.2"],
        ),
        (
            "drag x 1000",
            [
                "drag.multiplier=1000.0",
                "run.stiffness_N_m=1e7",
                "fines.count=50",
                "run.cap_ms=0.01",
            ],
        ),
    ],
)
def test_a_hard_case_runs_and_keeps_its_bounds(tmp_path, name, assignments):
    code, summary, err = run(tmp_path, *assignments)
    assert code == 0, f"{name}: {err}"
    check_bounds(tmp_path, summary)
    wanted = {"porosity 0.60": 0.60, "porosity 0.30": 0.30}
    if name in wanted:
        assert summary["porosity_initial"] == pytest.approx(wanted[name], abs=0.01)
    if name == "the contact bound":
        limits = [
            contact.step_limit
            for contact in scales_of(read_case(tmp_path / "case.toml")).contacts.values()
        ]
        assert summary["dem_dt_s"] == pytest.approx(0.3 * min(limits), rel=1e-6)
    if name == "porosity 0.30":
        assert any("denser than rigid spheres get" in one for one in summary["warnings"])


def test_one_layer_of_grains_runs(tmp_path):
    """3 mm x 0.55 mm x 2.5 mm: grains of 0.5 mm side by side between two walls."""
    code, summary, err = run(
        tmp_path, "box.size_mm=[3.0, 0.55, 2.5]", "grains.count=22", "fines.count=100"
    )
    assert code == 0, err
    assert summary["supplied_count"] == 100
    assert 0 < summary["k_damaged_m2"] <= summary["k_initial_m2"]
    plain = 1 - 22 * 4 / 3 * math.pi * 0.25**3 / (3.0 * 0.55 * 2.5)
    assert summary["porosity_initial"] == pytest.approx(plain, abs=5e-3)


def test_one_fine_lowers_k_by_less_than_its_pore(tmp_path):
    code, summary, err = run(tmp_path, "fines.count=1", "run.cap_ms=0.35")
    assert code == 0, err
    check_bounds(tmp_path, summary)
    assert summary["invaded_count"] + summary["passed_count"] + summary["upstream_count"] == 1
    assert summary["k_damaged_m2"] > 0.95 * summary["k_initial_m2"]


def test_no_fines_leave_the_pack_as_it_is(tmp_path):
    code, summary, err = run(tmp_path, without="fines")
    assert code == 0, err
    assert summary["k_damaged_m2"] == summary["k_initial_m2"] > 0
    assert summary["porosity_damaged"] == summary["porosity_initial"]
    assert summary["stop_reason"] is None


def test_fines_larger_than_every_throat_stay_at_the_face(tmp_path):
    """Circles between three touching grains of 0.25 mm have 0.04 mm: 0.2 mm cannot pass."""
    code, summary, err = run(tmp_path, "fines.radius_mm=0.2", "fines.count=30", "run.cap_ms=0.35")
    assert code == 0, err
    check_bounds(tmp_path, summary)
    assert summary["passed_count"] == 0
    assert summary["invasion_depth_m"] < 1e-3
    assert summary["upstream_count"] > 20


@pytest.mark.parametrize(
    ("assignments", "message"),
    [
        (
            ["box.size_mm=[0.4, 2.5, 2.5]", "grains.count=20"],
            "side x is 0.4 mm, expected at least 0.5 mm",
        ),
        (
            ["box.size_mm=[3.0, 0.4, 2.5]", "grains.count=20"],
            "side y is 0.4 mm, expected at least 0.5 mm",
        ),
        (
            ["box.sides='periodic'", "box.size_mm=[3.0, 0.9, 2.5]"],
            "a grain would meet its own image",
        ),
        (["grains.count=118"], "spheres sum to more than the box; expected at most 117"),
        (
            ["drag.multiplier=1000.0", "fluid.velocity_m_s=40.0"],
            "run.stiffness_N_m: drag alone would press a fine",
        ),
        (["fines.count=0"], "fines.count: 0"),
        (["fines.radius_mm=0.25"], "not below grains.radius_mm"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_written(tmp_path, assignments, message):
    code, _, err = run(tmp_path, *assignments)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_pack_denser_than_reachable_is_refused_with_the_overlap_it_needs(tmp_path):
    code, _, err = run(tmp_path, "grains.count=110")
    assert code == 2
    assert "grains.count: 110 needs grains that overlap by" in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "run").exists()


def test_a_supply_that_finds_no_place_leaves_no_folder(tmp_path):
    code, _, err = run(
        tmp_path, "fines.count=6000", "fines.concentration=0.3", "fines.radius_mm=0.0999"
    )
    assert code == 2
    assert "fines.concentration: 0.3 leaves" in err
    assert not (tmp_path / "run").exists()


def closed_system(
    case: Case, fines: Snapshot, binary, folder: Path, *, factor: float, steps: int
) -> list[Frame]:
    """Fines in a periodic box with the deck's own contacts and nothing else; frames of the run."""
    scales = scales_of(case)
    contacts = contact_variables(case, scales, "invade", friction=False)
    density = np.full(len(fines), case.fines.density_kg_m3)
    write_data(folder / "c.data", fines, bounds=fines.box, density=density, types=3)
    step = factor * scales.contacts["fine-fine"].step_limit
    header = {
        "stage": "test",
        "case_name": "c",
        "digest": "-",
        "left_out": [],
        "boundary": "p p p",
        "processors": "",
    }
    text = render_text("_header.in.j2", header)
    text += "read_data c.data\nneighbor 5e-5 bin\nneigh_modify delay 0\n"
    text += render_text("_contacts.in.j2", {"contacts": contacts, "time_step": number(step)})
    text += "fix integ all nve/sphere\n"
    for sphere, velocity in zip(fines.id, fines.velocity, strict=True):
        words = " ".join(f"{value:.17g}" for value in velocity)
        text += f"group one id {sphere}\nvelocity one set {words} units box\ngroup one delete\n"
    text += f"dump d all custom {steps // 100} d.dump id type x y z vx vy vz radius\n"
    text += 'dump_modify d sort id format "%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g"\n'
    (folder / "in.c").write_text(text + f'run {steps}\nprint "DECK_DONE"\n')
    run_deck(folder, "in.c", Launch(binary=binary))
    return read_dump(folder / "d.dump")


def undamped() -> Case:
    """Grains and fines of one material without damping: LIGGGHTS's type 1 is like the others."""
    same = [
        "normal_stiffness_N_m=63e9",
        "shear_stiffness_N_m=26e9",
        "density_kg_m3=2146.0",
        "damping_ratio=0.0",
    ]
    return tiny(
        *(f"{part}.{key}" for part in ("grains", "fines") for key in same), "run.stiffness_N_m=1e4"
    )


def gas(count_a_side: int, edge: float, speed: float) -> Snapshot:
    """Fines on a grid of a periodic box, no net momentum, the first of type 1."""
    place = (np.indices((count_a_side,) * 3).reshape(3, -1).T + 0.5) * edge / count_a_side
    still = resting(place, RADIUS, np.array([[0.0, edge]] * 3), Kind.FINE)
    velocity = np.random.default_rng(1).normal(0.0, speed, place.shape)
    kind = np.where(np.arange(len(place)) == 0, Kind.GRAIN, Kind.FINE)
    parts = {
        "id": still.id,
        "kind": kind,
        "position": place,
        "radius": still.radius,
        "box": still.box,
    }
    return Snapshot(step=0, time_s=0.0, velocity=velocity - velocity.mean(axis=0), **parts)


def energy(frame: Frame, stiffness: float, mass: float) -> float:
    """Kinetic energy and k delta^2 / 2 of every contact, J."""
    velocity = np.column_stack([frame.column(name) for name in ("vx", "vy", "vz")])
    place = np.column_stack([frame.column(name) for name in "xyz"])
    spheres = resting(place, frame.column("radius"), frame.box)
    overlap = touching_pairs(spheres, (True,) * 3)[1]
    return float(0.5 * mass * np.sum(velocity**2) + 0.5 * stiffness * np.sum(overlap**2))


@pytest.mark.parametrize(("factor", "bound"), [(0.1, 0.006), (0.2, 0.02), (0.3, 0.054)])
def test_an_undamped_closed_system_gains_no_energy(binary, tmp_path, factor, bound):
    """Velocity Verlet on linear springs keeps energy to (w dt)^2 / 8 of what a contact holds.

    w^2 = 2 k / m. The errors at the start and end of each contact add up like a random walk.
    The bounds are those over 40,000 steps. Momentum is kept to the rounding of sums.
    """
    case = undamped()
    frames = closed_system(
        case, gas(4, 0.6e-3, 1.0), binary, tmp_path, factor=factor, steps=40_000
    )
    stiffness = scales_of(case).contacts["fine-fine"].normal_stiffness
    mass = 4 / 3 * math.pi * RADIUS**3 * 2146.0
    energies = np.array([energy(frame, stiffness, mass) for frame in frames])
    assert len(frames) == 101
    turned = frames[-1].column("vx") - frames[0].column("vx")
    assert np.mean(np.abs(turned) > 0.1) > 0.9  # nearly all have collided
    assert np.max(np.abs(energies / energies[0] - 1.0)) < bound
    for name in ("vx", "vy", "vz"):
        drift = [abs(float(np.sum(frame.column(name)))) for frame in frames]
        assert max(drift) < 1e-10 * np.sum(np.abs(frames[0].column(name)))


@pytest.mark.parametrize("damping", [0.5, 0.7])
def test_a_damped_pack_comes_to_rest_up_to_the_largest_step_and_not_far_above(tmp_path, damping):
    """Grains with 6 to 8 contacts each, at porosity 0.30; the bound is that of 12."""
    case = tiny(*(f"{part}.damping_ratio={damping}" for part in ("grains", "fines")))
    largest = largest_factor(case, scales_of(case).contacts)
    left = [
        thrown_pack(
            tmp_path / str(share), factor=share * largest, seed=1, spans=150, damping=damping
        )
        for share in (1.0, 1.5)
    ]
    assert left[0]["kinetic_left"] < 1e-6
    assert left[1]["kinetic_left"] > 1e-4


def test_momentum_of_a_free_oblique_collision_is_conserved(binary, tmp_path):
    """Two fines in free space, one glancing blow; the third, far away, stays where it is."""
    place = np.array([[1.0, 1.0, 1.0], [0.30, 0.30, 0.30], [0.41, 0.33, 0.30]]) * 1e-3
    velocity = np.array([[0.0, 0.0, 0.0], [1.3, 0.2, -0.1], [-0.7, 0.1, 0.2]])
    still = resting(place, RADIUS, np.array([[0.0, 2e-3]] * 3), np.array([1, 2, 2]))
    parts = {name: getattr(still, name) for name in ("id", "kind", "position", "radius", "box")}
    fines = Snapshot(step=0, time_s=0.0, velocity=velocity, **parts)
    for zeta in (0.0, 0.3):
        folder = tmp_path / str(zeta)
        folder.mkdir()
        case = tiny(f"fines.damping_ratio={zeta}")
        frames = closed_system(case, fines, binary, folder, factor=0.05, steps=20_000)
        for k, name in enumerate(("vx", "vy", "vz")):
            total = [float(np.sum(frame.column(name)[1:])) for frame in frames]
            assert total == pytest.approx([velocity[1:, k].sum()] * len(total), abs=1e-13)
            assert frames[-1].column(name)[0] == 0
        assert frames[-1].column("vx")[1] < 1.0  # they did collide
