"""Hard networks: islands and many decades against exact arithmetic, blocked sections."""

import numpy as np
import pytest
from builders import naming

from fdnet.errors import FlowError
from fdnet.network.flow.flow import INLET, OUTLET, Flow, solve_flow
from fdnet.network.flow.sections import plane_pressures, whole_permeability
from fdnet.network.laws.named import LAWS
from fdnet.network.network import Network, build_network
from fdnet.spheres.snapshot import Array
from tests.network.exact import exact_balance
from tests.network.networks import chain, network_of
from tests.network.packs import random_pack

FACES = 4


def random_pores(seed: int, *, decades: float, count: int = 18) -> tuple[Network, Array]:
    """Pores with three links each, four on each face; conductances 0 or 10^0 to 10^decades m3."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(0.1, 0.9, (count, 3))
    position[:FACES, 0], position[FACES : 2 * FACES, 0] = 0.0, 1.0
    pairs = np.array(
        [(i, j) for i in range(count) for j in rng.choice(count, 3, replace=False) if i != j]
    )
    conductance = 10.0 ** rng.uniform(0, decades, len(pairs)) * (rng.random(len(pairs)) > 0.15)
    return network_of(position, pairs, [[0, 1]] * 3), conductance


def exact_inflow(network: Network, conductance: Array, flow: Flow) -> float:
    """Inflow in rational arithmetic over the pores that the flow reaches."""
    x = network.pore_position[:, 0]
    state = np.where(x <= 0, INLET, np.where(x >= 1, OUTLET, 0))
    free = (state == 0) & np.isfinite(flow.pore_pressure)
    node = np.where(state < 0, 0, np.cumsum(free))
    ends, state = network.throat_pores, state[network.throat_pores]
    live = (
        np.all((state < 0) | free[ends], axis=1) & (conductance > 0) & (state[:, 0] != state[:, 1])
    )
    live |= np.all(free[ends], axis=1) & (conductance > 0)
    jump = 1.0 * (state[live, 0] == INLET) - 1.0 * (state[live, 1] == INLET)
    return exact_balance(node[ends[live]], conductance[live], jump, int(free.sum()) + 1)[0]


def test_conductances_from_0_over_sixteen_decades_against_rational_arithmetic():
    for decades in [0, 8, 16]:
        with naming(decades):
            flowing = 0
            for seed in range(12):
                network, g = random_pores(seed, decades=decades)
                flow = solve_flow(network, g)
                if flow.inflow == 0:
                    assert "no open path" in flow.reason
                    continue
                flowing += 1
                assert flow.inflow == pytest.approx(exact_inflow(network, g, flow), rel=1e-8)
            assert flowing > 8


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
