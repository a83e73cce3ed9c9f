"""Rebound in the liquid, rolling friction and cohesion: formulas, keys, and decks."""

import math

import numpy as np
import pytest
from builders import tiny
from test_deck import has, invade_text

from fdnet.dem.packing import render_pack
from fdnet.errors import CaseError
from fdnet.scales.contacts import (
    pair_stokes,
    pull_off,
    restitution_of,
    secant_stiffness,
    wet_ratio,
)
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

WET = "contact.restitution=liquid"
HERTZ = "contact.model=hertz"


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


def test_a_creeping_fluid_leaves_a_damping_ratio_below_one():
    """Linear contacts stop at a restitution of 1e-6."""
    contacts = scales_of(tiny(WET, "fluid.velocity_m_s=1e-3")).contacts
    assert contacts["grain-fine"].stokes < 1e-3
    assert contacts["grain-fine"].restitution == pytest.approx(1e-6, rel=1e-9)


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


def test_hertz_takes_the_least_restitution_that_liggghts_does():
    scales = scales_of(tiny(WET, HERTZ, "fluid.velocity_m_s=1.0"))
    assert scales.contacts["grain-fine"].restitution == pytest.approx(0.0501, rel=1e-9)
    text = invade_text(WET, HERTZ, "fluid.velocity_m_s=1.0")
    assert has(text, r"^fix bounce .*peratomtypepair 3 0\.52\d+ 0\.0501\d* 0\.52\d+ 0\.0501")


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


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (("contact.cohesion_J_m3=1e4",), "take contact.model = 'hertz'"),
        (("contact.rolling_friction=0.1", "fines.friction=0.0"), "spheres that slide do not roll"),
        (("contact.rolling_friction=-0.1",), "contact.rolling_friction: -0.1"),
        (("contact.restitution=wet",), "contact.restitution: 'wet'"),
    ],
)
def test_options_that_do_nothing_are_refused(keys, message):
    with pytest.raises(CaseError, match="1 problem: ") as error:
        tiny(*keys)
    assert message in str(error.value)


def test_what_is_not_asked_for_is_left_out_and_named():
    words = "rolling|ohesi|limitForce off|cohere"
    plain = invade_text("box.wall_friction=0.3")
    assert not has(plain, words)
    options = ("loss of rebound in the liquid", "rolling resistance", "cohesion")
    for what in options:
        assert f"# left out: {what} (not asked for)" in plain
    keys = ("contact.rolling_friction=0.1", "contact.cohesion_J_m3=1e4", WET, HERTZ)
    text = invade_text(*keys, "box.wall_friction=0.3")
    model = "hertz tangential history cohesion sjkr rolling_friction epsd2"
    assert has(text, f"^pair_style gran model {model} tangential_damping off limitForce off$")
    assert has(text, f"^fix wy0 fines wall/gran model {model} primitive type 3")
    assert has(text, "^fix roll .* 3 " + " ".join(["0.1"] * 9))
    assert has(text, "^fix cohere .* 3 0.0 10000.0 0.0 10000.0 10000.0 10000.0 0.0 10000.0 0.0")
    assert not any(f"# left out: {what}" in text for what in options)
    smooth = invade_text(*keys)
    assert has(smooth, "^fix wy0 fines wall/gran model hertz cohesion sjkr primitive")
    case = tiny(*keys)
    assert not has(render_pack(case, count=66).text, words)


def test_options_are_another_invasion_of_the_same_pack():
    for keys in ((WET,), ("contact.rolling_friction=0.1",)):
        assert tiny(*keys).digest("pack") == tiny().digest("pack")
        assert tiny(*keys).digest("invade") != tiny().digest("invade")
