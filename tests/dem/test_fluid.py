"""The fluid that answers for its fines: crowds, and the flow of the network after its deposit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from builders import followed, resting_spheres

from fdnet.case.file import case_from
from fdnet.dem import invade_deck as deck
from fdnet.dem.checkpoint import plug_allowance, quiet_chunks, state_at
from fdnet.dem.invasion import invade
from fdnet.dem.supply import batches_of, densities
from fdnet.errors import CaseError
from fdnet.network.field.field import velocity_field
from fdnet.run.cake import cake_summary, measure_cake
from fdnet.run.fluid import Movers, NetworkFluid, fluid_of, history_rows, mean_ahead
from fdnet.run.network_flow import Renewal, on_each_fine
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind, Snapshot

pytestmark = pytest.mark.liggghts
FIRST = deck.Moment(step=0, time=0.0, before=None, fresh=True)


@pytest.fixture(scope="module")
def fluid(grains_of) -> NetworkFluid:
    case = followed()
    return fluid_of(case, scales_of(case), grains_of(case))


@pytest.fixture(scope="module")
def done(go, fluid, tmp_path_factory):
    return go(fluid.case, tmp_path_factory.mktemp("done"), fluid)


def fines(position, radius, box, velocity=(0.0, 0.0, 0.0)) -> Snapshot:
    made = resting_spheres(position, radius, box, kind=Kind.FINE, first=10_000)
    return replace(made, velocity=np.tile(velocity, (len(made), 1)))


def with_case(fluid, *more, **way):
    """The same pack in a case with other settings; the pack is not solved again."""
    case = followed(*more, **way)
    other = replace(fluid, case=case, scales=scales_of(case))
    other.__dict__["pack"] = fluid.pack
    return other


def deposit_of(done) -> Snapshot:
    spheres = done.state.fines()
    return replace(spheres, velocity=np.zeros_like(spheres.velocity))


def test_batches_come_as_the_mud_that_slows_down_carries_them(go, fluid, tmp_path):
    """The mud has moved by the filtrate over the face; a batch enters before it is needed."""
    keys = ("fines.supply=batches", "fines.count=600", "run.checkpoint_ms=0.02", "run.cap_ms=0.3")
    other = with_case(fluid, *keys)
    result = go(other.case, tmp_path, other)
    batches, area = batches_of(other.case, other.scales), fluid.pack.network.area
    table = history_rows(other.case, other.scales, result.history, result.updates)
    entered = [batches.entered_with(line["supplied_count"]) for line in table]
    counted = [row.upstream + row.invaded + row.passed for row in result.history]
    assert [line["supplied_count"] for line in table] == counted
    assert result.supplied == counted[-1]
    undisturbed = [batches.entered_at(row.chunk + 1) for row in result.history]
    assert all(late <= one for late, one in zip(entered, undisturbed, strict=True))
    assert 4 < entered[-1] < undisturbed[-1]
    for row, count in zip(result.history, entered, strict=True):
        filtrate = [line["filtrate_m3"] for line in result.updates if line["step"] < row.step][-1]
        assert count >= batches.entered_after(filtrate / area)


def carried_with(fluid, deposit):
    return Renewal(fluid.pack).of(deposit, anew=True)


def test_an_intact_pack_carries_all_and_its_grains_take_up_the_pressure_drop(fluid):
    none = fines(np.empty((0, 3)), 5e-5, fluid.grains.box)
    carried, _ = carried_with(fluid, none)
    assert carried.k_over_k0 == pytest.approx(1.0, rel=1e-9)
    assert carried.ratio == pytest.approx(1.0, rel=1e-9)
    assert carried.pressed.grains[0] == pytest.approx(fluid.pack.network.area, rel=1e-9)
    assert np.all(carried.pressed.groups == 0.0)


def test_the_overbalance_is_the_first_drop_of_pressure(fluid):
    """Over the pack's own permeability and the rest of the way, with inertia where it counts."""
    viscosity, permeability = fluid.case.fluid.viscosity_Pa_s, fluid.pack.permeability
    for length in (1.6, 4.8):
        other = with_case(fluid, way=f"fluid.darcy_length_mm={length}")
        pressure = viscosity * other.drive.velocity * 1e-3 * length / permeability
        assert pressure == pytest.approx(other.case.fluid.overbalance_Pa, rel=1e-9)
    around = ("well.radius_mm=108.0", "well.drainage_radius_m=100.0")
    around += ("well.formation_permeability_mD=50.0",)
    tight = with_case(fluid, *around, way="fluid.overbalance_MPa=2.0")
    path = 0.108 * np.log(100.0 / 0.108)
    resistance = 1.6e-3 / permeability + (path - 1.6e-3) / (50.0 * 9.869233e-16)
    velocity = tight.drive.velocity / tight.scales.force_factor
    assert viscosity * velocity * resistance == pytest.approx(2e6, rel=1e-9)
    assert tight.drive.rest == pytest.approx(resistance * permeability / 1.6e-3 - 1.0, rel=1e-9)
    fast = with_case(fluid, "fluid.darcy_law=ergun", way="fluid.darcy_length_mm=1.6")
    darcy = fluid.case.fluid.overbalance_Pa * permeability / viscosity / 1.6e-3
    assert 0.1 * darcy < fast.drive.velocity < 0.99 * darcy


def test_the_rate_follows_the_resistances_in_series(fluid, done):
    """Closed form for pack, cake and the rest of the way, in what the fluid itself measures."""
    standing = fluid.grains.joined(deposit_of(done))
    intact = fluid.case.fluid.viscosity_Pa_s * fluid.pack.length / fluid.pack.permeability
    for other, rest in ((fluid, 0.0), (with_case(fluid, way="fluid.darcy_length_mm=4.8"), 2.0)):
        row = other.forces(standing, FIRST).measures
        assert other.drive.rest == pytest.approx(rest, abs=1e-9)
        cake = row["pressure_cake_Pa"] / row["velocity_m_s"] / intact
        share = (1 + rest) / (1 / row["k_over_k0"] + cake + rest)
        assert row["velocity_m_s"] == pytest.approx(share * other.drive.velocity, rel=1e-9)
        assert row["k_over_k0"] < 0.95
    steady = with_case(fluid, "drag.drive=rate")
    row = steady.forces(standing, FIRST).measures
    assert row["velocity_m_s"] == steady.drive.velocity
    carried = carried_with(fluid, deposit_of(done))[0]
    assert carried.ratio.min() < 0.8, "the deposit turns the flow aside"
    assert carried.ratio.max() > 1.05


def test_a_standing_cake_takes_the_pressure_of_the_summary_and_of_carman_and_kozeny(fluid):
    """Sixteen layers of a cubic bed of touching fines before a layer inside the pack, at rest."""
    spacing, radius = 1e-4, 5e-5
    axis = np.arange(spacing / 2, 1e-3, spacing)
    x = spacing * (np.arange(-16, 1) + 0.5)
    place = np.stack(np.meshgrid(x, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    bed = fluid.grains.joined(fines(place, radius, fluid.grains.box))
    forces = fluid.forces(bed, FIRST)
    row, viscosity = forces.measures, fluid.case.fluid.viscosity_Pa_s
    solid = np.pi / 6
    gradient = 180 * viscosity * solid**2 * row["velocity_m_s"]
    gradient /= (1 - solid) ** 3 * (2 * radius) ** 2
    assert row["pressure_cake_Pa"] == pytest.approx(gradient * 16 * spacing, rel=0.15)
    assert row["cake_thickness_m"] == pytest.approx(16 * spacing, rel=1e-9)
    summary = cake_summary(measure_cake(bed, fluid.case.periodic), 1.0)["cake"]
    pressure = summary["resistance_1_m"] * viscosity * row["velocity_m_s"]
    assert row["pressure_cake_Pa"] == pytest.approx(pressure, rel=1e-9)
    assert summary["thickness_m"] == pytest.approx(row["cake_thickness_m"], rel=1e-9)
    on_cake = (forces.coefficient * forces.velocity[:, 0])[place[:, 0] < 0].sum()
    area = fluid.pack.network.area
    assert on_cake == pytest.approx(row["pressure_cake_Pa"] * area, rel=1e-9)


def test_fines_that_move_with_the_mud_make_no_cake_and_feel_no_force(fluid):
    place = np.random.default_rng(1).random((200, 3)) * 1e-3 - np.array([3e-3, 0, 0])
    speed = fluid.drive.velocity
    moving = fines(place, 5e-5, fluid.grains.box, velocity=(speed, 0.0, 0.0))
    forces = fluid.forces(fluid.grains.joined(moving), FIRST)
    assert forces.measures["pressure_cake_Pa"] == 0.0
    assert forces.measures["rate_over_initial"] == pytest.approx(1.0, rel=1e-9)
    assert forces.velocity[:, 0] == pytest.approx(speed, rel=1e-6)
    assert np.abs(forces.push).max() == 0.0


def test_forces_on_fines_and_grains_add_up_to_the_drop_of_pressure(fluid, done):
    standing = deposit_of(done)
    forces = fluid.forces(fluid.grains.joined(standing), FIRST)
    depth = standing.position[:, 0]
    inside = (depth >= 0) & (depth < fluid.pack.length)
    on_fines = forces.coefficient * forces.velocity[:, 0]
    carried, deposit = carried_with(fluid, standing)
    drop = forces.measures["pressure_pack_Pa"]
    caked = on_each_fine(carried.pressed, deposit)[deposit.fines.position[:, 0] < 0, 0]
    total = on_fines[inside].sum() + drop * (caked.sum() + carried.pressed.grains[0])
    assert float(total) == pytest.approx(drop * fluid.pack.network.area, rel=0.01)
    assert forces.measures["momentum_defect"] <= 0.01
    assert 0.5 < forces.measures["crowd_over_network"] < 2.0


def test_the_balance_holds_while_fines_move_at_another_pace_than_the_fluid(fluid):
    """Many fines in the pack that are slower or faster than it: exact, for drag is linear."""
    viscosity, pack = fluid.case.fluid.viscosity_Pa_s, fluid.pack
    whole = pack.length * fluid.drive.velocity * viscosity / pack.permeability
    place = np.random.default_rng(2).random((150, 3)) * np.array([1.5e-3, 1e-3, 1e-3])
    before = {"velocity_m_s": 0.6 * fluid.drive.velocity, "time_s": 0.0}
    moment = replace(FIRST, before=before | {"rate_m3_s": 0.0, "filtrate_m3": 0.0})
    for pace in (0.0, 2.0):
        speed = pace * fluid.drive.velocity / fluid.scales.porosity
        moving = fines(place, 2e-5, fluid.grains.box, velocity=(speed, 0.0, 0.0))
        row = replace(fluid, standing=0.0).forces(fluid.grains.joined(moving), moment).measures
        assert row["fines_standing"] == 0
        assert row["momentum_defect"] < 1e-9, pace
        assert row["pressure_pack_Pa"] == pytest.approx(whole, rel=1e-6), pace
        assert (row["rate_over_initial"] < 1.0) == (pace < 1.0)


def test_the_fines_take_the_share_of_the_pressure_that_resolved_flow_gives_them(fluid, done):
    """Stokes flow around grains and fines, to a factor of 2, which knows no network."""
    standing = deposit_of(done)
    depth = standing.position[:, 0]
    inside = standing.where((depth > 5e-5) & (depth < fluid.pack.length))
    pressed = carried_with(fluid, inside)[0].pressed
    network = pressed.groups[:, 0].sum() / (pressed.groups[:, 0].sum() + pressed.grains[0])
    field = velocity_field(fluid.grains, periodic="yz", fines=inside, cells=16)
    force = field.forces[0][:, 0]
    resolved = force[field.grains :].sum() / force.sum()
    assert 0.5 < network / resolved < 2.0


def test_what_fines_close_still_carries_the_pressure(fluid):
    """A wall of fines across the whole pack: nothing flows, and they feel the whole drop."""
    axis = np.arange(2.5e-5, 1e-3, 5e-5)
    layers = np.arange(0.6e-3, 0.9e-3, 5e-5)
    place = np.stack(np.meshgrid(layers, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    carried, _ = carried_with(fluid, fines(place, 4e-5, fluid.grains.box))
    assert 0.0 < carried.k_over_k0 < 1e-3
    total = carried.pressed.grains + carried.pressed.groups.sum(axis=0)
    assert total[0] == pytest.approx(fluid.pack.network.area, rel=1e-6)
    assert carried.pressed.groups[:, 0].sum() > 0.1 * fluid.pack.network.area


def test_updates_from_the_former_one_give_what_a_full_one_gives(fluid, done):
    standing = deposit_of(done)
    place = np.array(standing.position)
    place[::7] += 3e-5
    after = fluid.grains.joined(replace(standing, position=place))
    fluid.forces(fluid.grains.joined(standing), FIRST)
    grown = fluid.forces(after, FIRST)
    full = replace(fluid).forces(after, FIRST)
    for name in ("coefficient", "velocity", "push"):
        assert np.array_equal(getattr(grown, name), getattr(full, name))
    assert grown.measures == full.measures


def test_the_ledger_adds_up_and_momentum_closes(fluid, done):
    rows = done.updates
    rate, time = (np.array([row[name] for row in rows]) for name in ("rate_m3_s", "time_s"))
    passed = float(rate[:-1] @ np.diff(time))
    assert rows[-1]["filtrate_m3"] == pytest.approx(passed, rel=1e-9)
    assert rows[0]["rate_over_initial"] == pytest.approx(1.0, rel=0.02)
    assert rows[-1]["rate_over_initial"] < 0.95
    area, whole = fluid.pack.network.area, rows[0]
    total = whole["pressure_pack_Pa"] + whole["pressure_cake_Pa"]
    for row in rows:
        assert row["pressure_pack_Pa"] + row["pressure_cake_Pa"] == pytest.approx(total, rel=1e-6)
        assert row["rate_m3_s"] == pytest.approx(row["velocity_m_s"] * area, rel=1e-12)
        assert row["momentum_defect"] <= 0.01
    table = history_rows(fluid.case, fluid.scales, done.history, rows)
    assert [line["step"] for line in table] == [row.step for row in done.history]
    assert table[-1]["filtrate_m3"] == rows[-1]["filtrate_m3"]
    assert len(set(fluid.measured)) == len(fluid.measured), "no two columns have one name"


def test_a_rate_or_a_volume_that_is_asked_for_ends_the_run(go, fluid, done, tmp_path):
    pores = fluid.scales.porosity * np.prod(fluid.case.size_m)
    share = done.updates[len(done.updates) // 2]["rate_over_initial"]
    asked = float(0.5 * done.updates[-1]["filtrate_m3"] / pores)
    results = {}
    by_rate, by_volume = f"run.stop_rate={share}", f"run.stop_pore_volumes={asked!r}"
    for reason, key in (("plugged", by_rate), ("duration", by_volume)):
        other = with_case(fluid, key)
        result = results[reason] = go(other.case, tmp_path / reason, other)
        assert result.stop_reason == reason
        assert 0 < len(result.history) < len(done.history)
        assert result.updates == done.updates[: len(result.updates)]
    rows, history = results["duration"].updates, results["duration"].history
    before = [row for row in rows if row["step"] < history[-2].step]
    assert before[-1]["filtrate_m3"] < asked * pores <= rows[-1]["filtrate_m3"]


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_face_is_plugged_once_all_that_moves_has_come_to_rest(go, fluid, tmp_path, share):
    """The face alone was quiet before, while a fine left and others moved inside."""
    other = with_case(
        fluid,
        "fines={radius_mm=[0.03,0.11], friction=0.0, count=140, concentration=0.2, supply='slab'}",
        *("run.plug_time_ms=0.06", "run.checkpoint_ms=0.02", "run.cap_ms=2.0"),
        f"run.plug_rate={share}",
    )
    case, scales = other.case, other.scales
    result, chunks, ends = go(case, tmp_path, other), quiet_chunks(scales), []
    entered = [row.invaded + row.passed for row in result.history]
    same = [two - one for one, two in zip(entered, entered[chunks:], strict=False)]
    for row in result.history[chunks:]:
        spheres = state_at(tmp_path, row, case, scales, fluid.grains).fines()
        x, along = spheres.position[:, 0], spheres.velocity[:, 0] / scales.drive_velocity
        rest = along[(x >= 0) & (x < case.size_m[0])].mean() <= max(share, 0.01)
        ends.append(rest and row.quiet >= chunks)
    assert (result.stop_reason, ends.index(True)) == ("plugged", len(ends) - 1)
    assert min(same[:-1]) <= plug_allowance(case, scales)


def test_a_slab_at_constant_rate_raises_the_pressure(go, fluid, tmp_path):
    """The mud comes on as at the start, the filtrate is rate times time, the pressure grows."""
    other = with_case(fluid, "drag.drive=rate", "run.cap_ms=0.3")
    result = go(other.case, tmp_path, other)
    assert other.case.fines.supply == "slab"
    assert result.stop_reason == "cap"
    first, last = result.updates[0], result.updates[-1]
    assert last["velocity_m_s"] == first["velocity_m_s"] == other.drive.velocity
    assert last["filtrate_m3"] == pytest.approx(first["rate_m3_s"] * last["time_s"], rel=1e-9)
    assert last["k_over_k0"] < 0.95
    network = first["pressure_pack_Pa"] / last["k_over_k0"]
    assert last["pressure_pack_Pa"] == pytest.approx(network, rel=0.05)
    assert max(row["momentum_defect"] for row in result.updates) <= 0.01


def test_what_does_not_go_with_the_network_is_refused():
    """Key and value are named."""
    uniform = "drag.field=uniform"
    for keys, message in (
        (["drag.upstream=interstitial"], "drag.upstream: 'interstitial' belongs to"),
        (["grains.motion=mobile"], "grains.motion: 'mobile' with drag.field 'network'"),
        ([uniform, "drag.drive=rate"], "drag.drive: 'rate' belongs to"),
        (["drag.drive=rate", "run.stop_rate=0.1"], "run.stop_rate: 0.1 needs a rate that"),
        ([uniform, "run.stop_pore_volumes=2"], "run.stop_pore_volumes: 2.0 belongs to drag"),
        (["drag.inertia=none"], "drag.inertia: 'none' belongs to drag.field 'uniform'"),
        (["drag.scheme=viscous"], "drag.scheme: 'viscous' belongs to drag.field 'uniform'"),
        (["drag.pressure_gradient=false"], "drag.pressure_gradient: False belongs to"),
        (["drag.refresh_steps=5"], "drag.refresh_steps: 5 belongs to drag.field 'uniform'"),
    ):
        with pytest.raises(CaseError) as error:
            followed(*keys)
        assert message in str(error.value), keys
    with pytest.raises(CaseError, match="needs a fluid that fdnet computes"):
        invade(followed(), scales_of(followed()), None, Path("/nowhere"), None)


def test_a_fine_stands_when_it_is_slower_than_half_of_what_it_was_given(fluid):
    """One that left a fast throat is slow for its place, but as fast as its forces make it."""
    points = np.random.default_rng(4).random((500, 3)) * np.array([1.6e-3, 1e-3, 1e-3])
    place = points[np.linalg.norm(fluid.pack.shape.at(points), axis=1) > 0.5][:3]
    speed = 1e-3 * fluid.drive.velocity
    slow = fluid.grains.joined(fines(place, 2e-5, fluid.grains.box, (speed, 0.0, 0.0)))
    given = np.array([1.5 * speed, 4.0 * speed, 0.0])
    assert fluid.forces(slow, FIRST).measures["fines_standing"] == 3
    known = fluid.forces(slow, replace(FIRST, given=given))
    assert known.measures["fines_standing"] == 2  # the last was given nothing yet


class Watched:
    """A fluid whose answers are compared with what LIGGGHTS shows at the next update."""

    keep = recall = lambda self, path: None

    def __init__(self, fluid):
        self.fluid, self.measured, self.answer, self.compared = fluid, fluid.measured, {}, 0
        self.seen = []

    def forces(self, spheres, moment):
        self.seen.append((spheres.fines(), moment.density))
        known = [self.answer.get(one, 0.0) for one in spheres.fines().id]
        assert moment.given == pytest.approx(known, rel=1e-9)
        self.compared += np.count_nonzero(known)
        made = self.fluid.forces(spheres, moment)
        still = (spheres.fines().id + len(self.seen)) % 2 == 0  # zeros have no rows
        made.velocity[still], made.push[still] = 0.0, 0.0
        went = np.linalg.norm(made.velocity + made.push / made.coefficient[:, None], axis=1)
        self.answer = dict(zip(spheres.fines().id, went, strict=True))
        return made


def test_liggghts_shows_the_velocity_that_each_fine_was_given(go, fluid, tmp_path):
    keys = ("fines.supply=batches", "fines.count=600", "run.cap_ms=0.15")
    other = with_case(fluid, *keys)
    watched = Watched(other)
    go(other.case, tmp_path, watched)
    assert watched.compared > 1000


def test_the_fluid_is_asked_with_the_density_of_each_fine(go, grains_of, tmp_path):
    sizes = {"D10_mm": 0.09, "D90_mm": 0.11}
    materials = [
        {"name": name, "share": density, "density_kg_m3": density, "sizes": sizes}
        for name, density in (("light", 1100.0), ("heavy", 2200.0))
    ]
    supply = {"count": 400, "supply": "batches", "materials": materials}
    keys = ("run.cap_ms=0.25", "run.checkpoint_ms=0.05", "fluid.darcy_length_mm=20.0")
    case = case_from(followed(*keys, way="drag.multiplier=1.0").data() | {"fines": supply})
    watched, grains = Watched(fluid_of(case, scales_of(case), grains_of(case))), grains_of(case)
    go(case, tmp_path, watched)
    everyone = densities(case, batches_of(case, scales_of(case)).counts)
    assert len(watched.seen) >= 5
    for present, density in watched.seen:
        assert np.array_equal(density, everyone[present.id.astype(int) - 1 - int(grains.id.max())])
        assert set(density) == {1100.0, 2200.0}


# ---- What fines meet on the way until the next update.
def movers(place, rate, velocity=(0.0, 0.0, 0.0)) -> Movers:
    return Movers(position=np.array([place]), velocity=np.array([velocity]), rate=np.array([rate]))


def test_drag_takes_up_the_slip_exactly():
    """v = u + (v0 - u) exp(-a t), and its integral."""
    fluid = np.array([[2.0, -1.0, 0.0]])
    one = movers((1.0, 0.0, 0.0), 3.0, (0.0, 0.0, 5.0)).after(0.4, fluid)
    left = np.exp(-1.2)
    assert one.velocity[0] == pytest.approx([2 - 2 * left, -1 + left, 5 * left])
    share = (1 - left) / 3.0
    assert one.position[0] == pytest.approx([1.8 - 2 * share, -0.4 + share, 5 * share])


def test_the_mean_over_the_way_in_a_flow_that_speeds_up():
    """A tracer in u = a x goes to x exp(a T). The fluid where it begins is 1.7 times as slow."""
    a, time, start = 5.0, 0.2, 0.3
    mean = mean_ahead(movers((start, 0.0, 0.0), 1e9), lambda at: a * at, time)
    assert mean[0, 0] == pytest.approx(start * (np.exp(a * time) - 1) / time, rel=0.02)
    assert mean[0, 1:] == pytest.approx(0.0)
    slow = mean_ahead(movers((0.3, 0.0, 0.0), 1e-9), lambda at: a * at, time)
    assert slow[0] == pytest.approx([1.5, 0.0, 0.0]), "one that drag hardly moves stays"
