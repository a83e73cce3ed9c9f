"""The decks' physics on the real binary, against closed forms."""

import math

import numpy as np
import pytest
from builders import resting_spheres, tiny

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.dem.deck import contact_variables, number, render_text, write_data
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.dem.supply import densities
from fdnet.scales.clock import relaxation_time
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import read_dump
from fdnet.spheres.geometry import max_overlap, touching_pairs
from fdnet.spheres.snapshot import Kind, Snapshot

pytestmark = pytest.mark.liggghts

FEW = {"D10_mm": 0.08, "D90_mm": 0.12}


def snapshot(case: Case, position: list, kind: Kind, radius: float, first: int = 1) -> Snapshot:
    return resting_spheres(
        position, radius, np.column_stack([np.zeros(3), case.size_m]), kind=kind, first=first
    )


@pytest.mark.parametrize("scheme", ["held", "implicit", "viscous"])
def test_gravity_buoyancy_and_drag_relax_to_the_terminal_velocity(binary, tmp_path, scheme):
    """v_z(t) = v_T (1 - exp(-t / tau)), v_T = 2 r^2 (rho - rho_f) g / (9 mu) (Stokes 1851)."""
    g = -2.0e4
    case = tiny(
        "fines.count=1",
        f"drag.scheme={scheme}",
        "gravity.mode=on",
        f"gravity.acceleration_m_s2=[0.0,0.0,{g}]",
        "box.size_mm=[3.0,3.0,3.0]",
        "fluid.velocity_m_s=2.0",
        "run.duration_ms=0.05",
        "run.checkpoint_ms=0.01",
    )
    scales = scales_of(case)
    lonely = snapshot(case, [[2.9e-3, 3e-4, 3e-4]], Kind.GRAIN, 2.5e-4)
    result = invade(case, scales, lonely, tmp_path, Launch(binary=binary))
    fine = result.damaged.fines()
    tau = relaxation_time(0.05e-3, 2146, 0.05)
    terminal = 2 * (0.05e-3) ** 2 * (2146 - 1095) * g / (9 * 0.05)
    elapsed = result.history[-1].step * scales.time_step
    assert fine.velocity[0, 2] == pytest.approx(
        terminal * (1 - math.exp(-elapsed / tau)), rel=0.03
    )
    assert fine.velocity[0, 0] == pytest.approx(2.0, rel=1e-6)
    assert result.stop_reason == "duration"


OBLIQUE = (1.2e4, -0.9e4, -2.0e4)
"""Gravity, m/s2, across all axes, so that a fine settles within a millimetre."""


@pytest.mark.parametrize("scheme", ["held", "implicit", "viscous"])
def test_a_fine_settles_along_an_oblique_gravity(binary, tmp_path, scheme):
    """v(t) = u + v_T (1 - exp(-t / tau)), v_T = 2 r^2 (rho - rho_f) g / (9 mu), in each axis."""
    case = tiny(
        "fines.count=1",
        f"drag.scheme={scheme}",
        "gravity.mode=on",
        f"gravity.acceleration_m_s2={list(OBLIQUE)}",
        "box.size_mm=[3.0,3.0,3.0]",
        "fluid.velocity_m_s=2.0",
        "run.duration_ms=0.06",
        "run.checkpoint_ms=0.06",
    )
    fine, elapsed = fallen(case, binary, tmp_path)
    tau = relaxation_time(0.05e-3, 2146, 0.05)
    terminal = 2 * (0.05e-3) ** 2 * (2146 - 1095) * np.array(OBLIQUE) / (9 * 0.05)
    expected = np.array([2.0, 0, 0]) + terminal * (1 - math.exp(-elapsed / tau))
    assert fine.velocity[0] == pytest.approx(expected, abs=0.005 * np.linalg.norm(terminal))


@pytest.mark.parametrize(("density", "share"), [(2146.0, 1 - 1095 / 2146), (1000.0, -0.095)])
def test_free_fall_and_rise_are_exact_in_any_direction(binary, tmp_path, density, share):
    """With hardly any drag dv = g (1 - rho_f / rho_p) t, to 1e-6; a light fine rises."""
    case = tiny(
        "fines.count=1",
        f"fines.density_kg_m3={density}",
        "gravity.mode=on",
        "gravity.acceleration_m_s2=[60.0, -45.0, -100.0]",
        "box.size_mm=[3.0,3.0,3.0]",
        "fluid={velocity_m_s=0.5, viscosity_cP=1e-12}",
        "run.duration_ms=0.2",
        "run.checkpoint_ms=0.2",
    )
    fine, elapsed = fallen(case, binary, tmp_path)
    fall = share * np.array([60.0, -45.0, -100.0]) * elapsed
    assert fine.velocity[0] - [0.5, 0, 0] == pytest.approx(fall, rel=1e-5)


@pytest.mark.parametrize("buoyancy", ["true", "false"])
def test_each_fine_of_several_materials_falls_by_its_own_density(binary, tmp_path, buoyancy):
    """dv = g (1 - rho_f / rho_p) t with the density of its material, in the same run."""
    materials = [
        {"name": "light", "share": 1.0, "density_kg_m3": 1500.0, "sizes": FEW},
        {"name": "heavy", "share": 3.0, "density_kg_m3": 4500.0, "sizes": FEW},
    ]
    pull = np.array([60.0, -45.0, -100.0])
    case = tiny(
        "gravity.mode=on",
        f"gravity.acceleration_m_s2={pull.tolist()}",
        f"gravity.buoyancy={buoyancy}",
        "box.size_mm=[3.0,3.0,3.0]",
        "fluid={velocity_m_s=0.5, viscosity_cP=1e-12}",
        "run={duration_ms=0.2, checkpoint_ms=0.2}",
    )
    data = case.data()
    data["fines"] = {"count": 6, "concentration": 0.01, "supply": "slab", "materials": materials}
    case = case_from(data)
    fines, elapsed = fallen(case, binary, tmp_path)
    density = densities(case, [6])
    assert set(density) == {1500.0, 4500.0}
    share = 1 - 1095 / density[:, None] * (buoyancy == "true")
    order = np.argsort(fines.id)
    fall = fines.velocity[order] - [0.5, 0, 0]
    assert fall == pytest.approx(share * pull * elapsed, rel=1e-5)


def test_mobile_grains_fall_by_their_own_density(binary, tmp_path):
    """Grain and fine at once; the fluid drags the fine only."""
    pull = np.array([30.0, -45.0, -100.0])
    case = tiny(
        "fines.count=1",
        "grains.motion=mobile",
        "gravity.mode=on",
        f"gravity.acceleration_m_s2={pull.tolist()}",
        "box.size_mm=[3.0,3.0,3.0]",
        "fluid={velocity_m_s=0.5, viscosity_cP=1e-12}",
        "run.duration_ms=0.2",
        "run.checkpoint_ms=0.2",
    )
    lonely = snapshot(case, [[2e-3, 1.5e-3, 1.5e-3]], Kind.GRAIN, 2.5e-4)
    scales = scales_of(case)
    result = invade(case, scales, lonely, tmp_path, Launch(binary=binary))
    elapsed = result.history[-1].step * scales.time_step
    grain, fine = result.damaged.grains(), result.damaged.fines()
    assert grain.velocity[0] == pytest.approx((1 - 1095 / 2650) * pull * elapsed, rel=1e-6)
    moved = fine.velocity[0] - [0.5, 0, 0]
    assert moved == pytest.approx((1 - 1095 / 2146) * pull * elapsed, rel=1e-5)


def fallen(case: Case, binary, folder) -> tuple[Snapshot, float]:
    """One fine after its fall, far from the only grain, and the time, s."""
    scales = scales_of(case)
    lonely = snapshot(case, [[2.7e-3, 3e-4, 3e-4]], Kind.GRAIN, 2.5e-4)
    result = invade(case, scales, lonely, folder, Launch(binary=binary))
    assert result.stop_reason == "duration"
    return result.damaged.fines(), result.history[-1].step * scales.time_step


def collide(case: Case, speed: float, binary, folder) -> tuple[float, float]:
    """Two fines head on with the deck's own contact lines: restitution and largest overlap."""
    scales = scales_of(case)
    contacts = contact_variables(case, scales, "invade", friction=False)
    pair = snapshot(case, [[1e-3, 1e-3, 1e-3], [1.1005e-3, 1e-3, 1e-3]], Kind.FINE, 0.05e-3)
    pair = snapshot(case, [[1e-4, 1e-4, 1e-4]], Kind.GRAIN, 0.05e-3, first=3).joined(
        pair
    )  # LIGGGHTS wants a type 1
    write_data(
        folder / "two.data",
        pair,
        bounds=np.array([[0, 2e-3]] * 3),
        density=np.full(3, 2146.0),
        types=3,
    )
    step = 0.02 * scales.contacts["fine-fine"].step_limit
    text = render_text(
        "_header.in.j2",
        {
            "stage": "test",
            "case_name": "two",
            "digest": "-",
            "left_out": [],
            "boundary": "f f f",
            "processors": "",
        },
    )
    text += "read_data two.data\nneighbor 5e-5 bin\nneigh_modify delay 0\n"
    text += render_text("_contacts.in.j2", {"contacts": contacts, "time_step": number(step)})
    text += (
        "fix integ all nve/sphere\ngroup a id 1\ngroup b id 2\n"
        f"velocity a set {speed / 2} 0 0 units box\n"
        f"velocity b set {-speed / 2} 0 0 units box\n"
        "dump d all custom 20 d.dump id type x y z vx vy vz radius\n"
        'dump_modify d sort id format "%d %d %.17g %.17g %.17g %.17g %.17g %.17g %.17g"\n'
        f'run {round((6e-7 / (speed / 1.0) + 4e-6) / step)}\nprint "DECK_DONE"\n'
    )
    (folder / "in.two").write_text(text)
    run_deck(folder, "in.two", Launch(binary=binary))
    frames = read_dump(folder / "d.dump")
    gap = np.array(
        [frame.column("x")[1] - frame.column("x")[0] for frame in frames]
    )  # rows are sorted by id
    last = frames[-1].column("vx")
    return float((last[1] - last[0]) / speed), float(np.max(1e-4 - gap))


def test_collision_has_the_spring_and_the_restitution_of_the_case(binary, tmp_path):
    """The overlap without damping is v sqrt(m_eff/k); with damping the restitution e is known.

    Of a linear contact that is released at zero force (limitForce on) it is
    e = exp(-zeta/s (pi - atan2(2 s zeta, 2 zeta^2 - 1))), s = sqrt(1 - zeta^2) (Schwager &
    Poeschel 2007, eq. 20).
    """
    case = tiny("fines.damping_ratio=0.0", "grains.damping_ratio=0.0")
    mass = 4 / 3 * math.pi * (0.05e-3) ** 3 * 2146 / 2
    stiffness = scales_of(case).contacts["fine-fine"].normal_stiffness
    restitution, overlap = collide(case, 1.0, binary, tmp_path)
    assert overlap == pytest.approx(math.sqrt(mass / stiffness), rel=0.01)
    assert restitution == pytest.approx(1.0, abs=0.01)
    zeta, s = 0.2, math.sqrt(1 - 0.2**2)
    released = (math.pi - math.atan2(2 * zeta * s, 1 - 2 * zeta**2)) / s
    restitution, _ = collide(tiny(f"fines.damping_ratio={zeta}"), 1.0, binary, tmp_path)
    assert restitution == pytest.approx(math.exp(-zeta * released), abs=0.01)


def test_touching_pairs_against_brute_force():
    rng = np.random.default_rng(3)
    case = tiny()
    for periodic in ((False, False, False), (False, True, True)):
        size = np.array(case.size_m)
        radius = rng.choice([2.5e-4, 5e-5, 3e-5], 300)
        spheres = Snapshot(
            step=0,
            time_s=0.0,
            box=np.column_stack([np.zeros(3), size]),
            id=np.arange(300),
            kind=np.where(radius > 1e-4, Kind.GRAIN, Kind.FINE),
            position=rng.random((300, 3)) * size,
            radius=radius,
            velocity=np.zeros((300, 3)),
        )
        gap = spheres.position[:, None] - spheres.position[None]
        gap -= np.where(periodic, size * np.round(gap / size), 0.0)
        depth = radius[:, None] + radius[None] - np.sqrt(np.sum(gap**2, axis=2))
        expected = {(i, j) for i in range(300) for j in range(i + 1, 300) if depth[i, j] > 0}
        pairs, overlap = touching_pairs(spheres, periodic)
        assert {tuple(sorted(pair)) for pair in pairs.tolist()} == expected
        assert np.allclose(overlap, depth[pairs[:, 0], pairs[:, 1]])
        assert max_overlap(spheres, periodic) == pytest.approx(
            max(depth[i, j] / (2 * min(radius[i], radius[j])) for i, j in expected)
        )
