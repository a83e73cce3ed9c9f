"""Bands of shares that were counted."""

import math

Z_95 = 1.959963984540054
"""Standard normal quantile of 97.5 %."""


def wilson_interval(part: float, total: float) -> tuple[float, float]:
    """The 95 % interval of a binomial share `part` / `total`; nan without trials.

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
