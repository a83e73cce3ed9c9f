"""Nodes: the places from which the resistances of a pore's throats are counted.

The node of a pore is its power centre or, where that lies outside of the tetrahedron, the point of
the tetrahedron that is nearest to it. So the way of the fluid from node to node leads through the
facet. Between power centres on one side of a facet it does not: along a chain of such tetrahedra,
which a hole in a deposit is, the flow would meet next to no resistance. Pores of one polyhedron,
such as those that a face of the box cuts, keep its power centre.
"""

from typing import NamedTuple

import numpy as np

from fdnet.network.compiled import compiled_for_loops, loops_in_place
from fdnet.network.geometry import FACETS
from fdnet.network.network import Network
from fdnet.network.tessellation.delaunay import along, less, times
from fdnet.spheres.snapshot import Array, frozen

CENTRE = 4  # The row of the power centre, after those of the four corners of a tetrahedron
ON_FACET = 1e-9
"""A node that is nearer to a facet, in lengths of the facet, lies on it: its height is 0."""


class Nodes(NamedTuple):
    """The nodes of the pores (P) of a network, above the facets of its throats (T)."""

    position: Array  # (P, 3) m
    heights: Array
    """(T, 2) m, distances of the nodes of both pores from the facet of a throat, positive on the
    pore's own side. Only pores of a polyhedron with several tetrahedra can have a negative one."""


def nodes_of(network: Network) -> Nodes:
    """The nodes of all pores."""
    alone = np.bincount(network.pore_group)[network.pore_group] == 1
    node, moved = np.array(network.pore_power_centre), np.zeros(len(alone), bool)
    height, size = np.array(network.throat_heights), np.ptp(network.box, axis=1)
    place, images, pores = network.image_position, network.throat_images, network.throat_pores
    _move_inside(node, moved, place, size, network.pore_images, network.pore_wrap, alone)
    turn, wrap = network.throat_shift * size, network.pore_wrap * size
    _set_heights(height, node, moved, place, images, pores, turn, wrap)
    return Nodes(frozen(node), frozen(height))


@compiled_for_loops
def _move_inside(
    node: Array, moved: Array, place: Array, size: Array, vertex: Array, wrap: Array, alone: Array
) -> None:
    """Moves the nodes of pores that stand alone into their tetrahedra, and marks the moved."""
    corner, best, near = np.empty((5, 3)), np.empty(3), np.empty(3)
    for p in range(len(node)):
        if not alone[p]:
            continue
        for k in range(4):
            for axis in range(3):
                corner[k, axis] = place[vertex[p, k], axis] - wrap[p, axis] * size[axis]
        corner[CENTRE] = node[p]
        nearest = np.inf
        for k in range(4):
            if _behind(corner, k):
                square = _set_nearest(corner, k, near)
                if square < nearest:
                    nearest = square
                    best[:] = near
        if nearest < np.inf:
            moved[p] = True
            node[p] = best


@loops_in_place
def _behind(corner: Array, k: int) -> bool:
    """Whether the power centre and corner `k` lie on different sides of the facet opposite."""
    a, b, c = FACETS[k, 0], FACETS[k, 1], FACETS[k, 2]
    normal = times(less(corner, b, a), less(corner, c, a))
    return along(normal, less(corner, CENTRE, a)) * along(normal, less(corner, k, a)) <= 0.0


@loops_in_place
def _set_nearest(corner: Array, k: int, nearest: Array) -> float:
    """Sets the point of the facet opposite `k` nearest to the power centre; gives the distance m2.

    v and w are the weights of its second and third corner; signs say whether a corner or an edge
    is nearest (Ericson 2005, section 5.1.5).
    """
    i, j, m = FACETS[k, 0], FACETS[k, 1], FACETS[k, 2]
    ab, ac = less(corner, j, i), less(corner, m, i)
    ap, bp, cp = less(corner, CENTRE, i), less(corner, CENTRE, j), less(corner, CENTRE, m)
    d1, d2, d3 = along(ab, ap), along(ac, ap), along(ab, bp)
    d4, d5, d6 = along(ac, bp), along(ab, cp), along(ac, cp)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0.0 and d2 <= 0.0:
        v, w = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        v, w = 1.0, 0.0
    elif d6 >= 0.0 and d5 <= d6:
        v, w = 0.0, 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v, w = d1 / (d1 - d3), 0.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        v, w = 0.0, d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    square = 0.0
    for axis in range(3):
        nearest[axis] = corner[i, axis] + v * ab[axis] + w * ac[axis]
        square += (nearest[axis] - corner[CENTRE, axis]) ** 2
    return square


@compiled_for_loops
def _set_heights(
    height: Array,
    node: Array,
    moved: Array,
    place: Array,
    facets: Array,
    pores: Array,
    turn: Array,
    wrap: Array,
) -> None:
    """Sets the heights (T, 2) m of nodes that were moved; `turn` and `wrap` are shifts in m."""
    facet = np.empty((3, 3))
    for t in range(len(facets)):
        one = pores[t, 0]
        if not (moved[one] or moved[pores[t, 1]]):
            continue
        for k in range(3):
            for axis in range(3):
                facet[k, axis] = place[facets[t, k], axis] - wrap[one, axis]
        normal = times(less(facet, 1, 0), less(facet, 2, 0))
        long = np.sqrt(along(normal, normal))
        for side in range(2):
            pore = pores[t, side]
            if moved[pore]:
                total = 0.0
                for axis in range(3):
                    away = node[pore, axis] + turn[t, axis] * side - facet[0, axis]
                    total += normal[axis] * away
                above = abs(total) / long
                height[t, side] = above if above > ON_FACET * np.sqrt(long) else 0.0
