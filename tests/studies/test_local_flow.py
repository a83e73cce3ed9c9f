"""The flow by one scalar equation: its volume, and the flow of Stokes around the same grains."""

import numpy as np
import pytest

import fdnet
from tests.network.packs import random_pack
from validation.local_flow import local_flow, sampled


def test_the_local_flow_keeps_its_volume_and_is_near_that_of_stokes():
    pack = random_pack(16, seed=4)
    local = local_flow(pack, 2.0, 10.0)
    step = local.lattice.spacing
    gain = sum((np.roll(u, -1, axis) - u) / step[axis] for axis, u in enumerate(local.flow))
    assert np.abs(gain).max() < 0.02 * max(np.abs(u).max() for u in local.flow) / step[0]
    assert local.flow[0].mean(axis=(1, 2)) == pytest.approx(1.0, abs=0.01)
    # a flow that keeps its volume is left as it is
    same = local_flow(pack, 2.0, 10.0, kept=local, carried=local.flow)
    for one, other in zip(local.flow, same.flow, strict=True):
        assert other == pytest.approx(one, abs=0.02 * np.abs(one).max())
    size = np.ptp(pack.box, axis=1)
    places = pack.box[:, 0] + np.random.default_rng(1).random((2000, 3)) * size
    stokes = fdnet.velocity_field(pack, periodic="yz", cells=16.0).at(places)
    flow = sampled(local, pack).velocity(places)
    wet = np.any(stokes != 0.0, axis=1)
    off = np.sqrt(np.mean(np.sum((flow - stokes)[wet] ** 2, axis=1)))
    assert off < 0.3 * np.linalg.norm(stokes[wet], axis=1).mean()
