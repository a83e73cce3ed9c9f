"""The forces of the fluid on a fine, on the real binary: pressure gradient and Reynolds number."""

import math

import numpy as np
import pytest
from builders import resting_spheres, tiny
from test_drag import RADIUS, TAU, drag_text, drive, speeds

from fdnet.case.case import Case
from fdnet.dem.deck import render_text, write_data
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.scales.drag import Crowd, push_of
from fdnet.scales.drag import crowd_drag_factor as drag_factor
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import read_dump
from fdnet.spheres.snapshot import Kind

pytestmark = pytest.mark.liggghts
SPEED, START = 0.5, 1.75e-3 - RADIUS
"""Velocity of the fluid, m/s; where `drive` puts a fine that touches its grain, m."""


def pushed(*assignments: str) -> Case:
    """The gradient is as strong as the drag of the fluid in these fines."""
    return tiny(
        f"fluid.velocity_m_s={SPEED}",
        "fines.friction=0.0",
        "drag.pressure_gradient=true",
        "run.stiffness_N_m=500.0",
        f"run.time_step_s={0.005 * TAU}",
        *assignments,
    )


@pytest.mark.parametrize(
    ("scheme", "radius"),
    [
        ("held", "[0.0499999, 0.0500001]"),
        ("implicit", "[0.0499999, 0.0500001]"),
        ("viscous", "0.05"),
    ],
)
def test_a_free_fine_drifts_as_drag_and_gradient_have_it(binary, tmp_path, scheme, radius):
    """v(t) = (u + V G / (6 pi mu r)) (1 - exp(-t / tau)) inside the pack, G = mu u phi / k."""
    held = ["drag.refresh_steps=2"] if scheme == "held" else []
    case = pushed(f"drag.scheme={scheme}", f"fines.radius_mm={radius}", *held)
    scales, frames = drive(case, binary, tmp_path / "run", gap=1.2e-3, steps=400, every=40)
    ratio = 2 / 9 * RADIUS**2 * scales.porosity / scales.permeability
    assert scales.gradient_over_drag == pytest.approx(ratio, rel=1e-5)
    assert 0.2 < ratio < 2, "both forces count"
    time = scales.time_step * np.array([frame.step for frame in frames])
    expected = SPEED * (1 + ratio) * (1 - np.exp(-time / TAU))
    assert speeds(frames) == pytest.approx(expected, abs=0.006 * SPEED * (1 + ratio))
    assert scales.drift_velocity == pytest.approx(SPEED * (1 + ratio), rel=1e-5)


@pytest.mark.parametrize("scheme", ["held", "viscous"])
def test_no_gradient_acts_in_the_mud(binary, tmp_path, scheme):
    """A fine upstream of the face takes the velocity of the fluid, and gains speed inside."""
    case = pushed(f"drag.scheme={scheme}")
    scales, frames = drive(case, binary, tmp_path / "run", gap=START + 6e-5, steps=3000, every=20)
    place = np.array([frame.column("x")[0] for frame in frames])
    upstream = speeds(frames)[place < 0]
    assert upstream[-1] == pytest.approx(SPEED, rel=0.02)
    assert np.max(upstream) <= SPEED
    assert place[-1] > 6e-5
    assert speeds(frames)[-1] == pytest.approx(scales.drift_velocity, rel=0.02)
    assert scales.drift_velocity > 1.2 * SPEED


def test_a_fine_at_rest_is_pressed_by_drag_and_gradient(binary, tmp_path):
    """Overlap (6 pi mu r u + V G) / k; the estimate of the scales is that of the largest fine."""
    case = pushed("drag.scheme=viscous")
    scales, frames = drive(case, binary, tmp_path / "run", gap=1e-8, steps=20_000, every=20_000)
    overlap = frames[-1].column("x")[0] - START
    push = push_of(case, SPEED, scales.pressure_gradient)
    stiffness = scales.contacts["grain-fine"].normal_stiffness
    force = 6 * math.pi * 0.05 * RADIUS * SPEED
    force += 4 / 3 * math.pi * RADIUS**3 * 0.05 * SPEED * scales.porosity / scales.permeability
    assert push.force(RADIUS) == pytest.approx(force)
    assert overlap == pytest.approx(force / stiffness, rel=1e-4)
    assert scales.drag_overlap == pytest.approx(force / stiffness / (2 * RADIUS))


@pytest.mark.parametrize("steps", [1, 2])
def test_drag_at_a_finite_reynolds_number_relaxes_as_schiller_and_naumann_have_it(
    binary, tmp_path, steps
):
    """dv/dt = (u - v) (1 + 0.15 Re^0.687) / tau, by quadrature of time over speed."""
    case = tiny(
        "fluid={velocity_m_s=8.0, viscosity_cP=5.0}",
        "fines.friction=0.0",
        "run.stiffness_N_m=5000.0",
        f"run.time_step_s={5e-4 * TAU}",
        f"drag.refresh_steps={steps}",
        "drag.inertia=schiller-naumann",
    )
    _, frames = drive(case, binary, tmp_path / "run", gap=1.2e-3, steps=800, every=160)
    reynolds = 1095 * 2 * RADIUS * 8.0 / 5e-3
    assert reynolds > 100
    tau = 10 * TAU
    seen, step = speeds(frames), scales_of(case).time_step
    slip = np.geomspace(8.0, 1e-3, 200_001)
    rate = slip * (1 + 0.15 * (reynolds * slip / 8.0) ** 0.687) / tau
    time = np.concatenate([[0], np.cumsum(-np.diff(slip) * (1 / rate[1:] + 1 / rate[:-1]) / 2)])
    for frame, speed in zip(frames, seen, strict=True):
        expected = 8.0 - np.interp(frame.step * step, time, slip)
        assert speed == pytest.approx(expected, abs=0.01 * 8.0)
    assert seen[-1] > 2 * 8.0 * (1 - math.exp(-800 * step / tau)), "Stokes's is far slower"


@pytest.mark.parametrize("scheme", ["held", "viscous"])
def test_the_forces_on_a_dense_bed_add_up_to_its_pressure_drop(binary, tmp_path, scheme):
    """150 held fines at a porosity of 0.40: the sum of the dumped forces is G A L within 1 %.

    The drag coefficient is that of Beetstra's law beside the gradient of Carman and Kozeny's.
    """
    factor = 0.4 * float(drag_factor(Crowd(porosity=0.4)))
    volume = 150 * 4 / 3 * math.pi * RADIUS**3 / 0.6
    length = volume / 0.5e-3**2
    case = tiny(
        f"drag={{multiplier={factor}, scheme={scheme!r}}}",
        "grains={radius_mm=0.0500001, porosity=0.4}",
        f"box.size_mm=[{1e3 * length}, 0.5, 0.5]",
        "fines={radius_mm=0.05, count=150}",
        "fluid.velocity_m_s=0.01",
    )
    scales = scales_of(case)
    forces = bed_forces(case, binary, tmp_path)
    assert len(forces) == 150
    assert np.sum(forces) == pytest.approx(scales.pressure_gradient * volume, rel=0.01)
    single = 6 * math.pi * 0.05 * RADIUS * 0.01 * factor
    assert np.sum(forces) - 150 * single == pytest.approx(0.6 * scales.pressure_gradient * volume)


def bed_forces(case: Case, binary, folder) -> np.ndarray:
    """Forces along x, N, on fines that neither move nor touch, by the deck's own lines."""
    size = np.array(case.size_m)
    grid = np.stack(np.meshgrid(*[(np.arange(n) + 0.5) / n for n in (6, 5, 5)], indexing="ij"))
    box = np.column_stack([np.zeros(3), size])
    place = (grid.reshape(3, -1).T * size).tolist()
    fines = resting_spheres(place, RADIUS, box, kind=Kind.FINE, first=2)
    grain = resting_spheres([(size / 2).tolist()], RADIUS, box, kind=Kind.GRAIN)
    write_data(
        folder / "bed.data",
        grain.joined(fines),
        bounds=box,
        density=np.full(len(fines) + 1, 2146.0),
        types=2,
    )
    header = {
        "stage": "test",
        "case_name": "bed",
        "digest": "-",
        "left_out": [],
        "boundary": "f f f",
        "processors": "",
    }
    text = render_text("_header.in.j2", header) + "read_data bed.data\n"
    text += "group grains type 1\ngroup fines type 2\nneighbor 1e-5 bin\n"
    text += "fix kn all property/global kn peratomtypepair 2 1 1 1 1\n"
    text += "fix kt all property/global kt peratomtypepair 2 0 0 0 0\n"
    text += "fix gn all property/global gamman peratomtypepair 2 0 0 0 0\n"
    text += "fix gt all property/global gammat peratomtypepair 2 0 0 0 0\n"
    text += "pair_style gran model hooke/stiffness\npair_coeff * *\ntimestep 1e-8\n"
    text += "neigh_modify delay 0 exclude group all all\n"
    text += drag_text(case, scales_of(case))
    text += "dump d fines custom 1 d.dump id x fx\n"
    text += 'dump_modify d sort id format "%d %.17g %.17g"\nrun 1\nprint "DECK_DONE"\n'
    (folder / "in.bed").write_text(text)
    run_deck(folder, "in.bed", Launch(binary=binary))
    return read_dump(folder / "d.dump")[-1].column("fx")
