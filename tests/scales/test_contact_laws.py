"""Contacts of a case: closed forms of each model, rebound in the liquid, cohesion and locking."""

import math
import re
import tomllib

import numpy as np
import pytest
from builders import TINY, naming, tiny
from scipy.integrate import quad

from fdnet.case.file import case_from
from fdnet.case.spheres import SHEAR_RATIO
from fdnet.errors import CaseError
from fdnet.scales.contacts import (
    REFERENCE_OVERLAP,
    STEP_OVERLAP,
    collision_time,
    elastic,
    fall_velocity,
    false_force,
    groove_slope,
    joint_radius,
    overlap_of_impact,
    overlap_under,
    pair_stokes,
    pull_off,
    rayleigh_time,
    restitution_of,
    secant_stiffness,
    sphere_mass,
    tangential_stiffness,
    wet_ratio,
)
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

HERTZ = "contact.model=hertz"


WET = "contact.restitution=liquid"


def test_a_contact_of_like_spheres_by_hand():
    """E* = E / (2 (1 - nu^2)) and k_t / k_n = 3 (1 - nu) / (2 - nu), force over overlap."""
    for poisson in (0.0, 0.25, 0.5):
        pair = elastic((1e9, poisson), (1e9, poisson))
        assert pair.modulus == pytest.approx(1e9 / (2 * (1 - poisson**2)), rel=1e-14)
        assert tangential_stiffness(pair.shear, 1e-3, 1e-5) / secant_stiffness(
            pair.modulus, 1e-3, 1e-5
        ) == pytest.approx(3 * (1 - poisson) / (2 - poisson), rel=1e-14)
    assert joint_radius(1.0, 1.0) == 0.5
    assert joint_radius(1.0, math.inf) == 1.0
    depth = overlap_under(1e-3, 1e9, 5e-5)
    assert secant_stiffness(1e9, 5e-5, depth) * depth == pytest.approx(1e-3, rel=1e-12)


def test_overlap_and_duration_of_an_impact_are_those_of_energy():
    """The largest overlap turns m v^2 / 2 into 8/15 E* sqrt(R*) delta^(5/2); T = 2 int dx / v."""
    mass, speed, modulus, radius = 1e-9, 2.0, 1e9, 5e-5
    deepest = overlap_of_impact(mass, speed, modulus, radius)
    stored = 8 / 15 * modulus * math.sqrt(radius) * deepest**2.5
    assert stored == pytest.approx(0.5 * mass * speed**2, rel=1e-12)
    # with x = 1 - y^2 the integrand of 2 int_0^1 dx / sqrt(1 - x^(5/2)) has no pole
    span, _ = quad(lambda y: 4 * y / math.sqrt(1 - (1 - y * y) ** 2.5) if y else 0.0, 1e-9, 1)
    assert collision_time(mass, speed, modulus, radius) == pytest.approx(
        span * deepest / speed, rel=1e-6
    )
    textbook = 2.87 * (mass**2 / (radius * modulus**2 * speed)) ** 0.2
    assert collision_time(mass, speed, modulus, radius) == pytest.approx(textbook, rel=1e-3)


def test_damping_shortens_the_way_as_that_of_an_oscillator():
    """delta^(5/4) is the way of a linear oscillator: integrate it, and take the power 4/5."""
    mass, speed, modulus, radius, zeta = 1e-9, 2.0, 1e9, 5e-5, 0.3
    stiffness, step = 4 / 3 * modulus * math.sqrt(radius), 1e-11
    damping = 2 * zeta * math.sqrt(1.25 * stiffness * mass)
    x, v = 0.0, speed
    while v > 0:
        x += 0.5 * step * v
        v -= step / mass * (stiffness * x**1.5 + damping * x**0.25 * v)
        x += 0.5 * step * v
    assert overlap_of_impact(mass, speed, modulus, radius, damping=zeta) == pytest.approx(
        x, rel=1e-3
    )


def test_the_stiffness_of_the_case_is_that_of_the_stiffest_contact_of_a_fine():
    """At an overlap of 1 % of its diameter; all moduli are softened alike."""
    case = tiny(HERTZ)
    scales = scales_of(case)
    fines = {name: k.normal_stiffness for name, k in scales.contacts.items() if "fine" in name}
    assert max(fines.values()) == pytest.approx(case.run.stiffness_N_m, rel=1e-12)
    real = elastic((94.3e9, 0.387), (63e9, 0.212)).modulus
    used = scales.contacts["grain-fine"]
    assert used.elastic is not None
    assert used.elastic.modulus == pytest.approx(scales.stiffness_factor * real, rel=1e-12)
    joint = joint_radius(0.05e-3, 0.25e-3)
    assert used.normal_stiffness == pytest.approx(
        secant_stiffness(used.elastic.modulus, joint, REFERENCE_OVERLAP * 0.1e-3), rel=1e-12
    )
    assert scales_of(tiny(HERTZ, "run.stiffness_N_m=nominal")).stiffness_factor == 1.0
    bare = case_from(
        {k: v for k, v in TINY.items() if k != "fines"} | {"contact": case.data()["contact"]}
    )
    alone = [contact.normal_stiffness for contact in scales_of(bare).contacts.values()]
    assert max(alone) == pytest.approx(1e4, rel=1e-12)


def test_the_step_resolves_the_tangent_at_four_percent_and_the_usual_bounds():
    """At the largest factor it is below 0.2 Rayleigh times and 1/10 of a collision."""
    for keys in [(), ("fines.radius_mm=[0.03,0.08]",), ("fines.poissons_ratio=0.5",)]:
        with naming(keys):
            case = tiny(HERTZ, "run.time_step_factor=0.2", "fluid.velocity_m_s=2.0", *keys)
            scales = scales_of(case)
            low = case.fines.radius_range_m[0]
            mass = 4 / 3 * math.pi * low**3 * 2146
            stiffest = max(
                1.5 * secant_stiffness(contact.elastic.modulus, joint, STEP_OVERLAP * 2 * low)
                for contact, joint in (
                    (scales.contacts["grain-fine"], joint_radius(low, 0.25e-3)),
                    (scales.contacts["fine-fine"], low / 2),
                    (scales.contacts["fine-wall"], low),
                )
            )
            assert scales.time_step == pytest.approx(0.2 * math.sqrt(mass / stiffest), rel=1e-12)
            young = scales.stiffness_factor * case.fines.youngs_modulus_Pa
            rayleigh = rayleigh_time(low, 2146, young, case.fines.poissons_ratio)
            assert scales.time_step < 0.2 * rayleigh
            assert scales.time_step < 0.1 * min(
                k.contact_time for name, k in scales.contacts.items() if "fine" in name
            )
            rows = {row.name: row.value for row in scale_rows(case, scales)}
            assert rows["Rayleigh time of the smallest fine"] == pytest.approx(rayleigh)


def test_predicted_overlaps_are_hertz_s():
    scales = scales_of(tiny(HERTZ, "fluid.velocity_m_s=2.0"))
    modulus, joint = scales.contacts["grain-fine"].elastic.modulus, joint_radius(5e-5, 2.5e-4)
    mass = 4 / 3 * math.pi * 5e-5**3 * 2146
    assert scales.impact_overlap == pytest.approx(
        overlap_of_impact(mass, 2.0, modulus, joint) / 1e-4, rel=1e-12
    )
    push = 6 * math.pi * 0.05 * 5e-5 * 2.0
    assert scales.drag_overlap == pytest.approx(
        overlap_under(push, modulus, joint) / 1e-4, rel=1e-12
    )


def test_small_fines_lock_and_the_remedy_is_one_that_the_model_has():
    """Mindlin's tangential spring is as stiff as the normal one, so f > t is enough to lock."""
    text = " ".join(scales_of(tiny(HERTZ, "fines.radius_mm=0.025")).warnings)
    assert "may lock between grains" in text
    assert "contact.model = 'hooke'" in text
    assert "shear_stiffness_N_m" not in text
    assert "lock" not in " ".join(scales_of(tiny(HERTZ, "fines.friction=0.2")).warnings)


def test_a_key_that_the_model_does_not_read_is_one_clear_problem():
    for keys, message in (
        ((HERTZ, "grains.normal_stiffness_N_m=1e9"), "grains.normal_stiffness_N_m: not read by"),
        ((HERTZ, "fines.shear_stiffness_N_m=1e9"), "fines.shear_stiffness_N_m: not read by"),
        (("fines.youngs_modulus_GPa=50.0",), "fines.youngs_modulus_GPa: not read by"),
        (("grains.poissons_ratio=0.1",), "grains.poissons_ratio: not read by contact.model 'hoo"),
        ((HERTZ, "grains.damping_ratio=0.7"), "expected at most 0.69"),
        (("contact.model=linear",), "contact.model: 'linear'"),
        (("contact.cohesion_J_m3=1e4",), "take contact.model = 'hertz'"),
        (("contact.rolling_friction=0.1", "fines.friction=0.0"), "spheres that slide do not roll"),
        (("contact.rolling_friction=-0.1",), "contact.rolling_friction: -0.1"),
        (("contact.restitution=wet",), "contact.restitution: 'wet'"),
    ):
        with naming(keys), pytest.raises(CaseError, match="1 problem: ") as error:
            tiny(*keys)
        assert message in str(error.value)


def test_contacts_belong_to_the_digests_of_what_they_decide():
    """A Hertz case comes back from its text; a linear one has no key of the other model."""
    case = tiny(HERTZ, "fines.youngs_modulus_GPa=50.0")
    assert case_from(tomllib.loads(case.toml())).digest() == case.digest()
    assert "normal_stiffness_N_m" not in case.toml()
    assert "youngs_modulus_GPa" not in tiny().toml()
    packs = {tiny(*keys).digest("pack") for keys in ((), (HERTZ,), (HERTZ, SMALL))}
    assert len(packs) == 3
    assert tiny(HERTZ, "fines.count=301").digest("pack") == tiny(HERTZ).digest("pack")
    for key in (WET, "contact.rolling_friction=0.1"):
        assert tiny(key).digest("pack") == tiny().digest("pack")
        assert tiny(key).digest("invade") != tiny().digest("invade")


# ------------------------------------------------------------------------------------------------
# Rebound in the liquid, and cohesion.


def test_the_stokes_number_of_a_sphere_and_a_wall_is_joseph_s():
    """St = (1/9) (rho_s / rho_f) Re = 2 r rho_s v / (9 mu)."""
    radius, density, velocity, viscosity = 5e-5, 2146.0, 2.0, 0.05
    mass = 4 / 3 * math.pi * radius**3 * density
    reynolds = 1095 * velocity * 2 * radius / viscosity
    assert pair_stokes(mass, radius, velocity, viscosity) == pytest.approx(
        density / 1095 * reynolds / 9, rel=1e-12
    )


def test_restitution_is_lost_below_ten_and_dry_above_five_hundred():
    """Joseph and others (2001): no rebound below a Stokes number of 10, dry above 500."""
    dry = 0.1
    share = [
        restitution_of(wet_ratio(dry, stokes, least=1e-9)) / restitution_of(dry)
        for stokes in (5, 10, 35, 500)
    ]
    assert share[0] < 0.001
    assert share[1] < 0.04
    assert share[2] == pytest.approx(math.exp(-1), rel=1e-12)
    assert share[3] > 0.93
    assert restitution_of(wet_ratio(dry, 0.5, least=0.0501)) == pytest.approx(0.0501, rel=1e-12)


def test_contacts_of_a_fine_take_the_stokes_number_of_the_fluid():
    """Fixed grains count as infinitely heavy; contacts of grains stay dry."""
    case = tiny(WET, "fluid.velocity_m_s=3.0", "fluid.viscosity_cP=2.0")
    scales = scales_of(case)
    fine, grain = 5e-5, 2.5e-4
    mass = 4 / 3 * math.pi * fine**3 * 2146
    for name, effective, radius in (
        ("grain-fine", mass, 1 / (1 / fine + 1 / grain)),
        ("fine-fine", mass / 2, fine / 2),
        ("fine-wall", mass, fine),
    ):
        contact = scales.contacts[name]
        stokes = effective * 3.0 / (6 * math.pi * 2e-3 * radius**2)
        assert contact.stokes == pytest.approx(stokes, rel=1e-12)
        dry = math.exp(-math.pi * 0.2 / math.sqrt(1 - 0.04))
        assert contact.restitution == pytest.approx(dry * math.exp(-35 / stokes), rel=1e-9)
        frequency = math.sqrt(contact.normal_stiffness / effective)
        assert contact.damping_rate == pytest.approx(2 * contact.damping_ratio * frequency)
    assert scales.contacts["grain-grain"].stokes is None
    assert scales.contacts["grain-grain"].damping_ratio == 0.2
    rows = {row.name: row.value for row in scale_rows(case, scales)}
    assert (
        rows["grain-fine restitution in the liquid"] == scales.contacts["grain-fine"].restitution
    )
    assert rows["fine-wall impact Stokes number"] == scales.contacts["fine-wall"].stokes
    assert "grain-grain impact Stokes number" not in rows
    slow = scales_of(tiny(WET, "fluid.velocity_m_s=1e-3")).contacts["grain-fine"]
    assert slow.stokes < 1e-3
    assert slow.restitution == pytest.approx(1e-6, rel=1e-9), "linear contacts stop there"
    hertz = scales_of(tiny(WET, HERTZ, "fluid.velocity_m_s=1.0")).contacts["grain-fine"]
    assert hertz.restitution == pytest.approx(0.0501, rel=1e-9), "the least that LIGGGHTS takes"


def test_the_pull_off_force_is_the_least_of_the_force_curve():
    cohesion, modulus, radius = 2e5, 1e9, 5e-5
    expected = pull_off(cohesion, modulus, radius)
    overlap = np.linspace(0.0, 3 * expected.resting, 200_001)
    force = 4 / 3 * modulus * math.sqrt(radius) * overlap**1.5
    force -= 2 * math.pi * cohesion * radius * overlap
    assert -force.min() == pytest.approx(expected.force, rel=1e-8)
    assert overlap[force.argmin()] == pytest.approx(expected.overlap, rel=1e-4)
    resting = secant_stiffness(modulus, radius, expected.resting)
    assert resting == pytest.approx(2 * math.pi * cohesion * radius, rel=1e-12)


def test_cohesion_that_draws_fines_into_grains_warns_and_is_refused():
    """At rest the overlap is 9/4 (pi c / E*)^2 R*; E* is about 1.06e9 Pa here."""
    case = tiny(HERTZ, "contact.cohesion_J_m3=1e7", "fluid.velocity_m_s=1.0")
    modulus = scales_of(case).contacts["grain-fine"].elastic.modulus
    joint = 1 / (1 / 5e-5 + 1 / 2.5e-4)
    at_limit = 1e-4 / joint * (modulus / math.pi) ** 2 / 2.25
    for share, warned in ((0.029, False), (0.031, True)):
        cohesion = math.sqrt(share * at_limit)
        text = " ".join(
            scales_of(
                tiny(HERTZ, f"contact.cohesion_J_m3={cohesion!r}", "fluid.velocity_m_s=1.0")
            ).warnings
        )
        assert ("cohesion draws a fine" in text) is warned
    with pytest.raises(CaseError, match="draws a fine 51 % of its diameter into a grain"):
        scales_of(tiny(HERTZ, f"contact.cohesion_J_m3={math.sqrt(0.51 * at_limit)!r}"))
    rows = {row.name: row.value for row in scale_rows(case, scales_of(case))}
    assert rows["pull-off force of a fine from a grain"] == pytest.approx(
        2 / 3 * (math.pi * 1e7) ** 3 * joint**2 / modulus**2, rel=1e-12
    )


# ------------------------------------------------------------------------------------------------
# Fines that lock between two grains.


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


def test_springs_lock_above_a_shear_ratio_of_friction_times_slope():
    """A second way: the way out of the groove, step by step."""
    for slope in [0.1, 0.32, 0.45]:
        with naming(slope):
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
