"""Scales against the numbers of the thesis and closed forms worked out by hand."""

import math

import pytest
from builders import tiny

from fdnet.case.file import case_from, read_case
from fdnet.dem.checkpoint import chunks_of
from fdnet.errors import CaseError
from fdnet.scales.clock import relaxation_time
from fdnet.scales.contacts import series
from fdnet.scales.flow import carman_kozeny
from fdnet.scales.scales import scales_of
from fdnet.scales.table import scale_rows


@pytest.fixture
def specimen1(root):
    case = read_case(root / "cases" / "specimen1.toml")
    return case, scales_of(case)


def test_specimen_1_has_the_velocities_of_the_thesis(specimen1):
    _, scales = specimen1
    assert scales.permeability == pytest.approx(7.65e-11, rel=1e-3)
    assert scales.darcy_velocity == pytest.approx(0.670, rel=1e-3)
    assert scales.interstitial_velocity == pytest.approx(2.23, rel=2e-3)
    assert scales.reynolds == pytest.approx(8, abs=0.3)
    assert any("Reynolds" in warning for warning in scales.warnings)


def test_specimen_5_is_further_outside_stokes(root):
    assert scales_of(read_case(root / "cases" / "specimen5.toml")).reynolds == pytest.approx(
        12, abs=0.3
    )


def test_carman_kozeny_by_hand():
    assert carman_kozeny(0.5, 1e-3) == pytest.approx(1e-6 * 0.125 / (180 * 0.25), rel=1e-12)


@pytest.mark.parametrize(
    ("diameter_mm", "microseconds"), [(0.05, 5.96), (0.10, 23.8), (0.16, 61.0)]
)
def test_relaxation_times(diameter_mm, microseconds):
    assert relaxation_time(0.5e-3 * diameter_mm, 2146, 0.05) == pytest.approx(
        1e-6 * microseconds, rel=2e-3
    )


def test_springs_in_series_and_smaller_friction(specimen1):
    _, scales = specimen1
    nominal = {
        name: contact.normal_stiffness / scales.stiffness_factor
        for name, contact in scales.contacts.items()
    }
    assert nominal["grain-grain"] == pytest.approx(47.15e9)
    assert nominal["grain-fine"] == pytest.approx(37.77e9, rel=1e-3)
    assert nominal["fine-fine"] == pytest.approx(31.5e9)
    assert scales.contacts["fine-wall"].friction == 0.0
    assert scales_of(tiny("fines.friction=0.2")).contacts["grain-fine"].friction == 0.2
    assert series(2.0, 2.0) == 1.0


def test_scaling_keeps_ratios_of_stiffness(specimen1):
    _, scales = specimen1
    used = scales.contacts
    assert max(c.normal_stiffness for c in used.values()) == pytest.approx(1e4)
    ratio = used["fine-fine"].normal_stiffness / used["grain-grain"].normal_stiffness
    assert ratio == pytest.approx(31.5 / 47.15, rel=1e-9)
    assert scales_of(tiny("run.stiffness_N_m=94.3e9")).contacts[
        "grain-grain"
    ].normal_stiffness == pytest.approx(94.3e9)


FOLLOWED = ("drag.field=network", "drag.upstream=darcy", "fines.supply=slab", "fines.count=100")


@pytest.mark.parametrize("model", ["hooke", "hertz"])
def test_stiffness_auto_is_the_least_that_keeps_overlaps_small(model):
    keys = (*FOLLOWED, "drag.scheme=implicit", f"contact.model={model}", "fluid.velocity_m_s=5")
    auto = scales_of(tiny(*keys, "run.stiffness_N_m=auto"))
    deepest = [auto.impact_overlap, auto.drag_overlap, auto.deposit_overlap]
    assert max(deepest) == pytest.approx(0.03, rel=0.1)
    assert max(deepest) <= 0.03
    number = max(c.normal_stiffness for c in auto.contacts.values() if "fine" in c.pair)
    stiffness = max(c.normal_stiffness for c in auto.contacts.values())
    chosen = stiffness if model == "hooke" else number
    same = scales_of(tiny(*keys, f"run.stiffness_N_m={chosen!r}"))
    assert same.deposit_overlap == pytest.approx(auto.deposit_overlap, rel=1e-9)
    assert not any("overlap" in warning for warning in auto.warnings)


def test_stiffness_auto_is_the_default_where_overlaps_are_small():
    slow = ("fluid.velocity_m_s=1e-3", "run.stiffness_N_m=auto")
    assert max(c.normal_stiffness for c in scales_of(tiny(*slow)).contacts.values()) == (
        pytest.approx(1e4)
    )


def test_a_pack_of_stiffness_auto_depends_on_what_decides_it():
    one, other = (
        tiny("run.stiffness_N_m=auto", f"fluid.velocity_m_s={v!r}").digest("pack")
        for v in (1e-3, 9.0)
    )
    assert one != other
    assert len({tiny(f"fluid.velocity_m_s={v!r}").digest("pack") for v in (1e-3, 9.0)}) == 1


def test_damping_rate_gives_the_damping_ratio():
    case = tiny("fines.damping_ratio=0.3", "grains.damping_ratio=0.3")
    contact = scales_of(case).contacts["fine-fine"]
    mass = 4 / 3 * math.pi * (0.05e-3) ** 3 * 2146 / 2
    assert contact.damping_rate == pytest.approx(
        2 * 0.3 * math.sqrt(contact.normal_stiffness / mass)
    )


def test_supply_from_count_and_from_slab():
    counted = scales_of(tiny())
    assert counted.slab_length == pytest.approx(
        300 * 4 / 3 * math.pi * (0.05e-3) ** 3 / (0.1 * 1.6e-3**2)
    )
    slab = scales_of(tiny("fines={radius_mm=0.05, slab_mm=0.5}"))
    assert slab.supplied_count == round(
        0.1 * 0.5e-3 * 1.6e-3**2 / (4 / 3 * math.pi * (0.05e-3) ** 3)
    )


def test_given_velocity_replaces_darcy():
    scales = scales_of(tiny("fluid.velocity_m_s=3.0"))
    assert scales.interstitial_velocity == 3.0
    assert scales.darcy_velocity == pytest.approx(3.0 * scales.porosity)


@pytest.mark.parametrize(
    ("assignment", "bound"),
    [("run.time_step_s=1e-6", "contact bound"), ("drag.refresh_steps=100000", "are stable")],
)
def test_a_step_beyond_its_bound_is_refused_with_the_bound(assignment, bound):
    with pytest.raises(CaseError, match=bound):
        scales_of(tiny(assignment))


def test_a_step_beyond_the_drag_relaxation_time_is_refused():
    with pytest.raises(CaseError, match="drag relaxation time"):
        scales_of(tiny("run.time_step_s=1e-8", "drag.multiplier=1e4"))


def test_doubtful_input_warns():
    text = " ".join(scales_of(tiny("drag.refresh_steps=300")).warnings)
    assert "held for" in text
    assert "overlap under impact" in text
    assert "fewer than 10 fines" in " ".join(scales_of(tiny("run.plug_time_ms=0.0001")).warnings)
    assert "lengthened to one fine's diameter" in " ".join(
        scales_of(tiny("fines.count=1")).warnings
    )
    assert "overlap under drag" in " ".join(scales_of(tiny("drag.multiplier=40")).warnings)


def test_drag_that_presses_contacts_shut_is_refused():
    """6 pi mu M r u / k over 2 r: at M = 1000 a fine would be pressed through a grain."""
    with pytest.raises(CaseError, match="drag alone would press"):
        scales_of(tiny("drag.multiplier=1000"))


def test_an_inviscid_fluid_is_refused_for_its_speed_and_works_with_a_given_one():
    """Darcy's law makes 1e-12 cP a speed of 1e14 m/s; at a given 1 m/s the fines fly freely."""
    with pytest.raises(CaseError, match=r"impact alone would press a fine .* lower the velocity"):
        scales_of(tiny("fluid.viscosity_cP=1e-12"))
    scales = scales_of(tiny("fluid.viscosity_cP=1e-12", "fluid.velocity_m_s=1.0"))
    assert any("Reynolds" in warning for warning in scales.warnings)
    assert scales.drag_overlap == pytest.approx(0, abs=1e-12)


def test_impact_is_refused_above_half_a_diameter():
    scales = scales_of(tiny("fluid.velocity_m_s=1.0"))
    limit = 0.5 / scales.impact_overlap
    assert scales_of(tiny(f"fluid.velocity_m_s={0.999 * limit}")).impact_overlap == pytest.approx(
        0.4995
    )
    with pytest.raises(CaseError, match="impact alone"):
        scales_of(tiny(f"fluid.velocity_m_s={1.001 * limit}"))


def test_the_limit_of_the_warning_is_the_cases_own():
    assert "overlap under impact" in " ".join(scales_of(tiny()).warnings)
    assert "overlap under impact" not in " ".join(scales_of(tiny("run.max_overlap=0.2")).warnings)


@pytest.mark.parametrize(
    "assignment",
    ["fluid.overbalance_MPa=1e-17", "fluid.viscosity_cP=1e15", "run.time_step_s=1e-18"],
)
def test_extreme_numbers_are_refused_not_crashed_on(assignment):
    with pytest.raises(CaseError):
        scales_of(tiny(assignment))


def test_the_plug_time_waits_for_fines_to_arrive():
    """A dilute suspension: 10 v / (c A u) is longer than 4 grain diameters of passage."""
    case = tiny("fines={radius_mm=0.1, count=60, concentration=0.001}")
    scales = scales_of(case)
    arrival = 4 / 3 * math.pi * 1e-4**3 / (0.001 * 1.6e-3**2 * scales.upstream_velocity)
    assert scales.plug_time == pytest.approx(10 * arrival)
    assert scales_of(tiny()).plug_time == pytest.approx(
        4 * 0.5e-3 / scales_of(tiny()).interstitial_velocity
    )


@pytest.mark.parametrize("stiffness", [1e2, 3e2, 1e3, 3e3, 1e4, 1e5, 1e6])
@pytest.mark.parametrize("duration_ms", [0.08, 0.2, 2.0])
def test_a_duration_is_met_by_whole_chunks(stiffness, duration_ms):
    """To half a refresh of drag a chunk, whichever way the steps of a chunk were rounded."""
    case = tiny(
        f"run.duration_ms={duration_ms!r}",
        f"run.stiffness_N_m={stiffness!r}",
        "fluid.velocity_m_s=5.0",
    )
    scales = scales_of(case)
    chunks, refresh = chunks_of(case, scales), scales.hold_steps * scales.time_step
    run = chunks * scales.checkpoint_steps * scales.time_step
    assert abs(run - duration_ms * 1e-3) <= 0.5001 * chunks * refresh


@pytest.mark.parametrize(
    ("cap_ms", "expected"), [(0.05, 1), (0.09, 1), (0.12, 2), (0.18, 2), (0.2, 3)]
)
def test_a_cap_is_reached_by_whole_chunks(cap_ms, expected):
    """The least number of chunks of 0.09 ms that does not end before the cap, also for 0.12 ms."""
    case = tiny(f"run.cap_ms={cap_ms}", "run.checkpoint_ms=0.09", "fluid.velocity_m_s=5.0")
    scales = scales_of(case)
    chunk = scales.checkpoint_steps * scales.time_step
    assert chunks_of(case, scales) == expected
    assert (expected - 1) * chunk < cap_ms * 1e-3 <= expected * chunk * (1 + 1e-9)


@pytest.mark.parametrize(("motion", "heavy"), [("fixed", 0.0), ("mobile", 1.0)])
def test_damping_takes_the_mass_of_what_moves(motion, heavy):
    """A frozen grain is infinitely heavy, in LIGGGHTS too.

    The rate is 2 zeta sqrt(k / m), with 1/m = 1/m_fine + 1/m_grain if the grain moves.
    """
    contact = scales_of(
        tiny("fines.radius_mm=0.2", "fines.count=60", f"grains.motion={motion}")
    ).contacts["grain-fine"]
    fine, grain = (4 / 3 * math.pi * r**3 * rho for r, rho in ((0.2e-3, 2146), (0.25e-3, 2650)))
    assert contact.damping_rate == pytest.approx(
        2 * 0.2 * math.sqrt(contact.normal_stiffness * (1 / fine + heavy / grain))
    )


def test_every_row_has_formula_source_and_a_finite_value(specimen1):
    for row in scale_rows(*specimen1):
        assert row.formula
        assert row.source
        assert math.isfinite(row.value)


def test_defaults_follow_the_physics():
    """Periodic sides, or walls as rough as the grains; mud that arrives as fast as it flows in."""
    tables = {
        "name": "plain",
        "box": {"size_mm": [3.0, 1.6, 1.6]},
        "grains": {"radius_mm": 0.25, "count": 66, "friction": 0.3},
        "fines": {"radius_mm": 0.05, "count": 300},
    }
    plain = case_from(tables)
    assert plain.periodic == (False, True, True)
    assert plain.fines.supply == "batches"
    scales = scales_of(plain)
    assert scales.upstream_velocity == scales.darcy_velocity
    contact = scales.contacts["grain-fine"].step_limit
    assert scales.time_step == pytest.approx(0.2 * contact, rel=1e-12)

    def frictions(**walls: float) -> list[float]:
        walled = case_from(tables | {"box": tables["box"] | {"sides": "walls"} | walls})
        return [scales_of(walled).contacts[f"{name}-wall"].friction for name in ("grain", "fine")]

    assert frictions() == [0.3, 0.3]
    assert frictions(wall_friction=0.1) == [0.1, 0.1]
