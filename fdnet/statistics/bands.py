"""A mean and its 95 % band, by Student (1908)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A mean and its 95 % band."""

    mean: float  # the mean
    low: float  # lower end of the band; nan where the spread is not known
    high: float  # upper end of the band; nan where the spread is not known
    cut: tuple[float, ...] = ()  # bounds of the quantity at which the band was cut

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


def student_band(values: Sequence[float]) -> Band:
    """Mean of (N,) values with Student's 95 % band; nan ends for a single value."""
    mean = float(np.mean(values)) if len(values) else math.nan
    half = _half(float(np.std(values, ddof=1)), len(values)) if len(values) > 1 else math.nan
    return Band(mean=mean, low=mean - half, high=mean + half)


def seeds_for_width(values: Sequence[float], half_width: float, most: int) -> int:
    """Fewest seeds whose 95 % band is expected to be within `half_width`, at most `most`.

    The spread is that of `values`: the first n with t(n-1) s / sqrt(n) <= half_width.
    """
    spread = float(np.std(values, ddof=1))
    return next((n for n in range(2, most) if _half(spread, n) <= half_width), most)


def _half(spread: float, count: int) -> float:
    return float(student.ppf(0.5 + CONFIDENCE / 2, count - 1)) * spread / math.sqrt(count)
