"""Volume of spheres inside cylinders with flat ends: exact, and as the thesis estimates it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, pi, sqrt

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

GAUSS_POINTS = 10
"""Points of the Gauss-Legendre rule of `exact_volume`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pairs:
    """K pairs of a sphere and a cylinder, which spans depth 0 to its length.

    Attributes:
        sphere: (K,) m, radius of the sphere.
        offset: (K,) m, distance of the centre of the sphere from the axis.
        depth: (K,) m, place of the centre along the axis.
        tube: (K,) m, radius of the cylinder.
        length: (K,) m, of the cylinder.
    """

    sphere: Array
    offset: Array
    depth: Array
    tube: Array
    length: Array

    __repr__ = one_line

    def where(self, mask: Array) -> "Pairs":
        """The pairs for which `mask` (K,) is true."""
        return Pairs(
            sphere=self.sphere[mask],
            offset=self.offset[mask],
            depth=self.depth[mask],
            tube=self.tube[mask],
            length=self.length[mask],
        )


def exact_volume(pairs: Pairs, *, points: int = GAUSS_POINTS) -> Array:
    """Volume (K,) m3 common to sphere and cylinder.

    Discs of the sphere, cut by the tube, are integrated along the axis: in closed form where the
    disc lies within the tube or covers it; where they cross, by a Gauss-Legendre rule of `points`
    points in the angle phi with place = middle + half sin(phi), which smooths the ends. The error
    is below 1e-6 of the sphere (study throat-occupancy).
    """
    volume = np.zeros(len(pairs.sphere))
    node, weights = np.polynomial.legendre.leggauss(points)
    angle = 0.5 * np.pi * node
    rule = np.sin(angle), 0.5 * np.pi * weights * np.cos(angle)
    _fill_volumes(pairs.sphere, pairs.offset, pairs.depth, pairs.tube, pairs.length, rule, volume)
    return volume


@compiled
def _fill_volumes(
    sphere: Array,
    offset: Array,
    depth: Array,
    tube: Array,
    length: Array,
    rule: tuple[Array, Array],
    volume: Array,
) -> None:
    for k in range(len(sphere)):
        a, d, r = sphere[k], offset[k], tube[k]
        low, high = max(-depth[k], -a), min(length[k] - depth[k], a)
        if high <= low or d >= a + r:
            continue
        covers = sqrt(max(a**2 - (r + d) ** 2, 0.0))
        crosses = sqrt(max(a**2 - (r - d) ** 2, 0.0))
        total = pi * r**2 * max(min(high, covers) - max(low, -covers), 0.0)
        if r > d:
            total += _segment(a, low, min(high, -crosses)) + _segment(a, max(low, crosses), high)
        total += _crossing(a, d, r, max(low, -crosses), min(high, -covers), rule)
        volume[k] = total + _crossing(a, d, r, max(low, covers), min(high, crosses), rule)


@compiled
def _segment(a: float, low: float, high: float) -> float:
    """Volume of the sphere of radius `a` about 0 between two planes."""
    return pi * (a**2 * (high - low) - (high**3 - low**3) / 3.0) if high > low else 0.0


@compiled
def _crossing(
    a: float, d: float, r: float, low: float, high: float, rule: tuple[Array, Array]
) -> float:
    """Integral of the lens of the sphere's disc and the tube's, whose centres are `d` apart."""
    if high <= low:
        return 0.0
    total = 0.0
    for m in range(len(rule[0])):
        square = a**2 - (0.5 * (low + high) + 0.5 * (high - low) * rule[0][m]) ** 2
        to_chord = (d**2 + r**2 - square) / (2.0 * d)
        half = sqrt(max(r**2 - to_chord**2, 0.0))
        lens = r**2 * atan2(half, to_chord) + square * atan2(half, d - to_chord) - d * half
        total += rule[1][m] * lens
    return 0.5 * (high - low) * total


@compiled
def place_by_axis(
    start: Array, end: Array, throat: Array, point: Array, image: Array
) -> tuple[Array, Array]:
    """Distance (K,) m of points from the axes of throats, and their place (K,) m along the axis.

    The point `point[image]` goes with the axis from `start[throat]` to `end[throat]`. A throat
    between two pores at one place has the direction x.
    """
    offset, depth = np.empty(len(throat)), np.empty(len(throat))
    for k in range(len(throat)):
        a, b, p = start[throat[k]], end[throat[k]], point[image[k]]
        x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        span = sqrt(x * x + y * y + z * z)
        if span > 0.0:
            x, y, z = x / span, y / span, z / span
        else:
            x = 1.0
        u, v, w = p[0] - a[0], p[1] - a[1], p[2] - a[2]
        depth[k] = u * x + v * y + w * z
        u, v, w = u - depth[k] * x, v - depth[k] * y, w - depth[k] * z
        offset[k] = sqrt(u * u + v * v + w * w)
    return offset, depth


def two_plane_volume(pairs: Pairs) -> Array:
    """Volume (K,) m3 common to sphere and cylinder, as Shi 2011 estimates it (section 3.2.2).

    It is the mean of the two caps that are cut off by the planes through the highest and the
    lowest point of the intersection curve. These are read as the plane tangent to the tube, and
    the plane of the chord through the crossings of the two circles in the section at the centre of
    the sphere. The thesis does not mention the ends; they take off the share of the sphere beyond
    them.
    """
    apart = np.maximum(pairs.offset, 1e-12 * pairs.tube)
    chord = (pairs.offset**2 + pairs.tube**2 - pairs.sphere**2) / (2.0 * apart)
    caps = [
        geometry.cap_volume(pairs.sphere, pairs.sphere + plane - pairs.offset)
        for plane in (pairs.tube, chord)
    ]
    ball = 4.0 / 3.0 * np.pi * pairs.sphere**3
    within = pairs.offset + pairs.sphere <= pairs.tube
    apart_from = pairs.offset >= pairs.tube + pairs.sphere
    across = np.where(within, ball, np.where(apart_from, 0.0, 0.5 * (caps[0] + caps[1])))
    below = [
        geometry.cap_volume(pairs.sphere, pairs.sphere + plane - pairs.depth)
        for plane in (0.0, pairs.length)
    ]
    return across * (below[1] - below[0]) / ball


def covers_section(pairs: Pairs) -> Array:
    """True (K,) where the sphere covers a whole section of the cylinder (Shi 2011, figure 39)."""
    nearest = np.clip(pairs.depth, 0.0, pairs.length) - pairs.depth
    square = pairs.sphere**2 - nearest**2
    return (
        (pairs.tube > 0)
        & (square > 0)
        & (np.sqrt(np.maximum(square, 0.0)) >= pairs.offset + pairs.tube)
    )


OVERLAPS: dict[str, Callable[[Pairs], Array]] = {
    "exact": exact_volume,
    "two-plane": two_plane_volume,
}
"""Estimates of the common volume by their names in a case."""
