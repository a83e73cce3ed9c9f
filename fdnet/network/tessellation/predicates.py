"""Signs of the two determinants of a tessellation, certain or not given.

`side_of_plane` tells on which side of three points a fourth lies, `in_sphere` whether a point
changes a tetrahedron. Both are taken in double numbers with a bound of their rounding. Below that
bound they are taken again in pairs of double numbers (Dekker 1971, Numer. Math. 18, 224) with the
bound of those. A sign that is not certain even then is given as 0: the points are degenerate.

The bounds are those of the sum over all products of a determinant (6 and 24), each of at most the
product of the largest factors, and each rounded by at most 20 units (Higham 2002, section 3.1).
"""

from itertools import combinations, permutations

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.spheres.snapshot import Array

UNIT = float(np.finfo(float).eps) / 2.0
"""Largest relative rounding of one operation."""
PAIR_UNIT = 32.0 * UNIT**2
"""Largest relative rounding of one operation on pairs."""
ROUNDINGS = 24.0
"""Roundings that one product of a determinant sees, at most."""
PLANE_BOUND, SPHERE_BOUND = 6.0 * ROUNDINGS, 24.0 * ROUNDINGS
SPLITTER = 2.0**27 + 1.0
Pair = tuple[float, float]


def _orders(count: int) -> Array:
    """All orders of `count` columns with their signs (count!, count + 1)."""
    rows = [(*order, _sign(order)) for order in permutations(range(count))]
    return np.array(rows, np.int64)


def _sign(order: tuple[int, ...]) -> int:
    turns = sum(one > other for one, other in combinations(order, 2))
    return -1 if turns % 2 else 1


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
def in_sphere(points: Array, weight: Array, corner: tuple[int, int, int, int], e: int) -> int:
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
def _sphere_in_pairs(
    points: Array, weight: Array, corner: tuple[int, int, int, int], e: int, most: float
) -> int:
    high, low = np.empty((4, 4)), np.empty((4, 4))
    for k in range(4):
        lifted = _sum(weight[e], -weight[corner[k]])
        for axis in range(3):
            apart = _sum(points[corner[k], axis], -points[e, axis])
            high[k, axis], low[k, axis] = apart
            lifted = _add(lifted, _times(apart, apart))
        high[k, 3], low[k, 3] = lifted
    return _certain(_in_pairs(high, low, SPHERE_ORDERS)[0], SPHERE_BOUND * PAIR_UNIT * most)
