"""Drag, gravity and the other forces of the fluid on the real binary, against closed forms."""

import math
from pathlib import Path

import numpy as np
import pytest
from bench import bench, drag_text
from builders import resting_spheres, tiny

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.supply import densities
from fdnet.scales.clock import relaxation_time
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import Frame
from fdnet.spheres.snapshot import Kind, Snapshot

pytestmark = pytest.mark.liggghts
SCHEMES = ("held", "implicit", "viscous")
SPEED, RADIUS = 2.0, 0.05e-3
SLOW = "fluid.velocity_m_s=0.02"
TAU = relaxation_time(RADIUS, 2146, 0.05)
TOUCHES = 2e-3 - 2.5e-4 - RADIUS
"""Where a fine that touches the grain of `drive` is along x, m."""


def drag_case(*assignments: str) -> Case:
    return tiny(f"fluid.velocity_m_s={SPEED}", "fines.friction=0.0", *assignments)


def drive(case: Case, folder: Path, *, gap: float, steps: int, every: int) -> list[Frame]:
    """One fine from rest, `gap` m upstream of a fixed grain, under the drag of the case."""
    box = np.column_stack([np.zeros(3), case.size_m])
    grain = resting_spheres([[2e-3, 8e-4, 8e-4]], 2.5e-4, box, kind=Kind.GRAIN)
    place = [[TOUCHES - gap, 8e-4, 8e-4]]
    fine = resting_spheres(place, RADIUS, box, kind=Kind.FINE, first=2)
    run = {"step": scales_of(case).time_step, "steps": steps, "every": every}
    run |= {"density": [2650.0, 2146.0], "bounds": box - [[5e-4, 0], [0, 0], [0, 0]]}
    text = drag_text(case)
    return bench(case, grain.joined(fine), folder, commands=text, moving="fines", **run)


def along(frames: list[Frame], name: str = "vx") -> np.ndarray:
    """The values of the fine."""
    return np.array([frame.column(name)[1] for frame in frames])


def relaxation_error(scheme: str, step: float, folder: Path) -> float:
    """Largest error of v(t) = u (1 - exp(-t / tau)) over u in 2 tau, tested every 0.2 tau."""
    every = round(0.2 * TAU / step)
    held = ["drag.refresh_steps=1"] if scheme == "held" else []
    keys = (f"drag.scheme={scheme}", f"run.time_step_s={step}", "run.stiffness_N_m=500.0", *held)
    frames = drive(drag_case(*keys), folder, gap=1e-3, steps=10 * every, every=every)
    time = step * np.array([frame.step for frame in frames])
    assert len(time) == 11
    return float(np.max(np.abs(along(frames) / SPEED - (1 - np.exp(-time / TAU)))))


def test_a_fine_relaxes_to_the_fluid_as_stokes_has_it(tmp_path):
    """v = u (1 - exp(-t / tau)); every scheme is of first order in dt, within 0.5 dt / tau."""
    for scheme in SCHEMES:
        coarse = relaxation_error(scheme, 0.01 * TAU, tmp_path / f"{scheme} coarse")
        fine = relaxation_error(scheme, 0.005 * TAU, tmp_path / f"{scheme} fine")
        assert coarse < 0.5 * 0.01, scheme
        assert coarse / fine == pytest.approx(2.0, abs=0.1), scheme


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0, 100.0])
def test_implicit_drag_is_bounded_at_any_step(tmp_path, ratio):
    """u - v shrinks by q = (2 - k) / (2 + k) a step, k = dt / tau: |q| < 1 for every k.

    The first half step has no drag yet: u - v_n = u q^n / (1 - k / 2).
    """
    keys = (f"drag.multiplier={ratio * TAU / 3e-8}", "run.time_step_s=3e-8", SLOW)
    case = drag_case("drag.scheme=implicit", *keys)
    frames = drive(case, tmp_path / "run", gap=1e-4, steps=100, every=10)
    step = np.array([float(frame.step) for frame in frames[1:]])
    expected = 0.02 * (1 - ((2 - ratio) / (2 + ratio)) ** step / (1 - ratio / 2))
    assert along(frames)[1:] == pytest.approx(expected, rel=1e-9)


def test_a_fine_at_rest_is_pressed_by_the_drag_of_the_fluid(tmp_path):
    """Overlap 6 pi mu M r u / k, whatever the step."""
    for scheme, ratio in (("held", 0.5), ("viscous", 0.5), ("implicit", 0.1), ("implicit", 10)):
        keys = (f"drag.multiplier={ratio * TAU / 3e-8}", "run.time_step_s=3e-8", SLOW)
        case, folder = drag_case(f"drag.scheme={scheme}", *keys), tmp_path / f"{scheme}{ratio}"
        frames = drive(case, folder, gap=1e-8, steps=40_000, every=40_000)
        force = 6 * math.pi * 0.05 * case.drag.multiplier * RADIUS * 0.02
        overlap = force / scales_of(case).contacts["grain-fine"].normal_stiffness
        found = along(frames, "x")[-1] - TOUCHES
        assert found == pytest.approx(overlap, rel=1e-4), (scheme, ratio)


# ---- The pressure gradient, finite Reynolds numbers, and a dense bed.
def pushed(*assignments: str) -> Case:
    """The gradient is as strong as the drag of the fluid in these fines."""
    keys = ("drag.pressure_gradient=true", "run.stiffness_N_m=500.0")
    keys += ("fluid.velocity_m_s=0.5", f"run.time_step_s={0.005 * TAU}")
    return drag_case(*keys, *assignments)


def test_a_free_fine_drifts_as_drag_and_gradient_have_it(tmp_path):
    """v(t) = (u + V G / (6 pi mu r)) (1 - exp(-t / tau)) inside the pack, G = mu u phi / k."""
    for scheme in SCHEMES:
        radius = "0.05" if scheme == "viscous" else "[0.0499999, 0.0500001]"
        held = ["drag.refresh_steps=2"] if scheme == "held" else []
        case = pushed(f"drag.scheme={scheme}", f"fines.radius_mm={radius}", *held)
        scales = scales_of(case)
        frames = drive(case, tmp_path / scheme, gap=1.2e-3, steps=400, every=40)
        ratio = 2 / 9 * RADIUS**2 * scales.porosity / scales.permeability
        assert scales.gradient_over_drag == pytest.approx(ratio, rel=1e-5)
        assert 0.2 < ratio < 2, "both forces count"
        time = scales.time_step * np.array([frame.step for frame in frames])
        expected = 0.5 * (1 + ratio) * (1 - np.exp(-time / TAU))
        assert along(frames) == pytest.approx(expected, abs=0.006 * 0.5 * (1 + ratio)), scheme
        assert scales.drift_velocity == pytest.approx(0.5 * (1 + ratio), rel=1e-5)


def test_no_gradient_acts_in_the_mud(tmp_path):
    """A fine upstream of the face takes the velocity of the fluid, and gains speed inside."""
    for scheme in ("held", "viscous"):
        case = pushed(f"drag.scheme={scheme}")
        drift = scales_of(case).drift_velocity
        frames = drive(case, tmp_path / scheme, gap=TOUCHES + 6e-5, steps=3000, every=20)
        place, speed = along(frames, "x"), along(frames)
        assert speed[place < 0][-1] == pytest.approx(0.5, rel=0.02), scheme
        assert np.max(speed[place < 0]) <= 0.5
        assert place[-1] > 6e-5
        assert speed[-1] == pytest.approx(drift, rel=0.02), scheme
        assert drift > 1.2 * 0.5


def test_drag_at_a_finite_reynolds_number_relaxes_as_schiller_and_naumann_have_it(tmp_path):
    """dv/dt = (u - v) (1 + 0.15 Re^0.687) / tau, by quadrature of time over speed."""
    reynolds, tau = 1095 * 2 * RADIUS * 8.0 / 5e-3, 10 * TAU
    assert reynolds > 100
    slip = np.geomspace(8.0, 1e-3, 200_001)
    rate = slip * (1 + 0.15 * (reynolds * slip / 8.0) ** 0.687) / tau
    time = np.concatenate([[0], np.cumsum(-np.diff(slip) * (1 / rate[1:] + 1 / rate[:-1]) / 2)])
    for steps in (1, 2):
        case = drag_case(
            *("fluid={velocity_m_s=8.0, viscosity_cP=5.0}", "run.stiffness_N_m=5000.0"),
            *(f"run.time_step_s={5e-4 * TAU}", f"drag.refresh_steps={steps}"),
            "drag.inertia=schiller-naumann",
        )
        frames = drive(case, tmp_path / str(steps), gap=1.2e-3, steps=800, every=160)
        at = scales_of(case).time_step * np.array([frame.step for frame in frames])
        expected = 8.0 - np.interp(at, time, slip)
        assert along(frames) == pytest.approx(expected, abs=0.01 * 8.0), steps
        assert along(frames)[-1] > 2 * 8.0 * (1 - math.exp(-at[-1] / tau)), "Stokes's is slower"


# ---- Gravity, in whole invasions.
def fallen(case: Case, binary, folder: Path) -> tuple[Snapshot, float]:
    """Spheres after the fall of all fines far from the only grain, and the time, s."""
    scales = scales_of(case)
    box = np.column_stack([np.zeros(3), case.size_m])
    place = [[2.7e-3, 3e-4, 3e-4] if case.grains.motion == "fixed" else [2.0e-3, 1.5e-3, 1.5e-3]]
    lonely = resting_spheres(place, 2.5e-4, box, kind=Kind.GRAIN)
    result = invade(case, scales, lonely, folder, Launch(binary=binary))
    assert result.stop_reason == "duration"
    return result.state, result.history[-1].step * scales.time_step


PULL = np.array([60.0, -45.0, -100.0])
FREE = (
    "gravity.mode=on",
    f"gravity.acceleration_m_s2={PULL.tolist()}",
    "box.size_mm=[3.0,3.0,3.0]",
    "fluid={velocity_m_s=0.5, viscosity_cP=1e-12}",
    "run={duration_ms=0.2, checkpoint_ms=0.2}",
)
"""Gravity along all axes, and hardly any drag."""


def test_each_fine_of_several_materials_falls_by_its_own_density(binary, tmp_path):
    """With hardly any drag dv = g (1 - rho_f / rho_p) t in any direction; a light one rises."""
    sizes = {"D10_mm": 0.08, "D90_mm": 0.12}
    materials = [
        {"name": "light", "share": 1.0, "density_kg_m3": 1000.0, "sizes": sizes},
        {"name": "heavy", "share": 3.0, "density_kg_m3": 4500.0, "sizes": sizes},
    ]
    fines = {"count": 6, "concentration": 0.01, "supply": "slab", "materials": materials}
    for buoyancy in ("true", "false"):
        data = tiny(*FREE, f"gravity.buoyancy={buoyancy}").data()
        case = case_from(data | {"fines": fines})
        spheres, elapsed = fallen(case, binary, tmp_path / buoyancy)
        density = densities(case, [6])
        assert set(density) == {1000.0, 4500.0}
        share = 1 - 1095 / density[:, None] * (buoyancy == "true")
        six = spheres.fines()
        fall = six.velocity[np.argsort(six.id)] - [0.5, 0, 0]
        assert fall == pytest.approx(share * PULL * elapsed, rel=1e-5), f"buoyancy {buoyancy}"


def test_mobile_grains_fall_by_their_own_density(binary, tmp_path):
    """Grain and fine at once; the fluid drags the fine only."""
    case = tiny("fines.count=1", "grains.motion=mobile", *FREE)
    spheres, elapsed = fallen(case, binary, tmp_path)
    grain, fine = spheres.grains().velocity[0], spheres.fines().velocity[0] - [0.5, 0, 0]
    assert grain == pytest.approx((1 - 1095 / 2650) * PULL * elapsed, rel=1e-6)
    assert fine == pytest.approx((1 - 1095 / 2146) * PULL * elapsed, rel=1e-5)
