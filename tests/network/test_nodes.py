"""Nodes: power centres, or the points of their tetrahedra that are nearest to them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from fdnet.network.flow.sections import whole_permeability
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.network import build_network
from fdnet.network.nodes import nodes_of
from tests.network.packs import random_pack, simple_cubic

ALL = (True,) * 3


@pytest.fixture(scope="module")
def network():
    return build_network(random_pack(60), periodic=ALL)


def moved_of(network, nodes):
    """Whether each node is not the power centre."""
    return np.any(nodes.position != network.pore_power_centre, axis=1)


def nearest_by_search(corner, place):
    """The point of a tetrahedron nearest to a place, from weights that are searched for."""
    result = minimize(
        lambda weight: np.sum((weight @ corner - place) ** 2),
        np.full(4, 0.25),
        bounds=[(0.0, 1.0)] * 4,
        constraints={"type": "eq", "fun": lambda weight: weight.sum() - 1.0},
        options={"ftol": 1e-14, "maxiter": 500},
    )
    return result.x @ corner


def inside(corner, place):
    weight = np.linalg.solve(np.vstack([corner.T, np.ones(4)]), np.append(place, 1.0))
    return weight.min() > -1e-9


def test_a_node_is_the_point_of_its_tetrahedron_nearest_to_the_power_centre(network):
    nodes = nodes_of(network)
    node, moved = nodes.position, moved_of(network, nodes)
    corner, centre = network.pore_corner, network.pore_power_centre
    assert 0.1 < moved.mean() < 0.5
    for p in np.flatnonzero(moved)[:60]:
        best = nearest_by_search(corner[p], centre[p])
        assert np.linalg.norm(node[p] - centre[p]) <= np.linalg.norm(best - centre[p]) + 1e-9
        assert inside(corner[p], node[p])
    for p in np.flatnonzero(~moved)[:60]:
        assert inside(corner[p], centre[p])
        assert np.all(node[p] == centre[p])


def test_heights_are_those_of_the_nodes_above_the_facets(network):
    nodes = nodes_of(network)
    node, moved = nodes.position, moved_of(network, nodes)
    height, corner = nodes.heights, network.throat_corner
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    for side in (0, 1):
        place = node[network.throat_pores[:, side]]
        if side:
            place = place + network.throat_shift * np.ptp(network.box, axis=1)
        apart = np.abs(np.sum((place - corner[:, 0]) * normal, axis=1))
        assert height[:, side] == pytest.approx(apart, abs=1e-9)
        still = ~moved[network.throat_pores[:, side]]
        assert np.all(height[still, side] == network.throat_heights[still, side])
    assert height.min() >= 0.0


def test_pores_of_one_polyhedron_keep_its_power_centre():
    """The cells of a cubic lattice are split into tetrahedra with one centre outside of some."""
    cubic = build_network(simple_cubic(), periodic=ALL)
    nodes = nodes_of(cubic)
    assert not moved_of(cubic, nodes).any()
    assert np.all(nodes.position == cubic.pore_power_centre)
    assert np.all(nodes.heights == cubic.throat_heights)


def test_nodes_follow_the_spheres_without_a_jump():
    """A shift of all grains by a thousandth of a radius, each its own way, moves k by little."""
    pack, rng = random_pack(60), np.random.default_rng(5)
    shaken = replace(pack, position=pack.position + rng.uniform(-1e-7, 1e-7, pack.position.shape))
    k = [
        whole_permeability(one, 1.0 / half_resistances(one).sum(axis=1))[0]
        for one in (build_network(spheres, periodic=ALL) for spheres in (pack, shaken))
    ]
    assert k[1] == pytest.approx(k[0], rel=1e-4)
