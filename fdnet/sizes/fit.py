"""Laws of size through measured points, and by how much they miss them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from fdnet.sizes.laws import LogNormal, RosinRammler

LOG_NORMAL, ROSIN_RAMMLER = "log-normal", "rosin-rammler"


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A law through some points.

    Attributes:
        name: "log-normal" or "rosin-rammler".
        law: the law.
        misfit: by point, the diameter of the law over the given one, less 1.
    """

    name: str
    law: LogNormal | RosinRammler
    misfit: dict[float, float]

    @property
    def worst(self) -> float:
        """The largest misfit, without its sign."""
        return max(abs(one) for one in self.misfit.values())


def fit_log_normal(points: Mapping[float, float]) -> Fit:
    """The log-normal law that is nearest in ln d to diameters (m) by the share finer (0 to 1).

    Least squares of ln d over the normal quantile; two points are met exactly.
    """
    quantiles = [NormalDist().inv_cdf(share) for share in points]
    spread, mean = _line(quantiles, [math.log(size) for size in points.values()])
    return _fit(LOG_NORMAL, LogNormal(math.exp(mean), spread), points)


def fit_rosin_rammler(points: Mapping[float, float]) -> Fit:
    """The same for the law of Rosin and Rammler: ln d over ln(-ln(1 - share))."""
    quantiles = [math.log(-math.log1p(-share)) for share in points]
    slope, mean = _line(quantiles, [math.log(size) for size in points.values()])
    return _fit(ROSIN_RAMMLER, RosinRammler(math.exp(mean), 1 / slope), points)


def best_fit(points: Mapping[float, float], name: str | None = None) -> Fit:
    """The law called `name`, or of the two the one with the smaller misfit in the mean square.

    Two points are met by both; then it is the log-normal law.
    """
    fits = {fit.name: fit for fit in (fit_log_normal(points), fit_rosin_rammler(points))}
    if name is not None:
        return fits[name]
    if len(points) <= 2:
        return fits[LOG_NORMAL]
    return min(
        fits.values(), key=lambda fit: sum(math.log1p(one) ** 2 for one in fit.misfit.values())
    )


def _line(x: list[float], y: list[float]) -> tuple[float, float]:
    """Slope and value at 0 of the straight line of least squares."""
    slope, start = np.polynomial.Polynomial.fit(x, y, 1).convert().coef[::-1]
    return float(slope), float(start)


def _fit(name: str, law: LogNormal | RosinRammler, points: Mapping[float, float]) -> Fit:
    misfit = {share: law.quantile(share) / size - 1 for share, size in points.items()}
    return Fit(name=name, law=law, misfit=misfit)
