"""Rows of errors: against a known value, or against the mean of the runs of a reference."""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from fdnet.errors import CaseError
from validation.engine.bands import half_width
from validation.engine.study import DONE, Measured, Row, Value, row_of

NAN = float("nan")
_ROUNDING = 1e-12
"""Relative differences of sums below this one are rounding, not errors."""


def against_exact(
    measured: Sequence[Measured],
    quantity: str,
    exact: Callable[[Measured], float],
    *,
    uncertainty: float = 0.0,
    scale: Callable[[Measured], float] | None = None,
    magnitude: bool = False,
) -> list[Row]:
    """Errors (observed - exact) / scale of every run; runs that were not done keep a row.

    Args:
        measured: the runs.
        quantity: name of what was observed.
        exact: the known value of a run.
        uncertainty: one standard deviation of the error.
        scale: what the difference is divided by; |exact| if not given.
        magnitude: take |error|, where the signs of several runs would cancel.
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
    """Errors of every run against the mean of the reference runs, relative to that mean.

    The uncertainty of an error is the scatter of the errors among the seeds of its value.
    Differences that are rounding of sums are 0.

    Args:
        measured: the runs.
        quantity: name of what was observed.
        reference: whether a run belongs to the reference.
        paired: take the difference to the reference run of the same seed (same pack, same fines)
            where there is one. Unpaired rows hold the band of the reference's mean as well.
        magnitude: the rows are called "one run's NAME" and hold |error|, which is how far one run
            alone may be off.

    Raises:
        CaseError: no run of the reference was done.
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
        difference = run.observed[quantity] - origin
        return difference / size if abs(difference) > _ROUNDING * abs(mean) else 0.0

    errors = {id(run): error(run) for run in done}
    scatter = _scatter(done, errors)
    widest = max((s for s in scatter.values() if not math.isnan(s)), default=NAN)
    band = 0.0 if paired else half_width(list(base.values())) / size

    def row(run: Measured) -> Row:
        if id(run) not in errors:
            return row_of(run, name, error=NAN, uncertainty=NAN)
        own, value = scatter[_level_of(run)], errors[id(run)]
        uncertainty = widest if math.isnan(own) else own
        if magnitude:
            return row_of(run, name, error=abs(value), uncertainty=uncertainty)
        if reference(run):
            return row_of(run, name, error=value, uncertainty=uncertainty, role="reference")
        return row_of(run, name, error=value, uncertainty=uncertainty, band=band)

    return [row(run) for run in measured]


def profile_distance(
    measured: Sequence[Measured],
    names: Sequence[str],
    reference: Callable[[Measured], bool],
    quantity: str = "profile",
) -> list[Row]:
    """Distance of every run's depth profile from the mean profile of the reference.

    The distance is the area between the cumulative shares (first Wasserstein distance), in units
    of the reference's mean depth. It is never negative: every run is compared with the mean of
    the reference runs of other seeds, so the reference's own distance is what chance alone makes.

    Args:
        measured: the runs.
        names: names of the counts in equal bins of depth, in order.
        reference: whether a run belongs to the reference.
        quantity: name of the rows.

    Raises:
        CaseError: less than two reference runs were done.
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


def _without_reference(measured: Sequence[Measured], quantity: str) -> CaseError:
    why = (
        "; ".join(sorted({run.status for run in measured if run.status != DONE})[:3])
        or "none was asked for"
    )
    return CaseError(
        f"{quantity}: no reference run was done ({why}); mend the cause and repeat the command"
    )


def _shares(counts: Sequence[float]) -> list[float]:
    total = sum(counts)
    return [count / total if total else 0.0 for count in counts]


def _level_of(run: Measured) -> tuple[str, Value]:
    return run.point.series, run.point.value


def _scatter(done: Iterable[Measured], errors: dict[int, float]) -> dict[tuple[str, Value], float]:
    """Standard deviation of the errors of each series and value; nan of a single run."""
    groups: dict[tuple[str, Value], list[float]] = {}
    for run in done:
        groups.setdefault(_level_of(run), []).append(errors[id(run)])
    return {
        level: float(np.std(values, ddof=1)) if len(values) > 1 else NAN
        for level, values in groups.items()
    }
