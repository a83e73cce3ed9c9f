"""What the trends compare: quantities of one run, and values of several runs by seed."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import spearmanr

from fdnet.studies.engine.bands import Sample
from fdnet.studies.thesis.numbers.examine import THESIS_PAIR
from fdnet.studies.thesis.numbers.results import ResultRow
from fdnet.studies.thesis.runs.plan import QUICK

DEEP = slice(1, 4)
"""Sections 2 to 4, between 1 and 4 mm: as deep as the quick forms go."""
_DRAG = re.compile(r"(\S+) drag\.multiplier=(\S+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """`value` of a run, in `unit`. `by_law`: it depends on the pair of laws. `grows`: larger specimens have more of it,
    so that a spread lent by a quick form is scaled up with the mean. `deep`: cut short when fines pass through."""

    unit: str
    value: Callable[[ResultRow], float]
    by_law: bool = False
    grows: bool = False
    deep: bool = False


def beyond_the_others(row: ResultRow) -> float:
    """Reduction of the first section less the largest of any other, %."""
    return 100 * (row.k_reductions[0] - max(known(row.k_reductions[1:]), default=math.nan))


def first_share(row: ResultRow) -> float:
    """Share of the first section in the sum of the reductions of sections 1 to 4, %; nan when nothing is reduced."""
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
    """What becomes of `quantity`, one of QUANTITIES, as the drag grows: `of` multipliers and values, in `unit`."""

    quantity: str
    unit: str
    of: Callable[[list[float], list[float]], float]


def slope_per_decade(multipliers: Sequence[float], values: Sequence[float]) -> float:
    """Least-squares slope of `values` over the decimal logarithm of the drag; nan for fewer than three runs."""
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
    """The rows of one id under one pair of laws, by seed."""
    found = {row.seed: row for row in rows if row.id == run and (row.law, row.damage_law) == laws}
    return [found[seed] for seed in sorted(found)]


def sample_of(
    rows: Sequence[ResultRow], run: str, quantity: Quantity, laws: tuple[str, str] = THESIS_PAIR
) -> Sample:
    """Values of `quantity` of one id; a specimen's with those of its quick form lent."""
    values = known([quantity.value(row) for row in runs_of(rows, run, laws)])
    lent = (
        ()
        if run.startswith(QUICK)
        else known([quantity.value(row) for row in runs_of(rows, QUICK + run, laws)])
    )
    return _lent(values, lent, grows=quantity.grows)


def multipliers_of(
    rows: Sequence[ResultRow], run: str
) -> dict[int, list[tuple[float, ResultRow]]]:
    """By seed, the drag multipliers of one case and its runs, in order; the case itself is 1."""
    found: dict[int, dict[float, ResultRow]] = {}
    for row in rows:
        scanned = _DRAG.fullmatch(row.id)
        name, multiplier = (scanned[1], float(scanned[2])) if scanned else (row.id, 1.0)
        if name == run and (row.law, row.damage_law) == THESIS_PAIR:
            found.setdefault(row.seed, {})[multiplier] = row
    return {seed: sorted(runs.items()) for seed, runs in sorted(found.items())}


def drag_sample(rows: Sequence[ResultRow], run: str, response: Response) -> Sample:
    """`response` of one case, a value a seed: each seed keeps its own pack."""
    quick = () if run.startswith(QUICK) else _responses(rows, QUICK + run, response)
    return _lent(_responses(rows, run, response), quick, grows=False)


def _responses(rows: Sequence[ResultRow], run: str, response: Response) -> tuple[float, ...]:
    value = QUANTITIES[response.quantity].value
    found = []
    for pairs in multipliers_of(rows, run).values():
        drawn = [
            (multiplier, value(row)) for multiplier, row in pairs if not math.isnan(value(row))
        ]
        found.append(response.of([x for x, _ in drawn], [y for _, y in drawn]))
    return known(found)


def _lent(values: tuple[float, ...], lent: tuple[float, ...], *, grows: bool) -> Sample:
    """Unscaled, the spread of a quick form is more than that of a specimen 6 times as wide (means over a cross section
    scatter as one over the square root of its area); what grows with the specimen keeps at least its relative one."""
    widened = 1.0
    if grows and values and lent and np.mean(lent) > 0:
        widened = max(1.0, float(np.mean(values) / np.mean(lent)))
    return Sample(values=values, lent=lent, widened=widened)


def known(values: Sequence[float]) -> tuple[float, ...]:
    """Those that are not nan."""
    return tuple(value for value in values if not math.isnan(value))
