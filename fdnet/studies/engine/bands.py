"""Means over seeds, their 95 % bands, and whether two of them differ."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

CONFIDENCE = 0.95
FEWEST = 3
"""Runs that a spread is taken from; fewer say too little of it."""
ROUNDING = 1e-9
"""What counts as no difference: relative, among values of one sample."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """`values` (R,) of one quantity, one a seed. When they are fewer than FEWEST their spread is that of `lent` (L,),
    values of the quick form, times `widened`."""

    values: tuple[float, ...]
    lent: tuple[float, ...] = ()
    widened: float = 1.0

    @property
    def mean(self) -> float:
        """Mean; nan without values."""
        return float(np.mean(self.values)) if self.values else math.nan

    @property
    def spread_of(self) -> str:
        """Whose spread is used: "seeds", "quick form" or "" when none is known."""
        if not self.values:
            return ""
        if len(self.values) >= FEWEST:
            return "seeds"
        return "quick form" if len(self.lent) >= FEWEST else ""

    @property
    def error(self) -> tuple[float, int]:
        """Variance of the mean, and its degrees of freedom; (nan, 0) when the spread is not known."""
        if not self.spread_of:
            return math.nan, 0
        own = self.spread_of == "seeds"
        values, factor = (self.values, 1.0) if own else (self.lent, self.widened)
        same = np.ptp(values) <= ROUNDING * np.max(np.abs(values))
        variance = 0.0 if same else factor**2 * float(np.var(values, ddof=1))
        return variance / len(self.values), len(values) - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """`mean` and its 95 % band [low, high], nan where the spread is not known."""

    mean: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Half of the band."""
        return (self.high - self.low) / 2

    def less(self, value: float) -> "Band":
        """The band of the mean less a known value."""
        return Band(mean=self.mean - value, low=self.low - value, high=self.high - value)


def band(sample: Sample) -> Band:
    """Student's band of the mean."""
    return _band(sample.mean, [sample.error])


def difference(one: Sample, other: Sample) -> Band:
    """Mean of `one` less that of `other`, with Welch's band: spreads need not be equal, nor the runs paired.

    Degrees of freedom by Welch and Satterthwaite, (a + b)^2 / (a^2 / n_a + b^2 / n_b) for variances a, b of the means.
    """
    return _band(one.mean - other.mean, [one.error, other.error])


def _band(mean: float, errors: list[tuple[float, int]]) -> Band:
    variance = sum(error for error, _ in errors)
    if not variance > 0:
        # no scatter at all, or (nan) none known
        return Band(mean=mean, low=mean - variance, high=mean + variance)
    freedom = 1 / sum((error / variance) ** 2 / count for error, count in errors if error > 0)
    half = float(student.ppf(0.5 + CONFIDENCE / 2, freedom)) * math.sqrt(variance)
    return Band(mean=mean, low=mean - half, high=mean + half)
