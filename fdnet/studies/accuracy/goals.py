"""How near to truth: the measures of all tables of the accuracy page, and its goals."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array
from fdnet.studies.truth.cases import EQUAL, LATTICE, UNEQUAL

Row = dict[str, Any]
Goal = tuple[float | None, float]
"""Largest root mean square of ln(model / truth), or None, and largest |model / truth - 1|."""
GOALS: dict[str, Goal] = {EQUAL: (0.03, 0.06), LATTICE: (None, 0.10), UNEQUAL: (None, 0.06)}
"""Of packs without fines, by group."""
DAMAGE_GOAL: Goal = (0.05, 0.12)
"""Of k/k0 by the two-scale laws."""
ALL_SPHERES_GOAL: Goal = (0.04, 0.08)
"""Of k/k0 by the network of all spheres."""
ERROR_FREE = 0.02
"""Where truth's own relative error exceeds this, it is added to the goal."""


def rms(ratios: Array | Iterable[float]) -> float:
    """Root mean square of ln(model / truth)."""
    return float(np.sqrt(np.mean(np.log(np.asarray(ratios)) ** 2)))


def worst(ratios: Array | Iterable[float]) -> float:
    """The ratio furthest from 1, by its logarithm."""
    ratios = np.asarray(ratios)
    return float(ratios[np.argmax(np.abs(np.log(ratios)))])


def values(rows: Iterable[Row], name: str) -> list[float]:
    """Numbers of a column, without those that were not computed."""
    return [row[name] for row in rows if not np.isnan(row[name])]


def reached(rows: list[Row], name: str, goal: Goal) -> str:
    """Whether the column `name` is within the goal, "yes" or "no"."""
    spread, most = goal
    rows = [row for row in rows if not np.isnan(row[name])]
    allowed = [
        most + (row["truth_error"] if row["truth_error"] > ERROR_FREE else 0.0) for row in rows
    ]
    good = all(abs(row[name] - 1.0) <= limit for row, limit in zip(rows, allowed, strict=True))
    return "yes" if good and (spread is None or rms(values(rows, name)) <= spread) else "no"


def percent(value: float, digits: int = 1) -> str:
    """A share in percent."""
    return f"{100.0 * value:.{digits}f} %"


def ratio(value: float, digits: int = 3) -> str:
    """A ratio; a dash where it was not computed."""
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def span(numbers: Iterable[float], digits: int = 3) -> str:
    """The least and the largest of some numbers."""
    numbers = list(numbers)
    return f"{min(numbers):.{digits}f} to {max(numbers):.{digits}f}"


def summary(rows: list[Row], name: str) -> str:
    """Root mean square of ln, and the ratio furthest from 1, of a column."""
    ratios = values(rows, name)
    return f"{percent(rms(ratios))}, {ratio(worst(ratios))}" if ratios else "-"


def truth_errors(rows: Iterable[Row]) -> str:
    """Least and largest error of the truth of rows."""
    errors = sorted(row["truth_error"] for row in rows)
    return f"{100 * errors[0]:.2g} to {100 * errors[-1]:.2g} %"


def worst_case(rows: Iterable[Row], name: str) -> str:
    """The case that is farthest from truth by the law `name`, and its ratio."""
    known = [row for row in rows if not np.isnan(row[name])]
    row = max(known, key=lambda row: abs(np.log(row[name])))
    return f"{row['case']}, {row[name]:.3f}"


def summed_up(ratios: Iterable[float]) -> str:
    """rms and worst of ratios, as text."""
    ratios = list(ratios)
    return f"rms {percent(rms(ratios))}, worst {worst(ratios):.3f}"
