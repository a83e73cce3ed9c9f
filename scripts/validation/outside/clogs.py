"""Statistics of clogs: the probability that the next fine starts one, and how it falls with R.

The chance is constant once a heap stands on the hole, so the number of fines that escape before a
clog is geometric; its logarithm is linear in R^2 - 1, R the diameter of the hole over that of the
fines (Lafond and others, AIChE 2013, paper 172h; Lafond's thesis, Colorado School of Mines 2014).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta, chi2

from fdnet.spheres.snapshot import Array

CONFIDENCE = 0.95
HEAP_DENSITY = 0.6
"""Volume fraction of a heap of equal spheres."""
DRAWS = 2000
FEWEST = 5
"""Clogs below which a probability is not fitted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clogging:
    """The probability of a clog for each fine that comes to a hole.

    Attributes:
        clogs: number of clogs after the first `under_arch` fines that escaped.
        escapes: fines that escaped after them.
        early: runs in which fewer escaped, which are not counted.
        counted: the other runs.
        low: lower end of the 95 % band of the probability.
        high: upper end of the band.
    """

    clogs: int
    escapes: int
    early: int
    counted: int
    low: float
    high: float

    @property
    def probability(self) -> float:
        """Clogs over trials, the estimate of the largest likelihood; nan without a trial."""
        trials = self.clogs + self.escapes
        return self.clogs / trials if trials else math.nan

    @property
    def fitted(self) -> bool:
        """Whether there are `FEWEST` clogs, and most runs lived long enough to be counted.

        Where most do not, the others are not a sample of the flow but of what survives.
        """
        return self.clogs >= FEWEST and self.counted > self.early


def under_arch(ratio: float) -> int:
    """Fines in the half ball over a hole of that R: 2 pi/3 (R/2)^3 of a heap of density 0.6.

    So many still escape when an arch already stands over them.
    """
    half_ball, fine = 2 * math.pi / 3 * (0.5 * ratio) ** 3, math.pi / 6
    return math.ceil(HEAP_DENSITY * half_ball / fine)


def after_first(
    runs: Sequence[tuple[int, bool]], ratio: float
) -> tuple[list[tuple[int, bool]], int]:
    """Runs (escaped, clogged) less their first `under_arch` fines, and the number of shorter ones.

    A shorter run may have clogged while the heap was growing. The geometric law has no memory, so
    it holds for what follows.
    """
    skipped = under_arch(ratio)
    kept = [(escaped - skipped, clogged) for escaped, clogged in runs if escaped >= skipped]
    return kept, len(runs) - len(kept)


def clogging(runs: Sequence[tuple[int, bool]], ratio: float) -> Clogging:
    """The probability from runs (escaped, clogged) with its band (Clopper and Pearson 1934)."""
    kept, early = after_first(runs, ratio)
    clogs, escapes = sum(clogged for _, clogged in kept), sum(escaped for escaped, _ in kept)
    tail = 0.5 * (1 - CONFIDENCE)
    return Clogging(
        clogs=clogs,
        escapes=escapes,
        early=early,
        counted=len(kept),
        low=float(beta.ppf(tail, clogs, escapes + 1)) if clogs else 0.0,
        high=float(beta.ppf(1 - tail, clogs + 1, escapes)) if escapes else 1.0,
    )


def geometric_chance(counts: Sequence[int], *, seed: int) -> float:
    """How often geometric samples of that size lie as far from their own fit, 0 to 1.

    The distance is the largest one of the cumulative shares (Kolmogorov and Smirnov); as the
    probability is fitted to the sample, its distribution is drawn, not looked up.
    """
    sample = np.asarray(counts)
    rng = np.random.default_rng(seed)
    own = _distance(sample)
    chance = 1 / (1 + sample.mean())
    draws = rng.geometric(chance, (DRAWS, len(sample))) - 1
    return float(np.mean([_distance(draw) >= own for draw in draws]))


def _distance(sample: Array) -> float:
    """Largest distance of the sample's cumulative shares from those of its fitted geometric."""
    chance = 1 / (1 + sample.mean())
    values, times = np.unique(sample, return_counts=True)
    shares = np.cumsum(times) / len(sample)
    exact = 1 - (1 - chance) ** (values + 1.0)
    before = 1 - (1 - chance) ** values.astype(float)
    return float(
        max(np.max(np.abs(shares - exact)), np.max(np.abs(shares - times / len(sample) - before)))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """ln P = start + slope (R^2 - 1).

    Attributes:
        slope: with its sign.
        start: value at R = 1.
        slope_error: half of the 95 % band of the slope.
        explained: share of the variance of ln P that the line explains, weighted (R^2 of the fit).
        chance: of a larger scatter about a true line, from chi^2, 0 to 1.
        holes: number of holes.
        least: the smallest R among them.
        most: the largest R among them.
    """

    slope: float
    start: float
    slope_error: float
    explained: float
    chance: float
    holes: int
    least: float
    most: float


def fitted_line(ratios: Sequence[float], cloggings: Sequence[Clogging]) -> Line:
    """Least squares of ln P with weights of the number of clogs, whose inverse is its variance.

    Holes that are not `fitted` are left out. Raises ValueError below three holes.
    """
    used = [(r, one) for r, one in zip(ratios, cloggings, strict=True) if one.fitted]
    if len(used) < 3:
        raise ValueError(f"{len(used)} holes with at least {FEWEST} clogs, expected 3")
    x = np.array([r**2 - 1 for r, _ in used])
    y = np.log([one.probability for _, one in used])
    weight = np.array([float(one.clogs) for _, one in used])
    middle_x, middle_y = np.average(x, weights=weight), np.average(y, weights=weight)
    spread = float(np.sum(weight * (x - middle_x) ** 2))
    slope = float(np.sum(weight * (x - middle_x) * (y - middle_y))) / spread
    start = float(middle_y - slope * middle_x)
    left = float(np.sum(weight * (y - start - slope * x) ** 2))
    return Line(
        slope=slope,
        start=start,
        slope_error=1.96 / math.sqrt(spread),
        explained=1 - left / float(np.sum(weight * (y - middle_y) ** 2)),
        chance=float(chi2.sf(left, len(used) - 2)),
        holes=len(used),
        least=min(r for r, _ in used),
        most=max(r for r, _ in used),
    )
