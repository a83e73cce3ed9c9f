"""Looking up the numbers of a study's table, and how they are written in prose."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.engine.levels import Level, levels
from validation.engine.study import Row, Value
from validation.engine.table import read_rows


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lookup:
    """The rows of one study.

    Attributes:
        rows: the rows of its table.
    """

    rows: Sequence[Row]

    def levels(self, series: str, quantity: str, *, cost: str = "core_s") -> list[Level]:
        """All levels of a series."""
        return levels(self.rows, series, quantity, cost=cost)

    def level(self, series: str, quantity: str, value: Value, *, cost: str = "core_s") -> Level:
        """The level of one value of the knob."""
        every = self.levels(series, quantity, cost=cost)
        return next(level for level in every if level.value == value)

    def error(self, series: str, quantity: str, value: Value) -> float:
        """Mean error, signed."""
        return self.level(series, quantity, value).error

    def cost(self, series: str, quantity: str, value: Value, *, cost: str = "core_s") -> float:
        """Mean cost, core seconds if no other column is named."""
        return self.level(series, quantity, value, cost=cost).cost

    def runs(self, series: str, quantity: str, value: Value | None = None) -> list[Row]:
        """The rows themselves, of one value or of all of them."""
        return [
            row
            for row in self.rows
            if row.series == series
            and row.quantity == quantity
            and (value is None or row.value == value)
        ]

    def scatter(self, series: str, quantity: str, value: Value) -> float:
        """Standard deviation of the errors over the seeds."""
        return float(np.std([row.error for row in self.runs(series, quantity, value)], ddof=1))


def lookup(validation: Path, name: str) -> Lookup:
    """The committed table of a study."""
    return Lookup(rows=read_rows(validation / f"{name}.csv"))


def percent(share: float, digits: int = 0) -> str:
    """A share as a number of percent, without its sign."""
    return f"{100 * abs(share):.{digits}f}"


def percents(shares: Iterable[float], digits: int = 0) -> str:
    """The least and the largest of some shares in percent, by magnitude."""
    sizes = sorted(map(abs, shares))
    low, high = percent(sizes[0], digits), percent(sizes[-1], digits)
    return low if low == high else f"{low} to {high}"


def between(numbers: Iterable[float], digits: int = 2) -> str:
    """The least and the largest of some numbers, to so many significant digits."""
    every = sorted(numbers)
    low, high = significant(every[0], digits), significant(every[-1], digits)
    return low if low == high else f"{low} to {high}"


def significant(number: float, digits: int = 2) -> str:
    """A number to so many significant digits, thousands with a comma."""
    if number and not 1e-3 <= abs(number) < 1e7:
        return f"{number:.{digits - 1}e}".replace("e-0", "e-")
    if abs(number) >= 10**digits:
        exponent = math.floor(math.log10(abs(number))) - digits + 1
        return f"{round(number, -exponent):,.0f}"
    return f"{number:.{digits}g}"


def rounded_up(number: float) -> str:
    """A bound on a small number: its first digit, rounded up."""
    power = math.floor(math.log10(number))
    return f"{math.ceil(number / 10.0**power)}e{power}"


def with_band(level: Level) -> str:
    """The size of a mean error with its band, in percent."""
    return f"{percent(level.size)} ± {percent(level.half_width)}"


def exponent(levels_of_one: Sequence[Level]) -> float:
    """Exponent of the error in the value of the knob, from the first to the last level."""
    first, last = levels_of_one[0], levels_of_one[-1]
    return math.log(last.size / first.size) / math.log(float(last.value) / float(first.value))
