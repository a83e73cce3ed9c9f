"""Curves of sphere sizes: laws of size, what is between two cuts of them, and samples.

A law counts by number, by surface or by volume (equal to mass where all solids have one density);
a `SizeCurve` says by which. It gives its integrals over ranges of size, from which all moments and
conversions follow.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from statistics import NormalDist
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Law(Protocol):
    """A law of size, F(d): the share that is finer than the diameter d."""

    @property
    def knots(self) -> tuple[float, ...]:
        """Diameters, m, at which the density of the law jumps; none where it is smooth."""
        return ()

    def cells(self, power: float, edges: Array) -> Array:
        """(K,) integrals of d^power dF between neighbours of `edges` (K + 1,) m, which rise."""

    def quantile(self, share: float) -> float:
        """The diameter, m, below which lies `share` (0 to 1)."""


@dataclass(frozen=True, slots=True)
class LogNormal(Law):
    """ln d is normal, with the mean ln `median` and the standard deviation `spread`."""

    median: float  # m
    spread: float  # natural logarithm of the geometric standard deviation

    def cells(self, power: float, edges: Array) -> Array:
        """exp(p mu + p^2 s^2 / 2) times the normal distribution shifted by p s^2.

        Hatch and Choate, J. Franklin Inst. 207 (1929) 369.
        """
        mean, spread = math.log(self.median), self.spread
        scale = math.exp(power * mean + 0.5 * (power * spread) ** 2)
        return scale * _normal_shares((np.log(edges) - mean) / spread - power * spread)

    def quantile(self, share: float) -> float:
        """median exp(z spread), with the normal quantile z."""
        return self.median * math.exp(self.spread * NormalDist().inv_cdf(share))

    def counted(self, before: int, after: int) -> "LogNormal":
        """The same solids counted by another power of d (0 number, 2 surface, 3 volume).

        The spread stays and ln median moves by the difference of powers times spread^2 (Hatch and
        Choate 1929).
        """
        shift = (after - before) * self.spread**2
        return LogNormal(self.median * math.exp(shift), self.spread)


@dataclass(frozen=True, slots=True)
class RosinRammler(Law):
    """F = 1 - exp(-(d / scale)^exponent) (Rosin and Rammler 1933, Weibull)."""

    scale: float  # m, the diameter that 63.2 % are finer than
    exponent: float  # the larger, the narrower

    def cells(self, power: float, edges: Array) -> Array:
        """scale^p times the integral of u^(p/n) exp(-u) du, u = (d / scale)^n.

        It is a difference of incomplete gamma functions, by 8 points of Gauss and Legendre in ln u
        in each cell; on cells of 1/4096 of a curve they are exact to rounding.
        """
        order = 1 + power / self.exponent
        nodes, weights = np.polynomial.legendre.leggauss(8)
        ends = self.exponent * (np.log(edges) - math.log(self.scale))
        half, middle = 0.5 * np.diff(ends), 0.5 * (ends[1:] + ends[:-1])
        log_u = middle[:, None] + half[:, None] * nodes
        return np.asarray(
            self.scale**power * (half * (np.exp(order * log_u - np.exp(log_u)) @ weights))
        )

    def quantile(self, share: float) -> float:
        """scale (-ln(1 - share))^(1 / exponent)."""
        return self.scale * float((-math.log1p(-share)) ** (1 / self.exponent))


@dataclass(frozen=True, slots=True)
class Uniform(Law):
    """All diameters between two ends are equally frequent."""

    low: float  # m, smallest diameter
    high: float  # m, largest diameter

    def cells(self, power: float, edges: Array) -> Array:
        """Integral of d^p over the width of the range."""
        inside = np.clip(edges, self.low, self.high)
        if power == -1:
            return np.diff(np.log(inside)) / (self.high - self.low)
        return np.diff(inside ** (power + 1)) / ((power + 1) * (self.high - self.low))

    def quantile(self, share: float) -> float:
        """Linear between the ends."""
        return self.low + share * (self.high - self.low)


@dataclass(frozen=True, slots=True)
class Points(Law):
    """Measured points, joined by straight lines over ln d (as on the usual paper)."""

    size: tuple[float, ...]  # m, diameters that rise
    # shares (0 to 1) that are finer than each, which rise to 1. A first share above 0 is finer
    # than the smallest size, by how much is not known
    finer: tuple[float, ...]

    @property
    def knots(self) -> tuple[float, ...]:
        """The measured diameters."""
        return self.size

    def cells(self, power: float, edges: Array) -> Array:
        """Exact for edges that hold the knots: the density over ln d is constant in a cell."""
        size = np.array(self.size)
        inside = np.clip(edges, size[0], size[-1])
        logs = np.log(inside)
        middle = 0.5 * (logs[1:] + logs[:-1])
        piece = np.clip(np.searchsorted(np.log(size), middle) - 1, 0, len(size) - 2)
        density = (np.diff(self.finer) / np.diff(np.log(size)))[piece]
        width = np.diff(logs) if power == 0 else np.diff(inside**power) / power
        return np.asarray(density * width)

    def quantile(self, share: float) -> float:
        """Linear over ln d; the smallest size where the share is below the first one."""
        return float(np.exp(np.interp(share, self.finer, np.log(self.size))))


def _normal_shares(z: Array) -> Array:
    """Differences of the normal distribution between neighbours of `z` (K + 1,).

    By the complementary error function on the side of the smaller tail, so that far tails keep
    their digits.
    """
    tail = np.array([0.5 * math.erfc(abs(one) / math.sqrt(2)) for one in z.tolist()])
    below, above = z[:-1] < 0, z[1:] > 0
    same_side = np.where(below, tail[1:] - tail[:-1], tail[:-1] - tail[1:])
    return np.asarray(np.where(below & above, 1 - tail[1:] - tail[:-1], same_side))


# ---- The curve of sizes of some spheres: a law between two cuts, all moments and conversions.
NUMBER, SURFACE, VOLUME = 0, 2, 3  # By what a law counts: the power of the diameter
CELLS = 4096  # Cells, equal over ln d, in which a curve is tabulated
_WHOLE = 1e-9
"""Share at each end of a law that counts by number or surface, beyond which it is not followed
when its shares by volume are sought."""


@dataclass(frozen=True, eq=False)
class SizeCurve:
    """Diameters of spheres between two ends."""

    law: Law  # of the whole, beyond the ends too
    by: int  # the power of d by which `law` counts: 0 number, 2 surface, 3 volume
    low: float  # m, smallest diameter
    high: float  # m, largest diameter
    below: float = 0.0  # share of the solids, by volume, that is finer than `low` and left out
    above: float = 0.0  # share that is coarser than `high` and left out

    @cached_property
    def edges(self) -> Array:
        """(K + 1,) diameters, m, of the table, the knots of the law among them."""
        inner = [knot for knot in self.law.knots if self.low < knot < self.high]
        equal = np.geomspace(self.low, self.high, CELLS + 1)
        equal[[0, -1]] = self.low, self.high
        return np.unique(np.concatenate([equal, inner]))

    @cached_property
    def _known(self) -> dict[float, Array]:
        """By power the `cells` so far: a run asks for the same few thousands of times."""
        return {}

    def cells(self, power: float) -> Array:
        """(K,) integrals of d^power dF between neighbours of `edges`, F by `by`."""
        if power not in self._known:
            self._known[power] = self.law.cells(power, self.edges)
        return self._known[power]

    def total(self, power: float) -> float:
        """Integral of d^power dF between the ends, F by `by`."""
        return float(np.sum(self.cells(power)))

    def mean(self, power: float) -> float:
        """Mean of d^power by number, m^power."""
        if self.low == self.high:
            return self.low**power
        return self.total(power - self.by) / self.total(-self.by)

    def finer(self, weight: int = VOLUME) -> Array:
        """(K + 1,) shares finer than `edges`, by number (0), surface (2) or volume (3)."""
        sums = np.concatenate([[0.0], np.cumsum(self.cells(weight - self.by))])
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
class Blend(Law):
    """Several solids together, as a law that counts by volume."""

    shares: tuple[float, ...]  # of each part by volume; they sum to 1
    parts: tuple[SizeCurve, ...]  # the curve of each

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


# ---- Sorted spheres dealt out to batches so that each batch has the curve of all.
def dealt(counts: Sequence[int], rng: np.random.Generator) -> list[NDArray[np.int64]]:
    """For each batch the indices, into spheres sorted by size, that it gets.

    Every batch divides the sorted spheres into as many parts as it has spheres and takes one of
    each, at a random place (a Latin hypercube), so that each sphere goes to one batch.

    Args:
        counts: number of spheres in each batch.
        rng: gives the places.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.concatenate([(np.arange(n) + rng.random(n)) / n for n in counts])
    order = owner[np.argsort(place, kind="stable")]
    return [np.flatnonzero(order == batch) for batch in range(len(counts))]


def volume_quantiles(diameter: Array, shares: Sequence[float]) -> list[float]:
    """Diameters, m, that the `shares` by volume of some spheres (N,) m are finer than.

    Each sphere's volume is spread half below and half above its diameter.
    """
    rising = np.sort(diameter)
    volume = rising**3
    middle = (np.cumsum(volume) - 0.5 * volume) / np.sum(volume)
    return [float(one) for one in np.exp(np.interp(shares, middle, np.log(rising)))]


# ---- Laws of size through measured points, and by how much they miss them.
LOG_NORMAL, ROSIN_RAMMLER = "log-normal", "rosin-rammler"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A law through some points."""

    name: str  # "log-normal" or "rosin-rammler"
    law: LogNormal | RosinRammler  # the law
    misfit: dict[float, float]  # by point, the diameter of the law over the given one, less 1

    @property
    def worst(self) -> float:
        """The largest misfit, without its sign."""
        return max(abs(one) for one in self.misfit.values())


def best_fit(points: Mapping[float, float], name: str | None = None) -> Fit:
    """The law that is nearest to diameters (m) by the share finer (0 to 1).

    It is the law called `name`, or of the two the one with the smaller misfit in the mean square.
    Two points are met by both; then it is the log-normal law. Least squares of ln d over the
    normal quantile, or over ln(-ln(1 - share)) for the law of Rosin and Rammler.
    """
    names = [LOG_NORMAL, ROSIN_RAMMLER] if name is None else [name]
    fits = [_fit(one, points) for one in (names[:1] if len(points) <= 2 else names)]
    return min(fits, key=lambda fit: sum(math.log1p(one) ** 2 for one in fit.misfit.values()))


def _fit(name: str, points: Mapping[float, float]) -> Fit:
    if name == LOG_NORMAL:
        place = [NormalDist().inv_cdf(share) for share in points]
    else:
        place = [math.log(-math.log1p(-share)) for share in points]
    logs = [math.log(size) for size in points.values()]
    slope, mean = map(float, np.polynomial.Polynomial.fit(place, logs, 1).convert().coef[::-1])
    law: LogNormal | RosinRammler = LogNormal(math.exp(mean), slope)
    if name == ROSIN_RAMMLER:
        law = RosinRammler(math.exp(mean), 1 / slope)
    misfit = {share: law.quantile(share) / size - 1 for share, size in points.items()}
    return Fit(name=name, law=law, misfit=misfit)
