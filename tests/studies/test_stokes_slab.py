"""The Stokes oracle between two planes: half of a mirrored cell against the whole, a direct solve,
lattices, clipped spheres; the specimens of the slabs."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from direct_stokes import direct_tensor

from fdnet.errors import CaseError
from fdnet.network.stokes import (
    OPEN,
    Lattice,
    Response,
    extrapolate,
    find_walls,
    solve_slab,
    solve_stokes,
)
from fdnet.spheres.snapshot import Array, Snapshot, resting

EDGES = (7, 8, 9)
HALF = Lattice(
    low=np.zeros(3),
    spacing=np.ones(3),
    shape=EDGES,
    walled=OPEN,
    specimen=(0.0, float(EDGES[0])),
    repeats=True,
    planes=True,
)
CUT_PLACE = np.array(
    [
        [-1.3, 2, 2.5],
        [0.4, 6, 5.0],
        [2.7, 2.2, 5.5],
        [6.9, 5.5, 2.0],
        [8.6, 1.5, 6.1],
        [-2.6, 6, 1],
        [4.7, 7.5, 8.6],
    ]
)
CUT_RADIUS = np.array([2.1, 1.7, 2.0, 2.2, 2.3, 2.9, 1.8])
"""Spheres of which five are cut by a plane, three with their centres outside; the other two end
less than a cell before a plane."""


def cut_solid(point: Array) -> Array:
    """Whether points (..., 3) lie in the solid of the cut spheres between 0 and 7 or its image."""
    x = point[..., 0] % (2 * EDGES[0])
    x = np.minimum(x, 2 * EDGES[0] - x)
    within = np.zeros(point.shape[:-1], bool)
    for centre, r in zip(CUT_PLACE, CUT_RADIUS, strict=True):
        apart = [
            (point[..., d] - centre[d] + EDGES[d] / 2) % EDGES[d] - EDGES[d] / 2 for d in (1, 2)
        ]
        within |= (x - centre[0]) ** 2 + apart[0] ** 2 + apart[1] ** 2 <= r * r
    return within


def whole(node: Array, shape: tuple[int, ...], component: int) -> Array:
    """Flat indices (2, M) in the doubled grid of nodes of the half and of their images."""
    i, j, k = np.unravel_index(node, (shape[0] + (component == 0), *shape[1:]))
    doubled = (2 * shape[0], *shape[1:])
    image = (2 * shape[0] - i - (component != 0)) % doubled[0]
    return np.stack([np.ravel_multi_index((a, j, k), doubled) for a in (i, image)])


def first_hit(place: Array, way: Array) -> float:
    """Share of the step `way` after which it enters the solid: a coarse search, then bisection."""
    steps = np.linspace(0.0, 1.0, 201)
    first = int(np.argmax(cut_solid(place + steps[:, None] * way)))
    low, high = steps[first - 1], steps[first]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if cut_solid(place + middle * way) else (middle, high)
    return high


@pytest.mark.parametrize("component", range(3))
def test_walls_of_cut_spheres(component):
    """Against rays through the mirrored solid, at every node."""
    walls = find_walls(HALF, component, CUT_PLACE, CUT_RADIUS)
    nodes = (EDGES[0] + (component == 0), *EDGES[1:])
    offset = np.full(3, 0.5)
    offset[component] = 0.0
    slack = dict(zip(walls.node.tolist(), walls.slack.tolist(), strict=True))
    fluid = 0
    for index in np.ndindex(*nodes):
        node, place = int(np.ravel_multi_index(index, nodes)), np.array(index) + offset
        if cut_solid(place):
            assert slack.get(node, 0.0) == 0.0
            continue
        ways = [way for way in [*np.eye(3), *-np.eye(3)] if cut_solid(place + way)]
        drag = sum(1.0 / first_hit(place, way) - 1.0 for way in ways)
        own = 1.0 / slack[node] if node in slack else 0.0
        assert own == pytest.approx(drag, rel=1e-4, abs=1e-4)
        fluid += drag > 1e-3
    assert fluid > 130


def test_the_mirrored_response_is_that_of_the_doubled_grid():
    shape = (5, 6, 7)
    rng = np.random.default_rng(2)
    half = Response(shape, OPEN, np.ones(3), planes=True)
    doubled = Response((10, 6, 7), OPEN, np.ones(3))
    shapes = [(6, 6, 7), shape, shape]
    parts = [rng.normal(size=s).astype(np.float32) for s in shapes]
    full = [np.zeros(doubled.nodes, np.float32) for _ in range(3)]
    places = [whole(np.arange(part.size), shape, d) for d, part in enumerate(parts)]
    for d, (part, place) in enumerate(zip(parts, places, strict=True)):
        full[d].reshape(-1)[place[0]] = part.reshape(-1)
        full[d].reshape(-1)[place[1]] = (1.0 if d == 0 else -1.0) * part.reshape(-1)
    slow = doubled.velocity([part - part.mean() for part in full])
    given = [np.zeros(half.nodes, np.float32) for _ in range(3)]
    for one, part in zip(given, parts, strict=True):
        one[: len(part)] = part
    given[0][[0, -1]] *= np.sqrt(0.5)  # a node on a plane stands for one node, the others for two
    fast = half.velocity(given)
    fast[0][[0, -1]] *= np.sqrt(2.0)
    fast = [one[: len(part)] for one, part in zip(fast, parts, strict=True)]
    for d in range(3):
        got, expected = fast[d].reshape(-1), slow[d].reshape(-1)[places[d][0]]
        np.testing.assert_allclose(got - got.mean(), expected - expected.mean(), atol=3e-5)
    assert max(np.abs(part).max() for part in fast) > 0.1


def cut_slab() -> Snapshot:
    box = np.array([[0.0, edge] for edge in EDGES])
    return resting(CUT_PLACE, CUT_RADIUS, box)


def test_a_direct_solve_of_the_whole_mirrored_cell_gives_the_same():
    """One sparse LU on the doubled grid, with the walls of the half copied to their images."""
    walls = []
    for d in range(3):
        half = find_walls(HALF, d, CUT_PLACE, CUT_RADIUS)
        places = whole(half.node, EDGES, d)
        walls.append((places.ravel(), np.tile(half.slack, 2)))
    tensor = direct_tensor((2 * EDGES[0], *EDGES[1:]), walls)
    assert np.abs(tensor[0, 1:]).max() < 1e-9 * tensor[0, 0]
    k = solve_slab(cut_slab(), (0.0, EDGES[0]), cells=EDGES[2], tolerance=1e-6).k
    assert k == pytest.approx(tensor[0, 0], rel=1e-4)


def test_a_direct_solve_with_a_solid_layer_for_the_walls_gives_the_same():
    """The walls across y as a layer of nodes at rest on a grid that repeats, and one sparse LU.

    There a node half a spacing from a wall has a neighbour at rest, which is a drag of 1 of the 2.
    """
    grid, (n0, n1, n2) = replace(HALF, walled=(False, True, False)), EDGES
    walls = []
    for d in range(3):
        half = find_walls(grid, d, CUT_PLACE, CUT_RADIUS)
        i, j, k = np.unravel_index(half.node, (n0 + (d == 0), n1, n2))
        drag = np.divide(1.0, half.slack, out=np.zeros(len(j)), where=half.slack > 0.0)
        drag -= 1.0 * (drag > 0.0) * (d != 1) * ((j == 0) | (j == n1 - 1))
        slack = np.where(half.slack > 0.0, 1.0 / np.maximum(drag, 1e-12), 0.0)
        layered = np.ravel_multi_index((i, j, k), (n0 + (d == 0), n1 + 1, n2))
        rest = np.indices((2 * n0, 1, n2)).reshape(3, -1) + np.array([[0], [n1], [0]])
        still = [np.ravel_multi_index(rest, (2 * n0, n1 + 1, n2))]
        if d == 1:
            still.append(np.ravel_multi_index(rest * [[1], [0], [1]], (2 * n0, n1 + 1, n2)))
        nodes = [*whole(layered, (n0, n1 + 1, n2), d), *still]
        walls.append(
            (np.concatenate(nodes), np.concatenate([slack, slack, 0.0 * np.concatenate(still)]))
        )
    direct = direct_tensor((2 * n0, n1 + 1, n2), walls)[0, 0] * (n1 + 1) / n1
    k = solve_slab(cut_slab(), (0.0, n0), cells=n2, tolerance=1e-6, closed=(False, True, False)).k
    assert k == pytest.approx(direct, rel=1e-4)


def test_a_sphere_that_both_planes_cut_is_no_pipe():
    """Spheres buried in it close whatever its shell leaves open, and change nothing."""
    box = np.array([[0.0, 8.0], [0.0, 16.0], [0.0, 16.0]])
    place, buried = np.array([[4.0, 8.0, 8.0]]), np.arange(0.5, 5.0, 0.5)
    nested = np.repeat(place, len(buried) + 1, axis=0)
    one = solve_slab(resting(place, np.array([5.0]), box), (0.0, 8.0), cells=32)
    many = solve_slab(resting(nested, np.array([5.0, *buried]), box), (0.0, 8.0), cells=32)
    assert one.k == pytest.approx(many.k, rel=1e-3)


def test_half_of_a_cell_is_the_whole():
    """Spheres that no plane cuts, with their images on the periodic grid."""
    rng = np.random.default_rng(4)
    place, r = rng.random((6, 3)) * [0.2, 1.0, 1.0] + [0.15, 0.0, 0.0], 0.14
    half = resting(place, r, np.array([[0.0, 0.5], [0.0, 1.0], [0.0, 1.0]]))
    both = resting(np.vstack([place, place * [-1, 1, 1]]), r, np.array([[0.0, 1.0]] * 3))
    k = solve_slab(half, (0.0, 0.5), cells=20, tolerance=1e-6).k
    assert k == pytest.approx(solve_stokes(both, cells=20, tolerance=1e-6).k, rel=1e-6)


@pytest.mark.parametrize(("x_lo", "x_hi"), [(0.0, 0.5), (0.5, 1.0), (-0.5, 1.0)])
def test_zick_and_homsy_cut_at_planes_of_symmetry(x_lo, x_hi):
    """Touching spheres in a simple cubic lattice, cut through their centres and between them.

    Drag factor 42.1: Zick and Homsy 1982, J. Fluid Mech. 115, 13, table 2.
    """
    chain = resting(
        np.array([[i, 0.3, 0.7] for i in range(-2, 4)]), 0.5, np.array([[0.0, 1.0]] * 3)
    )
    cells = (48, 72) if x_hi - x_lo > 1.0 else (32, 48)
    k = extrapolate(*(solve_slab(chain, (x_lo, x_hi), cells=n) for n in cells)).k
    assert k == pytest.approx(2.0 * 0.5**2 / (9.0 * (pi / 6) * 42.1), rel=0.005)


def test_a_slab_needs_walls():
    with pytest.raises(CaseError, match="no wall"):
        solve_slab(cut_slab(), (40.0, 47.0), cells=9)


def test_cells_of_unequal_edges_give_the_same():
    """The drag on touching spheres, from a slab whose length is no whole number of cubic cells.

    0.45 of 24 cells is 10.8, so 11 are taken.
    """
    chain = resting(np.array([[0.2, 0.3, 0.7]]), 0.19, np.array([[0.0, 0.45], [0, 1.0], [0, 1.0]]))
    rough = [solve_slab(chain, (0.0, 0.45), cells=n) for n in (24, 36)]
    whole = [solve_slab(chain, (0.0, 0.45), cells=n) for n in (20, 40)]
    assert extrapolate(*rough).k == pytest.approx(extrapolate(*whole).k, rel=0.004)


@pytest.mark.parametrize("closed", [(False, True, True), (False, False, True)])
def test_walls_hold_the_fluid_as_in_a_duct(closed):
    """Between plates h^2 / 12, in a square duct 0.035144 a^2 (Shah and London 1978).

    The sphere buried in a wall closes nothing.
    """
    box = np.array([[0.0, 0.5], [0.0, 1.0], [0.0, 1.0]])
    buried = resting(np.array([[0.2, 0.5, -0.2]]), 0.1, box)
    flows = (solve_slab(buried, (0.0, 0.5), cells=n, closed=closed) for n in (20, 32))
    expected = 0.035144 if closed[1] else 1.0 / 12.0
    assert extrapolate(*flows).k == pytest.approx(expected, rel=0.002)


def test_walls_with_spheres_between_them_are_sheets_of_overlapping_spheres():
    """Sheets, flat to 0.002 of the width, fill the rest of the periodic cell along y and z."""
    place = np.array([[0.1, 0.3, 0.6], [0.45, 0.72, 0.25], [0.3, 0.5, 0.95]])
    radius, thick = np.array([0.3, 0.28, 0.2]), 0.25
    box = np.array([[0.0, 0.5], [0.0, 1.0], [0.0, 1.0]])
    steps = np.arange(0.0, 1.0 + thick, thick / 8)
    sheets = [np.meshgrid(steps[:16], steps, [1.0 + thick / 2], indexing="ij")]
    sheets.append([sheets[0][0], sheets[0][2], sheets[0][1]])
    flat = np.concatenate([np.stack(sheet, axis=-1).reshape(-1, 3) for sheet in sheets])
    walled = resting(
        np.concatenate([place, flat]),
        np.concatenate([radius, np.full(len(flat), thick / 2)]),
        box + np.array([[0.0, 0.0], [0.0, thick], [0.0, thick]]),
    )
    inside = resting(place, radius, box)
    sheeted = extrapolate(*(solve_slab(walled, (0.0, 0.5), cells=n) for n in (25, 40))).k
    closed = (False, True, True)
    flows = (solve_slab(inside, (0.0, 0.5), cells=n, closed=closed) for n in (20, 32))
    k = extrapolate(*flows).k
    assert k == pytest.approx(sheeted * (1.0 + thick) ** 2, rel=0.015)
    assert k < 0.9 * solve_slab(inside, (0.0, 0.5), cells=20).k


def test_the_drag_of_a_wall_on_cells_of_unequal_edges():
    """Along each axis (1/t - 1) over the square of the edge, for a free share t of the step."""
    step, place, r = np.array([0.8, 1.25, 1.0]), np.array([4.1, 5.3, 4.4]), 2.2
    grid = replace(HALF, shape=(11, 8, 9), spacing=step, planes=False)
    walls = find_walls(grid, 0, place[None], np.array([r]))
    free, offset = walls.slack > 0.0, np.array([0.0, 0.5, 0.5])
    for node, slack in zip(walls.node[free], walls.slack[free], strict=True):
        number = np.array(np.unravel_index(node, grid.shape))
        away = place - (number + offset) * step
        drag = 0.0
        for axis in range(3):
            ahead, aside = abs(away[axis]), away @ away - away[axis] ** 2
            inside = (ahead - step[axis]) ** 2 + aside <= r * r
            gap = ahead - np.sqrt(max(r * r - aside, 0.0))
            drag += (step[axis] / gap - 1.0) / step[axis] ** 2 if inside else 0.0
        assert 1.0 / slack == pytest.approx(step[0] ** 2 * drag, rel=1e-4)
    assert free.sum() > 40
