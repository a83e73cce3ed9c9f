"""Levels: what all runs of one value of a knob have in common, their mean error and mean cost."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from validation.engine.bands import half_width
from validation.engine.study import Row, Value

NAN = float("nan")
_NINE_DIGITS = 1e-8
"""Means below this share of their largest term are 0: the table holds nine digits."""
_OF_ONE_RUN = 1.96
"""Half of the 95 % band over the standard deviation of a single run."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """All runs of one value of a knob.

    Attributes:
        value: value of the knob.
        runs: number of runs that have an error.
        cost: mean cost, in the unit of the cost that was asked for.
        error: mean error, signed.
        half_width: half of the 95 % band of the mean over seeds, widened by the band of the
            reference; of a single run 1.96 times its uncertainty.
        reference: whether errors are taken from this level.
    """

    value: Value
    runs: int
    cost: float
    error: float
    half_width: float
    reference: bool = False

    @property
    def size(self) -> float:
        """Magnitude of the mean error."""
        return abs(self.error)

    @property
    def bound(self) -> float:
        """What the error may be, its band included."""
        return self.size + self.half_width


def levels(
    rows: Sequence[Row], series: str, quantity: str, *, cost: str = "core_s"
) -> list[Level]:
    """Levels of one series and quantity, in the order in which the values appear.

    Runs without an error are left out. `cost` is the name of a column of the rows, or "value":
    then the observed values take the place of errors (a quantity over the knob).
    """
    if cost == "value":
        rows = [replace(row, error=row.observed, error_uncertainty=0.0) for row in rows]
    groups: dict[Value, list[Row]] = {}
    for row in rows:
        if row.series == series and row.quantity == quantity and not math.isnan(row.error):
            groups.setdefault(row.value, []).append(row)
    return [_level(value, group, cost) for value, group in groups.items()]


def _level(value: Value, group: Sequence[Row], cost: str) -> Level:
    errors = np.array([row.error for row in group])
    mean = float(np.mean(errors))
    negligible = abs(mean) < _NINE_DIGITS * float(np.max(np.abs(errors)))
    return Level(
        value=value,
        runs=len(errors),
        cost=float(np.mean([getattr(row, cost) for row in group])),
        error=0.0 if negligible else mean,
        half_width=math.hypot(_own_half_width(group), group[0].reference_band),
        reference=group[0].role == "reference",
    )


def _own_half_width(group: Sequence[Row]) -> float:
    if len(group) > 1:
        return half_width([row.error for row in group])
    known = group[0].error_uncertainty
    return 0.0 if math.isnan(known) else _OF_ONE_RUN * known


def order(levels_of_one: Sequence[Level]) -> float:
    """Exponent p of error ~ cost^-p, by least squares over the levels that stand out.

    A level stands out when its error exceeds its band. The result is nan for less than three of
    them, or when their costs lie within a factor of two.
    """
    clear = [
        level
        for level in levels_of_one
        if level.size > level.half_width and level.size > 0 and level.cost > 0
    ]
    costs = [level.cost for level in clear]
    if len(clear) < 3 or max(costs) < 2.0 * min(costs):
        return NAN
    slope = np.polyfit(np.log(costs), np.log([level.size for level in clear]), 1)[0]
    return float(-slope)


def percent(level: Level) -> str:
    """A level's mean error with its band."""
    band = f" ± {100 * level.half_width:.2g}" if level.half_width else ""
    return f"{100 * level.error:+.3g}{band} %"
