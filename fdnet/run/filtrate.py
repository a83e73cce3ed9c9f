"""The filtrate over time: a cake that grows at constant pressure, fitted and extrapolated.

Each volume of filtrate leaves its solids on the cake, so the resistance of the cake is as the
volume V per area: dV/dt = dp / (mu (R + alpha V)). Its integral is quadratic in V,

    t = a V^2 + b V + c,  a = mu alpha / (2 dp),  b = mu R / dp,  c = 0

(Ruth 1935). Late in time V goes as sqrt(t / a), the line of the API's filtration tests, which name
a spurt 2 V(7.5 min) - V(30 min), where that line meets t = 0 (API RP 13I).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.spheres.arrays import Array

HALF_HOUR = 1800.0
"""s; the API's filter press runs for 30 minutes."""
FEWEST, FALLEN, MISFIT, CAKE_SHARE = 8, 0.5, 0.02, 0.5
"""What a fit needs: so many points, a last rate below this share of the first, an rms misfit of
at most this share of the whole time, and at the end at least this share of the resistance in the
cake, for the law is the cake's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Filtration:
    """t = a V^2 + b V + c of a filtrate V per area.

    Attributes:
        a: s/m2.
        b: s/m.
        c: s.
        misfit: rms difference of the times over the whole time.
        until: s, last time of the data.
        unsupported: why nothing may be extrapolated, in words; "" where it may.
    """

    a: float
    b: float
    c: float
    misfit: float
    until: float
    unsupported: str

    def volume(self, time: float) -> float:
        """Filtrate per area, m, at `time` s."""
        root = self.b**2 + 4.0 * self.a * (time - self.c)
        return (np.sqrt(root) - self.b) / (2.0 * self.a)

    @property
    def half_hour(self) -> float:
        """Filtrate per area at 30 minutes, m3/m2: an extrapolation."""
        return self.volume(HALF_HOUR)

    @property
    def intercept(self) -> float:
        """2 V(7.5 min) - V(30 min), m3/m2; below 0 where the pack itself holds back."""
        return 2.0 * self.volume(HALF_HOUR / 4.0) - self.half_hour

    @property
    def spurt(self) -> float:
        """The spurt, m3/m2: the intercept, or 0 where that is below 0."""
        return max(0.0, self.intercept)


def cake_share(updates: Sequence[Mapping[str, float]]) -> float | None:
    """Share of the last drop of pressure that the cake takes up; None where no flow says it."""
    last = updates[-1] if updates else {}
    drop = last.get("pressure_cake_Pa", 0.0) + last.get("pressure_pack_Pa", 0.0)
    return last["pressure_cake_Pa"] / drop if drop > 0 else None


def fit_filtration(time: Array, volume: Array, cake_share: float = 1.0) -> Filtration | None:
    """The fit to filtrate per area (N,) m at `time` (N,) s; None with fewer than four points.

    `cake_share` is the share of the last drop of pressure that the cake takes up. The fit is least
    squares in t. Nothing is extrapolated from a history whose rate hardly fell, that
    is not curved as a growing cake's, or that the formula does not meet.
    """
    time, volume = np.asarray(time, float), np.asarray(volume, float)
    use = np.concatenate([[True], np.diff(volume) > 0]) if len(volume) else np.zeros(0, bool)
    time, volume = time[use], volume[use]
    if len(time) < 4:
        return None
    whole, scale = float(time[-1] - time[0]), float(np.ptp(volume))
    unit = volume / scale
    columns = np.stack([unit**2, unit, np.ones_like(unit)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(columns, time, rcond=None)
    misfit = float(np.sqrt(np.mean((columns @ (a, b, c) - time) ** 2)) / whole)
    fit = {"a": float(a / scale**2), "b": float(b / scale), "c": float(c)}
    rates = np.diff(volume) / np.diff(time)
    return Filtration(
        **fit,
        misfit=misfit,
        until=float(time[-1]),
        unsupported=_unsupported(
            len(time), fit["a"], misfit, float(rates[-1] / rates[0]), cake_share
        ),
    )


def _unsupported(
    points: int, curvature: float, misfit: float, rate: float, cake_share: float
) -> str:
    if points < FEWEST:
        return f"{points} points of the history; {FEWEST} are needed"
    if rate > FALLEN:
        return f"the rate only fell to {rate:.2f} of the first; below {FALLEN:g} is needed"
    if cake_share < CAKE_SHARE:
        return (
            f"the cake has {100 * cake_share:.0f} % of the resistance of cake and pack, at least "
            f"{100 * CAKE_SHARE:g} % is needed: the pack shapes the history"
        )
    if curvature <= 0:
        return "the history is not curved as that of a growing cake"
    if misfit > MISFIT:
        return (
            f"t is not quadratic in V: the misfit is {100 * misfit:.2g} % of the time, at most "
            f"{100 * MISFIT:g} % is needed"
        )
    return ""
