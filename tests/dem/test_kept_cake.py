"""A cake that stays in a clean-up: in series with the way on which the drawdown is lost."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import resting_spheres, tiny

from fdnet.dem.clean_up import Start, clean_up, mark_of, out_plane
from fdnet.dem.clean_up_deck import Beginning, render_clean_up
from fdnet.dem.fluid import Moment
from fdnet.dem.kept_cake import kept_cake
from fdnet.dem.liggghts import Launch
from fdnet.network.fines.invaded import measure_invaded
from fdnet.run.clean_up import fluid_turned_back
from fdnet.run.dem_stages import invaded, packed_grains
from fdnet.run.fluid.behind_cake import BehindCake
from fdnet.run.fluid.mirrored import Mirrored
from fdnet.run.fluid.uniform import UniformCrowd
from fdnet.run.folder import open_folder
from fdnet.run.pipeline import RunOptions, run_stages
from fdnet.run.session import Session
from fdnet.scales.clean_up import back_flow, in_series
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind

STAGES = ("pack", "invade", "clean_up", "analyse")
WELL = ("well.radius_mm=108", "well.drainage_radius_m=100", "fluid.overbalance_MPa=20")
SCHEMES = [
    ("drag.scheme=viscous",),
    ("drag.refresh_steps=1", "drag.pressure_gradient=true"),
    ("drag.scheme=held", "drag.upstream=darcy"),
    ("drag.scheme=implicit",),
]


def small(*more, way="fluid.darcy_length_mm=8.0"):
    """25 grains and 900 fines, which leave a cake."""
    return tiny(
        "box.size_mm=[2.0,1.2,1.2]",
        "box.sides=periodic",
        "grains.count=25",
        way,
        "run.time_step_factor=0.2",
        "run.cap_ms=0.6",
        "fines.count=900",
        "clean_up.drawdown_MPa=1.0",
        "clean_up.lift_cake=false",
        *more,
    )


@pytest.mark.parametrize(("length", "keys"), [(8e-3, ()), (2e-3, ("fluid.darcy_length_mm=2",))])
def test_pack_and_standing_cake_are_in_series(length, keys):
    """U = p / (mu (l / k + h / k_c)) for a cake of known thickness h and permeability k_c."""
    case = small(*keys)
    flow, thickness, permeability = back_flow(case), 0.4e-3, 2e-11
    series = in_series(flow, thickness / permeability)
    pack = length / flow.scales.permeability
    whole = case.fluid.viscosity_Pa_s * (pack + thickness / permeability)
    rate = series.rate(1.0, 0.0) * flow.scales.darcy_velocity
    assert rate == pytest.approx(1e6 / whole, rel=1e-12)
    half = case.fluid.viscosity_Pa_s * (pack + 0.5 * thickness / permeability)
    rate = series.rate(0.5, 0.0) * flow.scales.darcy_velocity
    assert rate == pytest.approx(1e6 / half, rel=1e-12)


def test_around_a_well_the_way_is_longer():
    """The length that counts is r_w ln(r_e / r_w), so the cake matters little."""
    flow = back_flow(small(*WELL[1:], way=WELL[0]))
    way = 0.108 * np.log(100 / 0.108) / flow.scales.permeability
    series = in_series(flow, 2e7)
    assert series.rate(1.0, 0.0) == pytest.approx(way / (way + 2e7), rel=1e-12)


def test_with_inertia_the_losses_add_up_to_the_drawdown():
    case = small("fluid.darcy_law=ergun", "fluid.viscosity_cP=5")
    flow, resistance = back_flow(case), 3e7
    pack, cake = in_series(flow, 0.0), in_series(flow, resistance)
    assert cake.viscous < 0.9
    assert pack.rate(1.0, 0.0) == pytest.approx(1.0, rel=1e-12)
    rate, viscosity = cake.rate(1.0, 0.0), case.fluid.viscosity_Pa_s
    velocity = rate * flow.scales.darcy_velocity
    viscous = viscosity * velocity * (8e-3 / flow.scales.permeability + resistance)
    inertial = 1e6 - viscosity * flow.scales.darcy_velocity * 8e-3 / flow.scales.permeability
    assert viscous + inertial * rate**2 == pytest.approx(1e6, rel=1e-12)


@pytest.mark.parametrize("law", ["darcy", "ergun"])
def test_a_cake_that_moves_with_the_fluid_does_not_resist(law):
    series = in_series(back_flow(small(f"fluid.darcy_law={law}")), 5e7)
    for there in (1.0, 0.3, 0.0):
        assert series.rate(there, there) == pytest.approx(1.0, rel=1e-12)


def cake_of(flow, x, velocity):
    """Two grains and a fine at each x (m), moving along x."""
    box = np.array([[0.0, 2e-3], [0.0, 1.2e-3], [0.0, 1.2e-3]])
    grains = resting_spheres(
        [[3e-4, 6e-4, 6e-4], [9e-4, 6e-4, 6e-4]], 2.5e-4, box, kind=Kind.GRAIN
    )
    place = [[one, 6e-4, 6e-4] for one in x]
    fines = resting_spheres(place, 5e-5, box, kind=Kind.FINE, first=3)
    moving = np.zeros((len(x), 3))
    moving[:, 0] = velocity
    return grains.joined(replace(fines, velocity=moving))


def test_each_fine_upstream_takes_its_share():
    """Two of four stand, one moves with the fluid, one has come out, and one is inside."""
    flow = back_flow(small())
    start = cake_of(flow, [-1e-4, -2e-4, -3e-4, -4e-4, 6e-4], 0.0)
    density = np.full(5, 2000.0)
    cake = kept_cake(flow, start, -5e-4, 3e7, density=density)
    assert cake.rate(start) == pytest.approx(cake.series.rate(1.0, 0.0), rel=1e-12)
    speed = -flow.scales.upstream_velocity
    later = cake_of(flow, [-1e-4, -2e-4, -3e-4, -6e-4, 6e-4], [0.0, 0.0, speed, speed, speed])
    assert cake.rate(later) == pytest.approx(cake.series.rate(0.75, 0.25), rel=1e-12)
    inward = cake_of(flow, [-1e-4, -2e-4, -3e-4, -4e-4, 6e-4], -5 * speed)
    assert cake.rate(inward) == cake.rate(start)
    faster = cake_of(flow, [-1e-4, -2e-4, -3e-4, -4e-4, 6e-4], 5 * speed)
    assert cake.rate(faster) == pytest.approx(1.0, rel=1e-12)
    assert kept_cake(flow, start, 0.0, 3e7, density=density) is None
    assert kept_cake(flow, start, -5e-4, 0.0, density=density) is None


def test_the_uniform_field_with_a_crowd_is_slower_behind_the_cake():
    flow = back_flow(small("drag.crowd=beetstra", "drag.scheme=implicit"))
    start = cake_of(flow, [-1e-4, -2e-4, -3e-4, -4e-4, 6e-4], 0.0)
    cake = kept_cake(flow, start, -5e-4, 3e7, density=np.full(5, 2000.0))
    fluid = UniformCrowd(case=flow.case, scales=flow.scales)
    moment = Moment(step=0, time=0.0, before=None, first=None, fresh=True)
    free = Mirrored(fluid=fluid).forces(start, moment)
    slow = BehindCake(fluid=fluid, cake=cake).forces(start, moment)
    assert cake.rate(start) < 0.9
    assert np.allclose(slow.velocity, cake.rate(start) * free.velocity, rtol=1e-12)
    assert slow.pace == free.pace


@pytest.mark.parametrize("stays", [False, True])
def test_the_mud_side_has_the_upstream_velocity_in_a_crowd_turned_back(stays):
    """As in the deck of lone fines: Darcy's upstream of the face, that of the pores elsewhere."""
    keys = ("drag.crowd=beetstra", "drag.scheme=implicit", "drag.upstream=darcy")
    flow = back_flow(small(*keys, f"clean_up.lift_cake={str(not stays).lower()}"))
    spheres = cake_of(flow, [-2e-4, -1e-6, 1e-6, 6e-4, 1.999e-3, 2.1e-3], 0.0)
    cake = kept_cake(flow, spheres, -5e-4, 3e7, density=np.full(6, 2000.0)) if stays else None
    start = Start(
        grains=spheres.grains(),
        invaded=spheres,
        invasion=Path("invade"),
        cake=4e-4,
        digest="test",
        slows=cake,
    )
    fluid = fluid_turned_back(flow, spheres.grains(), start)
    moment = Moment(step=0, time=0.0, before=None, first=None, fresh=True)
    made = fluid.forces(spheres, moment).velocity[:, 0]
    rate, scales = cake.rate(spheres) if stays else 1.0, flow.scales
    assert scales.upstream_velocity < 0.6 * scales.drive_velocity
    assert made[:2] == pytest.approx(-rate * scales.upstream_velocity, rel=1e-12)
    assert made[2:] == pytest.approx(-rate * scales.drive_velocity, rel=1e-12)


def test_a_cake_that_is_lifted_leaves_the_deck_alone():
    flow = back_flow(small("clean_up.lift_cake=true"))
    begin = Beginning(restart="../invade/post/invade_1.restart", row=None, face=0.0)
    deck = render_clean_up(flow, "0", begin)
    assert "v_rate" not in deck.text
    assert "rate equal" not in deck.text


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The run folder of a finished clean-up with its cake, and its summary."""
    folder = tmp_path_factory.mktemp("run") / "run"
    options = RunOptions(out=folder, show_progress=False, stages=STAGES)
    return folder, run_stages(small(), options)


@pytest.fixture(scope="module")
def start(run):
    """What the clean-up of the run began with, but for the cake's resistance."""
    folder, case = run[0], small()
    held = open_folder(folder, case, stages=STAGES, resume=False, force=False)
    session = Session(
        case=case, scales=scales_of(case), folder=held, options=RunOptions(out=folder)
    )
    grains = packed_grains(session)
    damaged = invaded(session, case, grains).damaged
    held.close()
    return Start(
        grains=grains,
        invaded=damaged,
        invasion=folder / "invade",
        cake=measure_invaded(damaged, periodic=case.periodic).cake_thickness,
        digest="test",
    )


def slows(start, flow, resistance):
    """The cake of the invasion, with a `resistance` in 1/m."""
    density = np.full(900, flow.case.fines.density_kg_m3)
    face = out_plane(flow, start.cake)
    return kept_cake(flow, start.invaded, face, resistance, density=density)


def again(start, flow, folder, binary, cake, **options):
    """A clean-up of the same invasion in another folder, behind a `cake`."""
    begin = replace(start, slows=cake)
    return clean_up(flow, begin, folder, Launch(binary=binary, **options))


def printed_rate(log):
    """The rate that the deck begins with."""
    lines = [line for line in log.read_text().splitlines() if line.startswith("FDNET rate")]
    return float(lines[0].split()[2])


@pytest.mark.liggghts
def test_a_run_begins_with_the_rate_of_pack_and_cake_in_series(run):
    """All fines upstream stand or still come in, so the whole cake resists."""
    folder, summary = run
    cake = summary["cake_by_depth"]
    resistance = cake["resistance_network_1_m"] or cake["resistance_kozeny_1_m"]
    pack = 8e-3 / scales_of(small()).permeability
    rate = printed_rate(folder / "clean_up" / "log.liggghts")
    assert 0.3 < rate < 0.95
    assert rate == pytest.approx(pack / (pack + resistance), rel=1e-5)
    record = json.loads((folder / "clean_up" / "stage.json").read_text())
    assert not [text for text in record["left_out"] if "cake" in text]
    assert record["rate_at_start"] == pytest.approx(rate, rel=1e-9)
    assert summary["clean_up"]["rate_at_start"] == record["rate_at_start"]


@pytest.mark.liggghts
@pytest.mark.parametrize("keys", SCHEMES)
def test_behind_a_cake_that_lets_nothing_through_the_fluid_stands(keys, start, run, binary):
    """Every scheme of the drag is slowed down. The cake counts as standing though it moves."""
    flow = back_flow(small("clean_up.duration_ms=0.15", *keys))
    shut = replace(slows(start, flow, 1e15), velocity=-1e15)
    speed = []
    for name, cake in (("free", None), ("shut", shut)):
        done = again(start, flow, run[0] / f"{keys[0]}-{name}", binary, cake)
        speed.append(float(np.median(np.abs(done.state.fines().velocity[:, 0]))))
    assert speed[1] < 0.01 * speed[0]


@pytest.mark.liggghts
def test_a_cut_clean_up_behind_its_cake_goes_on_bit_for_bit(start, run, binary):
    flow = back_flow(small("clean_up.duration_ms=1.0"))
    cake = slows(start, flow, 3e7)

    class StopError(Exception):
        pass

    def stop(line):
        if line.startswith("FDNET cleaned 2 "):
            raise StopError

    whole = again(start, flow, run[0] / "whole", binary, cake)
    with pytest.raises(StopError):
        again(start, flow, run[0] / "cut", binary, cake, follow=stop)
    rest = again(start, flow, run[0] / "cut", binary, cake)
    assert (run[0] / "cut" / "in.clean_up.resume").exists()
    assert rest.history == whole.history
    for column in ("id", "position", "velocity"):
        assert np.array_equal(getattr(rest.state, column), getattr(whole.state, column))


@pytest.mark.liggghts
def test_a_checkpoint_without_the_cake_in_series_is_not_continued(start):
    """What an earlier version left unfinished starts over."""
    assert mark_of(back_flow(small("clean_up.lift_cake=true")), start) == start.digest
    assert mark_of(back_flow(small()), start) != start.digest


def test_a_checkpoint_of_a_crowd_with_the_ends_exchanged_is_not_continued(tmp_path):
    spheres = cake_of(back_flow(small()), [6e-4], 0.0)
    start = Start(
        grains=spheres.grains(), invaded=spheres, invasion=tmp_path, cake=0.0, digest="test"
    )
    crowd = ("drag.crowd=beetstra", "drag.scheme=implicit")
    assert mark_of(back_flow(small(*crowd, "drag.upstream=darcy")), start) != "test"
    assert mark_of(back_flow(small(*crowd)), start) == "test"
    assert mark_of(back_flow(small("drag.scheme=held", "drag.upstream=darcy")), start) == "test"
