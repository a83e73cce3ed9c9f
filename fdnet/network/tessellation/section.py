"""What is measured on one facet after the other, in one compiled pass.

The formulas are those of `geometry`, which has their sources.
"""

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.tessellation.tetrahedron import along, less, times
from fdnet.spheres.snapshot import Array

SIDE_ENDS = (1, 2, 0)
"""The corner that follows each corner of a triangle."""


@compiled
def sections(
    points: Array, radius: Array, vertex: Array, touching: float
) -> tuple[Array, Array, Array]:
    """Inscribed radius (T,) m, open area (T,) m2, and whether two of the three spheres overlap.

    `vertex` (T, 3) are the corners among `points` (M, 3) m with spheres of `radius` (M,) m. The
    radius is NaN where no circle touches the three discs. Spheres overlap that are nearer than the
    sum of their radii by more than the share `touching` of it.
    """
    count = len(vertex)
    inscribed, area, overlap = np.empty(count), np.empty(count), np.zeros(count, np.bool_)
    for t in range(count):
        a, b, c = vertex[t, 0], vertex[t, 1], vertex[t, 2]
        one, two = less(points, b, a), less(points, c, a)
        product = times(one, two)
        twice, base = np.sqrt(along(product, product)), np.sqrt(along(one, one))
        place = (base, along(one, two) / base, twice / base)
        inscribed[t] = _inscribed(place, (radius[a], radius[b], radius[c]))
        open_part = 0.5 * twice
        for i in range(3):
            own, after = vertex[t, i], vertex[t, SIDE_ENDS[i]]
            left = less(points, after, own)
            right = less(points, vertex[t, SIDE_ENDS[SIDE_ENDS[i]]], own)
            open_part -= 0.5 * np.arctan2(twice, along(left, right)) * radius[own] ** 2
            apart, both = np.sqrt(along(left, left)), radius[own] + radius[after]
            open_part += 0.5 * _lens_area(radius[own], radius[after], apart)
            overlap[t] = overlap[t] or apart < (1.0 - touching) * both
        area[t] = open_part
    return inscribed, area, overlap


@compiled
def _inscribed(place: tuple[float, float, float], disc: tuple[float, float, float]) -> float:
    """Radius m of the circle that touches three discs from outside, NaN where there is none.

    The corners are (0, 0), (a, 0) and (x, y) m with `place` = (a, x, y).
    """
    a, x, y = place
    r = disc[0]
    ux = 0.5 * (a * a + r * r - disc[1] ** 2) / a
    vx = (r - disc[1]) / a
    uy = (0.5 * (x * x + y * y + r * r - disc[2] ** 2) - x * ux) / y
    vy = (r - disc[2] - x * vx) / y
    half, rest = r - ux * vx - uy * vy, ux * ux + uy * uy - r * r
    under = half * half - (vx * vx + vy * vy - 1.0) * rest
    if not under >= 0.0:
        return np.nan
    below = half + np.sqrt(under)
    touching = rest / below if below != 0.0 else np.nan
    return touching if touching > -min(disc) else np.nan


@compiled
def _lens_area(first: float, second: float, apart: float) -> float:
    """Area m2 common to two discs whose centres are `apart` m."""
    if apart >= first + second:
        return 0.0
    if apart <= abs(first - second):
        return np.pi * min(first, second) ** 2
    to_chord = (apart**2 + first**2 - second**2) / (2.0 * apart)
    chord = np.sqrt(max(first**2 - to_chord**2, 0.0))
    return (
        first**2 * np.arctan2(chord, to_chord)
        - to_chord * chord
        + second**2 * np.arctan2(chord, apart - to_chord)
        - (apart - to_chord) * chord
    )


@compiled
def heights(
    places: tuple[Array, Array],
    vertex: Array,
    apex: Array,
    centre: Array,
    ends: tuple[Array, Array],
) -> Array:
    """Distances (T, 2) m of two power centres from each facet, positive on their own side.

    `places` are the points (M, 3) m and their shaken places. Which side is whose follows from the
    shaken ones, for a flat tetrahedron has none without. `vertex` (T, 3) are the corners, `apex`
    (T,) is the point on the side of the first; `ends` are the indices (T, 2) of the tetrahedra,
    whose centres are `centre` (P, 3) m, and what moves the second next to the first (T, 3) m.
    """
    (points, shaken), (pore, shift) = places, ends
    height = np.empty((len(vertex), 2))
    for t in range(len(vertex)):
        a, b, c = vertex[t, 0], vertex[t, 1], vertex[t, 2]
        outward = times(less(shaken, b, a), less(shaken, c, a))
        normal = times(less(points, b, a), less(points, c, a))
        size = np.sqrt(along(normal, normal))
        if size == 0.0:  # the corners lie on one line: no facet, whose height is 0 on both sides
            size = 1.0
        if along(less(shaken, apex[t], a), outward) > 0.0:
            size = -size
        one, two = pore[t, 0], pore[t, 1]
        height[t] = 0.0
        for k in range(3):
            height[t, 0] += (points[a, k] - centre[one, k]) * normal[k] / size
            height[t, 1] += (centre[two, k] + shift[t, k] - points[a, k]) * normal[k] / size
    return height
