"""Means over seeds, their 95 % bands, and whether two of them differ."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

CONFIDENCE = 0.95
FEWEST = 3
"""The spread of a sample is taken from at least so many runs; fewer say too little of it."""
ROUNDING = 1e-9
"""Relative differences within a sample below this one count as none."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A mean and its 95 % band.

    Attributes:
        mean: the mean.
        low: lower end of the band; nan where the spread is not known.
        high: upper end of the band; nan where the spread is not known.
        cut: bounds of the quantity at which the band was cut.
    """

    mean: float
    low: float
    high: float
    cut: tuple[float, ...] = ()

    @property
    def half_width(self) -> float:
        """Half of the band."""
        return (self.high - self.low) / 2

    def within(self, least: float, most: float) -> "Band":
        """The band without values that the quantity cannot take: below `least`, above `most`.

        It covers the true mean as often as the whole band does, because the mean cannot lie in
        what is cut off.
        """
        beyond = ((least, self.low < least), (most, self.high > most))
        return Band(
            mean=self.mean,
            low=least if self.low < least else self.low,
            high=most if self.high > most else self.high,
            cut=tuple(bound for bound, is_beyond in beyond if is_beyond),
        )

    def less(self, value: float) -> "Band":
        """The band of the mean less a known value."""
        return Band(mean=self.mean - value, low=self.low - value, high=self.high - value)


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
