"""The curve of sizes of some spheres: a law between two cuts, all moments and conversions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fdnet.sizes.laws import Array, Law, LogNormal, Points

NUMBER, SURFACE, VOLUME = 0, 2, 3
"""By what a law counts: the power of the diameter."""
CELLS = 4096
"""Cells, equal over ln d, in which a curve is tabulated."""
_WHOLE = 1e-9
"""Share at each end of a law that counts by number or surface, beyond which it is not followed
when its shares by volume are sought."""


@dataclass(frozen=True, eq=False)
class SizeCurve:
    """Diameters of spheres between two ends.

    Attributes:
        law: of the whole, beyond the ends too.
        by: the power of d by which `law` counts: 0 number, 2 surface, 3 volume.
        low: m, smallest diameter.
        high: m, largest diameter.
        below: share of the solids, by volume, that is finer than `low` and left out.
        above: share that is coarser than `high` and left out.
    """

    law: Law
    by: int
    low: float
    high: float
    below: float = 0.0
    above: float = 0.0

    @cached_property
    def edges(self) -> Array:
        """(K + 1,) diameters, m, of the table, the knots of the law among them."""
        inner = [knot for knot in self.law.knots if self.low < knot < self.high]
        equal = np.geomspace(self.low, self.high, CELLS + 1)
        equal[[0, -1]] = self.low, self.high
        return np.unique(np.concatenate([equal, inner]))

    def total(self, power: float) -> float:
        """Integral of d^power dF between the ends, F by `by`."""
        return float(np.sum(self.law.cells(power, self.edges)))

    def mean(self, power: float) -> float:
        """Mean of d^power by number, m^power."""
        if self.low == self.high:
            return self.low**power
        return self.total(power - self.by) / self.total(-self.by)

    def finer(self, weight: int = VOLUME) -> Array:
        """(K + 1,) shares finer than `edges`, by number (0), surface (2) or volume (3)."""
        sums = np.concatenate([[0.0], np.cumsum(self.law.cells(weight - self.by, self.edges))])
        return np.asarray(sums / sums[-1])

    def share_finer(self, diameter: Array, weight: int = VOLUME) -> Array:
        """(N,) shares of the spheres between the ends that are finer than `diameter` (N,) m."""
        if self.low == self.high:
            return np.asarray(np.where(np.asarray(diameter) >= self.low, 1.0, 0.0))
        return np.interp(np.log(diameter), np.log(self.edges), self.finer(weight))

    def size_at(self, share: float, weight: int = VOLUME) -> float:
        """Diameter, m, that `share` of the spheres between the ends are finer than.

        By bisection in the cell of the table that holds it.
        """
        if self.low == self.high:
            return self.low
        finer, power = self.finer(weight), weight - self.by
        cell = min(max(int(np.searchsorted(finer, share)) - 1, 0), len(finer) - 2)
        start, low, high = self.edges[cell], self.edges[cell], self.edges[cell + 1]
        rest = (share - finer[cell]) * self.total(power)
        for _ in range(40):
            middle = 0.5 * (low + high)
            inside = self.law.cells(power, np.array([start, middle]))[0]
            low, high = (middle, high) if inside < rest else (low, middle)
        return float(0.5 * (low + high))

    @property
    def kept(self) -> float:
        """Share of the solids, by volume, between the ends."""
        return 1.0 - self.below - self.above

    def strata(self, count: int) -> Array:
        """(N,) diameters, m, rising, that stand for the curve in N spheres.

        The spheres are divided into N parts of equal number, and each gets the mean volume of its
        part. So the volumes sum to N mean volumes, and the shares by volume between the parts are
        those of the curve.
        """
        if self.low == self.high:
            return np.full(count, self.low)
        cubes = self.mean(3) * count
        bounds = np.interp(np.linspace(0, 1, count + 1), self.finer(NUMBER), self.finer(VOLUME))
        return np.clip(np.cbrt(cubes * np.diff(bounds)), self.low, self.high)


@dataclass(frozen=True, slots=True, eq=False)
class Blend:
    """Several solids together, as a law that counts by volume.

    Attributes:
        shares: of each part by volume; they sum to 1.
        parts: the curve of each.
    """

    shares: tuple[float, ...]
    parts: tuple[SizeCurve, ...]

    @property
    def knots(self) -> tuple[float, ...]:
        """Ends and knots of the parts."""
        own = ((part.low, part.high, *part.law.knots) for part in self.parts)
        return tuple(sorted({knot for knots in own for knot in knots}))

    def cells(self, power: float, edges: Array) -> Array:
        """The sum of the parts' integrals, each by its share."""
        result = np.zeros(len(edges) - 1)
        for share, part in zip(self.shares, self.parts, strict=True):
            inside = np.clip(edges, part.low, part.high)
            result += share * part.law.cells(power + 3 - part.by, inside) / part.total(3 - part.by)
        return result

    def quantile(self, share: float) -> float:
        """By the table of the whole."""
        return blended(self.shares, self.parts).size_at(share)


def blended(shares: Sequence[float], parts: Sequence[SizeCurve]) -> SizeCurve:
    """The curve of several solids together; `shares` are by volume of all that is not cut.

    One part is returned as it is. What the parts leave out adds up by their shares.
    """
    if len(parts) == 1:
        return parts[0]
    total = sum(shares)
    below = sum(s * part.below for s, part in zip(shares, parts, strict=True)) / total
    above = sum(s * part.above for s, part in zip(shares, parts, strict=True)) / total
    kept = [s * part.kept for s, part in zip(shares, parts, strict=True)]
    return SizeCurve(
        law=Blend(tuple(one / sum(kept) for one in kept), tuple(parts)),
        by=VOLUME,
        low=min(part.low for part in parts),
        high=max(part.high for part in parts),
        below=below,
        above=above,
    )


def cut_curve(
    law: Law, *, by: int = VOLUME, cut: tuple[float, float] = (0.0, 1.0), finest: float = 0.0
) -> SizeCurve:
    """A law between two of its shares by volume, and nothing finer than `finest` m.

    Args:
        law: the sizes.
        by: the power of d by which it counts.
        cut: shares by volume, 0 to 1, below and above which the sizes are left out.
        finest: m, diameter below which they are left out too.
    """
    if isinstance(law, LogNormal):
        law, by = law.counted(by, VOLUME), VOLUME
    whole = law if by == VOLUME else _by_volume(law, by)
    low, high = whole.quantile(cut[0]), whole.quantile(cut[1])
    first = whole.finer[0] if isinstance(whole, Points) else 0.0
    below, above = max(cut[0], first), 1.0 - cut[1]
    if finest > low:
        low, below = finest, _share_below(whole, finest)
    return SizeCurve(law=law, by=by, low=low, high=high, below=below, above=above)


def _share_below(law: Law, size: float) -> float:
    """The share that is finer than `size` m, of a law by volume, by bisection of its quantile."""
    low, high = 0.0, 1.0
    while high - low > 4 * math.ulp(high):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if law.quantile(middle) < size else (low, middle)
    return high


def _by_volume(law: Law, by: int) -> Points:
    """The shares by volume of a law that counts by another power, as a fine table."""
    ends = (
        law.quantile(0.0 if law.knots else _WHOLE),
        law.quantile(1.0 if law.knots else 1 - 1e-15),
    )
    wide = SizeCurve(law=law, by=by, low=ends[0], high=ends[1])
    finer, keep = wide.finer(VOLUME), [0]
    keep += [i for i, (a, b) in enumerate(pairwise(finer.tolist()), 1) if b > a]
    return Points(tuple(wide.edges[keep].tolist()), tuple(finer[keep].tolist()))
