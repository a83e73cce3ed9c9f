"""Two samples over seeds against each other, and the seeds that would distinguish them.

Sources: Student (1908), Welch (1947), Holm (1979); power of the t test by the noncentral t
distribution (Owen 1965; Cohen 1988, section 2.5).
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import nct, norm
from scipy.stats import t as student

from fdnet.statistics.bands import CONFIDENCE, Band

POWER = 0.80
"""Chance of seeing a difference that is there, for which the number of seeds is computed."""
MOST_SEEDS = 10_000
_SAME = 1e-12  # Relative spread below which values count as equal


class Difference(NamedTuple):
    """How two samples of a quantity differ."""

    band: Band  # mean of the one less that of the other, with its 95 % band
    paired: bool  # whether values of the same seed were compared
    # chance of a difference as large between equal quantities; nan of one seed each
    p_value: float
    # seeds of each that show a difference of this size with a chance of 80 %; None when more than
    # MOST_SEEDS
    seeds_needed: int | None


def difference(
    one: Mapping[int, float], other: Mapping[int, float], *, paired: bool
) -> Difference:
    """Two samples by seed; `paired` where those of one seed have the same pack."""
    seeds = [seed for seed in one if seed in other]
    paired = paired and len(seeds) >= 2
    samples = [list(one.values()), list(other.values())]
    gap = float(np.mean(samples[0]) - np.mean(samples[1]))
    if paired:
        samples = [[one[seed] - other[seed] for seed in seeds]]
        gap = float(np.mean(samples[0]))
    if min(map(len, samples)) < 2:
        return Difference(Band(mean=gap, low=math.nan, high=math.nan), False, math.nan, None)
    variances = [float(np.var(values, ddof=1)) for values in samples]
    error, freedom = _error(variances, [len(values) for values in samples])
    half = float(student.ppf(0.5 + CONFIDENCE / 2, freedom)) * error
    p_value = float(gap == 0)
    if error > _SAME * abs(gap):
        p_value = float(2 * student.sf(abs(gap) / error, freedom))
    band = Band(mean=gap, low=gap - half, high=gap + half)
    return Difference(band, paired, p_value, _seeds_needed(abs(gap), variances))


def holm(p_values: Sequence[float]) -> list[bool]:
    """Which of (N,) differences are there, at 5 % for all of them together (Holm 1979).

    In the order of their p-values, the i-th smallest of m must be below 5 % / (m - i); the first
    that is not ends it.
    """
    result, open_still = [False] * len(p_values), True
    for rank, index in enumerate(np.argsort(p_values, kind="stable")):
        open_still = open_still and p_values[index] < (1 - CONFIDENCE) / (len(p_values) - rank)
        result[index] = open_still
    return result


def _error(variances: Sequence[float], counts: Sequence[int]) -> tuple[float, float]:
    """Standard error of a sum of means, and Welch's degrees of freedom."""
    parts = [variance / count for variance, count in zip(variances, counts, strict=True)]
    total = sum(parts)
    if total == 0:
        return 0.0, sum(counts) - len(counts)
    shares = ((part / total) ** 2 / (n - 1) for part, n in zip(parts, counts, strict=True))
    return math.sqrt(total), 1 / sum(shares)


def _seeds_needed(gap: float, variances: Sequence[float]) -> int | None:
    """Fewest seeds, 2 or more, that show `gap` with a chance of 80 %; None above MOST_SEEDS."""
    if math.sqrt(sum(variances)) <= _SAME * gap:
        return 2 if gap else None
    if not gap or _power(gap, variances, MOST_SEEDS) < POWER:
        return None
    low, high = 1, MOST_SEEDS
    while high - low > 1:
        middle = (low + high) // 2
        enough = _power(gap, variances, middle) >= POWER
        low, high = (low, middle) if enough else (middle, high)
    return high


def _power(gap: float, variances: Sequence[float], count: int) -> float:
    """Chance that a two-sided t test at 5 % of `count` seeds of each shows `gap`."""
    error, freedom = _error(variances, [count] * len(variances))
    limit = float(student.ppf(0.5 + CONFIDENCE / 2, freedom))
    upper, lower = nct.sf(limit, freedom, gap / error), nct.cdf(-limit, freedom, gap / error)
    if math.isnan(upper):  # scipy's series ends far out in the tails
        upper = norm.sf(limit - gap / error)
    return float(upper) + (0.0 if math.isnan(lower) else float(lower))
