"""From measurements to errors: against a known value, against the ensemble of a reference, and what the levels show."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from fdnet.studies.study import DONE, Measured, Row, Value, row_of, shown

NAN = float("nan")
CONFIDENCE = 0.95
_ROUNDING, _NINE_DIGITS, _FALLS = 1e-12, 1e-8, 0.2
"""What counts as no error: of sums, of means of what the table holds; exponent from which error falls with cost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """All runs of one value of a knob: mean cost s, mean error, half-width of its 95 % band (0: one run)."""

    value: Value
    runs: int
    cost: float
    error: float
    half_width: float

    @property
    def size(self) -> float:
        """Magnitude of the mean error."""
        return abs(self.error)


def against_exact(
    measured: Sequence[Measured],
    quantity: str,
    exact: Callable[[Measured], float],
    *,
    uncertainty: float = 0.0,
    scale: Callable[[Measured], float] | None = None,
    magnitude: bool = False,
) -> list[Row]:
    """Errors (observed - exact) / scale of every run, or their magnitude, where signs would cancel among runs.

    `scale` is |exact| if not given. Runs that were not done keep a row.
    """
    rows = []
    for run in measured:
        if run.status != DONE or quantity not in run.observed:
            rows.append(row_of(run, quantity, error=NAN, uncertainty=NAN))
            continue
        truth = exact(run)
        size = abs(truth) if scale is None else scale(run)
        error = (run.observed[quantity] - truth) / size
        rows.append(row_of(run, quantity, error=abs(error) if magnitude else error, uncertainty=uncertainty))
    return rows


def against_reference(
    measured: Sequence[Measured],
    quantity: str,
    reference: Callable[[Measured], bool],
    *,
    paired: bool = True,
    magnitude: bool = False,
) -> list[Row]:
    """Errors of every run against the mean of the runs for which `reference` holds, relative to that mean.

    When `paired` and the reference has the run's seed the difference is taken to that run (same pack, same fines), else
    to the reference's mean. The uncertainty is the scatter of those differences among the seeds of a value; of
    reference runs the scatter about their own mean. With `magnitude` the row is called "one run's NAME" and holds
    |error|: what one run alone may be off by. What is rounding of the sums is 0.
    """
    done = [run for run in measured if run.status == DONE and quantity in run.observed]
    name = f"one run's {quantity}" if magnitude else quantity
    base = {run.point.seed: run.observed[quantity] for run in done if reference(run)}
    if not base:
        raise ValueError(f"{quantity}: no reference run was done")
    mean = float(np.mean(list(base.values())))
    size = abs(mean) if mean else 1.0

    def error(run: Measured) -> float:
        origin = mean if reference(run) or not paired else base.get(run.point.seed, mean)
        found = run.observed[quantity] - origin
        return found / size if abs(found) > _ROUNDING * abs(mean) else 0.0

    errors = {id(run): error(run) for run in done}
    scatter = {key: _deviation([errors[id(run)] for run in runs]) for key, runs in _grouped(done).items()}
    widest = max((s for s in scatter.values() if not math.isnan(s)), default=NAN)
    rows = []
    for run in measured:
        if id(run) not in errors:
            rows.append(row_of(run, name, error=NAN, uncertainty=NAN))
            continue
        own, value = scatter[_level_of(run)], errors[id(run)]
        sigma = widest if math.isnan(own) else own
        rows.append(row_of(run, name, error=abs(value) if magnitude else value, uncertainty=sigma))
    return rows


def profile_distance(
    measured: Sequence[Measured], names: Sequence[str], reference: Callable[[Measured], bool], quantity: str = "profile"
) -> list[Row]:
    """Distance of every run's depth profile from the reference's mean profile, in units of the reference's mean depth.

    Profiles are counts in equal bins, `names` in order; the distance is the area between the cumulative shares (first
    Wasserstein distance). It is never negative: a reference run is held against the mean of the other reference runs,
    which gives the distance that chance alone makes.
    """
    done = [run for run in measured if run.status == DONE and names[0] in run.observed]
    share = {id(run): np.cumsum(_shares([run.observed[name] for name in names])) for run in done}
    base = [run for run in done if reference(run)]
    if len(base) < 2:
        raise ValueError(f"{quantity}: {len(base)} reference runs were done, expected at least 2")

    def distance(run: Measured) -> float:
        others = np.mean([share[id(other)] for other in base if other is not run], axis=0)
        middle = float(np.sum(1 - others)) + 0.5
        return float(np.sum(np.abs(share[id(run)] - others))) / middle

    return [
        row_of(run, quantity, error=distance(run) if id(run) in share else NAN, uncertainty=NAN) for run in measured
    ]


def _shares(counts: Sequence[float]) -> list[float]:
    total = sum(counts)
    return [count / total if total else 0.0 for count in counts]


def _level_of(run: Measured) -> tuple[str, Value]:
    return run.point.series, run.point.value


def _grouped(runs: Iterable[Measured]) -> dict[tuple[str, Value], list[Measured]]:
    groups: dict[tuple[str, Value], list[Measured]] = {}
    for run in runs:
        groups.setdefault(_level_of(run), []).append(run)
    return groups


def _deviation(values: Sequence[float]) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else NAN


def levels(rows: Sequence[Row], series: str, quantity: str, *, cost: str = "core_s") -> list[Level]:
    """Means by value of the knob, in the order in which the values appear; runs without an error are left out."""
    groups: dict[Value, list[Row]] = {}
    for row in rows:
        if row.series == series and row.quantity == quantity and not math.isnan(row.error):
            groups.setdefault(row.value, []).append(row)
    return [_level(value, group, cost) for value, group in groups.items()]


def _level(value: Value, group: Sequence[Row], cost: str) -> Level:
    errors = np.array([row.error for row in group])
    count = len(errors)
    if count > 1:
        half = float(student.ppf(0.5 + CONFIDENCE / 2, count - 1) * np.std(errors, ddof=1) / math.sqrt(count))
    else:
        known = group[0].error_uncertainty
        half = 0.0 if math.isnan(known) else 1.96 * known
    mean_cost = float(np.mean([getattr(row, cost) for row in group]))
    mean = float(np.mean(errors))
    mean = 0.0 if abs(mean) < _NINE_DIGITS * float(np.max(np.abs(errors))) else mean
    return Level(value=value, runs=count, cost=mean_cost, error=mean, half_width=half)


def knee(found: Sequence[Level]) -> Level | None:
    """The cheapest level whose error is within the band of the smallest: |e| <= least (|e| + h); None without any."""
    if not found:
        return None
    best = min(level.size + level.half_width for level in found)
    good = [level for level in found if level.size <= best]
    return min(good, key=lambda level: level.cost)


def order(found: Sequence[Level]) -> float:
    """Exponent p of error ~ cost^-p by least squares over the levels whose error stands out of its band; nan for less
    than three, or costs within a factor of two."""
    clear = [level for level in found if level.size > level.half_width and level.size > 0 and level.cost > 0]
    if len(clear) < 3 or max(level.cost for level in clear) < 2.0 * min(level.cost for level in clear):
        return NAN
    slope = np.polyfit(np.log([level.cost for level in clear]), np.log([level.size for level in clear]), 1)[0]
    return float(-slope)


def knee_sentence(found: Sequence[Level], *, default: Value | None, unit: str = "s") -> str:
    """What the levels say, in one sentence: the knee, the order where error falls with cost, and the default."""
    at = knee(found)
    if at is None:
        return "no run was done"
    if len(found) == 1:
        return f"error {_percent(at)} for {at.cost:.3g} {unit}"
    costs = [level.cost for level in found]
    if max(costs) < 1.5 * min(costs):
        least, most = min(found, key=lambda level: level.size), max(found, key=lambda level: level.size)
        return (
            f"all cost about the same ({min(costs):.3g} to {max(costs):.3g} {unit}); error {_percent(least)} at "
            f"{shown(least.value)} to {_percent(most)} at {shown(most.value)}"
        )
    costliest = max(found, key=lambda level: level.cost)
    power = order(found)
    falls = f"error falls as cost^-{power:.2g}" if not math.isnan(power) and power > _FALLS else ""
    end = f"{_percent(costliest)} for {costliest.cost:.3g} {unit}"
    if at is costliest:
        said = f"no knee, the costliest, {shown(at.value)}, is the best: {end}{'; ' if falls else ''}{falls}"
    else:
        said = (
            f"knee at {shown(at.value)}: error {_percent(at)} for {at.cost:.3g} {unit}; the costliest, "
            f"{shown(costliest.value)}, has {end}{'; ' if falls else ''}{falls}"
        )
    chosen = next((level for level in found if level.value == default), None)
    return (
        said
        if chosen is None
        else f"{said}; default {shown(chosen.value)}: {_percent(chosen)}, {chosen.cost:.3g} {unit}"
    )


def _percent(level: Level) -> str:
    band = f" ± {100 * level.half_width:.2g}" if level.half_width else ""
    return f"{100 * level.error:+.3g}{band} %"
