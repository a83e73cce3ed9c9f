"""What fines meet on the way until the next update."""

from dataclasses import replace

import numpy as np
import pytest
from builders import followed

from fdnet.dem.invade_deck import Moment, drag_rate
from fdnet.dem.invasion import steps_between
from fdnet.dem.liggghts import Launch
from fdnet.dem.packing import make_pack
from fdnet.run.fluid import Movers, NetworkFluid, mean_ahead
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind, Snapshot

TRACER, FINE = 1e9, "fines.radius_mm=0.0125"


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
    mean = mean_ahead(movers((start, 0.0, 0.0), TRACER), lambda at: a * at, time)
    assert mean[0, 0] == pytest.approx(start * (np.exp(a * time) - 1) / time, rel=0.02)
    assert mean[0, 1:] == pytest.approx(0.0)


def test_a_fine_that_drag_hardly_moves_meets_the_fluid_at_its_place():
    mean = mean_ahead(movers((0.3, 0.0, 0.0), 1e-9), lambda at: 5.0 * at, 0.2)
    assert mean[0] == pytest.approx([1.5, 0.0, 0.0])


def test_a_way_that_leads_into_a_grain_ends_before_it():
    """The grain begins at x = 1; the fluid before it has the velocity 1 at 0 and 2 at 1."""

    def fluid(at):
        assert np.all(np.isfinite(at))
        return np.where(at[:, :1] < 1.0, (1.0 + at[:, :1]) * np.array([1.0, 0.0, 0.0]), 0.0)

    near = mean_ahead(movers((0.0, 0.0, 0.0), TRACER), fluid, 100.0)
    assert 1.0 <= near[0, 0] < 2.0
    assert mean_ahead(movers((1.5, 0.0, 0.0), TRACER), fluid, 1.0)[0] == pytest.approx(0.0)


def test_a_fine_that_stays_where_the_fluid_is_even_meets_it_there():
    """Before x = 0 the velocity is 1, from there on 1 + x: only fines that get there are asked."""
    asked = []

    def fluid(at):
        asked.append(len(at))
        return (1.0 + np.maximum(at[:, :1], 0.0)) * np.array([1.0, 0.0, 0.0])

    place = np.array([[-5.0, 0.0, 0.0], [-0.5, 0.0, 0.0], [-2.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    four = Movers(
        position=place,
        velocity=np.array([[1.0, 0.0, 0.0]] * 2 + [[3.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        rate=np.array([TRACER, TRACER, 1e-9, TRACER]),
    )
    everywhere = mean_ahead(four, fluid, 1.0)
    asked.clear()
    assert np.array_equal(mean_ahead(four, fluid, 1.0, even_to=0.0), everywhere)
    assert asked == [4] + [3] * 7
    assert everywhere[0, 0] == 1.0
    assert np.all(everywhere[1:, 0] > 1.0)


@pytest.mark.liggghts
def test_updates_at_every_diameter_carry_fines_as_far_as_sixteen_times_as_many(binary, tmp_path):
    """Fines of 1/20 of a grain cross a pack; the fluid at their place alone holds them back."""
    case = followed(FINE)
    scales = scales_of(case)
    grains = make_pack(case, tmp_path, Launch(binary=binary)).grains
    fluid = NetworkFluid(case=case, scales=scales, grains=grains, standing=0.0)
    seldom, often = gone(fluid, 1.0), gone(fluid, 0.0625)
    assert seldom == pytest.approx(often, rel=0.05)


def gone(fluid: NetworkFluid, travel: float) -> float:
    """Mean way of fines through a pack with updates at each `travel` diameters."""
    case = followed(FINE, f"drag.update_travel={travel}")
    other = replace(fluid, case=case)
    other.__dict__["pack"] = fluid.pack
    place = np.random.default_rng(3).random((400, 3)) * np.array([0.0, 1e-3, 1e-3])
    start = Snapshot.from_arrays(place, 1.25e-5, box=fluid.grains.box, kind=Kind.FINE)
    now = replace(start, velocity=np.tile((fluid.first_velocity, 0.0, 0.0), (400, 1)))
    time, end = 0.0, 4e-4 / fluid.first_velocity
    moment = Moment(step=0, time=0.0, before=None, first=None, fresh=False)
    while time < end:
        forces = other.forces(fluid.grains.joined(now), moment)
        rate = drag_rate(now, forces.coefficient, case.fines.density_kg_m3)
        met = forces.velocity + forces.push / forces.coefficient[:, None]
        left = steps_between(case, fluid.scales, forces.pace) * fluid.scales.time_step
        movers = Movers(position=now.position, velocity=now.velocity, rate=rate)
        after = movers.after(min(left, end - time), met)
        free = np.any(fluid.pack.shape.at(after.position) != 0.0, axis=1)[:, None]
        now = replace(
            now,
            position=np.where(free, after.position, now.position),
            velocity=np.where(free, after.velocity, 0.0),
        )
        time += left
    return float(now.position[:, 0].mean())
