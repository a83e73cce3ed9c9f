"""The regular triangulation of weighted points, with exact predicates."""

from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.spheres.snapshot import Array

SHARE = 8
"""All points up to a round are this many times those up to the round before."""
ORDER_SEED = 271_828
BITS = 16
"""Bits of a coordinate along Hilbert's curve."""


def insertion_order(points: Array) -> Array:
    """Order (M,) of `points` (M, 3).

    They come in rounds, each of 7 times as many as have come before, drawn at random; within a
    round they follow Hilbert's curve (Amenta, Choi and Rote 2003, Proc. 19th SoCG, 211).
    """
    count = len(points)
    low, size = points.min(axis=0), float(np.max(np.ptp(points, axis=0)))
    cell = np.minimum((points - low) / size * 2**BITS, 2**BITS - 1).astype(np.int64)
    rank = np.random.default_rng(ORDER_SEED).permutation(count)
    late = np.floor(np.log((rank + 1.0) / count) / np.log(SHARE)).astype(np.int64)
    # stable, for the order that other sorts give to equal places depends on the processor
    return np.argsort(((late + 2 * BITS) << (3 * BITS)) + _along_curve(cell), kind="stable")


@compiled
def _along_curve(cell: Array) -> Array:
    """Place (M,) on Hilbert's curve of cells (M, 3), integers of BITS bits each.

    Skilling 2004 (AIP Conf. Proc. 707, 381).
    """
    place = np.zeros(len(cell), np.int64)
    part = np.zeros(3, np.int64)
    for k in range(len(cell)):
        for i in range(3):
            part[i] = cell[k, i]
        bit = 1 << (BITS - 1)
        while bit > 1:
            for i in range(3):
                if part[i] & bit:
                    part[0] ^= bit - 1
                else:
                    swap = (part[0] ^ part[i]) & (bit - 1)
                    part[0] ^= swap
                    part[i] ^= swap
            bit >>= 1
        part[1] ^= part[0]
        part[2] ^= part[1]
        swap, bit = 0, 1 << (BITS - 1)
        while bit > 1:
            if part[2] & bit:
                swap ^= bit - 1
            bit >>= 1
        total = 0
        for at in range(BITS - 1, -1, -1):
            for i in range(3):
                total = (total << 1) | (((part[i] ^ swap) >> at) & 1)
        place[k] = total
    return place


# ------------------------------------------------------------------------------------------------
# Signs of the two determinants of a tessellation, certain or not given.
#
# `side_of_plane` tells on which side of three points a fourth lies, `in_sphere` whether a point
# changes a tetrahedron. Both are taken in double numbers with a bound of their rounding. Below
# that bound they are taken again in pairs of double numbers (Dekker 1971, Numer. Math. 18, 224)
# with the bound of those. A sign that is not certain even then is given as 0: the points are
# degenerate.
#
# The bounds are those of the sum over all products of a determinant (6 and 24), each of at most
# the product of the largest factors, and each rounded by at most 20 units (Higham 2002, section
# 3.1).


UNIT = float(np.finfo(float).eps) / 2.0
"""Largest relative rounding of one operation."""
PAIR_UNIT = 32.0 * UNIT**2
"""Largest relative rounding of one operation on pairs."""
ROUNDINGS = 24.0
"""Roundings that one product of a determinant sees, at most."""
PLANE_BOUND, SPHERE_BOUND = 6.0 * ROUNDINGS, 24.0 * ROUNDINGS
SPLITTER = 2.0**27 + 1.0
Pair = tuple[float, float]
Corners = tuple[int, int, int, int]


def _orders(count: int) -> Array:
    """All orders of `count` columns with their signs (count!, count + 1)."""
    every = list(permutations(range(count)))
    turns = [sum(one > other for one, other in combinations(order, 2)) for order in every]
    return np.array([(*order, (-1) ** turn) for order, turn in zip(every, turns, strict=True)])


PLANE_ORDERS, SPHERE_ORDERS = _orders(3), _orders(4)


@compiled
def _sum(one: float, other: float) -> Pair:
    """The sum of two numbers and its rounding, exact."""
    total = one + other
    part = total - one
    return total, (one - (total - part)) + (other - part)


@compiled
def _product(one: float, other: float) -> Pair:
    """The product of two numbers and its rounding, exact."""
    total = one * other
    a, b = SPLITTER * one, SPLITTER * other
    one_high, other_high = a - (a - one), b - (b - other)
    one_low, other_low = one - one_high, other - other_high
    rest = ((one_high * other_high - total) + one_high * other_low) + one_low * other_high
    return total, rest + one_low * other_low


@compiled
def _add(one: Pair, other: Pair) -> Pair:
    high, low = _sum(one[0], other[0])
    more, least = _sum(one[1], other[1])
    high, low = _sum(high, low + more)
    return _sum(high, low + least)


@compiled
def _times(one: Pair, other: Pair) -> Pair:
    high, low = _product(one[0], other[0])
    return _sum(high, low + (one[0] * other[1] + one[1] * other[0]))


@compiled
def _in_pairs(high: Array, low: Array, orders: Array) -> Pair:
    """Determinant of the pairs `high` and `low` (n, n), by all `orders` (n!, n + 1) of columns.

    The last number of an order is its sign.
    """
    total = (0.0, 0.0)
    for order in orders:
        value = (1.0 * order[-1], 0.0)
        for row in range(len(high)):
            value = _times(value, (high[row, order[row]], low[row, order[row]]))
        total = _add(total, value)
    return total


@compiled
def side_of_plane(points: Array, a: int, b: int, c: int, d: int) -> int:
    """Sign of (a - d) . ((b - d) x (c - d)) for rows a, b, c, d of `points` (M, 3)."""
    ax, ay, az = (
        points[a, 0] - points[d, 0],
        points[a, 1] - points[d, 1],
        points[a, 2] - points[d, 2],
    )
    bx, by, bz = (
        points[b, 0] - points[d, 0],
        points[b, 1] - points[d, 1],
        points[b, 2] - points[d, 2],
    )
    cx, cy, cz = (
        points[c, 0] - points[d, 0],
        points[c, 1] - points[d, 1],
        points[c, 2] - points[d, 2],
    )
    value = az * (bx * cy - cx * by) + bz * (cx * ay - ax * cy) + cz * (ax * by - bx * ay)
    most = (
        max(abs(ax), abs(bx), abs(cx))
        * max(abs(ay), abs(by), abs(cy))
        * max(abs(az), abs(bz), abs(cz))
    )
    sign = _certain(value, PLANE_BOUND * UNIT * most)
    return sign if sign != 0 else _side_in_pairs(points, a, b, c, d, most)


@compiled
def _side_in_pairs(points: Array, a: int, b: int, c: int, d: int, most: float) -> int:
    high, low = np.empty((3, 3)), np.empty((3, 3))
    rows = (a, b, c)
    for k in range(3):
        for axis in range(3):
            high[k, axis], low[k, axis] = _sum(points[rows[k], axis], -points[d, axis])
    return _certain(_in_pairs(high, low, PLANE_ORDERS)[0], PLANE_BOUND * PAIR_UNIT * most)


@compiled
def _certain(value: float, bound: float) -> int:
    if abs(value) > bound:
        return 1 if value > 0.0 else -1
    return 0


@compiled
def in_sphere(points: Array, weight: Array, corner: Corners, e: int) -> int:
    """1 where point `e` changes the tetrahedron of `corner`, -1 where it does not.

    It changes the tetrahedron when its power to the sphere that is orthogonal to the four corners
    is less than its own weight; without weights, when it lies in the circumsphere. `weight` (M,)
    are squared radii. `side_of_plane` of the corners in their order is 1.
    """
    a, b, c, d = corner
    x, y, z, own = points[e, 0], points[e, 1], points[e, 2], weight[e]
    ax, ay, az = points[a, 0] - x, points[a, 1] - y, points[a, 2] - z
    bx, by, bz = points[b, 0] - x, points[b, 1] - y, points[b, 2] - z
    cx, cy, cz = points[c, 0] - x, points[c, 1] - y, points[c, 2] - z
    dx, dy, dz = points[d, 0] - x, points[d, 1] - y, points[d, 2] - z
    ab, bc = ax * by - bx * ay, bx * cy - cx * by
    cd, da = cx * dy - dx * cy, dx * ay - ax * dy
    ac, bd = ax * cy - cx * ay, bx * dy - dx * by
    aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    cc, dd = cx * cx + cy * cy + cz * cz, dx * dx + dy * dy + dz * dz
    value = (
        (dd - (weight[d] - own)) * (az * bc - bz * ac + cz * ab)
        - (cc - (weight[c] - own)) * (dz * ab + az * bd + bz * da)
    ) + (
        (bb - (weight[b] - own)) * (cz * da + dz * ac + az * cd)
        - (aa - (weight[a] - own)) * (bz * cd - cz * bd + dz * bc)
    )
    heaviest = max(max(weight[a], weight[b]), max(weight[c], weight[d]))
    most = (
        max(max(abs(ax), abs(bx)), max(abs(cx), abs(dx)))
        * max(max(abs(ay), abs(by)), max(abs(cy), abs(dy)))
        * max(max(abs(az), abs(bz)), max(abs(cz), abs(dz)))
        * (max(max(aa, bb), max(cc, dd)) + heaviest + own)
    )
    sign = _certain(value, SPHERE_BOUND * UNIT * most)
    return sign if sign != 0 else _sphere_in_pairs(points, weight, corner, e, most)


@compiled
def _sphere_in_pairs(points: Array, weight: Array, corner: Corners, e: int, most: float) -> int:
    high, low = np.empty((4, 4)), np.empty((4, 4))
    for k in range(4):
        lifted = _sum(weight[e], -weight[corner[k]])
        for axis in range(3):
            apart = _sum(points[corner[k], axis], -points[e, axis])
            high[k, axis], low[k, axis] = apart
            lifted = _add(lifted, _times(apart, apart))
        high[k, 3], low[k, 3] = lifted
    return _certain(_in_pairs(high, low, SPHERE_ORDERS)[0], SPHERE_BOUND * PAIR_UNIT * most)


# ------------------------------------------------------------------------------------------------
# The tessellation of points, point by point, with signs that are certain.
#
# Bowyer (1981, Comput. J. 24, 162) and Watson (1981, Comput. J. 24, 167): a new point removes the
# tetrahedra that it changes, and is joined to the facets of the hole. With weights the same makes
# the power tessellation (Edelsbrunner and Shah 1996, Algorithmica 15, 223). The points come in the
# order of `insertion_order`, so that the next tetrahedron is found within a few steps of the last.
#
# All points lie in one tetrahedron of four distant points. What these four are part of is left out
# at the end. A tetrahedron is missed only where its sphere reaches that far.
#
# Where a sign is not certain (points that coincide, five points on a sphere) there is no result,
# and the caller takes Qhull's.


FAR = 1000.0
"""Distance of the four distant points, in sizes of the whole."""
TETRAHEDRA_A_POINT = 8
HOLE, MOST_HOLE = 256, 8192
"""Numbers of tetrahedra of a hole that there is room for, first and at most."""
DEGENERATE, SMALL = -1, -2
IN, USED, FREE, NEAR, TRIES = range(5)
"""Places in the state of the work: points that are in, tetrahedra ever used, those on the free
list, a tetrahedron near the next point, and the number of tries."""


class Mesh(NamedTuple):
    """Room for tetrahedra: corners and neighbours (K, 4), -1 where free, marks and a free list."""

    vertex: Array
    neighbour: Array
    mark: Array
    spare: Array


class Room(NamedTuple):
    """Room for a hole: its tetrahedra, its facets (tetrahedron within and corner opposite),
    numbers of the corners of these, and what waits at their edges, -1 for nothing."""

    hole: Array
    rim: Array
    number: Array
    edge: Array


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
    finite = np.all((mesh.vertex >= 0) & (mesh.vertex < count), axis=1)
    index = np.full(len(finite) + 1, -1, np.int32)
    kept = np.flatnonzero(finite)
    index[kept] = np.arange(len(kept))
    return mesh.vertex[kept], index[mesh.neighbour[kept]]


def _insert_all(points: Array, weight: Array, order: Array) -> Mesh | None:
    """The tetrahedra of all points; None if degenerate. The last four points are the distant ones.

    They are the corners of the first tetrahedron.
    """
    count, most = len(order), TETRAHEDRA_A_POINT * len(order) + 4 * HOLE
    corners = np.full((most, 4), -1, np.int32)
    mesh = Mesh(corners, corners.copy(), np.zeros(most, np.int32), np.zeros(most, np.int32))
    mesh.vertex[0] = count + np.arange(4)
    room = _room(len(points), HOLE)
    state = np.array([0, 1, 0, 0, 0])
    while True:
        code = _insert(points, weight, order, mesh, room, state)
        if code == DEGENERATE:
            return None
        if code != SMALL:
            return mesh
        if state[USED] + len(room.hole) > len(mesh.vertex):
            more = (np.full_like(one, -1 if one.ndim == 2 else 0) for one in mesh)
            mesh = Mesh(*(np.concatenate(pair) for pair in zip(mesh, more, strict=True)))
        elif len(room.hole) < MOST_HOLE:
            room = _room(len(points), 2 * len(room.hole))
        else:
            return None


def _room(count: int, size: int) -> Room:
    """Room for a hole of `size` tetrahedra among `count` points."""
    return Room(
        hole=np.zeros(size, np.int32),
        rim=np.zeros((size, 2), np.int32),
        number=np.full(count, -1, np.int32),
        edge=np.full((size, size), -1, np.int32),
    )


@compiled_in_place
def _insert(
    points: Array, weight: Array, order: Array, mesh: Mesh, room: Room, state: Array
) -> int:
    """Inserts `order` from where `state` stands; 0, or DEGENERATE, or SMALL for want of room."""
    while state[IN] < len(order):
        new = order[state[IN]]
        start = _containing(points, mesh, state[NEAR], new)
        corner = _corners(mesh, start)
        sign = in_sphere(points, weight, corner, new)
        state[NEAR] = start
        state[TRIES] += 1
        if sign > 0:
            # an even mark that was never used
            hole, rim = _hole(points, weight, mesh, room, start, new, 2 * state[TRIES])
            if hole < 0:
                return hole
            if state[USED] + rim > len(mesh.vertex):
                return SMALL
            _fill(mesh, room, hole, rim, new, state)
        elif sign == 0:
            return DEGENERATE
        else:
            for i in range(4):
                if _side(points, corner, i, new) <= 0:  # not certain to lie in a tetrahedron
                    return DEGENERATE
        state[IN] += 1
    return 0


@compiled_in_place
def _corners(mesh: Mesh, at: int) -> Corners:
    """The corners of tetrahedron `at`."""
    vertex = mesh.vertex
    return vertex[at, 0], vertex[at, 1], vertex[at, 2], vertex[at, 3]


@compiled_in_place
def _side(points: Array, corner: Corners, i: int, new: int) -> int:
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
    at, before = start, -1
    while True:
        corner = _corners(mesh, at)
        step = -1
        for i in range(4):
            beyond = mesh.neighbour[at, i]
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
    points: Array, weight: Array, mesh: Mesh, room: Room, start: int, new: int, stamp: int
) -> tuple[int, int]:
    """Numbers of the tetrahedra that a point changes and of the facets around them, in `room`.

    The point `new` lies in the tetrahedron `start`. The changed ones are marked by the even
    number `stamp`, those that were looked at by the next.
    """
    hole, rim, mark = room.hole, room.rim, mesh.mark
    hole[0], mark[start] = start, stamp
    count, facets, at = 1, 0, 0
    while at < count:
        inner = hole[at]
        at += 1
        if count + 4 > len(hole) or facets + 4 > len(rim):
            return SMALL, 0
        for i in range(4):
            outer = mesh.neighbour[inner, i]
            if outer >= 0 and mark[outer] == stamp:
                continue
            if outer >= 0 and mark[outer] != stamp + 1:
                sign = in_sphere(points, weight, _corners(mesh, outer), new)
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
def _fill(mesh: Mesh, room: Room, count: int, facets: int, new: int, state: Array) -> None:
    """Joins the point `new` to the `facets` of its hole, and frees the `count` tetrahedra in it.

    A new tetrahedron is that within the facet with the point in place of the corner opposite. Two
    of them meet at each edge of the rim, where the first waits for the second.
    """
    vertex, neighbour, spare = mesh.vertex, mesh.neighbour, mesh.spare
    rim, number, edge = room.rim, room.number, room.edge
    for f in range(facets):
        for k in range(4):
            number[vertex[rim[f, 0], k]] = -1
    corners = 0
    for f in range(facets):
        inner, i = rim[f, 0], rim[f, 1]
        if state[FREE] > 0:
            state[FREE] -= 1
            made = spare[state[FREE]]
        else:
            made = state[USED]
            state[USED] += 1
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
        for k in range(4):
            if k == i:
                continue
            one, other = -1, -1
            for m in range(4):
                if m != k and m != i:
                    one, other = other, number[vertex[made, m]]
            low, high = min(one, other), max(one, other)
            known = edge[low, high]
            if known < 0:
                edge[low, high] = 4 * made + k
            else:
                neighbour[known // 4, known % 4] = made
                neighbour[made, k] = known // 4
                edge[low, high] = -1
        state[NEAR] = made
    for k in range(count):
        spare[state[FREE]] = room.hole[k]
        vertex[room.hole[k], 0] = -1
        state[FREE] += 1
