"""Laws of size: the share of the solids that is finer than a diameter.

A law counts by number, by surface or by volume (equal to mass where all solids have one density);
`fdnet.sizes.curve` says by which. It gives its integrals over ranges of size, from which all
moments and conversions follow.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_GAUSS_POINTS = 8
"""Points of the Gauss-Legendre rule in a cell; on cells of 1/4096 of a curve it is exact to
rounding, on a whole curve the caller divides it first."""


class Law(Protocol):
    """A law of size, F(d): the share that is finer than the diameter d."""

    @property
    def knots(self) -> tuple[float, ...]:
        """Diameters, m, at which the density of the law jumps."""

    def cells(self, power: float, edges: Array) -> Array:
        """(K,) integrals of d^power dF between neighbours of `edges` (K + 1,) m, which rise."""

    def quantile(self, share: float) -> float:
        """The diameter, m, below which lies `share` (0 to 1)."""


@dataclass(frozen=True, slots=True)
class LogNormal:
    """ln d is normal, with the mean ln `median` and the standard deviation `spread`.

    Attributes:
        median: m.
        spread: natural logarithm of the geometric standard deviation.
    """

    median: float
    spread: float

    @property
    def knots(self) -> tuple[float, ...]:
        """None: the density is smooth."""
        return ()

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
class RosinRammler:
    """F = 1 - exp(-(d / scale)^exponent) (Rosin and Rammler 1933, Weibull).

    Attributes:
        scale: m, the diameter that 63.2 % are finer than.
        exponent: the larger, the narrower.
    """

    scale: float
    exponent: float

    @property
    def knots(self) -> tuple[float, ...]:
        """None: the density is smooth."""
        return ()

    def cells(self, power: float, edges: Array) -> Array:
        """scale^p times the integral of u^(p/n) exp(-u) du, u = (d / scale)^n.

        It is a difference of incomplete gamma functions, by Gauss and Legendre in ln u.
        """
        order = 1 + power / self.exponent

        def density(log_u: Array) -> Array:
            return np.asarray(np.exp(order * log_u - np.exp(log_u)))

        log_u = self.exponent * (np.log(edges) - math.log(self.scale))
        return np.asarray(self.scale**power * _gauss(density, log_u))

    def quantile(self, share: float) -> float:
        """scale (-ln(1 - share))^(1 / exponent)."""
        return self.scale * float((-math.log1p(-share)) ** (1 / self.exponent))


@dataclass(frozen=True, slots=True)
class Uniform:
    """All diameters between two ends are equally frequent.

    Attributes:
        low: m, smallest diameter.
        high: m, largest diameter.
    """

    low: float
    high: float

    @property
    def knots(self) -> tuple[float, ...]:
        """None inside its ends."""
        return ()

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
class Points:
    """Measured points, joined by straight lines over ln d (as on the usual paper).

    Attributes:
        size: m, diameters that rise.
        finer: shares (0 to 1) that are finer than each, which rise to 1. A first share above 0
            is finer than the smallest size, by how much is not known.
    """

    size: tuple[float, ...]
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


def _gauss(density: Callable[[Array], Array], edges: Array) -> Array:
    """(K,) integrals of `density` between neighbours of `edges` (K + 1,)."""
    nodes, weights = _rule()
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    return np.asarray(half * (density(middle[:, None] + half[:, None] * nodes) @ weights))


@lru_cache(maxsize=1)
def _rule() -> tuple[Array, Array]:
    nodes, weights = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    return nodes, weights
