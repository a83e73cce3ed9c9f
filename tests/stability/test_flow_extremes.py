"""Hard networks: bad conductances, blocked sections, many decades.

Answers against exact arithmetic stand in tests/network/test_flow.py and test_properties.py.
"""

import numpy as np
import pytest
from builders import naming

from fdnet.errors import FlowError
from fdnet.network.flow.flow import solve_flow
from fdnet.network.flow.sections import plane_pressures, whole_permeability
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from tests.network.networks import chain
from tests.network.packs import random_pack


def test_one_bad_conductance_among_many_is_refused_and_named():
    for bad in [np.nan, np.inf, -1.0, -1e-300]:
        with naming(bad), pytest.raises(FlowError, match="throat 7"):
            solve_flow(chain(9), np.array([1.0] * 7 + [bad, 1.0]))


def pack_network():
    network = build_network(random_pack(120), periodic=(False, True, True), walls="slip")
    return network, LAWS["lubrication"](network)


def test_a_section_with_all_throats_blocked_leaves_k_0_there_and_k_elsewhere():
    network, g = pack_network()
    length = network.box[0, 1]
    ends = network.throat_ends[:, :, 0]
    across = (ends.min(axis=1) <= 0.5 * length) & (ends.max(axis=1) >= 0.5 * length)
    g = np.where(across, 0.0, g)
    k, flow = whole_permeability(network, g)
    assert k == 0
    assert "no open path from x = 0 m" in flow.reason
    x = network.pore_position[:, 0]
    assert flow.isolated_pores == np.sum((x > 0) & (x < length))
    assert solve_flow(network, g, span=(0.0, 0.2 * length)).inflow > 0
    assert solve_flow(network, g, span=(0.4 * length, 0.6 * length)).inflow == 0


def test_sections_in_place_recombine_over_sixteen_decades():
    """The mean pressures of planes fall from 1 to 0 along the flow."""
    network, clean = pack_network()
    g = clean * 10.0 ** np.random.default_rng(5).uniform(-16, 0, len(clean))
    flow = solve_flow(network, g)
    planes = np.linspace(0.0, network.box[0, 1], 9)
    pressure = plane_pressures(network, flow, planes)
    assert pressure[0] == 1.0
    assert pressure[-1] == 0.0
    assert np.all(np.diff(pressure) < 0)
    assert flow.mass_balance < 1e-6
