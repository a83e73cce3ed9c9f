"""The piece of a ball inside a tetrahedron: volume and surface in closed form.

The two may lie anywhere. The tetrahedron is the signed sum of the cones from the centre of the
ball to its facets. Each cone is the signed sum, over the edges of its facet, of the cones to the
triangles between the edge and the foot of the centre on the facet.

Lengths are in units of the radius of the ball: d is the distance of the facet from the centre, h
the distance of the edge from the foot, t the place along the edge from the point nearest to the
foot; all are signed. phi = arctan(t / h) is the angle about the foot. The part of the sphere in a
cone is made of the directions that leave the ball before they reach the facet:

    integral of (1 - cos theta) d phi  less the same within the disc of the facet
        = c phi(t) - arctan(t d / (h sqrt(t^2 + h^2 + d^2))),

taken between the ends of each part of the edge outside the disc of radius sqrt(1 - d^2). Here
c = d where the plane of the facet cuts the ball, and c = 1 where the ball lies inside of it
(outside of it the piece is empty). With cos theta = d / sqrt(d^2 + h^2 / cos^2 phi) the second
term is the integral of cos theta.

The volume is a third of that surface, plus d / 3 times the area common to triangle and disc
(divergence theorem). Strobl, Formella and Poeschel 2016 (J. Comput. Phys. 311, 158) decompose by
facets and edges too.
"""

from math import atan2, copysign, pi, sqrt

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.spheres.snapshot import Array

ROUNDING = 1e-13
"""A piece of less volume, in cubes of the radius, is rounding."""
OTHERS = np.array([(1, 2, 3), (2, 3, 0), (3, 0, 1), (0, 1, 2)])
"""(4, 3) corners of the facet opposite each corner."""

Vector = tuple[float, float, float]


@compiled
def pieces(corner: Array, pairs: tuple[Array, Array], centre: Array, radius: Array) -> Array:
    """Volume m3 and surface m2 (K, 2) of the piece of a ball in a tetrahedron, pair by pair.

    Both are 0 where the two are apart. Pieces below 1e-13 cubes of the radius are rounding and
    left out.

    Args:
        corner: (P, 4, 3) m, corners of the tetrahedra.
        pairs: index of the tetrahedron and of the ball (K,), which may be apart.
        centre: (N, 3) m, of the balls.
        radius: (N,) m, of the balls.
    """
    pore, ball = pairs
    normal, place, depth = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros(4)
    measured = np.zeros((len(pore), 2))
    last = -1
    for k in range(len(pore)):
        p, b = pore[k], ball[k]
        if p != last:
            _facet_normals(corner[p], normal)
            last = p
        cuts = 0
        for f in range(4):
            depth[f] = _dot(normal[f], _apart(corner[p, OTHERS[f, 0]], centre[b])) / -radius[b]
            cuts += 1 if depth[f] < 1.0 else 0
        if min(min(depth[0], depth[1]), min(depth[2], depth[3])) <= -1.0:
            continue
        for c in range(4):
            for axis in range(3):
                place[c, axis] = (corner[p, c, axis] - centre[b, axis]) / radius[b]
        inside, area = _piece(place, normal, depth, cuts)
        if inside > ROUNDING:
            measured[k, 0], measured[k, 1] = inside * radius[b] ** 3, area * radius[b] ** 2
    return measured


@compiled
def _apart(a: Array, b: Array) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _facet_normals(corner: Array, normal: Array) -> None:
    """Inward unit normals (4, 3) of the facets opposite each corner."""
    turn = 1.0
    for f in range(4):
        a, b, c = corner[OTHERS[f, 0]], corner[OTHERS[f, 1]], corner[OTHERS[f, 2]]
        across = _cross(_apart(b, a), _apart(c, a))
        if f == 0:
            # one sign for all four, so that the facets of a flat tetrahedron face each other
            turn = copysign(1.0, _dot(_apart(corner[0], a), across))
        scale = (turn if f % 2 == 0 else -turn) / sqrt(_dot(across, across))
        for axis in range(3):
            normal[f, axis] = scale * across[axis]


@compiled
def _piece(place: Array, normal: Array, depth: Array, cuts: int) -> tuple[float, float]:
    """Volume and surface of the unit ball about the origin inside a tetrahedron.

    `place` (4, 3) are its corners, `normal` (4, 3) the inward normals of its facets, `depth` (4,)
    the distances of the facets and `cuts` the number of facets that cut the ball: the piece is the
    whole ball, a cap, or the sum over facets and edges.
    """
    if cuts == 0:
        return 4.0 / 3.0 * pi, 4.0 * pi
    if cuts == 1:
        height = 1.0 + min(min(depth[0], depth[1]), min(depth[2], depth[3]))
        return pi * height**2 * (3.0 - height) / 3.0, 2.0 * pi * height
    volume, surface = 0.0, 0.0
    for f in range(4):
        for e in range(3):
            start, end, third = (
                place[OTHERS[f, e]],
                place[OTHERS[f, e - 2]],
                place[OTHERS[f, e - 1]],
            )
            side = _apart(end, start)
            length = sqrt(_dot(side, side))
            if length == 0.0:  # shorter than the rounding of places in radii of the ball
                continue
            inward = _cross(normal[f], side)
            height = -_dot(inward, start) / length
            if _dot(inward, _apart(third, start)) < 0.0:
                height = -height
            area, shadow = _edge(
                depth[f], height, _dot(side, start) / length, _dot(side, end) / length
            )
            volume += (shadow + depth[f] * area) / 3.0
            surface += shadow
    return volume, surface


@compiled
def _edge(depth: float, height: float, start: float, end: float) -> tuple[float, float]:
    """Area of the triangle (foot, edge) within the disc, and solid angle of the part outside it.

    The facet lies at `depth`, the edge at `height` from the foot, from `start` to `end` > `start`.
    The area has the sign of `height`, the solid angle that of `depth` times `height`.
    """
    disc = 1.0 - depth**2
    if disc <= 0.0:
        return 0.0, _shadow(1.0, depth, height, start, end)[0]
    chord = disc - height**2
    if chord <= 0.0:
        shadow, turn = _shadow(depth, depth, height, start, end)
        return 0.5 * disc * turn, shadow
    enter = min(max(-sqrt(chord), start), end)
    leave = min(max(sqrt(chord), start), end)
    before, turn_before = _shadow(depth, depth, height, start, enter)
    after, turn_after = _shadow(depth, depth, height, leave, end)
    return 0.5 * (height * (leave - enter) + disc * (turn_before + turn_after)), before + after


@compiled
def _shadow(
    weight: float, depth: float, height: float, start: float, end: float
) -> tuple[float, float]:
    """Solid angle over the part of an edge from `start` to `end`, and its angle about the foot."""
    if start == end:
        return 0.0, 0.0
    side, away = copysign(1.0, height), abs(height)
    square = height**2 + depth**2
    turn = side * (atan2(end, away) - atan2(start, away))
    tilt = atan2(end * depth, away * sqrt(end**2 + square)) - atan2(
        start * depth, away * sqrt(start**2 + square)
    )
    return weight * turn - side * tilt, turn
