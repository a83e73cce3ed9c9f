"""The compiled tessellation: certain signs, and the tetrahedra of Qhull."""

from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import LAWS
from fdnet.network.network import build_network
from fdnet.network.tessellation import delaunay, triangulation
from fdnet.network.tessellation.triangulation import in_sphere, side_of_plane, triangulate
from tests.network.packs import random_pack


def determinant(rows: list[list[Fraction]]) -> Fraction:
    """By Leibniz's sum over all orders of the columns."""
    total = Fraction(0)
    for order in permutations(range(len(rows))):
        turns = sum(a > b for k, a in enumerate(order) for b in order[k + 1 :])
        product = Fraction((-1) ** turns)
        for row, column in zip(rows, order, strict=True):
            product *= row[column]
        total += product
    return total


def exact_signs(points: np.ndarray, weight: np.ndarray) -> tuple[int, int]:
    """Signs of `side_of_plane` and `in_sphere` of five points in exact arithmetic."""
    place = [[Fraction(float(x)) for x in row] for row in points]
    heavy = [Fraction(float(x)) for x in weight]
    plane = [[x - y for x, y in zip(row, place[3], strict=True)] for row in place[:3]]
    sphere = []
    for row, own in zip(place[:4], heavy[:4], strict=True):
        apart = [x - y for x, y in zip(row, place[4], strict=True)]
        sphere.append([*apart, sum(x * x for x in apart) - own + heavy[4]])
    return int(np.sign(determinant(plane))), int(np.sign(determinant(sphere)))


def nearly_degenerate(kind: int, rng: np.random.Generator) -> np.ndarray:
    if kind == 0:
        return 10.0 * rng.random((5, 3))
    if kind == 1:  # a plane, but for the last digits
        flat = np.round(10.0 * rng.random((5, 3)), 1)
        flat[3] = flat[0] + flat[1] - flat[2]
        return flat + 1e-15 * rng.random((5, 3))
    ball = rng.normal(size=(5, 3))
    return 3.0 * ball / np.linalg.norm(ball, axis=1)[:, None]  # a sphere, but for the last digits


@pytest.mark.parametrize("kind", [0, 1, 2])
def test_signs_are_those_of_exact_arithmetic_or_none(kind):
    rng = np.random.default_rng(kind)
    certain = 0
    for case in range(60):
        points = nearly_degenerate(kind, rng)
        weight = rng.random(5) if case % 2 and kind == 0 else np.full(5, 0.3)
        plane, sphere = exact_signs(points, weight)
        given = side_of_plane(points, 0, 1, 2, 3), in_sphere(points, weight, (0, 1, 2, 3), 4)
        assert given[0] in (plane, 0)
        assert given[1] in (sphere, 0)
        certain += given == (plane, sphere)
    assert certain > 50


def test_five_points_of_a_cube_have_no_sign():
    corners = np.indices((2, 2, 2)).reshape(3, -1).T.astype(float)
    assert in_sphere(corners, np.zeros(8), (0, 1, 2, 4), 7) == 0
    assert side_of_plane(corners, 0, 1, 2, 3) == 0


def rows_of(simplices: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(row) for row in np.sort(simplices, axis=1).tolist()}


def by_qhull(points: np.ndarray, radius: np.ndarray) -> np.ndarray:
    if np.ptp(radius) == 0:
        return Delaunay(points).simplices
    return delaunay._power_hull(points, radius)[0]


@pytest.mark.parametrize("spread", [0.0, 0.4])
def test_tetrahedra_are_those_of_qhull_but_for_slivers_at_the_hull(spread):
    rng = np.random.default_rng(8)
    points = 10.0 * rng.random((800, 3))
    radius = 1.0 + spread * rng.uniform(-1, 1, 800)
    made, neighbour = triangulate(points, (radius - radius.min()) ** 2 + radius.min() ** 2)
    expected = rows_of(by_qhull(points, np.sqrt((radius - radius.min()) ** 2 + radius.min() ** 2)))
    assert rows_of(made) <= expected
    assert len(made) > 0.99 * len(expected)
    assert len(rows_of(made)) == len(made)
    across, corner = np.nonzero(neighbour >= 0)
    shared = [
        set(made[a]) - {made[a, c]} <= set(made[neighbour[a, c]])
        for a, c in zip(across, corner, strict=True)
    ]
    assert all(shared)
    assert np.sum(neighbour < 0) < 0.1 * len(made)


def test_room_grows_where_it_is_too_small(monkeypatch):
    points = np.random.default_rng(3).random((200, 3))
    expected = rows_of(triangulate(points, np.zeros(200))[0])
    monkeypatch.setattr(triangulation, "HOLE", 8)
    monkeypatch.setattr(triangulation, "TETRAHEDRA_A_POINT", 1)
    assert rows_of(triangulate(points, np.zeros(200))[0]) == expected


def test_degenerate_points_have_no_tessellation():
    lattice = np.indices((3, 3, 3)).reshape(3, -1).T.astype(float)
    assert triangulate(lattice, np.zeros(27)) is None
    twice = np.concatenate([np.random.default_rng(1).random((20, 3))] * 2)
    assert triangulate(twice, np.zeros(40)) is None


@pytest.mark.parametrize("degenerate", [False, True])
@pytest.mark.parametrize("periodic", ["xyz", ""])
@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_the_network_does_not_depend_on_who_tessellates(monkeypatch, spread, periodic, degenerate):
    """Nor where the compiled tessellation finds the points degenerate: Qhull then takes over."""
    pack = random_pack(60, 0.55, spread=spread)
    one = build_network(pack, periodic=periodic)
    monkeypatch.setattr(delaunay, "COMPILED_FROM", 1)
    if degenerate:
        monkeypatch.setattr(delaunay, "triangulate", lambda points, weight: None)
    other = build_network(pack, periodic=periodic)
    assert dict(other.counts) == dict(one.counts)
    assert len(other.throat_pores) == len(one.throat_pores)
    flows = [solve_flow(net, LAWS["lubrication"](net)).inflow for net in (one, other)]
    assert flows[1] == pytest.approx(flows[0], rel=1e-10)
