"""Points in given boxes, by sorting the points into cubic cells."""

import numpy as np

from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.spheres.snapshot import Array


def points_in_boxes(point: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """All pairs of a box and a point in it, in the order of the boxes.

    Args:
        point: (N, 3) m.
        low: (M, 3) m, low corners of the boxes.
        high: (M, 3) m, high corners; points on the faces of a box are in it.

    Returns:
        Index of the box (K,) and of the point (K,).
    """
    if not len(point) or not len(low):
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    grid, order = grid_of(point)
    placed = point[order]
    count = _search(grid, placed, low, high, np.zeros(0, np.intp))
    box = np.repeat(np.arange(len(low)), count)
    inside = np.empty(len(box), np.intp)
    _search(grid, placed, low, high, inside)
    return box, order[inside]


Grid = tuple[Array, float, Array, Array]
"""Low corner (3,) m, edge m of a cell, number of cells (3,) along each axis, and for each cell the
index of its first point, with the number of points at the end."""


def grid_of(point: Array, edge: float | None = None) -> tuple[Grid, Array]:
    """Points (N, 3) m sorted into cubic cells of `edge` m, with N at least 1.

    Without an edge the cells are as many as the points along the longest side of a cube.

    Returns:
        The cells, and the order (N,) in which they hold the points.
    """
    start = point.min(axis=0)
    if edge is None:
        edge = max(float(np.ptp(point, axis=0).max()) / len(point) ** (1.0 / 3.0), 1e-300)
    cell = ((point - start) / edge).astype(np.intp)
    shape = cell.max(axis=0) + 1
    flat = np.ravel_multi_index(tuple(cell.T), tuple(shape))
    order = np.argsort(flat, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=int(shape.prod())))])
    return (start, edge, shape, first), order


@compiled_in_place
def cells_between(
    low: float, high: float, start: float, edge: float, number: int
) -> tuple[int, int]:
    """The first cell along an axis between `low` and `high` m, and the one after the last.

    The `number` cells begin at `start` m, and each is `edge` m long.
    """
    lower, upper = (low - start) / edge, (high - start) / edge + 1.0
    return int(min(max(lower, 0.0), float(number))), int(min(max(upper, 0.0), float(number)))


@compiled
def _search(grid: Grid, point: Array, low: Array, high: Array, inside: Array) -> Array:
    """Number of points (M,) in each box; writes their indices to `inside` where that has room."""
    start, edge, shape, first = grid
    count = np.zeros(len(low), np.intp)
    cell = np.empty((3, 2), np.intp)
    total = 0
    for box in range(len(low)):
        x, y, z = low[box, 0], low[box, 1], low[box, 2]
        u, v, w = high[box, 0], high[box, 1], high[box, 2]
        for axis in range(3):
            cell[axis, 0], cell[axis, 1] = cells_between(
                low[box, axis], high[box, axis], start[axis], edge, shape[axis]
            )
        before = total
        for i in range(cell[0, 0], cell[0, 1]):
            for j in range(cell[1, 0], cell[1, 1]):
                row = (i * shape[1] + j) * shape[2]
                for k in range(first[row + cell[2, 0]], first[row + max(cell[2, 1], cell[2, 0])]):
                    if x <= point[k, 0] <= u and y <= point[k, 1] <= v and z <= point[k, 2] <= w:
                        if total < len(inside):
                            inside[total] = k
                        total += 1
        count[box] = total - before
    return count
