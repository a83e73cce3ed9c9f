"""Arrivals of fines at throats, on ways whose crossings are known."""

from dataclasses import replace

import numpy as np
import pytest
from network.packs import random_pack

from fdnet.network.network import build_network
from fdnet.spheres.geometry import wrapped
from fdnet.spheres.snapshot import Kind, Snapshot
from validation.dem.arrivals import arrivals
from validation.dem.clogging import Met, clogging_rows

RADIUS = 0.05


@pytest.fixture(scope="module")
def network():
    return build_network(random_pack(16, seed=4), periodic="yz")


def facet(network, throat):
    """Centre and unit normal of the facet of a throat."""
    a, b, c = network.throat_corner[throat]
    normal = np.cross(b - a, c - a)
    return (a + b + c) / 3.0, normal / np.linalg.norm(normal)


def state(network, places):
    """One fine at each place, brought into the box as a dump has it."""
    count = len(places)
    return Snapshot(
        step=0,
        time_s=0.0,
        box=network.box,
        id=np.arange(7, 7 + count),
        kind=np.full(count, Kind.FINE),
        position=wrapped(np.array(places), network.box, network.periodic),
        radius=np.full(count, RADIUS),
        velocity=np.zeros((count, 3)),
    )


@pytest.mark.parametrize("throat", range(0, 60, 7))
def test_a_fine_that_steps_over_one_facet_arrives_at_that_throat_alone(network, throat):
    """Short steps: no other facet is as near to the centre of this one."""
    centre, normal = facet(network, throat)
    ahead = [state(network, [centre + side * 2e-3 * normal]) for side in (-1.0, 1.0, -1.0)]
    far = state(network, [[-5.0, *centre[1:]]])
    count = arrivals(network, [*ahead, replace(far, id=np.array([99]))])
    assert count[throat] == 1, "forth and back is one fine"
    assert count.sum() == 1


def test_a_resting_fine_arrives_within_its_radius_of_the_facet(network):
    centre, normal = facet(network, 3)
    for away, expected in ((0.9, 1), (1.1, 0)):
        alone = [state(network, [centre + away * RADIUS * normal])]
        assert arrivals(network, alone)[3] == expected


def test_states_in_between_change_nothing_on_a_straight_way(network):
    low, high = network.box[:, 0], network.box[:, 1]
    places = np.random.default_rng(2).random((40, 3)) * (high - low) + low
    places[:, 0] = low[0] - 1.0
    way = np.array([high[0] - low[0] + 2.0, 0.2, -0.1])
    whole = [state(network, places + share * way) for share in (0.0, 1.0)]
    parts = [state(network, places + share * way) for share in np.linspace(0.0, 1.0, 8)]
    assert np.array_equal(arrivals(network, whole), arrivals(network, parts))
    assert arrivals(network, whole).sum() > 40


def test_rows_hold_the_throats_that_fines_came_to():
    """Of five throats two of one class were met, one of them blocked: the share is a half."""
    one = Met(
        concentration=0.1,
        ratio=np.array([0.45, 0.48, 0.45, 1.2, 0.45]),
        arrived=np.array([3, 1, 0, 1, 0]),
        halved=np.array([3, 0, 0, 1, 0]),
        estimated=np.array([5.0, 2.0, 1.0, 1.0, 9.0]),
        blocked=np.array([True, False, True, True, False]),
    )
    middle, wide = clogging_rows([one])
    assert (middle["met"], middle["blocked"], middle["share_blocked"]) == (2, 1, 0.5)
    assert (middle["arrived_mean"], middle["arrived_mean_half_the_states"]) == (2.0, 1.5)
    assert middle["arrived_mean_estimated"] == pytest.approx(3.5)
    assert middle["blocked_per_100_arrivals"] == pytest.approx(25.0)
    assert (wide["ratio_lo"], wide["met"], wide["share_blocked"]) == (1.0, 1, 1.0)
