"""Fines that lock between two grains: when, and what the warning says."""

import math
import re

import pytest
from builders import tiny

from fdnet.case.spheres import SHEAR_RATIO
from fdnet.scales.contacts import fall_velocity, false_force, groove_slope, sphere_mass
from fdnet.scales.scales import scales_of

MATERIALS = ("grains.shear_stiffness_N_m=34e9", "fines.shear_stiffness_N_m=26e9")
SMALL = "fines.radius_mm=0.0125"


def locking(*assignments):
    return [one for one in scales_of(tiny(*assignments)).warnings if "lock between" in one]


def test_the_groove_of_two_touching_grains_by_its_triangle():
    """Centres at (-R, 0), (R, 0) and (0, h): the sides of the groove rise by h over R."""
    for ratio in (0.05, 0.2, 1.0):
        height = math.sqrt((1 + ratio) ** 2 - 1)
        assert math.hypot(1.0, height) == pytest.approx(1 + ratio)
        assert groove_slope(ratio) == pytest.approx(height)
    assert groove_slope(math.sqrt(2) - 1) == pytest.approx(1.0)


def thrown_back(slope, friction, ratio):
    """Depth left of a depth of 1 in a groove, by steps of the way out; 0 when it leaves.

    Per unit of depth the normal spring is 1 / (1 + t^2)^(1/2) t, the tangential one slides at
    -f N on the way in and gains k_t / k_n times the way along the side on the way out.
    """
    n_r, n_x = slope / math.hypot(1, slope), 1 / math.hypot(1, slope)
    start = -friction * n_r
    depth, step = 1.0, 1e-4
    while depth > 0:
        normal = n_r * depth
        tangential = start + ratio * n_x * (1 - depth)
        if tangential * n_x >= normal * n_r:
            return depth
        depth -= step
    return 0.0


@pytest.mark.parametrize("slope", [0.1, 0.32, 0.45])
def test_springs_lock_above_a_shear_ratio_of_friction_times_slope(slope):
    """A second way: the way out of the groove, step by step."""
    for friction in (0.5, 0.8):
        limit = friction * slope
        assert thrown_back(slope, friction, 1.05 * limit) > 0
        assert thrown_back(slope, friction, 0.95 * limit) == 0.0
        fine = f"fines.radius_mm={0.25 * (math.hypot(1, slope) - 1)}"
        for factor in (0.95, 1.05):
            shear = [
                f"{part}.shear_stiffness_N_m={factor * limit * normal!r}"
                for part, normal in (("grains", 94.3e9), ("fines", 63e9))
            ]
            case = tiny(
                fine,
                f"fines.friction={friction}",
                f"grains.friction={friction}",
                "fines.count=3000",
                *shear,
            )
            assert scales_of(case).sticking.by_springs == (factor > 1)


def test_the_default_shear_stiffness_locks_no_fine_larger_than_a_370th():
    assert 0.55 * groove_slope(1 / 370) > SHEAR_RATIO
    for radius in (0.0125, 0.025, 0.05):
        scales = scales_of(tiny(f"fines.radius_mm={radius}"))
        assert scales.sticking.shear_ratio == pytest.approx(SHEAR_RATIO)
        assert not scales.sticking.by_springs
        assert not locking(f"fines.radius_mm={radius}")


def test_the_warning_names_ratio_friction_and_push_and_what_to_do():
    (text,) = locking(SMALL, *MATERIALS)
    scales = scales_of(tiny(SMALL, *MATERIALS))
    contact = scales.contacts["grain-fine"]
    push = 6 * math.pi * 0.05 * scales.interstitial_velocity / contact.normal_stiffness
    assert "fines of 1/20 of a grain" in text
    assert "friction 0.55 (above the slope 0.32" in text
    assert f"push F/(k r) {push:.1e}" in text
    assert "leave out grains.shear_stiffness_N_m" in text
    assert not locking(SMALL, *MATERIALS, "fines.friction=0.32")
    assert not locking("fines.radius_mm=0.05", *MATERIALS)


def test_a_weak_push_on_stiff_springs_warns_of_the_integrator_and_its_remedies_hold():
    weak = (SMALL, "fluid.viscosity_cP=0.5", "fluid.velocity_m_s=1.0")
    (text,) = locking(*weak)
    sticking = scales_of(tiny(*weak)).sticking
    assert sticking.false_force > 0.5
    parsed = re.search(
        r"divide run.time_step_factor by (\S+), or run.stiffness_N_m by (\S+) ", text
    )
    step, stiffness = (float(one) for one in parsed.groups())
    assert locking(*weak, f"run.time_step_factor={0.1 / (0.9 * step)!r}")
    assert not locking(*weak, f"run.time_step_factor={0.1 / (1.1 * step)!r}")
    assert locking(*weak, f"run.stiffness_N_m={1e4 / (0.9 * stiffness)!r}")
    assert not locking(*weak, f"run.stiffness_N_m={1e4 / (1.1 * stiffness)!r}")


def test_the_false_force_by_hand():
    """A force of 1 N over 2 m gives 2 kg a speed of sqrt(2) m/s; k_t v dt pi / 4 of it."""
    assert fall_velocity(1.0, 2.0, 2.0) == pytest.approx(math.sqrt(2))
    assert false_force(4.0, 3.0, 0.5) == pytest.approx(1.5 * math.pi)
    sticking = scales_of(tiny(SMALL)).sticking
    mass, radius = sphere_mass(0.0125e-3, 2146), 0.0125e-3
    scales = scales_of(tiny(SMALL))
    drag = 6 * math.pi * 0.05 * radius
    slow = scales.contacts["grain-fine"].shear_stiffness * scales.time_step * math.pi / 4 / drag
    assert mass / drag * scales.interstitial_velocity < 0.1e-3
    assert sticking.false_force == pytest.approx(slow)
