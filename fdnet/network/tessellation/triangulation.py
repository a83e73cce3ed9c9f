"""The tessellation of points, point by point, with signs that are certain.

Bowyer (1981, Comput. J. 24, 162) and Watson (1981, Comput. J. 24, 167): a new point removes the
tetrahedra that it changes, and is joined to the facets of the hole. With weights the same makes
the power tessellation (Edelsbrunner and Shah 1996, Algorithmica 15, 223). The points come in the
order of `curve`, so that the next tetrahedron is found within a few steps of the last.

All points lie in one tetrahedron of four distant points. What these four are part of is left out
at the end. A tetrahedron is missed only where its sphere reaches that far.

Where a sign is not certain (points that coincide, five points on a sphere) there is no result, and
the caller takes Qhull's.
"""

import numpy as np

from fdnet.network.compiled import compiled_in_place
from fdnet.network.tessellation.curve import insertion_order
from fdnet.network.tessellation.predicates import in_sphere, side_of_plane
from fdnet.spheres.snapshot import Array

FAR = 1000.0
"""Distance of the four distant points, in sizes of the whole."""
TETRAHEDRA_A_POINT = 8
HOLE, MOST_HOLE = 256, 8192
"""Numbers of tetrahedra of a hole that there is room for, first and at most."""
DEGENERATE, SMALL = -1, -2
Mesh = tuple[Array, Array, Array, Array]
Room = tuple[Array, Array, Array, Array]


def triangulate(points: Array, weight: Array) -> tuple[Array, Array] | None:
    """Tetrahedra (P, 4) and neighbours (P, 4), -1 for none, of `points` (M, 3).

    `weight` (M,) are the squared radii, all 0 for Delaunay's tessellation; a point may then have
    no tetrahedron. The neighbour k lies across the facet opposite corner k. None where the points
    are degenerate.
    """
    count = len(points)
    low, high = points.min(axis=0), points.max(axis=0)
    corners = np.array([[-1.0, -1, -1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]])
    distant = 0.5 * (low + high) + FAR * float(np.max(high - low)) * corners
    every = np.concatenate([points, distant])
    weights = np.concatenate([weight, np.zeros(4)])
    mesh = _insert_all(every, weights, insertion_order(points))
    if mesh is None:
        return None
    vertex, neighbour = mesh
    finite = np.all((vertex >= 0) & (vertex < count), axis=1)
    index = np.full(len(vertex) + 1, -1, np.int32)
    kept = np.flatnonzero(finite)
    index[kept] = np.arange(len(kept))
    return vertex[kept], index[neighbour[kept]]


def _insert_all(points: Array, weight: Array, order: Array) -> tuple[Array, Array] | None:
    """Corners and neighbours of all tetrahedra, -1 in those that are free; None if degenerate.

    The last four points are the distant ones.
    """
    mesh = _first_mesh(len(order))
    room = _room(len(points), HOLE)
    state = np.array([0, 1, 0, 0, 0])
    while True:
        code = _insert(points, weight, order, mesh, room, state)
        if code == DEGENERATE:
            return None
        if code != SMALL:
            return mesh[0], mesh[1]
        if state[1] + len(room[0]) > len(mesh[0]):
            mesh = (_doubled(mesh[0]), _doubled(mesh[1]), _doubled(mesh[2]), _doubled(mesh[3]))
        elif len(room[0]) < MOST_HOLE:
            room = _room(len(points), 2 * len(room[0]))
        else:
            return None


def _first_mesh(count: int) -> Mesh:
    """Room for the tetrahedra of `count` points: corners, neighbours, marks and a free list.

    The first tetrahedron is that of the four distant points.
    """
    most = TETRAHEDRA_A_POINT * count + 4 * HOLE
    vertex = np.full((most, 4), -1, np.int32)
    neighbour = np.full((most, 4), -1, np.int32)
    vertex[0] = count + np.arange(4)
    return vertex, neighbour, np.zeros(most, np.int32), np.zeros(most, np.int32)


def _room(count: int, size: int) -> Room:
    """Room for a hole: its tetrahedra, its facets, numbers of its corners, and their edges."""
    return (
        np.zeros(size, np.int32),
        np.zeros((size, 2), np.int32),
        np.full(count, -1, np.int32),
        np.full((size, size), -1, np.int32),
    )


def _doubled(one: Array) -> Array:
    return np.concatenate([one, np.full_like(one, -1 if one.ndim == 2 else 0)])


@compiled_in_place
def _insert(
    points: Array, weight: Array, order: Array, mesh: Mesh, room: Room, state: Array
) -> int:
    """Inserts `order` from where `state` stands; 0, or DEGENERATE, or SMALL for want of room.

    `state` holds the number of points that are in, the number of tetrahedra ever used, that of
    those on the free list, a tetrahedron near the next point, and the number of tries.
    """
    vertex = mesh[0]
    while state[0] < len(order):
        new = order[state[0]]
        start = _containing(points, mesh, state[3], new)
        corner = (vertex[start, 0], vertex[start, 1], vertex[start, 2], vertex[start, 3])
        sign = in_sphere(points, weight, corner, new)
        state[3] = start
        state[4] += 1
        if sign > 0:
            hole, rim = _hole(points, weight, mesh, room, (start, new, 2 * state[4]))
            if hole < 0:
                return hole
            if state[1] + rim > len(vertex):
                return SMALL
            _fill(mesh, room, (hole, rim, new), state)
        elif sign == 0 or not _strictly_within(points, corner, new):
            return DEGENERATE
        state[0] += 1
    return 0


@compiled_in_place
def _strictly_within(points: Array, corner: tuple[int, int, int, int], new: int) -> bool:
    """Whether `new` is certain to lie in a tetrahedron."""
    certain = True
    for i in range(4):
        certain = certain and _side(points, corner, i, new) > 0
    return certain


@compiled_in_place
def _side(points: Array, corner: tuple[int, int, int, int], i: int, new: int) -> int:
    """1 where `new` lies on the side of corner `i` of the facet opposite to it, -1 beyond."""
    return side_of_plane(
        points,
        new if i == 0 else corner[0],
        new if i == 1 else corner[1],
        new if i == 2 else corner[2],
        new if i == 3 else corner[3],
    )


@compiled_in_place
def _containing(points: Array, mesh: Mesh, start: int, new: int) -> int:
    """The tetrahedron in which `new` lies, by steps from `start` across facets towards it."""
    vertex, neighbour = mesh[0], mesh[1]
    at, before = start, -1
    while True:
        corner = (vertex[at, 0], vertex[at, 1], vertex[at, 2], vertex[at, 3])
        step = -1
        for i in range(4):
            beyond = neighbour[at, i]
            if beyond == before or beyond < 0:
                continue
            side = _side(points, corner, i, new)
            if side < 0:
                step = beyond
                break
        if step < 0:
            return at
        before, at = at, step


@compiled_in_place
def _hole(
    points: Array, weight: Array, mesh: Mesh, room: Room, given: tuple[int, int, int]
) -> tuple[int, int]:
    """Numbers of the tetrahedra that a point changes and of the facets around them, in `room`.

    `given` is the tetrahedron in which the point lies, the point, and an even mark that was never
    used. A facet is the tetrahedron within and the number of the corner opposite.
    """
    vertex, neighbour, mark, _ = mesh
    hole, rim = room[0], room[1]
    start, new, stamp = given
    hole[0], mark[start] = start, stamp
    count, facets, at = 1, 0, 0
    while at < count:
        inner = hole[at]
        at += 1
        if count + 4 > len(hole) or facets + 4 > len(rim):
            return SMALL, 0
        for i in range(4):
            outer = neighbour[inner, i]
            if outer >= 0 and mark[outer] == stamp:
                continue
            if outer >= 0 and mark[outer] != stamp + 1:
                corner = (vertex[outer, 0], vertex[outer, 1], vertex[outer, 2], vertex[outer, 3])
                sign = in_sphere(points, weight, corner, new)
                if sign == 0:
                    return DEGENERATE, 0
                if sign > 0:
                    mark[outer] = stamp
                    hole[count] = outer
                    count += 1
                    continue
                mark[outer] = stamp + 1
            rim[facets, 0], rim[facets, 1] = inner, i
            facets += 1
    return count, facets


@compiled_in_place
def _fill(mesh: Mesh, room: Room, given: tuple[int, int, int], state: Array) -> None:
    """Joins a point to the facets of its hole, and frees what was in it.

    `given` are the numbers of tetrahedra and of facets of the hole, and the point. A new
    tetrahedron is that within the facet with the point in place of the corner opposite. Two of
    them meet at each edge of the rim.
    """
    vertex, neighbour, _, spare = mesh
    hole, rim, number, edge = room
    count, facets, new = given
    for f in range(facets):
        for k in range(4):
            number[vertex[rim[f, 0], k]] = -1
    corners = 0
    for f in range(facets):
        inner, i = rim[f, 0], rim[f, 1]
        if state[2] > 0:
            state[2] -= 1
            made = spare[state[2]]
        else:
            made = state[1]
            state[1] += 1
        outer = neighbour[inner, i]
        for k in range(4):
            corner = vertex[inner, k]
            vertex[made, k] = corner
            if k != i and number[corner] < 0:
                number[corner] = corners
                corners += 1
        vertex[made, i], neighbour[made, i] = new, outer
        if outer >= 0:
            for k in range(4):
                if neighbour[outer, k] == inner:
                    neighbour[outer, k] = made
        _join(vertex, neighbour, number, edge, made, i)
        state[3] = made
    for k in range(count):
        spare[state[2]] = hole[k]
        vertex[hole[k], 0] = -1
        state[2] += 1


@compiled_in_place
def _join(
    vertex: Array, neighbour: Array, number: Array, edge: Array, made: int, apex: int
) -> None:
    """Makes `made` the neighbour of those made before it that share an edge of the rim with it.

    `edge` is -1 wherever it waits for no second tetrahedron.
    """
    for k in range(4):
        if k == apex:
            continue
        one, other = -1, -1
        for m in range(4):
            if m != k and m != apex:
                if one < 0:
                    one = number[vertex[made, m]]
                else:
                    other = number[vertex[made, m]]
        low, high = min(one, other), max(one, other)
        known = edge[low, high]
        if known < 0:
            edge[low, high] = 4 * made + k
        else:
            neighbour[known // 4, known % 4] = made
            neighbour[made, k] = known // 4
            edge[low, high] = -1
