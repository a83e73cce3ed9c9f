"""Two variants against each other: their difference, and the seeds that would distinguish them.

Sources: Student (1908), Welch (1947), Holm (1979); power of the t test by the noncentral t
distribution (Owen 1965; Cohen 1988, section 2.5).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import nct, norm
from scipy.stats import t as student

from fdnet.statistics.bands import CONFIDENCE, Band

POWER = 0.80
"""Chance of seeing a difference that is there, for which the number of seeds is computed."""
MOST_SEEDS = 10_000
SAME = 1e-12
"""Relative spread below which values count as equal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """How two variants differ in one quantity.

    Attributes:
        one: name of a variant.
        other: name of another.
        difference: mean of `one` less that of `other`, with its 95 % band.
        paired: whether runs of the same seed were compared, which have the same pack.
        p_value: chance of a difference as large between equal variants.
        apart: whether they differ, at 5 % for all pairs together (Holm).
        seeds_needed: seeds of each that show a difference of this size with a chance of 80 %;
            None when more than MOST_SEEDS.
    """

    one: str
    other: str
    difference: Band
    paired: bool
    p_value: float
    apart: bool
    seeds_needed: int | None


def student_band(values: Sequence[float]) -> Band:
    """Mean and Student's 95 % band, from two values on; nan ends for a single one."""
    if len(values) < 2:
        mean = float(np.mean(values)) if len(values) else math.nan
        return Band(mean=mean, low=math.nan, high=math.nan)
    mean, half = float(np.mean(values)), _half(float(np.std(values, ddof=1)), len(values))
    return Band(mean=mean, low=mean - half, high=mean + half)


def seeds_for_width(values: Sequence[float], half_width: float, most: int) -> int:
    """Fewest seeds whose 95 % band is expected to be within `half_width`, at most `most`.

    The spread is that of `values`: the first n with t(n-1) s / sqrt(n) <= half_width.
    """
    spread = float(np.std(values, ddof=1))
    return next((n for n in range(2, most) if _half(spread, n) <= half_width), most)


def compare_pair(
    names: tuple[str, str],
    one: Mapping[int, float],
    other: Mapping[int, float],
    *,
    paired: bool,
) -> Pair:
    """Two variants by seed; `paired` where runs of one seed have the same pack.

    `apart` is by this pair alone; `holm` decides it for several.
    """
    seeds = [seed for seed in one if seed in other]
    if paired and len(seeds) >= 2:
        gaps = [one[seed] - other[seed] for seed in seeds]
        gap, spread, count = student_band(gaps), float(np.std(gaps, ddof=1)), len(gaps)
        p_value = _p_value(gap.mean, spread / math.sqrt(count), count - 1)
        needed = paired_seeds(gap.mean, spread)
    else:
        paired, gap, p_value, needed = False, *_welch(list(one.values()), list(other.values()))
    return Pair(
        one=names[0],
        other=names[1],
        difference=gap,
        paired=paired,
        p_value=p_value,
        apart=p_value < 1 - CONFIDENCE,
        seeds_needed=needed,
    )


def _welch(one: Sequence[float], other: Sequence[float]) -> tuple[Band, float, int | None]:
    """Difference of independent means, its p-value, and the seeds of each that would show it."""
    gap = float(np.mean(one) - np.mean(other))
    if min(len(one), len(other)) < 2:
        return Band(mean=gap, low=math.nan, high=math.nan), math.nan, None
    errors = [float(np.var(values, ddof=1)) / len(values) for values in (one, other)]
    total = sum(errors)
    freedom = _freedom(errors, (len(one), len(other)))
    half = float(student.ppf(0.5 + CONFIDENCE / 2, freedom)) * math.sqrt(total)
    spreads = (float(np.std(one, ddof=1)), float(np.std(other, ddof=1)))
    return (
        Band(mean=gap, low=gap - half, high=gap + half),
        _p_value(gap, math.sqrt(total), freedom),
        separate_seeds(gap, *spreads),
    )


def _freedom(errors: Sequence[float], counts: Sequence[int]) -> float:
    """Welch's degrees of freedom of the sum of these variances of means."""
    total = sum(errors)
    if total == 0:
        return sum(counts) - len(counts)
    return 1 / sum((e / total) ** 2 / (n - 1) for e, n in zip(errors, counts, strict=True))


def holm(pairs: Sequence[Pair]) -> list[Pair]:
    """The pairs with `apart` decided for all of them together (Holm 1979).

    In the order of their p-values, the i-th smallest of m must be below 5 % / (m - i); the first
    that is not ends it.
    """
    p_values = [pair.p_value for pair in pairs]
    order = sorted(range(len(pairs)), key=lambda i: (math.isnan(p_values[i]), p_values[i]))
    result, open_still = list(pairs), True
    for rank, index in enumerate(order):
        limit = (1 - CONFIDENCE) / (len(pairs) - rank)
        open_still = open_still and pairs[index].p_value < limit
        result[index] = replace(pairs[index], apart=open_still)
    return result


def paired_seeds(gap: float, spread: float) -> int | None:
    """Fewest pairs of runs for a power of 80 %: differences of mean `gap` and this spread."""
    return _fewest(lambda n: _power(abs(gap) * math.sqrt(n) / spread, n - 1), gap, spread)


def separate_seeds(gap: float, one: float, other: float) -> int | None:
    """Fewest seeds of each of two independent variants of these spreads for a power of 80 %."""

    def power(n: int) -> float:
        errors = (one**2 / n, other**2 / n)
        return _power(abs(gap) / math.sqrt(sum(errors)), _freedom(errors, (n, n)))

    return _fewest(power, gap, math.hypot(one, other))


def _fewest(power: Callable[[int], float], gap: float, spread: float) -> int | None:
    """The smallest n, 2 or more, whose power is enough, by bisection; None above MOST_SEEDS."""
    if spread <= SAME * abs(gap):
        return 2 if gap else None
    if not gap or power(MOST_SEEDS) < POWER:
        return None
    low, high = 1, MOST_SEEDS
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power(middle) >= POWER else (middle, high)
    return high


def _power(shift: float, freedom: float) -> float:
    """Chance that a two-sided t test at 5 % rejects, for a mean `shift` standard errors off."""
    limit = float(student.ppf(0.5 + CONFIDENCE / 2, freedom))
    upper, lower = nct.sf(limit, freedom, shift), nct.cdf(-limit, freedom, shift)
    if math.isnan(upper):  # scipy's series ends far out in the tails
        upper = norm.sf(limit - shift)
    return float(upper) + (0.0 if math.isnan(lower) else float(lower))


def _p_value(gap: float, error: float, freedom: float) -> float:
    if error <= SAME * abs(gap):
        return 1.0 if gap == 0 else 0.0
    return float(2 * student.sf(abs(gap) / error, freedom))


def _half(spread: float, count: int) -> float:
    return float(student.ppf(0.5 + CONFIDENCE / 2, count - 1)) * spread / math.sqrt(count)
