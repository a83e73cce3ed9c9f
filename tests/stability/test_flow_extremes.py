"""Hard networks against exact arithmetic.

Conductances over many decades, blocked sections, a single path, islands.
"""

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


def test_the_unit_of_conductance_does_not_matter():
    for unit in [1e-300, 1e-30, 1e16, 1e200]:
        with naming(unit):
            network, g = random_pores(3, decades=6)
            assert solve_flow(network, unit * g).inflow == pytest.approx(
                unit * solve_flow(network, g).inflow, rel=1e-9
            )


def test_one_bad_conductance_among_many_is_refused_and_named():
    for bad in [np.nan, np.inf, -1.0, -1e-300]:
        with naming(bad):
            network, g = random_pores(3, decades=6)
            g[7] = bad
            with pytest.raises(FlowError, match="throat 7"):
                solve_flow(network, g)


def pack_network() -> tuple[Network, Array]:
    network = build_network(random_pack(120), periodic=(False, True, True), walls="slip")
    return network, LAWS["lubrication"](network)


def crossing(network: Network, plane: float) -> Array:
    """True (T,) for throats with an end on either side of `plane`, or on it."""
    x = network.throat_ends[:, :, 0]
    return (x.min(axis=1) <= plane) & (x.max(axis=1) >= plane)


def test_a_section_with_all_throats_blocked_leaves_k_0_there_and_k_elsewhere():
    network, g = pack_network()
    length = network.box[0, 1]
    g = np.where(crossing(network, 0.5 * length), 0.0, g)
    k, flow = whole_permeability(network, g)
    assert k == 0
    assert "no open path from x = 0 m" in flow.reason
    assert flow.isolated_pores == np.sum(
        (network.pore_position[:, 0] > 0) & (network.pore_position[:, 0] < length)
    )
    assert solve_flow(network, g, span=(0.0, 0.2 * length)).inflow > 0
    assert solve_flow(network, g, span=(0.4 * length, 0.6 * length)).inflow == 0


def shortest_path(network: Network, conductance: Array) -> list[int]:
    """Throats of a shortest path from face to face, by a breadth-first search."""
    x, length = network.pore_position[:, 0], network.box[0, 1]
    came: dict[int, tuple[int, int]] = {int(pore): (-1, -1) for pore in np.flatnonzero(x <= 0)}
    edge = list(came)
    links = [
        np.flatnonzero(np.any(network.throat_pores == pore, axis=1)) for pore in range(len(x))
    ]
    while edge:
        pore = edge.pop(0)
        if x[pore] >= length:
            path = []
            while came[pore][1] >= 0:
                path.append(came[pore][1])
                pore = came[pore][0]
            return path
        for throat in links[pore]:
            other = int(network.throat_pores[throat].sum() - pore)
            inner = network.pore_group[other] != network.pore_group[pore]
            if other not in came and conductance[throat] > 0 and inner:
                came[other] = (pore, int(throat))
                edge.append(other)
    raise AssertionError("no path")


def test_a_single_open_way_is_its_throats_in_series():
    """1/g = sum of 1/g_i, the same flux through each, nothing elsewhere."""
    for decades in [0.0, 16.0]:
        with naming(decades):
            network, clean = pack_network()
            path = shortest_path(network, clean)
            assert len(path) > 3
            g = np.zeros(len(clean))
            g[path] = clean[path] * 10.0 ** np.random.default_rng(0).uniform(0, decades, len(path))
            flow = solve_flow(network, g)
            assert flow.inflow == pytest.approx(
                1.0 / np.sum(1.0 / (g * network.throat_share)[path]), rel=1e-9
            )
            assert np.abs(flow.throat_flux[path]) == pytest.approx(flow.inflow, rel=1e-9)
            assert np.count_nonzero(flow.throat_flux) == len(path)


def test_islands_are_counted_and_change_nothing():
    """A ring of ten pores tied to nothing, and one tied to the inlet alone."""
    angle = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    ring = np.column_stack([1.5 + np.cos(angle), 3 + np.sin(angle), np.zeros(10)])
    position = np.vstack([[[n, 0.5, 0.5] for n in range(4)], ring, ring + np.array([0, 4, 0])])
    loop = [(n, (n + 1) % 10) for n in range(10)]
    pairs = [
        (0, 1),
        (1, 2),
        (2, 3),
        *((a + 4, b + 4) for a, b in loop),
        *((a + 14, b + 14) for a, b in loop),
        (0, 14),
    ]
    network = network_of(position, pairs, [[0, 3], [0, 9], [0, 1]])
    flow = solve_flow(network, np.ones(len(pairs)))
    alone = solve_flow(chain(3), np.ones(3))
    assert flow.inflow == pytest.approx(alone.inflow, rel=1e-12)
    assert flow.isolated_pores == 20
    assert np.all(flow.throat_flux[3:] == 0)


def test_sections_in_place_recombine_over_sixteen_decades():
    """The drops of the planes' mean pressures add up to 1 and never rise along the flow."""
    network, clean = pack_network()
    g = clean * 10.0 ** np.random.default_rng(5).uniform(-16, 0, len(clean))
    flow = solve_flow(network, g)
    planes = np.linspace(0.0, network.box[0, 1], 9)
    pressure = plane_pressures(network, flow, planes)
    assert pressure[0] == 1.0
    assert pressure[-1] == 0.0
    assert np.all(np.diff(pressure) < 0)
    assert flow.mass_balance is not None
    assert flow.mass_balance < 1e-6
