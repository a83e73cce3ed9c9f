"""Polyhedra: tetrahedra of one power centre, which the tessellation splits arbitrarily."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fdnet.network.tessellation.delaunay import SAME_CENTRE, Tetrahedra
from fdnet.network.tessellation.section import heights
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
    height = _heights(tessellation, centre)
    joined = np.abs(height.sum(axis=1)) < SAME_CENTRE * tessellation.scale
    pairs, count = tessellation.facets.pore[joined], len(centre)
    graph = coo_matrix((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    group = connected_components(graph, directed=False)[1]
    return Polyhedra(
        centre=centre, heights=height, group=group, wall=_walls(tessellation, centre, group)
    )


def _adopted_centres(tessellation: Tessellation) -> Array:
    """Centres (P, 3) m, where a flat tetrahedron has the centre of a neighbour.

    The corners of a flat tetrahedron are four corners of the face between two polyhedra. Its own
    centre depends on the shake alone. Either neighbour leaves the same flow, since both splits of
    a face count the same. A neighbour that no other mirrored face cuts comes first, so that the
    flat one keeps its share inside the box; of these the one with the nearest centre, whatever the
    order of the tetrahedra.
    """
    tetrahedra, size = tessellation.tetrahedra, tessellation.size
    centre, known = tetrahedra.centre.copy(), ~tetrahedra.flat
    near = tessellation.facets.where(np.any(tetrahedra.flat[tessellation.facets.pore], axis=1))
    lender = np.concatenate([near.pore[:, 1], near.pore[:, 0]])
    taker = np.concatenate([near.pore[:, 0], near.pore[:, 1]])
    turn = np.concatenate([near.shift, -near.shift]) * size
    middle = tetrahedra.points.position[tetrahedra.vertex[taker]].mean(axis=1)
    crossed = _crossed(tetrahedra, taker)
    for alike in (True, False):
        for _ in range(ADOPTION_ROUNDS):
            use = np.flatnonzero(known[lender] & ~known[taker])
            if alike:
                cut = _crossed(tetrahedra, lender[use]) | _on_face(
                    tessellation, centre[lender[use]]
                )
                use = use[np.all(cut == crossed[use], axis=1)]
            offered = centre[lender[use]] + turn[use]
            away = np.sum((offered - middle[use]) ** 2, axis=1)
            nearest = np.lexsort((away, taker[use]))
            taken, rows = np.unique(taker[use][nearest], return_index=True)
            centre[taken] = offered[nearest[rows]]
            known[taken] = True
    return centre


def _crossed(tetrahedra: Tetrahedra, which: Array) -> Array:
    """Whether a tetrahedron has corners on both sides of a mirrored face, (K, 3) by axis."""
    mirror = tetrahedra.points.mirror[tetrahedra.vertex[which]]
    inside = np.any(mirror == INSIDE, axis=1)
    return np.asarray(inside & np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1))


def _on_face(tessellation: Tessellation, centre: Array) -> Array:
    """Whether a centre (K, 3) m lies on a mirrored face, (K, 3) by axis."""
    tolerance = SAME_CENTRE * tessellation.scale
    near = [np.abs(centre - face) < tolerance for face in tessellation.box.T]
    return (near[0] | near[1]) & ~np.array(tessellation.periodic)


def _heights(tessellation: Tessellation, centre: Array) -> Array:
    """Distances (T, 2) m of the two power centres from the facet, positive on their own side."""
    tetrahedra, facets = tessellation.tetrahedra, tessellation.facets
    apex = tetrahedra.vertex[facets.pore[:, 0], facets.opposite[:, 0]]
    ends = (facets.pore, facets.shift * tessellation.size)
    places = (tetrahedra.points.position, tetrahedra.points.shaken)
    result: Array = heights(places, facets.vertex, apex, centre, ends)
    return result


def _walls(tessellation: Tessellation, centre: Array, group: Array) -> Array:
    """Mirrored faces (P, 3) that cut each polyhedron: -1 the low one, 1 the high one, 0 none.

    A face cuts a tetrahedron with corners on both sides of it, and one with corners beyond it
    whose centre lies on it. What it does to one part of a polyhedron it does to all.
    """
    tetrahedra = tessellation.tetrahedra
    mirror = tetrahedra.points.mirror
    mirrored = np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1)
    doubtful = np.flatnonzero(np.any(mirrored[tetrahedra.vertex], axis=1))
    corner = mirror[tetrahedra.vertex[doubtful]]
    near = _on_face(tessellation, centre[doubtful])
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
