"""The quantities that the trends compare, and their values over seeds."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from fdnet.case.file import QUICK
from validation.engine.bands import Sample
from validation.thesis.numbers.examine import THESIS_PAIR
from validation.thesis.numbers.results import ResultRow

DEEP = slice(1, 4)
"""Sections 2 to 4, between 1 and 4 mm; the quick forms end there."""
_DRAG = re.compile(r"(\S+) drag\.multiplier=(\S+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity of one run.

    Attributes:
        unit: its unit.
        value: gives it from a result row.
        by_law: whether it depends on the pair of laws.
        grows: whether larger specimens have more of it. Then a spread that is borrowed from a
            quick form is scaled up with the mean.
        deep: whether it is too small when fines pass through the specimen.
    """

    unit: str
    value: Callable[[ResultRow], float]
    by_law: bool = False
    grows: bool = False
    deep: bool = False


def beyond_the_others(row: ResultRow) -> float:
    """Reduction of the first section less the largest of any other, in per cent."""
    return 100 * (row.k_reductions[0] - max(known(row.k_reductions[1:]), default=math.nan))


def first_share(row: ResultRow) -> float:
    """Share of the first section in the sum of the reductions of sections 1 to 4, in per cent.

    It is nan when nothing is reduced.
    """
    total = row.k_reductions[0] + float(np.nansum(row.k_reductions[DEEP]))
    return 100 * row.k_reductions[0] / total if total > 0 else math.nan


def _deep_reduction(row: ResultRow) -> float:
    values = known(row.k_reductions[DEEP])
    return 100 * float(np.mean(values)) if values else math.nan


QUANTITIES: Mapping[str, Quantity] = {
    "mean depth": Quantity(unit="mm", value=lambda row: row.mean_depth_mm, grows=True, deep=True),
    "depth of 95 %": Quantity(
        unit="mm", value=lambda row: row.invasion_depth_p95_mm, grows=True, deep=True
    ),
    "fines in the first mm": Quantity(unit="%", value=lambda row: 100 * row.fraction_first_mm),
    "porosity loss": Quantity(
        unit="points", value=lambda row: 100 * (row.porosity_initial - row.porosity_damaged)
    ),
    "porosity loss in the first mm": Quantity(
        unit="points", value=lambda row: 100 * row.porosity_loss_first_mm
    ),
    "invaded fines": Quantity(unit="", value=lambda row: float(row.invaded_count), grows=True),
    "k reduction": Quantity(unit="%", value=lambda row: 100 * row.k_reduction, by_law=True),
    "k reduction in the first mm": Quantity(
        unit="%", value=lambda row: 100 * row.k_reductions[0], by_law=True
    ),
    "k reduction from 1 to 4 mm": Quantity(unit="%", value=_deep_reduction, by_law=True),
    "first mm's k reduction beyond any other's": Quantity(
        unit="%", value=beyond_the_others, by_law=True
    ),
    "first mm's share in the k reduction": Quantity(unit="%", value=first_share, by_law=True),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """How a quantity changes with the drag.

    Attributes:
        quantity: the name of the quantity in QUANTITIES.
        unit: unit of the response.
        of: gives the response from multipliers of the drag and values of the quantity.
    """

    quantity: str
    unit: str
    of: Callable[[list[float], list[float]], float]


def slope_per_decade(multipliers: Sequence[float], values: Sequence[float]) -> float:
    """Least-squares slope of the values over the decimal logarithm of the drag multiplier.

    It is nan for fewer than three runs.
    """
    if len(values) < 3:
        return math.nan
    x = np.log10(multipliers)
    return float(np.dot(x - x.mean(), values) / np.dot(x - x.mean(), x))


def rank_correlation(multipliers: Sequence[float], values: Sequence[float]) -> float:
    """Spearman's; 0 when all values are the same, nan for fewer than three runs."""
    if len(values) < 3:
        return math.nan
    return 0.0 if len(set(values)) == 1 else float(spearmanr(multipliers, values).statistic)


RESPONSES: Mapping[str, Response] = {
    "mean depth per decade of drag": Response(
        quantity="mean depth", unit="mm", of=slope_per_decade
    ),
    "depth of 95 % per decade of drag": Response(
        quantity="depth of 95 %", unit="mm", of=slope_per_decade
    ),
    "rank correlation of mean depth with drag": Response(
        quantity="mean depth", unit="", of=rank_correlation
    ),
}


def runs_of(
    rows: Sequence[ResultRow], run: str, laws: tuple[str, str] = THESIS_PAIR
) -> list[ResultRow]:
    """The rows of one run under one pair of laws, in the order of the seeds."""
    by_seed = {
        row.seed: row for row in rows if row.id == run and (row.law, row.damage_law) == laws
    }
    return [by_seed[seed] for seed in sorted(by_seed)]


def sample_of(
    rows: Sequence[ResultRow], run: str, quantity: Quantity, laws: tuple[str, str] = THESIS_PAIR
) -> Sample:
    """Values of a quantity over the seeds of a run; its quick form lends its spread."""
    values = known([quantity.value(row) for row in runs_of(rows, run, laws)])
    quick = (
        ()
        if run.startswith(QUICK)
        else known([quantity.value(row) for row in runs_of(rows, QUICK + run, laws)])
    )
    return _borrowing(values, quick, grows=quantity.grows)


def multipliers_of(
    rows: Sequence[ResultRow], run: str
) -> dict[int, list[tuple[float, ResultRow]]]:
    """By seed, the multipliers of the drag in order and their runs; the case itself has 1."""
    by_seed: dict[int, dict[float, ResultRow]] = {}
    for row in rows:
        scanned = _DRAG.fullmatch(row.id)
        name, multiplier = (scanned[1], float(scanned[2])) if scanned else (row.id, 1.0)
        if name == run and (row.law, row.damage_law) == THESIS_PAIR:
            by_seed.setdefault(row.seed, {})[multiplier] = row
    return {seed: sorted(runs.items()) for seed, runs in sorted(by_seed.items())}


def drag_sample(rows: Sequence[ResultRow], run: str, response: Response) -> Sample:
    """The response of one case over its seeds; each seed has a pack of its own."""
    quick = () if run.startswith(QUICK) else _responses(rows, QUICK + run, response)
    return _borrowing(_responses(rows, run, response), quick, grows=False)


def _responses(rows: Sequence[ResultRow], run: str, response: Response) -> tuple[float, ...]:
    value = QUANTITIES[response.quantity].value
    responses = []
    for pairs in multipliers_of(rows, run).values():
        drawn = [
            (multiplier, value(row)) for multiplier, row in pairs if not math.isnan(value(row))
        ]
        responses.append(response.of([x for x, _ in drawn], [y for _, y in drawn]))
    return known(responses)


def _borrowing(values: tuple[float, ...], quick: tuple[float, ...], *, grows: bool) -> Sample:
    """A sample that can borrow the spread of the quick form.

    The spread of a quick form is larger than that of a specimen with 6 times its cross-section,
    for means over a cross-section scatter as one over the square root of its area. So it is
    borrowed unscaled. What grows with the specimen keeps at least its relative spread.
    """
    widened = 1.0
    if grows and values and quick and np.mean(quick) > 0:
        widened = max(1.0, float(np.mean(values) / np.mean(quick)))
    return Sample(values=values, lent=quick, widened=widened)


def known(values: Sequence[float]) -> tuple[float, ...]:
    """The values that are not nan."""
    return tuple(value for value in values if not math.isnan(value))
