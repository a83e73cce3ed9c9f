"""The Stokes solver against closed forms, one sparse LU, and what must change nothing."""

from dataclasses import replace

import numpy as np
import pytest
from direct_stokes import direct_tensor

from fdnet.errors import CaseError, FlowError
from fdnet.network import stokes
from fdnet.network.stokes import extrapolate, find_walls, solve_slab, solve_stokes
from fdnet.spheres.snapshot import resting

SC, BCC = [[0.31, 0.17, 0.43]], [[0.1, 0.2, 0.3], [0.6, 0.7, 0.8]]
FCC = [[0.1, 0.2, 0.3], [0.1, 0.7, 0.8], [0.6, 0.2, 0.8], [0.6, 0.7, 0.3]]
HALF = stokes.Lattice(
    low=np.zeros(3),
    spacing=np.ones(3),
    shape=(7, 8, 9),
    walled=stokes.OPEN,
    specimen=(0.0, 7.0),
    repeats=True,
    planes=True,
)
CUT = resting(
    np.array(
        [
            *([-1.3, 2, 2.5], [0.4, 6, 5.0], [2.7, 2.2, 5.5], [6.9, 5.5, 2.0]),
            *([8.6, 1.5, 6.1], [-2.6, 6, 1], [4.7, 7.5, 8.6]),
        ]
    ),
    np.array([2.1, 1.7, 2.0, 2.2, 2.3, 2.9, 1.8]),
    np.array([[0.0, 7.0], [0.0, 8.0], [0.0, 9.0]]),
)
"""Spheres of which five are cut by a plane, three with their centres outside; the other two end
less than a cell before a plane."""


def cell(position, radius, edges=(1.0, 1.0, 1.0)):
    return resting(np.asarray(position, float), radius, np.array([[0.0, edge] for edge in edges]))


LATTICES = [
    (SC, 0.343, 15.4, (24, 48), 0.004),
    (BCC, np.pi * np.sqrt(3) / 8, 162.9, (32, 48), 0.01),
    (SC, 0.064, 2.810, (24, 48), 0.002),
    (SC, 0.216, 7.442, (24, 48), 0.002),
    (SC, 0.45, 28.1, (24, 48), 0.004),
    (SC, np.pi / 6, 42.1, (32, 48), 0.005),
    (FCC, np.pi * np.sqrt(2) / 6, 435.0, (48, 64), 0.015),
]


@pytest.mark.parametrize(
    "lattices", [LATTICES[:2], pytest.param(LATTICES[2:], marks=pytest.mark.nightly)]
)
def test_zick_and_homsy(lattices):
    """The drag factor K of F = 6 pi mu R K U (1982, J. Fluid Mech. 115, 13, table 2)."""
    for places, solid, drag, cells, bound in lattices:
        pack = cell(places, (solid / len(places) * 3 / 4 / np.pi) ** (1 / 3))
        k = extrapolate(*(solve_stokes(pack, cells=n) for n in cells)).k
        exact = 2.0 * pack.radius[0] ** 2 / (9.0 * solid * drag)
        assert k == pytest.approx(exact, rel=bound), solid


def test_a_direct_solve_gives_the_same_tensor():
    rng = np.random.default_rng(5)
    edges = np.array([1.0, 0.8, 0.9])
    pack = cell(rng.random((4, 3)) * edges, [0.2, 0.25, 0.3, 0.15], edges)
    shape = stokes.divide(edges, 10)
    grid = replace(HALF, spacing=edges / shape, shape=shape, specimen=(0.0, 1.0), planes=False)
    walls = [find_walls(grid, d, pack.position, pack.radius) for d in range(3)]
    tensor = direct_tensor(shape, [(wall.node, wall.slack) for wall in walls]) * grid.unit**2
    for axis in "xyz":
        k = solve_stokes(pack.turned(axis), cells=10, tolerance=1e-6).k
        d = "xyz".index(axis)
        assert k == pytest.approx(tensor[d, d], rel=1e-4)


def whole(node, shape, component):
    """Flat indices (2, M) in the doubled grid of nodes of the half and of their images."""
    i, j, k = np.unravel_index(node, (shape[0] + (component == 0), *shape[1:]))
    doubled = (2 * shape[0], *shape[1:])
    image = (2 * shape[0] - i - (component != 0)) % doubled[0]
    return np.stack([np.ravel_multi_index((a, j, k), doubled) for a in (i, image)])


def test_a_direct_solve_of_the_whole_mirrored_cell_gives_the_same():
    """One sparse LU on the doubled grid, with the walls of the half copied to their images."""
    walls = []
    for d in range(3):
        half = find_walls(HALF, d, CUT.position, CUT.radius)
        walls.append((whole(half.node, HALF.shape, d).ravel(), np.tile(half.slack, 2)))
    tensor = direct_tensor((14, 8, 9), walls)
    assert np.abs(tensor[0, 1:]).max() < 1e-9 * tensor[0, 0]
    k = solve_slab(CUT, (0.0, 7.0), cells=9, tolerance=1e-6).k
    assert k == pytest.approx(tensor[0, 0], rel=1e-4)


@pytest.mark.parametrize(("closed", "expected"), [((False, True, True), 0.035144), (None, 1 / 12)])
def test_walls_hold_the_fluid_as_in_a_duct(closed, expected):
    """0.035144 a^2 (Shah and London 1978), h^2 / 12; a sphere buried in a wall closes nothing."""
    buried = cell([[0.2, 0.5, -0.2]], 0.1, (0.5, 1.0, 1.0))
    closed = closed or (False, False, True)
    flows = (solve_slab(buried, (0.0, 0.5), cells=n, closed=closed) for n in (20, 32))
    assert extrapolate(*flows).k == pytest.approx(expected, rel=0.002)


def test_turning_scaling_tiling_and_shifting_by_a_cell_change_nothing():
    rng = np.random.default_rng(3)
    place, radius = rng.random((5, 3)), 0.15 + 0.15 * rng.random(5)
    two = cell(np.vstack([place, np.add(place, [0, 1, 0])]), np.tile(radius, 2), (1, 2, 1))
    k = solve_stokes(cell(place, radius), cells=20).k
    others = [
        solve_stokes(cell(place[:, [1, 2, 0]], radius).turned("z"), cells=20).k,
        1e6 * solve_stokes(cell(1e-3 * place, 1e-3 * radius, (1e-3,) * 3), cells=20).k,
        solve_stokes(two, cells=40).k,
        solve_stokes(cell(np.add(place, [0.05, 0.1, -0.15]), radius), cells=20).k,
    ]
    assert others == pytest.approx([k] * 4, rel=3e-4)


def test_the_drag_of_a_wall_on_cells_of_unequal_edges():
    """Along each axis (1/t - 1) over the square of the edge, for a free share t of the step."""
    step, place, r = np.array([0.8, 1.25, 1.0]), np.array([4.1, 5.3, 4.4]), 2.2
    grid = replace(HALF, shape=(11, 8, 9), spacing=step, planes=False)
    walls = find_walls(grid, 0, place[None], np.array([r]))
    free, offset = walls.slack > 0.0, np.array([0.0, 0.5, 0.5])
    for node, slack in zip(walls.node[free], walls.slack[free], strict=True):
        away = place - (np.array(np.unravel_index(node, grid.shape)) + offset) * step
        ahead, aside = np.abs(away), away @ away - away**2
        inside = (ahead - step) ** 2 + aside <= r * r
        gap = ahead - np.sqrt(np.maximum(r * r - aside, 0.0))
        drag = np.sum((step[inside] / gap[inside] - 1.0) / step[inside] ** 2)
        assert 1.0 / slack == pytest.approx(step[0] ** 2 * drag, rel=1e-4)
    assert free.sum() > 40


def test_refusals(monkeypatch):
    one = cell(SC, 0.3)
    with pytest.raises(CaseError, match="at least 4"):
        solve_stokes(one, cells=3)
    with pytest.raises(CaseError, match="no wall"):
        solve_slab(CUT, (40.0, 47.0), cells=9)
    flow = solve_stokes(one, cells=10)
    with pytest.raises(CaseError, match="finer"):
        extrapolate(flow, flow)
    with pytest.raises(FlowError):  # closed pores are no flow
        solve_stokes(cell([[0.5, 0.5, 0.5]], 0.74), cells=16)
    monkeypatch.setattr(stokes, "MOST_ITERATIONS", 5)
    with pytest.raises(FlowError, match="after 5 iterations"):
        solve_stokes(cell(SC, 0.4), cells=16)
