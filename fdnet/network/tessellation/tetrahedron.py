"""What is measured on one tetrahedron after the other, in one compiled pass.

The formulas are those of `geometry`, which has their sources. Here they are written for the
corners of one tetrahedron, so that a whole pack needs no arrays in between.
"""

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.spheres.snapshot import Array

Vector = tuple[float, float, float]


@compiled
def less(points: Array, a: int, b: int) -> Vector:
    """Row `a` of `points` (M, 3) less row `b`."""
    return points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]


@compiled
def times(left: Vector, right: Vector) -> Vector:
    """Vector product."""
    return (
        left[1] * right[2] - left[2] * right[1],
        left[2] * right[0] - left[0] * right[2],
        left[0] * right[1] - left[1] * right[0],
    )


@compiled
def along(left: Vector, right: Vector) -> float:
    """Scalar product."""
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


@compiled
def centres(
    position: Array, shaken: Array, radius: Array, vertex: Array, given: tuple[float, float]
) -> tuple[Array, Array, Array, Array]:
    """Power centre (P, 3) m, reach (P,) m, volume (P,) m3 and flatness (P,) of tetrahedra.

    `position` and `shaken` (M, 3) m are the points, `radius` (M,) m their spheres, `vertex` (P, 4)
    the corners. `given` is the volume m3 below which a tetrahedron is flat and takes the centre of
    its shaken corners, and the radius m of the largest sphere: the reach is that of the sphere
    about the power centre in which the centre of the largest would have less power.
    """
    count = len(vertex)
    centre, reach = np.empty((count, 3)), np.empty(count)
    volume, flat = np.empty(count), np.empty(count, np.bool_)
    flattest, largest = given
    for t in range(count):
        a, b, c, d = vertex[t, 0], vertex[t, 1], vertex[t, 2], vertex[t, 3]
        one, two, three = less(position, b, a), less(position, c, a), less(position, d, a)
        volume[t] = abs(along(one, times(two, three))) / 6.0
        flat[t] = volume[t] < flattest
        base = shaken if flat[t] else position
        if flat[t]:
            one, two, three = less(base, b, a), less(base, c, a), less(base, d, a)
        first = radius[a]
        half = (
            0.5 * (along(one, one) + (first - radius[b]) * (first + radius[b])),
            0.5 * (along(two, two) + (first - radius[c]) * (first + radius[c])),
            0.5 * (along(three, three) + (first - radius[d]) * (first + radius[d])),
        )
        offset = _solved(one, two, three, half)
        for k in range(3):
            centre[t, k] = base[a, k] + offset[k]
        power = along(offset, offset) - first * first
        reach[t] = np.sqrt(max(power + largest * largest, 0.0))
    return centre, reach, volume, flat


@compiled
def _solved(one: Vector, two: Vector, three: Vector, right: Vector) -> Vector:
    """The vector with these three scalar products with three others; NaN if they lie in a plane.

    Cramer's rule.
    """
    first, second, third = times(two, three), times(three, one), times(one, two)
    determinant = along(one, first)
    scale = 1.0 / determinant if determinant != 0.0 else np.nan
    x, y, z = right[0] * scale, right[1] * scale, right[2] * scale
    return (
        x * first[0] + y * second[0] + z * third[0],
        x * first[1] + y * second[1] + z * third[1],
        x * first[2] + y * second[2] + z * third[2],
    )


@compiled
def touching_spheres(
    points: Array, radius: Array, vertex: Array, tolerance: float
) -> tuple[Array, Array, Array]:
    """Sphere that touches the four on the corners: centre (P, 3) m, radius (P,) m, and if within.

    The radius is NaN where there is none. The last (P,) is true where the centre lies in the
    tetrahedron; a barycentric coordinate may be negative by `tolerance`.
    """
    count = len(vertex)
    centre, touching = np.empty((count, 3)), np.empty(count)
    within = np.zeros(count, np.bool_)
    for t in range(count):
        a, b, c, d = vertex[t, 0], vertex[t, 1], vertex[t, 2], vertex[t, 3]
        one, two, three = less(points, b, a), less(points, c, a), less(points, d, a)
        first = radius[a]
        constant = (
            0.5 * (along(one, one) + first**2 - radius[b] ** 2),
            0.5 * (along(two, two) + first**2 - radius[c] ** 2),
            0.5 * (along(three, three) + first**2 - radius[d] ** 2),
        )
        apart = (first - radius[b], first - radius[c], first - radius[d])
        u, v = _solved(one, two, three, constant), _solved(one, two, three, apart)
        half, rest = first - along(u, v), along(u, u) - first**2
        under = half**2 - (along(v, v) - 1.0) * rest
        below = half + np.sqrt(under) if under >= 0.0 else np.nan
        touching[t] = rest / below if below != 0.0 else np.nan
        if not touching[t] > -min(first, radius[b], radius[c], radius[d]):
            touching[t] = np.nan
        offset = (
            u[0] + v[0] * touching[t],
            u[1] + v[1] * touching[t],
            u[2] + v[2] * touching[t],
        )
        for k in range(3):
            centre[t, k] = points[a, k] + offset[k]
        within[t] = _within(one, two, three, offset, tolerance)
    return centre, touching, within


@compiled
def _within(one: Vector, two: Vector, three: Vector, offset: Vector, tolerance: float) -> bool:
    """Whether `offset` from a corner lies in the tetrahedron of three sides at that corner."""
    first = times(two, three)
    determinant = along(one, first)
    if determinant == 0.0:
        return False
    x = along(offset, first) / determinant
    y = along(offset, times(three, one)) / determinant
    z = along(offset, times(one, two)) / determinant
    return min(x, y, z) >= -tolerance and x + y + z <= 1.0 + tolerance


@compiled
def solids(points: Array, radius: Array, vertex: Array) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the spheres on the corners in each tetrahedron.

    As `geometry.solid_in_tetrahedra`.
    """
    count = len(vertex)
    volume, surface = np.zeros(count), np.zeros(count)
    for t in range(count):
        a = vertex[t, 0]
        one, two = less(points, vertex[t, 1], a), less(points, vertex[t, 2], a)
        triple = abs(along(one, times(two, less(points, vertex[t, 3], a))))
        for i in range(4):
            own = vertex[t, i]
            r = radius[own]
            angle = _corner_angle(points, vertex[t], i, triple)
            volume[t] += angle * r**3 / 3.0
            surface[t] += angle * r**2
            for j in range(i + 1, 4):
                side = less(points, vertex[t, j], own)
                apart, other = np.sqrt(along(side, side)), radius[vertex[t, j]]
                if apart < r + other:
                    turn = _edge_angle(points, vertex[t], (i, j), triple) / (2.0 * np.pi)
                    shared, hidden = _lens(r, other, apart)
                    volume[t] -= turn * shared
                    surface[t] -= turn * hidden
    return volume, surface


@compiled
def _corner_angle(points: Array, corner: Array, i: int, triple: float) -> float:
    """Solid angle sr at corner `i`; `triple` m3 is six times the volume."""
    a = less(points, corner[(i + 1) % 4], corner[i])
    b = less(points, corner[(i + 2) % 4], corner[i])
    c = less(points, corner[(i + 3) % 4], corner[i])
    la, lb, lc = np.sqrt(along(a, a)), np.sqrt(along(b, b)), np.sqrt(along(c, c))
    below = la * lb * lc + along(a, b) * lc + along(a, c) * lb + along(b, c) * la
    return 2.0 * np.arctan2(triple, below)


@compiled
def _edge_angle(points: Array, corner: Array, ends: tuple[int, int], triple: float) -> float:
    """Angle rad between the faces at the edge from corner i to j, `ends`."""
    i, j = ends
    k = 0
    while k in (i, j):
        k += 1
    m = 6 - i - j - k
    axis = less(points, corner[j], corner[i])
    left = times(axis, less(points, corner[k], corner[i]))
    right = times(axis, less(points, corner[m], corner[i]))
    # (axis x u) x (axis x v) = axis (axis . (u x v))
    return np.arctan2(np.sqrt(along(axis, axis)) * triple, along(left, right))


@compiled
def _lens(first: float, second: float, apart: float) -> tuple[float, float]:
    """Volume m3 and surface m2 of the lens of two spheres that overlap."""
    to_plane = (apart**2 + first**2 - second**2) / (2.0 * apart)
    one = min(max(first - to_plane, 0.0), 2.0 * first)
    other = min(max(second - apart + to_plane, 0.0), 2.0 * second)
    volume = np.pi * (one**2 * (3.0 * first - one) + other**2 * (3.0 * second - other)) / 3.0
    return volume, 2.0 * np.pi * (first * one + second * other)
