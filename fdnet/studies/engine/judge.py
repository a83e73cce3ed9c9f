"""From measurements to errors: against a known value, against the ensemble of a reference, and what the levels show."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from fdnet.errors import CaseError
from fdnet.studies.engine.bands import CONFIDENCE
from fdnet.studies.engine.study import DONE, Measured, Row, Value, row_of, shown

NAN = float("nan")
NEARLY, ALIKE, FALLS, FEW_SEEDS = 2.0, 1.5, 0.2, 2
"""A knee's error over the best one; costs that are alike; exponent from which error falls; seeds too few for a knee."""
_ROUNDING, _NINE_DIGITS = 1e-12, 1e-8
"""What counts as no error: of sums, of means of what the table holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """All runs of one value of a knob: mean cost s, mean error, half-width of its 95 % band.

    The band is that of the mean over seeds, widened by the reference's own; of a single run 1.96 times its uncertainty.
    `reference` marks the level that the errors are taken from.
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
        rows.append(
            row_of(
                run, quantity, error=abs(error) if magnitude else error, uncertainty=uncertainty
            )
        )
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
    reference runs the scatter about their own mean; unpaired, the band of the reference's mean is told too. Raises
    CaseError when no reference run was done. With `magnitude` the row is called "one run's NAME" and holds
    |error|: what one run alone may be off by. What is rounding of the sums is 0.
    """
    done = [run for run in measured if run.status == DONE and quantity in run.observed]
    name = f"one run's {quantity}" if magnitude else quantity
    base = {run.point.seed: run.observed[quantity] for run in done if reference(run)}
    if not base:
        raise _without_reference(measured, quantity)
    mean = float(np.mean(list(base.values())))
    size = abs(mean) if mean else 1.0

    def error(run: Measured) -> float:
        origin = mean if reference(run) or not paired else base.get(run.point.seed, mean)
        found = run.observed[quantity] - origin
        return found / size if abs(found) > _ROUNDING * abs(mean) else 0.0

    errors = {id(run): error(run) for run in done}
    scatter = {
        key: _deviation([errors[id(run)] for run in runs]) for key, runs in _grouped(done).items()
    }
    band = 0.0 if paired else _half_width(list(base.values())) / size
    widest = max((s for s in scatter.values() if not math.isnan(s)), default=NAN)
    rows = []
    for run in measured:
        if id(run) not in errors:
            rows.append(row_of(run, name, error=NAN, uncertainty=NAN))
            continue
        own, value = scatter[_level_of(run)], errors[id(run)]
        own_band, role = (0.0, "reference") if reference(run) else (band, "")
        rows.append(
            row_of(
                run,
                name,
                error=abs(value) if magnitude else value,
                uncertainty=widest if math.isnan(own) else own,
                band=0.0 if magnitude else own_band,
                role="" if magnitude else role,
            )
        )
    return rows


def _without_reference(measured: Sequence[Measured], quantity: str) -> CaseError:
    why = (
        "; ".join(sorted({run.status for run in measured if run.status != DONE})[:3])
        or "none was asked for"
    )
    return CaseError(
        f"{quantity}: no reference run was done ({why}); mend the cause and repeat the command"
    )


def _half_width(values: Sequence[float]) -> float:
    """Half-width of the 95 % band of the mean (Student's t); 0 of a single value."""
    count = len(values)
    if count < 2:
        return 0.0
    return float(
        student.ppf(0.5 + CONFIDENCE / 2, count - 1) * np.std(values, ddof=1) / math.sqrt(count)
    )


def profile_distance(
    measured: Sequence[Measured],
    names: Sequence[str],
    reference: Callable[[Measured], bool],
    quantity: str = "profile",
) -> list[Row]:
    """Distance of every run's depth profile from the reference's mean profile, in units of the reference's mean depth.

    Profiles are counts in equal bins, `names` in order; the distance is the area between the cumulative shares (first
    Wasserstein distance). It is never negative: every run is held against the mean of the reference runs of other
    seeds, so that the reference's own distance is the one that chance alone makes. Raises CaseError when less than two
    reference runs were done.
    """
    done = [run for run in measured if run.status == DONE and names[0] in run.observed]
    share = {id(run): np.cumsum(_shares([run.observed[name] for name in names])) for run in done}
    base = [run for run in done if reference(run)]
    if len({run.point.seed for run in base}) < 2:
        raise _without_reference(measured, f"{quantity} (two seeds of a reference are needed)")

    def distance(run: Measured) -> float:
        others = np.mean(
            [share[id(other)] for other in base if other.point.seed != run.point.seed], axis=0
        )
        middle = float(np.sum(1 - others)) + 0.5
        return float(np.sum(np.abs(share[id(run)] - others))) / middle

    return [
        row_of(run, quantity, error=distance(run) if id(run) in share else NAN, uncertainty=NAN)
        for run in measured
    ]


def sizes(runs: Sequence[Measured], quantity: str) -> list[Row]:
    """Rows of a quantity that is an error already, by its magnitude."""
    return against_exact(runs, quantity, lambda _: 0.0, scale=lambda _: 1.0, magnitude=True)


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


def levels(
    rows: Sequence[Row], series: str, quantity: str, *, cost: str = "core_s"
) -> list[Level]:
    """Means by value of the knob, in the order in which the values appear; runs without an error are left out.

    With `cost` "value" the observed values take the place of errors: a quantity over the knob.
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
    count = len(errors)
    known = group[0].error_uncertainty
    half = _half_width(list(errors)) if count > 1 else (0.0 if math.isnan(known) else 1.96 * known)
    half = math.hypot(half, group[0].reference_band)
    mean_cost = float(np.mean([getattr(row, cost) for row in group]))
    mean = float(np.mean(errors))
    mean = 0.0 if abs(mean) < _NINE_DIGITS * float(np.max(np.abs(errors))) else mean
    role = group[0].role == "reference"
    return Level(
        value=value, runs=count, cost=mean_cost, error=mean, half_width=half, reference=role
    )


def knee(found: Sequence[Level]) -> Level | None:
    """The cheapest level whose error, band included, is at most twice the best one's.

    Levels of two seeds, whose bands say nothing, are passed over, and single runs beside ensembles. None when errors go
    on falling with cost, or without levels beside the reference.
    """
    own = _with_bands(found)
    if not own:
        return None
    best, costliest = min(level.bound for level in own), max(own, key=lambda level: level.cost)
    if order(own) > FALLS and costliest.bound == best:
        return None
    return min(
        (level for level in own if level.bound <= NEARLY * best), key=lambda level: level.cost
    )


def _with_bands(found: Sequence[Level]) -> list[Level]:
    """Levels beside the reference that a knee can be told from: of more than two seeds, or all of one exact run."""
    own = [level for level in found if not level.reference]
    alone = all(level.runs == 1 for level in own)
    return [level for level in own if alone or level.runs > FEW_SEEDS]


def order(found: Sequence[Level]) -> float:
    """Exponent p of error ~ cost^-p by least squares over the levels whose error stands out of its band; nan for less
    than three, or costs within a factor of two."""
    clear = [
        level
        for level in found
        if level.size > level.half_width and level.size > 0 and level.cost > 0
    ]
    if len(clear) < 3 or max(level.cost for level in clear) < 2.0 * min(
        level.cost for level in clear
    ):
        return NAN
    slope = np.polyfit(
        np.log([level.cost for level in clear]), np.log([level.size for level in clear]), 1
    )[0]
    return float(-slope)


def knee_sentence(found: Sequence[Level], *, default: Value | None, unit: str = "s") -> str:
    """What the levels say, in one sentence: the knee, the order where error falls with cost, and the default."""
    own = [level for level in found if not level.reference]
    if not own:
        return (
            f"nothing beside the reference, {shown(found[0].value)}"
            if found
            else "no run was done"
        )
    parts = [_knee_words(own, unit), *_order_words(own)]
    parts += [
        f"default {_cost_words(level, unit)}"
        for level in found
        if level.value == default and len(found) > 1
    ]
    parts += [
        f"errors from {shown(level.value)}, which costs {level.cost:.3g} {unit}"
        for level in found
        if level.reference
    ]
    return "; ".join(parts)


def _knee_words(own: Sequence[Level], unit: str) -> str:
    least, most = min(own, key=lambda level: level.cost), max(own, key=lambda level: level.cost)
    if len(own) == 1:
        return f"error {_cost_words(own[0], unit, named=isinstance(own[0].value, str))}"
    if most.cost < ALIKE * least.cost:
        low, high = min(own, key=lambda level: level.size), max(own, key=lambda level: level.size)
        return (
            f"all cost about the same ({least.cost:.3g} to {most.cost:.3g} {unit}); error {percent(low)} at "
            f"{shown(low.value)} to {percent(high)} at {shown(high.value)}"
        )
    judged = _with_bands(own)
    if not judged:
        return f"too few seeds for a knee; the costliest {_cost_words(most, unit)}"
    at, last = knee(own), max(judged, key=lambda level: level.cost)
    if at is None:
        return f"no knee: the costliest is the best, {_cost_words(last, unit)}"
    if at is last:
        return f"only the costliest will do, {_cost_words(last, unit)}"
    return f"knee at {_cost_words(at, unit)}; the costliest {_cost_words(most, unit)}"


def _order_words(own: Sequence[Level]) -> list[str]:
    power = order(own)
    return [f"error falls as cost^-{power:.2g}"] if power > FALLS else []


def _cost_words(level: Level, unit: str, *, named: bool = True) -> str:
    name = f"{shown(level.value)}: " if named else ""
    return f"{name}{percent(level)} for {level.cost:.3g} {unit}"


def percent(level: Level) -> str:
    """A level's mean error with its band."""
    band = f" ± {100 * level.half_width:.2g}" if level.half_width else ""
    return f"{100 * level.error:+.3g}{band} %"
