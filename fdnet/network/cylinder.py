"""Volume of spheres inside a cylinder with flat ends: exact, and as the thesis averages two cut caps.

K sphere-cylinder pairs: `sphere` (K,) radius, `offset` (K,) distance of the centre from the axis, `depth` (K,) place of
the centre along the axis, `tube` (K,) radius, `length` (K,) of the cylinder, which spans depth 0 to length. Lengths m.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fdnet.network import geometry
from fdnet.snapshot import Array

GAUSS_POINTS = 6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pairs:
    """Sphere-cylinder pairs, all (K,) m."""

    sphere: Array
    offset: Array
    depth: Array
    tube: Array
    length: Array

    def where(self, mask: Array) -> "Pairs":
        """The pairs for which `mask` (K,) is true."""
        return Pairs(
            sphere=self.sphere[mask],
            offset=self.offset[mask],
            depth=self.depth[mask],
            tube=self.tube[mask],
            length=self.length[mask],
        )


def exact_volume(pairs: Pairs) -> Array:
    """Volume (K,) m3 common to sphere and cylinder: discs of the sphere cut by the tube, integrated along the axis.

    Gauss-Legendre in the polar angle of the sphere, piece by piece between the changes of kind of the section.
    """
    volume = np.zeros(len(pairs.sphere))
    low, high = np.maximum(pairs.depth - pairs.sphere, 0.0), np.minimum(pairs.depth + pairs.sphere, pairs.length)
    touched = (high > low) & (pairs.offset < pairs.sphere + pairs.tube)
    whole = touched & (pairs.offset + pairs.sphere <= pairs.tube)
    whole &= (pairs.depth >= pairs.sphere) & (pairs.depth + pairs.sphere <= pairs.length)
    volume[whole] = 4.0 / 3.0 * np.pi * pairs.sphere[whole] ** 3
    cut = touched & ~whole
    volume[cut] = _integrated(pairs.where(cut), low[cut], high[cut])
    return volume


def _integrated(pairs: Pairs, low: Array, high: Array) -> Array:
    edges = _polar_edges(pairs, low, high)
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    total = np.zeros(len(low))
    for start, end in pairwise(edges):
        half = 0.5 * (end - start)
        for point, weight in zip(points, weights, strict=True):
            disc = pairs.sphere * np.cos(start + half * (1.0 + point))
            total += weight * half * disc * geometry.disc_lens_area(disc, pairs.tube, pairs.offset)
    return total


def _polar_edges(pairs: Pairs, low: Array, high: Array) -> Array:
    """Angles (6, K) between which the section keeps one kind: disc within tube, crossing it, or tube within disc."""
    start = np.arcsin(np.clip((low - pairs.depth) / pairs.sphere, -1.0, 1.0))
    end = np.arcsin(np.clip((high - pairs.depth) / pairs.sphere, -1.0, 1.0))
    crossing = np.arccos(np.minimum(np.abs(pairs.tube - pairs.offset) / pairs.sphere, 1.0))
    covering = np.arccos(np.minimum((pairs.tube + pairs.offset) / pairs.sphere, 1.0))
    return np.clip([start, -crossing, -covering, covering, crossing, end], start, end)


def two_plane_volume(pairs: Pairs) -> Array:
    """Volume (K,) m3 as Shi 2011 estimates it (section 3.2.2): mean of the two caps cut by the planes across the
    highest and the lowest point of the intersection curve.

    Read as: the plane tangent to the tube, and the plane of the chord through the crossings of the two circles in
    the section at the sphere's centre. The ends, of which the thesis says nothing, take off their zone's share.
    """
    apart = np.maximum(pairs.offset, 1e-12 * pairs.tube)
    chord = (pairs.offset**2 + pairs.tube**2 - pairs.sphere**2) / (2.0 * apart)
    caps = [geometry.cap_volume(pairs.sphere, pairs.sphere + plane - pairs.offset) for plane in (pairs.tube, chord)]
    ball = 4.0 / 3.0 * np.pi * pairs.sphere**3
    within = pairs.offset + pairs.sphere <= pairs.tube
    apart_from = pairs.offset >= pairs.tube + pairs.sphere
    across = np.where(within, ball, np.where(apart_from, 0.0, 0.5 * (caps[0] + caps[1])))
    below = [geometry.cap_volume(pairs.sphere, pairs.sphere + plane - pairs.depth) for plane in (0.0, pairs.length)]
    return across * (below[1] - below[0]) / ball


def covers_section(pairs: Pairs) -> Array:
    """True (K,) where the sphere covers a whole cross-section of the cylinder (Shi 2011, figure 39)."""
    nearest = np.clip(pairs.depth, 0.0, pairs.length) - pairs.depth
    square = pairs.sphere**2 - nearest**2
    return (pairs.tube > 0) & (square > 0) & (np.sqrt(np.maximum(square, 0.0)) >= pairs.offset + pairs.tube)


OVERLAPS: dict[str, Callable[[Pairs], Array]] = {"exact": exact_volume, "two-plane": two_plane_volume}
