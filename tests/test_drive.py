"""Fines driven at a chosen velocity: the same ratios of forces, and the clock of the fluid."""

import math

import numpy as np
import pytest
from builders import resting_spheres, tiny

from fdnet.dem.invade_deck import render_invade
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.errors import CaseError
from fdnet.scales.flow import impact_stokes
from fdnet.scales.scales import InvasionScales, scales_of
from fdnet.scales.table import scale_rows
from fdnet.spheres.snapshot import Array, Kind

WELL = "well={radius_mm=108.0, drainage_radius_m=100.0}"


def driven(*assignments: str) -> InvasionScales:
    return scales_of(tiny(WELL, *assignments))


def test_the_impact_stokes_number_by_hand():
    """m v / (6 pi mu r^2) = (2/9) rho r v / mu, v that of a free fine."""
    scales = driven()
    mass = 4 / 3 * math.pi * 5e-5**3 * 2146
    by_hand = mass * scales.interstitial_velocity / (6 * math.pi * 0.05 * 5e-5**2)
    assert scales.impact_stokes == pytest.approx(by_hand, rel=1e-12)
    pushed = driven("drag.pressure_gradient=true")
    ratio = 2 / 9 * 5e-5**2 * pushed.porosity / pushed.permeability
    assert pushed.impact_stokes == pytest.approx((1 + ratio) * by_hand, rel=1e-12)
    assert impact_stokes(2.0, 3.0, 4.0) == 1.5


def test_the_simulation_is_driven_and_the_fluid_keeps_its_velocity():
    plain, fast = driven(), driven("drag.drive_velocity_m_s=0.5", "drag.upstream=darcy")
    assert plain.force_factor == 1.0
    assert plain.drive_velocity == plain.interstitial_velocity
    assert fast.interstitial_velocity == plain.interstitial_velocity
    assert fast.drive_velocity == 0.5
    assert fast.force_factor == pytest.approx(0.5 / plain.interstitial_velocity, rel=1e-12)
    assert fast.upstream_velocity == pytest.approx(0.5 * plain.porosity, rel=1e-12)
    # what belongs to the fluid is that of the fluid, what belongs to contacts is as simulated
    for name in ("reynolds", "gravity_over_drag", "pressure_gradient", "relaxation_time"):
        assert getattr(fast, name) == getattr(plain, name), name
    for name in ("stokes", "impact_stokes", "impact_overlap", "drag_overlap"):
        assert getattr(fast, name) == pytest.approx(
            fast.force_factor * getattr(plain, name), rel=1e-12
        ), name


def test_auto_drives_to_a_tenth_or_as_fast_as_the_fluid():
    assert driven("drag.drive_velocity_m_s=auto").impact_stokes == pytest.approx(0.1, rel=1e-12)
    own = ("fluid.velocity_m_s=1.0", "drag.drive_velocity_m_s=auto")
    assert scales_of(tiny(*own)).force_factor == 1.0


@pytest.mark.parametrize("key", ["duration", "plug_time", "cap", "checkpoint"])
def test_the_times_of_a_case_are_those_of_the_fluid(key):
    """Three times as fast, in a third of the time."""
    speed = driven().interstitial_velocity
    keys = {"checkpoint": 2.0, "plug_time": 40.0} | {key: 60.0 if key != "checkpoint" else 4.0}
    given = [f"run.{name}_ms={value}" for name, value in keys.items()]
    slow, fast = driven(*given), driven(*given, f"drag.drive_velocity_m_s={3 * speed}")
    assert fast.plug_time == pytest.approx(slow.plug_time / 3, rel=1e-12)
    assert fast.cap_time == pytest.approx(slow.cap_time / 3, rel=1e-12)
    chunk = [one.checkpoint_steps * one.time_step for one in (slow, fast)]
    assert chunk[1] == pytest.approx(chunk[0] / 3, rel=0.01)


def test_all_forces_of_the_deck_are_scaled_alike():
    heavy = ("gravity.mode=on", "run.duration_ms=20.0")

    def forces(*assignments: str) -> tuple[float, float]:
        case = tiny(WELL, "drag.scheme=viscous", *heavy, *assignments)
        box = np.column_stack([np.zeros(3), case.size_m])
        grain = resting_spheres([[1e-3, 8e-4, 8e-4]], 2.5e-4, box, kind=Kind.GRAIN)
        lines = render_invade(case, scales_of(case), grain).text.splitlines()
        push = next(line for line in lines if line.startswith("fix push"))
        pull = next(line for line in lines if line.startswith("fix grav"))
        return float(push.split()[4]), float(pull.split()[4])

    speed = driven().interstitial_velocity
    (push, pull), (fast_push, fast_pull) = forces(), forces(f"drag.drive_velocity_m_s={4 * speed}")
    assert fast_push == pytest.approx(4 * push, rel=1e-12)
    assert fast_pull == pytest.approx(4 * pull, rel=1e-12)


def test_a_drive_that_inertia_forbids_is_refused():
    most = 5e-5 / scales_of(tiny()).relaxation_time[0]
    with pytest.raises(CaseError, match=r"impact Stokes number 2 .*at most") as caught:
        driven(f"drag.drive_velocity_m_s={2 * most}")
    assert f"expected at most {most:.2g} m/s" in str(caught.value)
    with pytest.raises(CaseError, match="in the fluid itself"):
        scales_of(tiny(f"fluid.velocity_m_s={2 * most}", "drag.drive_velocity_m_s=0.1"))
    with pytest.raises(CaseError, match="in the fluid itself"):
        scales_of(tiny(f"fluid.velocity_m_s={2 * most}", "drag.drive_velocity_m_s=auto"))


def test_a_drive_near_the_bound_warns():
    most = 0.3 * 5e-5 / scales_of(tiny()).relaxation_time[0]
    texts = " ".join(driven(f"drag.drive_velocity_m_s={1.5 * most}").warnings)
    assert "impact Stokes number is 0.45 (above 0.3)" in texts
    assert f"lower it to {most:.2g} m/s" in texts
    assert "inertia may" not in " ".join(driven(f"drag.drive_velocity_m_s={most}").warnings)
    assert "inertia may" not in " ".join(scales_of(tiny()).warnings)


def test_a_drive_does_not_go_with_cohesion():
    keys = ("contact.model=hertz", "contact.cohesion_J_m3=1e4")
    with pytest.raises(CaseError, match=r"drag\.drive_velocity_m_s: auto with .*cohesion is not"):
        tiny("drag.drive_velocity_m_s=auto", *keys)


def test_the_table_of_scales_shows_the_drive():
    case = tiny(WELL, "drag.drive_velocity_m_s=0.5")
    rows = {one.symbol: one.value for one in scale_rows(case, scales_of(case))}
    assert rows["u_DEM"] == 0.5
    assert rows["s"] == pytest.approx(0.5 / rows["u"], rel=1e-12)
    assert "u_DEM" not in {one.symbol for one in scale_rows(tiny(), scales_of(tiny()))}


@pytest.mark.liggghts
def test_driven_fines_go_the_same_way_in_a_part_of_the_time(binary, tmp_path):
    """Between 16 grains, with gravity across: each of 30 fines ends where the slow fluid takes it.

    They go 30 of their radii and sink by two. Inertia leaves about the impact Stokes number (0.02
    and 0.07) times a radius at each contact.
    """
    keys = (
        "box={size_mm=[3.0, 1.6, 1.6], sides='periodic'}",
        "fines={radius_mm=0.05, count=30}",
        "fluid={viscosity_cP=50.0, velocity_m_s=0.05}",
        "gravity={mode='on', acceleration_m_s2=[0.0, 0.0, -300.0]}",
        "run={stiffness_N_m=30.0, duration_ms=30.0, time_step_factor=0.2}",
    )
    places = [(i, j) for i in range(4) for j in range(4)]
    centres = [[4e-4 + 3e-4 * ((i + j) % 2), 2e-4 + 4e-4 * i, 2e-4 + 4e-4 * j] for i, j in places]

    def ends(velocity: float) -> Array:
        case = tiny(*keys, f"drag.drive_velocity_m_s={velocity}")
        box = np.column_stack([np.zeros(3), case.size_m])
        grains = resting_spheres(centres, 1.7e-4, box, kind=Kind.GRAIN)
        folder = tmp_path / str(velocity)
        result = invade(case, scales_of(case), grains, folder, Launch(binary=binary))
        fines = result.damaged.fines()
        return fines.position[np.argsort(fines.id)]

    away = ends(0.15) - ends(0.05)
    away[:, 1:] -= 1.6e-3 * np.round(away[:, 1:] / 1.6e-3)
    in_radii = np.linalg.norm(away, axis=1) / 5e-5
    assert np.median(in_radii) < 0.1
    assert in_radii.max() < 0.3
