"""Polyhedra: tetrahedra of one power centre, which the tessellation splits arbitrarily."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import SAME_CENTRE
from fdnet.network.tessellation.tessellation import Tessellation
from fdnet.spheres.arrays import one_line
from fdnet.spheres.images import INSIDE, MIRROR_LOW, ON_FACE
from fdnet.spheres.snapshot import Array

ADOPTION_ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Polyhedra:
    """Power centres of the tetrahedra (P), and which tetrahedra share one.

    Attributes:
        centre: (P, 3) m, power centres; a flat tetrahedron has that of a neighbour.
        heights: (T, 2) m, distance of the two centres from their facet, positive on their own
            side.
        group: (P,) number of the polyhedron, equal for all parts of one.
        wall: (P, 3) -1 or 1 where the low or high mirrored face cuts the polyhedron, else 0.
    """

    centre: Array
    heights: Array
    group: Array
    wall: Array

    __repr__ = one_line


def join_polyhedra(tessellation: Tessellation) -> Polyhedra:
    """Power centres, heights over the facets, groups, and the walls they lie on."""
    centre = _adopted_centres(tessellation)
    heights = _heights(tessellation, centre)
    joined = np.abs(heights.sum(axis=1)) < SAME_CENTRE * tessellation.scale
    pairs, count = tessellation.facets.pore[joined], len(centre)
    graph = coo_matrix((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    group = connected_components(graph, directed=False)[1]
    return Polyhedra(
        centre=centre, heights=heights, group=group, wall=_walls(tessellation, centre, group)
    )


def _adopted_centres(tessellation: Tessellation) -> Array:
    """Centres (P, 3) m, where a flat tetrahedron has the centre of a neighbour.

    The corners of a flat tetrahedron are four corners of the face between two polyhedra. Its own
    centre depends on the shake alone. Either neighbour leaves the same flow, since both splits of
    a face count the same.
    """
    tetrahedra, size = tessellation.tetrahedra, tessellation.size
    centre, known = tetrahedra.centre.copy(), ~tetrahedra.flat
    near = tessellation.facets.where(np.any(tetrahedra.flat[tessellation.facets.pore], axis=1))
    for _ in range(ADOPTION_ROUNDS):
        for own, other, sign in ((0, 1, 1.0), (1, 0, -1.0)):
            lender, taker = near.pore[:, other], near.pore[:, own]
            use = np.flatnonzero(known[lender] & ~known[taker])
            taken, rows = np.unique(taker[use], return_index=True)
            centre[taken] = centre[lender[use[rows]]] + sign * near.shift[use[rows]] * size
            known[taken] = True
    return centre


def _heights(tessellation: Tessellation, centre: Array) -> Array:
    """Distances (T, 2) m of the two power centres from the facet, positive on their own side."""
    tetrahedra, facets = tessellation.tetrahedra, tessellation.facets
    shaken = tetrahedra.points.shaken
    heights = np.empty((len(facets.pore), 2))
    for part in geometry.slices(len(heights)):
        one, two = facets.pore[part].T
        corner = shaken[facets.vertex[part]]
        normal = geometry.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        apex = shaken[tetrahedra.vertex[one, facets.opposite[part, 0]]]
        normal *= (
            np.where(geometry.dot(apex - corner[:, 0], normal) > 0, -1.0, 1.0)
            / np.linalg.norm(normal, axis=1)
        )[:, None]
        other = centre[two] + facets.shift[part] * tessellation.size
        heights[part, 0] = geometry.dot(corner[:, 0] - centre[one], normal)
        heights[part, 1] = geometry.dot(other - corner[:, 0], normal)
    return heights


def _walls(tessellation: Tessellation, centre: Array, group: Array) -> Array:
    """Mirrored faces (P, 3) that cut each polyhedron: -1 the low one, 1 the high one, 0 none.

    A face cuts a tetrahedron with corners on both sides of it, and one with corners beyond it
    whose centre lies on it. What it does to one part of a polyhedron it does to all.
    """
    tetrahedra, scale = tessellation.tetrahedra, tessellation.scale
    mirror = tetrahedra.points.mirror
    mirrored = np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1)
    doubtful = np.flatnonzero(np.any(mirrored[tetrahedra.vertex], axis=1))
    corner = mirror[tetrahedra.vertex[doubtful]]
    near = np.stack(
        [np.abs(centre[doubtful] - face) < SAME_CENTRE * scale for face in tessellation.box.T],
        axis=2,
    ).any(axis=2)
    beyond = np.any((corner != INSIDE) & (corner != ON_FACE), axis=1)
    low = np.any(corner == MIRROR_LOW, axis=1)
    cut = beyond & (np.any(corner == INSIDE, axis=1) | near)
    wall = np.zeros((len(centre), 3), np.int8)
    wall[doubtful] = np.where(cut, np.where(low, -1, 1), 0)
    for axis in range(3):
        for side in (-1, 1):
            groups = np.zeros(int(group.max(initial=-1)) + 1, bool)
            groups[group[wall[:, axis] == side]] = True
            wall[groups[group], axis] = side
    return wall
