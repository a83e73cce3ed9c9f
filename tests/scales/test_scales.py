"""Scales against the numbers of the thesis and closed forms worked out by hand."""

import itertools
import math

import numpy as np
import pytest
from builders import naming, resting_spheres, tiny
from scipy.integrate import quad

from fdnet.case.case import Case
from fdnet.case.file import case_from, read_case, set_keys
from fdnet.dem.checkpoint import chunks_of, lasting_overlap, reference_chunks, steps_after
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.supply import batches_of
from fdnet.errors import CaseError
from fdnet.scales.clock import STARTING, deposit_pressure, slab_of
from fdnet.scales.contacts import series
from fdnet.scales.flow import Losses, carman_kozeny, radial, straight, velocity_of
from fdnet.scales.scales import InvasionScales, back_flow, invasion_scales, scales_of, stiffened
from fdnet.scales.table import scale_rows
from fdnet.spheres.snapshot import Array, Kind


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
    assert carman_kozeny(0.5, 1e-3) == pytest.approx(1e-6 * 0.125 / (180 * 0.25), rel=1e-12)


def test_springs_in_series_and_smaller_friction(specimen1):
    _, scales = specimen1
    for name, nominal in (
        ("grain-grain", 47.15e9),
        ("grain-fine", 37.77e9),
        ("fine-fine", 31.5e9),
    ):
        used = scales.contacts[name].normal_stiffness / scales.stiffness_factor
        assert used == pytest.approx(nominal, rel=1e-3), name
    assert scales.contacts["fine-wall"].friction == 0.0
    assert scales_of(tiny("fines.friction=0.2")).contacts["grain-fine"].friction == 0.2
    assert series(2.0, 2.0) == 1.0
    used = scales.contacts
    assert max(c.normal_stiffness for c in used.values()) == pytest.approx(1e4)
    ratio = used["fine-fine"].normal_stiffness / used["grain-grain"].normal_stiffness
    assert ratio == pytest.approx(31.5 / 47.15, rel=1e-9)


FOLLOWED = ('drag={field = "network"}', "fines.supply=slab", "fines.count=100")


def test_stiffness_auto_is_the_least_that_keeps_overlaps_small():
    for model in ["hooke", "hertz"]:
        keys = (*FOLLOWED, f"contact.model={model}", "fluid.velocity_m_s=5")
        auto = scales_of(tiny(*keys, "run.stiffness_N_m=auto"))
        deepest = max(auto.impact_overlap, auto.drag_overlap, auto.deposit_overlap)
        assert 0.027 <= deepest <= 0.03, model
        which = "" if model == "hooke" else "fine"
        chosen = max(c.normal_stiffness for c in auto.contacts.values() if which in c.pair)
        same = scales_of(tiny(*keys, f"run.stiffness_N_m={chosen!r}"))
        start = auto.deposit_overlap / STARTING ** (2 / 3 if model == "hertz" else 1.0)
        assert same.deposit_overlap == pytest.approx(start, rel=1e-9), model
        assert not any("overlap" in warning for warning in auto.warnings)


def test_a_deposit_bears_its_share_of_the_way():
    """In series: 3 mm of sand and what comes on a way of 100 mm, at constant pressure or rate."""
    keys = (*FOLLOWED, "fluid.overbalance_MPa=2.0", "fluid.darcy_length_mm=100.0")
    case = tiny(*keys, "drag.scheme=implicit")
    porosity, length, way = 0.4, 3e-3, 0.1
    flow = velocity_of(case, porosity)
    bed = 1e-4**2 * 0.36**3 / (180 * 0.64**2)  # m2, of fines of 0.1 mm
    solids = 100 * math.pi / 6 * 1e-12 / (1.6e-3) ** 2  # m3 a m2 of face
    fines = flow.permeability * solids / 0.64 / bed
    whole = 2e6 * (length + fines) / (way + fines)

    def borne(*more: str) -> float:
        return deposit_pressure(tiny(*keys, "drag.scheme=implicit", *more), flow, porosity)

    assert borne() == pytest.approx(whole, rel=1e-9)
    rate = 2e6 * (length + fines) / way
    assert borne("drag.drive=rate") == pytest.approx(rate, rel=1e-9)
    # a tenth of the slab is fed; the rate may fall by 1 %
    some = 0.1 * fines
    feeding = 0.1 * slab_of(case, 1.0).length / flow.darcy
    fed = 2e6 * (length + some) / (way + some)
    assert borne(f"run.duration_ms={1e3 * feeding!r}") == pytest.approx(fed, rel=1e-9)
    volumes = 0.1 * slab_of(case, 1.0).length / (porosity * length)
    assert borne(f"run.stop_pore_volumes={volumes!r}") == pytest.approx(fed, rel=1e-9)
    ample = fines * 0.6 * 0.5e-3 / solids
    until = borne("fines={radius_mm=0.05, concentration=0.1}")
    assert until == pytest.approx(2e6 * (length + ample) / (way + ample), rel=1e-9)
    slower = 2e6 * (length + way * (1 / 0.999 - 1)) / (way / 0.999)
    assert borne("run.stop_rate=0.999") == pytest.approx(slower, rel=1e-9)
    assert deposit_pressure(tiny(*FOLLOWED), velocity_of(tiny(), porosity), porosity) <= 3.5e6


def test_springs_grow_with_the_square_of_the_steps_of_a_chunk():
    case = tiny(*FOLLOWED, "drag.scheme=implicit", "run.stiffness_N_m=auto")
    scales = invasion_scales(case)
    usual = scales.checkpoint_steps

    def after(*lasted: float, raised: int = 0) -> float:
        """Of the steps of the last chunk, with other springs in the first chunks that `raised`."""
        steps = [usual // 2] * raised + [usual] * (len(lasted) - raised)
        known = [lasted[chunk] for chunk in reference_chunks(steps, 2)]
        return steps_after(case, usual, lasted[-1], known) / usual

    assert after(0.02) == 1
    assert after(0.02, 0.03) == pytest.approx(math.sqrt(1 / 0.6), rel=1e-3)
    assert after(0.9) == 2
    assert after(0.03, 0.018, 0.033, raised=1) == 1, "a wedged fine that is watched in turns"
    assert after(0.03, 0.033, 0.018, 0.033, raised=1) == 1
    assert after(0.03, 0.018, 0.018, 0.022, raised=1) > 1, "loads have grown again"
    assert after(0.03, 0.018, 0.018, 0.019, 0.02, 0.021, raised=1) > 1, "slowly"
    assert lasting_overlap([0.9, *[0.02] * 10]) == 0.02, "an impact is no load"
    assert lasting_overlap([0.9, 0.9, *[0.02] * 10]) == 0.9
    assert stiffened(case, scales, usual) is scales
    more = stiffened(case, scales, 2 * usual)
    chunk = more.checkpoint_steps * more.time_step
    assert chunk == pytest.approx(usual * scales.time_step, rel=1e-12)
    for name, contact in more.contacts.items():
        before = scales.contacts[name]
        assert contact.normal_stiffness == pytest.approx(4 * before.normal_stiffness, rel=1e-12)
        assert contact.shear_stiffness == pytest.approx(4 * before.shear_stiffness, rel=1e-12)
        share = scales.time_step / before.step_limit
        assert more.time_step / contact.step_limit == pytest.approx(share, rel=1e-12)
    given = tiny(*FOLLOWED, "run.stiffness_N_m=100000")
    assert steps_after(given, usual, 0.9, ()) == usual


def test_one_seed_has_one_pack_whatever_stiffness_the_invasion_takes():
    auto = (f"fluid.velocity_m_s={v!r}" for v in (1e-3, 9.0))
    packs = {tiny("run.stiffness_N_m=auto", one).digest("pack") for one in auto}
    assert packs == {tiny().digest("pack")}
    slow = scales_of(tiny("run.stiffness_N_m=auto", "fluid.velocity_m_s=1e-3")).contacts
    assert max(c.normal_stiffness for c in slow.values()) == pytest.approx(1e4), "the default"


def test_damping_takes_the_mass_of_what_moves():
    """2 zeta sqrt(k / m), 1/m = 1/m_fine + 1/m_grain if the grain moves; a frozen one is heavy."""
    fine, grain = (4 / 3 * math.pi * r**3 * rho for r, rho in ((0.2e-3, 2146), (0.25e-3, 2650)))
    for motion, moves in (("fixed", 0.0), ("mobile", 1.0)):
        keys = ("fines.radius_mm=0.2", "fines.count=60", f"grains.motion={motion}")
        contact = scales_of(tiny(*keys)).contacts["grain-fine"]
        rate = 2 * 0.2 * math.sqrt(contact.normal_stiffness * (1 / fine + moves / grain))
        assert contact.damping_rate == pytest.approx(rate), motion


def test_an_inviscid_fluid_is_refused_for_its_speed_and_works_with_a_given_one():
    """Darcy's law makes 1e-12 cP a speed of 1e14 m/s; at a given 1 m/s the fines fly freely."""
    with pytest.raises(CaseError, match=r"impact alone would press a fine .* lower drag or"):
        scales_of(tiny("fluid.viscosity_cP=1e-12"))
    scales = scales_of(tiny("fluid.viscosity_cP=1e-12", "fluid.velocity_m_s=1.0"))
    assert any("Reynolds" in warning for warning in scales.warnings)
    assert scales.drag_overlap == pytest.approx(0, abs=1e-12)


def test_impact_is_refused_above_half_a_diameter():
    limit = 0.5 / scales_of(tiny("fluid.velocity_m_s=1.0")).impact_overlap
    below = scales_of(tiny(f"fluid.velocity_m_s={0.999 * limit}"))
    assert below.impact_overlap == pytest.approx(0.4995)
    with pytest.raises(CaseError, match="impact alone"):
        scales_of(tiny(f"fluid.velocity_m_s={1.001 * limit}"))
    assert "overlap under impact" not in " ".join(scales_of(tiny("run.max_overlap=0.2")).warnings)


def test_extreme_numbers_are_refused_not_crashed_on():
    pressure, viscosity, step = "fluid.overbalance_MPa", "fluid.viscosity_cP", "run.time_step_s"
    for assignment in (f"{pressure}=1e-17", f"{viscosity}=1e15", f"{step}=1e-18"):
        with naming(assignment), pytest.raises(CaseError):
            scales_of(tiny(assignment))


def test_the_plug_time_waits_for_fines_to_arrive():
    """A dilute suspension: 10 v / (c A u) is longer than 4 grain diameters of passage."""
    case = tiny("fines={radius_mm=0.1, count=60, concentration=0.001}")
    scales = scales_of(case)
    arrival = 4 / 3 * math.pi * 1e-4**3 / (0.001 * 1.6e-3**2 * scales.upstream_velocity)
    assert scales.plug_time == pytest.approx(10 * arrival)
    usual = scales_of(tiny())
    assert usual.plug_time == pytest.approx(4 * 0.5e-3 / usual.interstitial_velocity)


def test_mud_without_an_end_is_bounded_by_what_plugs_by_pores_and_by_number():
    """n v / (A D50) = 2.5, or 2 phi L where fines pass, or 200,000 fines; and the box is long."""
    area, ball = 1.6e-3**2, 4 / 3 * math.pi
    held = scales_of(tiny("fines={radius_mm=0.08}"))
    solids = held.supplied_count * ball * 0.08e-3**3 / area
    assert solids == pytest.approx(2.5 * 0.5e-3, rel=1e-3)
    assert held.slab_length == pytest.approx(2.5 * 0.5e-3 / 0.1)
    passing = scales_of(tiny("fines={radius_mm=0.02}"))
    assert passing.slab_length == pytest.approx(2 * passing.porosity * 3e-3)
    many = scales_of(tiny("fines={radius_mm=0.002}"))
    assert many.supplied_count == 200_000
    assert many.slab_length == pytest.approx(2e5 * ball * 2e-6**3 / (0.1 * area))
    dilute = tiny("fines={radius_mm=0.08, concentration=1e-4}")
    assert scales_of(dilute).slab_length == pytest.approx(1000 * 3e-3)
    assert batches_of(dilute, scales_of(dilute)).counts[:-1] == (10,) * 35
    assert tiny("well={radius_mm=108.0}", "fines={radius_mm=0.08}").well.drainage_radius_m == 100


def test_a_duration_is_met_by_whole_chunks():
    """To half a refresh of drag a chunk, whichever way the steps of a chunk were rounded."""
    for duration, stiffness in itertools.product((0.08, 0.2, 2.0), 10.0 ** np.arange(2, 6.5, 0.5)):
        times = (f"run.duration_ms={duration!r}", f"run.stiffness_N_m={stiffness:.0f}")
        case = tiny(*times, "fluid.velocity_m_s=5.0")
        scales = scales_of(case)
        chunks, refresh = chunks_of(case, scales), scales.hold_steps * scales.time_step
        run = chunks * scales.checkpoint_steps * scales.time_step
        assert abs(run - duration * 1e-3) <= 0.5001 * chunks * refresh, times


def test_a_cap_is_reached_by_whole_chunks():
    """The least number of chunks of 0.09 ms that does not end before the cap, also for 0.12 ms."""
    for cap_ms, expected in [(0.05, 1), (0.09, 1), (0.12, 2), (0.18, 2), (0.2, 3)]:
        case = tiny(f"run.cap_ms={cap_ms}", "run.checkpoint_ms=0.09", "fluid.velocity_m_s=5.0")
        scales = scales_of(case)
        chunk = scales.checkpoint_steps * scales.time_step
        assert chunks_of(case, scales) == expected, cap_ms
        assert (expected - 1) * chunk < cap_ms * 1e-3 <= expected * chunk * (1 + 1e-9)


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
    assert scales.time_step == pytest.approx(0.3 * contact, rel=1e-12)

    def frictions(**walls: float) -> list[float]:
        walled = case_from(tables | {"box": tables["box"] | {"sides": "walls"} | walls})
        return [scales_of(walled).contacts[f"{name}-wall"].friction for name in ("grain", "fine")]

    assert frictions() == [0.3, 0.3]
    assert frictions(wall_friction=0.1) == [0.1, 0.1]


# ---- The velocity at the formation face: a plug, a well, Darcy's law and Ergun's.
WELL = "well={radius_mm=108.0, drainage_radius_m=100.0}"

GRADIENT = 3.5e6 / (0.108 * math.log(100 / 0.108))
"""Of 3.5 MPa at the face, radial Darcy flow: 4.7 MPa/m."""


def at_a_well(name: str, root, *assignments: str) -> Case:
    """A specimen of the thesis at the face of a well instead of in a plug of 8 mm."""
    data = read_case(root / f"cases/{name}.toml").data()
    del data["fluid"]["darcy_length_mm"]
    return case_from(set_keys(data, [WELL, *assignments]))


def test_a_well_of_the_field_moves_the_fluid_at_centimetres_per_second(root):
    for name, speed in [("specimen1", 0.024), ("specimen5", 0.059)]:
        plug = scales_of(read_case(root / f"cases/{name}.toml"))
        well = scales_of(at_a_well(name, root))
        assert pytest.approx(4.744e6, rel=1e-3) == GRADIENT
        assert well.pressure_gradient == pytest.approx(GRADIENT, rel=1e-12), name
        assert plug.pressure_gradient == pytest.approx(3.5e6 / 8e-3, rel=1e-12), name
        assert well.interstitial_velocity == pytest.approx(speed, abs=5e-4), name
        darcy = well.permeability * GRADIENT / 0.05
        assert well.interstitial_velocity == pytest.approx(darcy / well.porosity, rel=1e-12)
        assert not any("Darcy" in one or "overbalance" in one for one in well.warnings)


def test_a_formation_tighter_than_the_pack_slows_the_fluid(root):
    own, tight = (
        scales_of(at_a_well("specimen5", root, *more))
        for more in ((), ("well.formation_permeability_mD=1000.0",))
    )
    assert tight.darcy_velocity == pytest.approx(9.869233e-13 / 0.05 * GRADIENT, rel=1e-12)
    # the gradient is that which drives this flow through the pack itself
    lower = tight.darcy_velocity / own.darcy_velocity
    assert tight.pressure_gradient == pytest.approx(lower * GRADIENT, rel=1e-12)


def test_a_well_and_another_velocity_are_one_error():
    for more, named in [
        (("fluid.velocity_m_s=1.0",), "fluid.velocity_m_s: 1.0:"),
        (("fluid.darcy_length_mm=8.0",), "fluid.darcy_length_mm: 8.0:"),
    ]:
        with pytest.raises(CaseError, match=r"1 problem: well\.radius_mm: 108") as caught:
            tiny(WELL, *more)
        assert named in str(caught.value)
        assert "keep one of them" in str(caught.value)


def test_a_well_must_be_smaller_than_its_drainage():
    with pytest.raises(CaseError, match=r"well\.drainage_radius_m: 0\.1 m is not above"):
        tiny("well={radius_mm=108.0, drainage_radius_m=0.1}")
    with pytest.raises(CaseError, match=r"unknown key .*did you mean well\.radius_mm"):
        tiny("well={radius_m=0.108, drainage_radius_m=100.0}")


def test_inertia_takes_a_tenth_to_a_quarter_at_the_gradients_of_the_thesis(root):
    """Ergun's ratio of the losses, (1.75 / 150) rho q d / (mu (1 - phi)), with the pack's k."""
    for name, percent in [("specimen1", 10), ("specimen5", 26)]:
        path = root / f"cases/{name}.toml"
        darcy = scales_of(read_case(path))
        ergun = scales_of(read_case(path, assignments=["fluid.darcy_law=ergun"]))
        q, gradient = ergun.darcy_velocity, 3.5e6 / 8e-3
        excess = 1.75 / 150 * 1095 * q * 0.5e-3 / (0.05 * (1 - ergun.porosity))
        losses = 0.05 * q / ergun.permeability * (1 + excess)
        assert (losses, ergun.pressure_gradient) == pytest.approx((gradient, gradient), rel=1e-12)
        lost = 1 - q / darcy.darcy_velocity
        assert lost == pytest.approx(percent / 100, abs=0.005), name
        assert darcy.inertial_loss == ergun.inertial_loss == pytest.approx(lost, rel=1e-12)
        assert any(f"lower it by {percent} % (Ergun)" in one for one in darcy.warnings)
        assert not any("Ergun" in one for one in ergun.warnings)


def test_the_root_of_the_radial_law_loses_the_pressure_on_the_way():
    """The second method: the gradient at each distance, summed up numerically."""
    losses, well, outer = Losses(viscous=2e8, inertial=4e10), 0.1, 30.0
    face = losses.velocity(5e6, radial(well, outer))

    def gradient(log_r: float) -> float:
        r = math.exp(log_r)
        return losses.gradient(face * well / r) * r

    lost, _ = quad(gradient, math.log(well), math.log(outer))
    assert lost == pytest.approx(5e6, rel=1e-9)
    root = (-2e8 + math.sqrt(4e16 + 4 * 4e10 * 5e6 / 0.2)) / 8e10
    assert losses.velocity(5e6, straight(0.2)) == pytest.approx(root, rel=1e-9)
    assert Losses(viscous=2e8).velocity(5e6, straight(0.2)) == pytest.approx(0.125, rel=1e-15)


def test_a_run_without_spheres_is_bound_by_none_of_their_limits():
    """Whole muds have more fines than spheres could be, and no step of LIGGGHTS is taken."""
    mud = "fines={sizes={D10_mm=0.005, D50_mm=0.025, D90_mm=0.07}, concentration=0.02}"
    keys = (mud, WELL, "drag={}", "invasion.method=network", "run={time_step_s=1.0}")
    scales = scales_of(tiny(*keys))
    assert scales.supplied_count > 1e6
    assert scales.slab_length * 0.02 == pytest.approx(10 * 0.25 * 0.5e-3, rel=0.03)
    with pytest.raises(CaseError, match=r"run\.time_step_s: 1 s is above the contact bound"):
        scales_of(tiny(*keys, "invasion.method=liggghts"))


# ---- Fines driven at a chosen velocity: the same ratios of forces, and the clock of the fluid.
def driven(*assignments: str) -> InvasionScales:
    return scales_of(tiny(WELL, *assignments))


def test_auto_drives_to_a_tenth_or_as_fast_as_the_fluid():
    assert driven("drag.drive_velocity_m_s=auto").impact_stokes == pytest.approx(0.1, rel=1e-12)
    own = ("fluid.velocity_m_s=1.0", "drag.drive_velocity_m_s=auto")
    assert scales_of(tiny(*own)).force_factor == 1.0


def test_the_times_of_a_case_are_those_of_the_fluid():
    """Three times as fast, in a third of the time."""
    speed = driven().interstitial_velocity
    for more in ({"duration": 60.0}, {"plug_time": 60.0}, {"cap": 60.0}, {"checkpoint": 4.0}):
        keys = {"checkpoint": 2.0, "plug_time": 40.0} | more
        given = [f"run.{name}_ms={value}" for name, value in keys.items()]
        slow, fast = driven(*given), driven(*given, f"drag.drive_velocity_m_s={3 * speed}")
        assert fast.plug_time == pytest.approx(slow.plug_time / 3, rel=1e-12), more
        assert fast.cap_time == pytest.approx(slow.cap_time / 3, rel=1e-12), more
        chunk = [one.checkpoint_steps * one.time_step for one in (slow, fast)]
        assert chunk[1] == pytest.approx(chunk[0] / 3, rel=0.01), more


def test_a_drive_that_inertia_forbids_is_refused():
    most = 5e-5 / scales_of(tiny()).relaxation_time[0]
    inertia = r"impact Stokes number of the fines is 2,.*at most"
    with pytest.raises(CaseError, match=inertia) as caught:
        driven(f"drag.drive_velocity_m_s={2 * most}")
    assert f"expected at most {0.3 * most:.2g} m/s" in str(caught.value)
    with pytest.raises(CaseError, match="in the fluid itself"):
        scales_of(tiny(f"fluid.velocity_m_s={2 * most}", "drag.drive_velocity_m_s=0.1"))
    keys = ("contact.model=hertz", "contact.cohesion_J_m3=1e4")
    with pytest.raises(CaseError, match=r"drag\.drive_velocity_m_s: 0.1 with .*cohesion is not"):
        tiny("drag.drive_velocity_m_s=0.1", *keys)
    for kept in ([f"fluid.velocity_m_s={2 * most}"], [*keys, WELL]):
        assert scales_of(tiny("drag.drive_velocity_m_s=auto", *kept)).force_factor == 1.0


@pytest.mark.liggghts
def test_driven_fines_go_the_same_way_in_a_part_of_the_time(binary, tmp_path):
    """Among 16 grains, with gravity across; inertia leaves some 0.02 and 0.07 radii a contact."""
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
        fines = result.state.fines()
        return fines.position[np.argsort(fines.id)]

    away = ends(0.15) - ends(0.05)
    away[:, 1:] -= 1.6e-3 * np.round(away[:, 1:] / 1.6e-3)
    in_radii = np.linalg.norm(away, axis=1) / 5e-5
    assert np.median(in_radii) < 0.1
    assert in_radii.max() < 0.3


def test_the_springs_of_a_clean_up_bear_its_load_where_the_fines_are_driven(root):
    """Drives of 5.2 and 34 times the fluid, at weak and strong drawdowns."""
    for name in ("well", "reservoir-sand"):
        for drawdown in (0.1, 0.7, 3.5):
            keys = [f"clean_up.drawdown_MPa={drawdown}"]
            case = read_case(root / f"cases/{name}.toml", assignments=keys)
            flow = back_flow(case).scales
            most = max(flow.deposit_overlap, flow.drag_overlap, flow.impact_overlap)
            assert most <= 0.03, (name, drawdown)
            assert 1.0 < flow.force_factor <= invasion_scales(case).force_factor * (1 + 1e-9)
