"""Contacts of a case: closed forms of each model, rebound in the liquid, cohesion and locking."""

import math
import re
import tomllib

import pytest
from builders import TINY, naming, tiny

from fdnet.case.file import case_from
from fdnet.errors import CaseError
from fdnet.scales.contacts import STEP_OVERLAP, elastic, joint_radius, secant_stiffness
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows

HERTZ = "contact.model=hertz"
WET = "contact.restitution=liquid"


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
    expected = secant_stiffness(used.elastic.modulus, joint, 0.01 * 0.1e-3)
    assert used.normal_stiffness == pytest.approx(expected, rel=1e-12)
    assert scales_of(tiny(HERTZ, "run.stiffness_N_m=nominal")).stiffness_factor == 1.0
    bare = {k: v for k, v in TINY.items() if k != "fines"} | {"contact": case.data()["contact"]}
    contacts = scales_of(case_from(bare)).contacts.values()
    alone = [contact.normal_stiffness for contact in contacts]
    assert max(alone) == pytest.approx(1e4, rel=1e-12)


def test_the_step_resolves_the_tangent_at_four_percent_and_the_usual_bounds():
    """At the largest factor it is below 0.2 Rayleigh times and 1/10 of a collision.

    A Rayleigh wave takes pi r sqrt(rho / G) / (0.1631 nu + 0.8766) along half a sphere (Thornton
    and Randall 1988).
    """
    for keys in [(), ("fines.radius_mm=[0.03,0.08]",), ("fines.poissons_ratio=0.5",)]:
        case = tiny(HERTZ, "run.time_step_factor=0.2", "fluid.velocity_m_s=2.0", *keys)
        scales = scales_of(case)
        low = case.fines.radius_range_m[0]
        joints = {"grain-fine": joint_radius(low, 0.25e-3), "fine-fine": low / 2, "fine-wall": low}
        stiffest = 1.5 * max(
            secant_stiffness(scales.contacts[name].elastic.modulus, joint, STEP_OVERLAP * 2 * low)
            for name, joint in joints.items()
        )
        shortest = math.sqrt(4 / 3 * math.pi * low**3 * 2146 / stiffest)
        assert scales.time_step == pytest.approx(0.2 * shortest, rel=1e-12), keys
        young, poisson = case.fines.youngs_modulus_Pa, case.fines.poissons_ratio
        shear = scales.stiffness_factor * young / (2 * (1 + poisson))
        rayleigh = math.pi * low * math.sqrt(2146 / shear) / (0.1631 * poisson + 0.8766)
        assert scales.time_step < 0.2 * rayleigh, keys
        collision = min(scales.contacts[name].contact_time for name in joints)
        assert scales.time_step < 0.1 * collision, keys


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


# ---- Rebound in the liquid, and cohesion.
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
    restitution = scales.contacts["grain-fine"].restitution
    assert rows["grain-fine restitution in the liquid"] == restitution
    assert rows["fine-wall impact Stokes number"] == scales.contacts["fine-wall"].stokes
    assert "grain-grain impact Stokes number" not in rows
    slow = scales_of(tiny(WET, "fluid.velocity_m_s=1e-3")).contacts["grain-fine"]
    assert slow.stokes < 1e-3
    assert slow.restitution == pytest.approx(1e-6, rel=1e-9), "linear contacts stop there"
    hertz = scales_of(tiny(WET, HERTZ, "fluid.velocity_m_s=1.0")).contacts["grain-fine"]
    assert hertz.restitution == pytest.approx(0.0501, rel=1e-9), "the least that LIGGGHTS takes"


def test_cohesion_that_draws_fines_into_grains_warns_and_is_refused():
    """At rest the overlap is 9/4 (pi c / E*)^2 R*; E* is about 1.06e9 Pa here."""
    case = tiny(HERTZ, "contact.cohesion_J_m3=1e7", "fluid.velocity_m_s=1.0")
    modulus = scales_of(case).contacts["grain-fine"].elastic.modulus
    joint = 1 / (1 / 5e-5 + 1 / 2.5e-4)
    at_limit = 1e-4 / joint * (modulus / math.pi) ** 2 / 2.25
    for share, warned in ((0.049, False), (0.051, True)):
        cohesion = f"contact.cohesion_J_m3={math.sqrt(share * at_limit)!r}"
        said = scales_of(tiny(HERTZ, cohesion, "fluid.velocity_m_s=1.0")).warnings
        assert ("cohesion draws a fine" in " ".join(said)) is warned
    with pytest.raises(CaseError, match="draws a fine 51 % of its diameter into a grain"):
        scales_of(tiny(HERTZ, f"contact.cohesion_J_m3={math.sqrt(0.51 * at_limit)!r}"))
    rows = {row.name: row.value for row in scale_rows(case, scales_of(case))}
    force = 2 / 3 * (math.pi * 1e7) ** 3 * joint**2 / modulus**2
    assert rows["pull-off force of a fine from a grain"] == pytest.approx(force, rel=1e-12)


# ---- Fines that lock between two grains.
SMALL = "fines.radius_mm=0.0125"


def locking(*assignments):
    return [one for one in scales_of(tiny(*assignments)).warnings if "lock between" in one]


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
        fine = f"fines.radius_mm={0.25 * (math.hypot(1, slope) - 1)}"
        for friction in (0.5, 0.8):
            limit = friction * slope
            assert thrown_back(slope, friction, 1.05 * limit) > 0, (slope, friction)
            assert thrown_back(slope, friction, 0.95 * limit) == 0.0, (slope, friction)
            for factor in (0.95, 1.05):
                keys = [fine, "fines.count=3000"]
                for part, normal in (("grains", 94.3e9), ("fines", 63e9)):
                    keys += [f"{part}.friction={friction}"]
                    keys += [f"{part}.shear_stiffness_N_m={factor * limit * normal!r}"]
                locks = scales_of(tiny(*keys)).sticking.by_springs
                assert locks == (factor > 1), (slope, friction, factor)


def test_a_weak_push_on_stiff_springs_warns_of_the_integrator_and_its_remedies_hold():
    weak = (SMALL, "fluid.viscosity_cP=0.5", "fluid.velocity_m_s=1.0")
    (text,) = locking(*weak)
    sticking = scales_of(tiny(*weak)).sticking
    assert sticking.false_force > 0.5
    said = r"divide run.time_step_factor by (\S+), or run.stiffness_N_m by (\S+) "
    step, stiffness = map(float, re.search(said, text).groups())
    assert locking(*weak, f"run.time_step_factor={0.1 / (0.9 * step)!r}")
    assert not locking(*weak, f"run.time_step_factor={0.1 / (1.1 * step)!r}")
    assert locking(*weak, f"run.stiffness_N_m={1e4 / (0.9 * stiffness)!r}")
    assert not locking(*weak, f"run.stiffness_N_m={1e4 / (1.1 * stiffness)!r}")
