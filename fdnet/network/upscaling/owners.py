"""In which cell each pore lies."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network import geometry
from fdnet.network.fines.fine_images import periodic_images
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.network import Network
from fdnet.network.upscaling.pore_graph import PoreGraph, inside
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

FLAT = 1e-9
"""A tetrahedron of less volume, in cubed mean grain radii, holds no pore."""
MARGIN = 1e-6
"""By how much the boxes around tetrahedra are widened, in mean grain radii."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Owners:
    """The cells in which the pores (G) lie.

    Attributes:
        cell: (G,) its number.
        offset: (G, 3) whole periods by which the place of a pore has to be moved to lie in its
            cell.
    """

    cell: Array
    offset: Array

    __repr__ = one_line


class Tetrahedra:
    """The tetrahedra of the pores of a network, and how far points lie inside them."""

    def __init__(self, network: Network) -> None:
        corner = network.pore_corner
        self.low, self.high = corner.min(axis=1), corner.max(axis=1)
        self._first = corner[:, 0]
        edges = np.transpose(corner[:, 1:] - corner[:, :1], (0, 2, 1))
        self.solid = np.abs(geometry.signed_volume(corner)) > FLAT * network.grain_radius**3
        edges[~self.solid] = np.eye(3) * network.grain_radius
        self._inverse = np.linalg.inv(edges)

    def depth(self, tetrahedron: Array, point: Array) -> Array:
        """Least barycentric coordinate (K,) of `point` (K, 3) m in each `tetrahedron` (K,).

        It is negative outside, and -inf in a flat one.
        """
        weight = np.einsum(
            "kij,kj->ki", self._inverse[tetrahedron], point - self._first[tetrahedron]
        )
        least = np.minimum(weight.min(axis=1), 1.0 - weight.sum(axis=1))
        return np.where(self.solid[tetrahedron], least, -np.inf)


def owners_of(
    points: Array, network: Network, coarse: PoreGraph, tetrahedra: Tetrahedra
) -> Owners:
    """The cells that hold the `points` (G, 3) m of the pores.

    A point in no tetrahedron, or in a cell without an open throat, gets the nearest open cell.
    `network` is that of the grains, and `coarse` is its graph.
    """
    open_cells = _open(coarse)
    rows = np.flatnonzero(tetrahedra.solid & open_cells[network.pore_group])
    low, high = tetrahedra.low[rows], tetrahedra.high[rows]
    margin = MARGIN * network.grain_radius
    image, owner = periodic_images(network, points, low.min(axis=0), high.max(axis=0), margin)
    box, which = points_in_boxes(image, low - margin, high + margin)
    depth = tetrahedra.depth(rows[box], image[which])
    order = np.lexsort((-depth, owner[which]))
    best = order[np.unique(owner[which][order], return_index=True)[1]]
    cell, offset = np.full(len(points), -1), np.zeros((len(points), 3), np.intp)
    at = owner[which[best]]
    cell[at] = network.pore_group[rows[box[best]]]
    offset[at] = np.rint((image[which[best]] - points[at]) / np.ptp(network.box, axis=1))
    left = np.flatnonzero(cell < 0)
    if len(left):
        some = np.flatnonzero(open_cells)
        near, offset[left] = _nearest(points[left], network, coarse.place[some])
        cell[left] = some[near]
    return Owners(cell=cell, offset=offset)


def centroids(network: Network, graph: PoreGraph) -> Array:
    """Centroid (G, 3) m of the largest tetrahedron of each pore, inside the box."""
    return inside(network, network.pore_corner[graph.pore].mean(axis=1))


def _open(coarse: PoreGraph) -> Array:
    """Cells (C,) on a plane, or from which an open throat leads to another cell or to a plane."""
    count = len(coarse.node)
    open_ = coarse.node != np.arange(count)
    ends = coarse.ends.ravel()
    open_[ends[ends < count]] = True
    return open_


def _nearest(points: Array, network: Network, places: Array) -> tuple[Array, Array]:
    """The nearest of the `places` (M, 3) m to each point (N, 3) m, and its offset (N, 3)."""
    size = np.where(network.periodic, np.ptp(network.box, axis=1), 0.0)
    low = network.box[:, 0]
    around = np.where(size > 0.0, size, np.inf)
    wrapped = [np.mod(place - low, around) for place in (points, places)]
    wrapped = [np.where(place < around, place, 0.0) for place in wrapped]
    tree = cKDTree(wrapped[1], boxsize=size)
    near = tree.query(wrapped[0])[1]
    with np.errstate(invalid="ignore", divide="ignore"):
        offset = np.rint((places[near] - points) / size)
    return near, np.where(np.isfinite(offset), offset, 0).astype(np.intp)
