"""The Stokes oracle: Zick and Homsy's arrays, order of convergence, a direct solve, invariances,
necks, refusals."""

import csv
from itertools import product

import numpy as np
import pytest
from direct_stokes import direct_tensor

from fdnet.errors import CaseError, FlowError
from fdnet.network import stokes as forces
from fdnet.network.stokes import (
    OPEN,
    Lattice,
    Response,
    divide,
    extrapolate,
    find_walls,
    solve_stokes,
)
from fdnet.spheres.snapshot import Array, Snapshot
from validation.truth.packs import DATA, OWN_TRUTH

SC = [[0.31, 0.17, 0.43]]
BCC = [[0.1, 0.2, 0.3], [0.6, 0.7, 0.8]]
FCC = [[0.1, 0.2, 0.3], [0.1, 0.7, 0.8], [0.6, 0.2, 0.8], [0.6, 0.7, 0.3]]


def cell(
    position: Array | list,
    radius: Array | list | float,
    edges: tuple[float, ...] = (1.0, 1.0, 1.0),
) -> Snapshot:
    place = np.asarray(position, float)
    count = len(place)
    return Snapshot(
        step=0,
        time_s=0.0,
        box=np.array([[0.0, edge] for edge in edges]),
        id=np.arange(count),
        kind=np.ones(count),
        position=place,
        radius=np.broadcast_to(np.asarray(radius, float), count),
        velocity=np.zeros((count, 3)),
    )


def lattice(shape: tuple[int, int, int], edges: Array | None = None) -> Lattice:
    """A periodic grid, of cells of edge 1 where no edges of the whole are given."""
    size = np.array(shape, float) if edges is None else edges
    return Lattice(
        low=np.zeros(3),
        spacing=size / shape,
        shape=shape,
        walled=OPEN,
        specimen=(0.0, float(size[0])),
        repeats=True,
    )


def lattice_radius(places: list, solid: float) -> float:
    return float((solid / len(places) * 3 / 4 / np.pi) ** (1 / 3))


def literature(solid: float, drag: float, radius: float) -> float:
    """k from the drag factor K, F = 6 pi mu R K U.

    Zick and Homsy 1982, J. Fluid Mech. 115, 13, table 2.
    """
    return 2.0 * radius**2 / (9.0 * solid * drag)


@pytest.mark.parametrize(
    ("places", "solid", "drag", "cells", "bound"),
    [
        (SC, 0.064, 2.810, (24, 48), 0.002),
        (SC, 0.216, 7.442, (24, 48), 0.002),
        (SC, 0.343, 15.4, (24, 48), 0.004),
        (SC, 0.45, 28.1, (24, 48), 0.004),
        (SC, np.pi / 6, 42.1, (32, 48), 0.005),
        (BCC, np.pi * np.sqrt(3) / 8, 162.9, (32, 48), 0.01),
        (FCC, np.pi * np.sqrt(2) / 6, 435.0, (48, 64), 0.015),
    ],
)
def test_zick_and_homsy(places, solid, drag, cells, bound):
    pack = cell(places, lattice_radius(places, solid))
    k = extrapolate(*(solve_stokes(pack, cells=n) for n in cells)).k
    assert k == pytest.approx(literature(solid, drag, pack.radius[0]), rel=bound)


def test_second_order():
    pack = cell(SC, lattice_radius(SC, 0.45))
    exact = literature(0.45, 28.09, pack.radius[0])
    error = [solve_stokes(pack, cells=n).k / exact - 1.0 for n in (16, 32, 64)]
    order = np.log2(np.array(error[:-1]) / error[1:])
    assert np.all((order > 1.7) & (order < 2.4)), order


def test_grid_offset_within_the_error():
    radius = lattice_radius(SC, 0.45)
    ks = [
        solve_stokes(cell([[x, x / 3, 0.7 * x]], radius), cells=32).k
        for x in (0.0, 0.01, 0.5 / 32, 0.02, 0.5)
    ]
    assert np.ptp(ks) < 0.006 * np.mean(ks)


def test_green_solves_the_discrete_stokes_equations():
    rng = np.random.default_rng(1)
    force = [rng.normal(size=(6, 8, 5)) for _ in range(3)]
    force = [part - part.mean() for part in force]
    response = Response((6, 8, 5), OPEN, np.ones(3))
    velocity = response.velocity([part.astype(np.float32) for part in force])
    divergence = sum(np.roll(v, -1, axis=d) - v for d, v in enumerate(velocity))
    assert np.abs(divergence).max() < 1e-5
    excess = [
        f + sum(np.roll(v, s, axis=d) - v for d, s in product(range(3), (1, -1)))
        for f, v in zip(force, velocity, strict=True)
    ]
    curl = [
        np.roll(excess[a], 1, axis=b) - excess[a] - np.roll(excess[b], 1, axis=a) + excess[b]
        for a, b in ((0, 1), (1, 2), (2, 0))
    ]
    assert max(np.abs(part).max() for part in curl) < 1e-5
    assert max(np.abs(part).max() for part in excess) > 0.1


def tensor_of(pack: Snapshot, cells: int) -> Array:
    """K (3, 3), m2, by the direct solve."""
    edges = np.diff(pack.box)[:, 0]
    grid = lattice(divide(edges, cells), edges)
    walls = [find_walls(grid, d, pack.position, pack.radius) for d in range(3)]
    return direct_tensor(grid.shape, [(wall.node, wall.slack) for wall in walls]) * grid.unit**2


def test_a_direct_solve_gives_the_same_tensor():
    rng = np.random.default_rng(5)
    pack = cell(rng.random((4, 3)) * [1.0, 0.8, 0.9], [0.2, 0.25, 0.3, 0.15], (1.0, 0.8, 0.9))
    tensor = tensor_of(pack, 10)
    np.testing.assert_allclose(tensor, tensor.T, atol=1e-9 * tensor.max())
    for axis in range(3):
        free, held = (
            solve_stokes(pack, cells=10, axis=axis, tolerance=1e-6, transverse=way).k
            for way in (True, False)
        )
        assert free == pytest.approx(tensor[axis, axis], rel=1e-4)
        assert held == pytest.approx(1.0 / np.linalg.inv(tensor)[axis, axis], rel=1e-4)
        assert held < free * (1.0 - 1e-3)


def test_walls_stand_where_the_sphere_is():
    point, r = np.array([3.7, 4.2, 5.1]), 2.3
    walls = find_walls(lattice((9, 10, 11)), 1, point[None], np.array([r]))
    offset = np.array([0.5, 0.0, 0.5])
    for node, slack in zip(walls.node, walls.slack, strict=True):
        place = np.array(np.unravel_index(node, (9, 10, 11))) + offset
        depth = r - np.linalg.norm(place - point)
        if slack == 0.0:
            assert 0.0 <= depth < 1.0
            continue
        drag = 0.0
        for way in [*np.eye(3), *-np.eye(3)]:
            steps = np.linspace(0.0, 1.0, 100_001)
            within = np.linalg.norm(place + steps[:, None] * way - point, axis=1) <= r
            drag += 1.0 / steps[np.argmax(within)] - 1.0 if within[-1] else 0.0
        assert depth < 0.0
        assert 1.0 / slack == pytest.approx(drag, rel=1e-3, abs=1e-4)
    assert np.count_nonzero(walls.slack == 0.0) == sum(
        0.0 <= r - np.linalg.norm(np.array(i) + offset - point) < 1.0
        for i in np.ndindex(9, 10, 11)
    )


def test_turning_scaling_tiling_and_shifting_by_a_cell_change_nothing():
    rng = np.random.default_rng(3)
    place, radius = rng.random((5, 3)), 0.15 + 0.15 * rng.random(5)
    k = solve_stokes(cell(place, radius), cells=20).k
    turned = solve_stokes(cell(place[:, [1, 2, 0]], radius), cells=20, axis=2).k
    large = solve_stokes(cell(1e-3 * place, 1e-3 * radius, (1e-3,) * 3), cells=20).k
    tiled = solve_stokes(
        cell(np.vstack([place, place + np.array([0, 1, 0])]), np.tile(radius, 2), (1, 2, 1)),
        cells=40,
    ).k
    shifted = solve_stokes(cell(place + np.array([0.05, 0.1, -0.15]), radius), cells=20).k
    assert [turned, 1e6 * large, tiled, shifted] == pytest.approx([k] * 4, rel=3e-4)


def test_necks_between_overlapping_spheres_do_not_leak():
    """Spheres buried in the necks of a percolating solid close any inner path.

    They must change nothing.
    """
    radius = 0.58
    middle = np.array([[0.5, 0.5, 0.5]])
    neck = np.array([[0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]])
    buried = cell(np.vstack([middle, neck]), [radius, *[0.28] * 3])
    assert np.all(np.hypot(0.28, 0.5) < radius)
    open_, closed = (
        solve_stokes(pack, cells=40, tolerance=2e-5).k for pack in (cell(middle, radius), buried)
    )
    assert open_ == pytest.approx(closed, rel=2e-3)


def test_swallowed_and_doubled_spheres_change_nothing():
    one = cell([[0.4, 0.5, 0.6]], 0.3)
    many = cell([[0.4, 0.5, 0.6], [0.4, 0.5, 0.6], [0.42, 0.5, 0.6]], [0.3, 0.3, 0.1])
    ks = [solve_stokes(pack, cells=24, tolerance=1e-5).k for pack in (one, many)]
    assert ks[0] == pytest.approx(ks[1], rel=1e-4)


def test_stored_truth_lies_below_a_coarse_grid_by_its_error():
    with (DATA / OWN_TRUTH).open(newline="") as file:
        truth = next(row for row in csv.DictReader(file) if row["case"] == "packH_40_eps40")
    table = np.genfromtxt(
        DATA / truth["file"],
        delimiter=",",
        skip_header=2,
        usecols=range(4),
    )
    pack = cell(table[:, :3], table[:, 3], (float(truth["edge_mm"]),) * 3)
    grids = [solve_stokes(pack, cells=n) for n in (32, 48)]
    assert grids[0].k > grids[1].k > float(truth["k_mm2"])
    assert extrapolate(*grids).k == pytest.approx(float(truth["k_mm2"]), rel=0.02)


def test_refusals(monkeypatch):
    with pytest.raises(CaseError, match="at least 4"):
        solve_stokes(cell(SC, 0.3), cells=3)
    with pytest.raises(CaseError, match="no wall"):
        solve_stokes(cell(np.zeros((0, 3)), np.zeros(0)), cells=10)
    with pytest.raises(CaseError, match="axis 3"):
        solve_stokes(cell(SC, 0.3), cells=10, axis=3)
    flow = solve_stokes(cell(SC, 0.3), cells=10)
    with pytest.raises(CaseError, match="finer"):
        extrapolate(flow, flow)
    monkeypatch.setattr(forces, "MOST_ITERATIONS", 5)
    with pytest.raises(FlowError, match="after 5 iterations"):
        solve_stokes(cell(SC, 0.4), cells=16)


def test_closed_pores_are_no_flow():
    with pytest.raises(FlowError):
        solve_stokes(cell([[0.5, 0.5, 0.5]], 0.74), cells=16)
