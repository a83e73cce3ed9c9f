"""The flow through a section that side walls hold, by finite differences."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve


def resolved_flux(place, disc, cells=200, *, edge=False):
    """Flux of laplacian(w) = -1 in a trapezoid, by finite differences.

    w = 0 on the wall and on two discs; the other sides carry no shear. With `edge` a second wall
    stands where the second disc would be, and the trapezoid is a rectangle.
    """
    step = place[2] / cells
    x, y = np.meshgrid(
        (np.arange(cells) + 0.5) * step, np.arange(step / 2, max(place[:2]), step), indexing="ij"
    )
    first = x**2 + (y - place[0]) ** 2 < disc[0] ** 2
    solid = first | ((x - place[2]) ** 2 + (y - place[1]) ** 2 < disc[1] ** 2)
    inside = y < place[0] + (place[1] - place[0]) * x / place[2]
    fluid = np.pad(inside & ~solid, 1)
    held = np.pad(inside & solid, 1)
    held[:, 0] = True
    held[-1] |= edge
    index = np.full(fluid.shape, -1)
    index[fluid] = np.arange(fluid.sum())
    own, rows, columns = np.zeros(fluid.sum()), [], []
    for axis, shift in ((0, 1), (0, -1), (1, 1), (1, -1)):
        neighbour = np.roll(index, shift, axis=axis)[fluid]
        x, y = np.nonzero(fluid)
        at_wall = y == 1 if axis == 1 else edge & (x == cells)
        half = at_wall & ((axis, shift) in ((1, 1), (0, -1)))
        own += (neighbour >= 0) + np.roll(held, shift, axis=axis)[fluid] * np.where(half, 2.0, 1.0)
        rows.append(np.flatnonzero(neighbour >= 0))
        columns.append(neighbour[neighbour >= 0])
    row, column = np.concatenate(rows), np.concatenate(columns)
    count = len(own)
    system = coo_matrix((-np.ones(len(row)), (row, column)), shape=(count, count)).tolil()
    system.setdiag(own)
    return spsolve(system.tocsc(), np.full(count, step**2)).sum() * step**2
