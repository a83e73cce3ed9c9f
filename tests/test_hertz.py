"""Hertz contacts of a case: closed forms, softening, steps, and the keys of each model."""

import math
import tomllib

import pytest
from builders import TINY, tiny
from scipy.integrate import quad

from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.scales.contacts import (
    REFERENCE_OVERLAP,
    STEP_OVERLAP,
    collision_time,
    elastic,
    joint_radius,
    overlap_of_impact,
    overlap_under,
    rayleigh_time,
    secant_stiffness,
    tangential_stiffness,
)
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

HERTZ = "contact.model=hertz"


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


def test_the_overlap_under_a_force_carries_the_force():
    depth = overlap_under(1e-3, 1e9, 5e-5)
    assert secant_stiffness(1e9, 5e-5, depth) * depth == pytest.approx(1e-3, rel=1e-12)


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


@pytest.mark.parametrize(
    "keys", [(), ("fines.radius_mm=[0.03,0.08]",), ("fines.poissons_ratio=0.5",)]
)
def test_the_step_resolves_the_tangent_at_four_percent_and_the_usual_bounds(keys):
    """At the largest factor it is below 0.2 Rayleigh times and 1/10 of a collision."""
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


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ((HERTZ, "grains.normal_stiffness_N_m=1e9"), "grains.normal_stiffness_N_m: not read by"),
        ((HERTZ, "fines.shear_stiffness_N_m=1e9"), "fines.shear_stiffness_N_m: not read by"),
        (("fines.youngs_modulus_GPa=50.0",), "fines.youngs_modulus_GPa: not read by"),
        (
            ("grains.poissons_ratio=0.1",),
            "grains.poissons_ratio: not read by contact.model 'hooke'",
        ),
        ((HERTZ, "grains.damping_ratio=0.7"), "expected at most 0.69"),
        (("contact.model=linear",), "contact.model: 'linear'"),
    ],
)
def test_a_key_of_the_other_model_is_one_clear_problem(keys, message):
    with pytest.raises(CaseError, match="1 problem: ") as error:
        tiny(*keys)
    assert message in str(error.value)


def test_a_hertz_case_comes_back_from_its_text_and_a_hooke_one_is_as_before():
    case = tiny(HERTZ, "fines.youngs_modulus_GPa=50.0")
    again = case_from(tomllib.loads(case.toml()))
    assert again.digest() == case.digest()
    assert "normal_stiffness_N_m" not in case.toml()
    assert "youngs_modulus_GPa" not in tiny().toml()
    packs = {
        tiny(*keys).digest("pack") for keys in ((), (HERTZ,), (HERTZ, "fines.radius_mm=0.06"))
    }
    assert len(packs) == 3
    assert tiny(HERTZ, "fines.count=301").digest("pack") == tiny(HERTZ).digest("pack")
