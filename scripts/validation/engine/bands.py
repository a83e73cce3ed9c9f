"""Means over seeds, their 95 % bands, and whether two of them differ; bands of counted shares."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from fdnet.statistics.bands import CONFIDENCE, Band

FEWEST = 3
"""The spread of a sample is taken from at least so many runs; fewer say too little of it."""
ROUNDING = 1e-9
"""Relative differences within a sample below this one count as none."""
Z_95 = 1.959963984540054
"""Standard normal quantile of 97.5 %."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """Values of one quantity, one of each seed.

    Attributes:
        values: (R,) the values themselves.
        lent: (L,) values of the quick form, whose spread stands in where R is below `FEWEST`.
        widened: factor on the spread of `lent`.
    """

    values: tuple[float, ...]
    lent: tuple[float, ...] = ()
    widened: float = 1.0

    @property
    def mean(self) -> float:
        """Mean; nan without values."""
        return float(np.mean(self.values)) if self.values else math.nan

    @property
    def spread_of(self) -> str:
        """Where the spread comes from: "seeds", "quick form", or "" when none is known."""
        if not self.values:
            return ""
        if len(self.values) >= FEWEST:
            return "seeds"
        return "quick form" if len(self.lent) >= FEWEST else ""

    @property
    def error(self) -> tuple[float, int]:
        """Variance of the mean and its degrees of freedom; (nan, 0) without a known spread."""
        if not self.spread_of:
            return math.nan, 0
        own = self.spread_of == "seeds"
        values, factor = (self.values, 1.0) if own else (self.lent, self.widened)
        same = np.ptp(values) <= ROUNDING * np.max(np.abs(values))
        variance = 0.0 if same else factor**2 * float(np.var(values, ddof=1))
        return variance / len(self.values), len(values) - 1


def band(sample: Sample) -> Band:
    """Student's band of the mean."""
    return _band(sample.mean, [sample.error])


def difference(one: Sample, other: Sample) -> Band:
    """Mean of `one` less that of `other`, with the band of Welch (1947).

    Spreads need not be equal, nor the runs paired. For variances a and b of the two means, with
    n_a and n_b degrees of freedom, those of the difference are (a + b)^2 / (a^2/n_a + b^2/n_b).
    """
    return _band(one.mean - other.mean, [one.error, other.error])


def half_width(values: Sequence[float]) -> float:
    """Half of Student's 95 % band of the mean of `values`; 0 of a single value."""
    count = len(values)
    if count < 2:
        return 0.0
    return float(_quantile(count - 1) * np.std(values, ddof=1) / math.sqrt(count))


def _quantile(freedom: float) -> float:
    """Student's t that the 95 % band reaches, for so many degrees of freedom."""
    return float(student.ppf(0.5 + CONFIDENCE / 2, freedom))


def _band(mean: float, errors: list[tuple[float, int]]) -> Band:
    variance = sum(error for error, _ in errors)
    if not variance > 0:
        # no scatter at all, or (nan) none known
        return Band(mean=mean, low=mean - variance, high=mean + variance)
    freedom = 1 / sum((error / variance) ** 2 / count for error, count in errors if error > 0)
    half = _quantile(freedom) * math.sqrt(variance)
    return Band(mean=mean, low=mean - half, high=mean + half)


def wilson_interval(part: float, total: float) -> tuple[float, float]:
    """The 95 % interval of a binomial share `part` / `total`; nan without trials.

    Both may be weighted sums, which scipy.stats.binomtest does not take.

    Source: Wilson 1927, J. Am. Stat. Assoc. 22, 209.
    """
    if total <= 0:
        return math.nan, math.nan
    square = Z_95**2 / total
    share = part / total
    spread = Z_95 * math.sqrt(part * (total - part) / total + 0.25 * Z_95**2) / total
    low = (share + 0.5 * square - spread) / (1.0 + square)
    high = (share + 0.5 * square + spread) / (1.0 + square)
    return max(0.0, min(share, low)), min(1.0, max(share, high))
