"""Drag: its schemes against the exact relaxation of one fine, and in whole invasions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.scales.clock import HOLD_OVER_RELAXATION
from fdnet.scales.scales import invasion_scales
from validation.dem.runs import (
    BINS,
    OBSERVED,
    base_inputs,
    invasion_run,
    relaxation_run,
    slab_case,
    window_run,
)
from validation.engine.error_rows import against_reference, profile_distance, sizes
from validation.engine.study import Measured, Panel, Point, Row, Study, Value

EVERY, HELD, IMPLICIT, VISCOUS = "every step", "held", "implicit", "viscous"
"""Names of the series; `EVERY` is held drag that is computed at each step."""
SCHEMES = (EVERY, HELD, IMPLICIT, VISCOUS)
HOLDING, OTHER = "invasion, held", "invasion, not held"
RESTARTED = "implicit, a run every tau/4"
WINDOW_HOLDING, WINDOW_OTHER = "20,000 fines, held", "20,000 fines, not held"


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """An invasion; tau is the relaxation time of a fine.

    Attributes:
        stiffness: of the contacts, N/m.
        steps_per_tau: time steps in one tau (a step is about 0.1 sqrt(m/k)); a multiple of the
            steps for which drag is held, so that all schemes run the same steps.
        chunks: duration, in units of 4 tau.
        keys: further settings, "key=value".
        small: whether the specimen is the small one of the quick forms.
    """

    stiffness: float
    steps_per_tau: int
    chunks: int
    keys: tuple[str, ...] = ()
    small: bool = False


FORMS: Mapping[str, Form] = {
    "small": Form(stiffness=1e3, steps_per_tau=200, chunks=5, small=True),
    "whole": Form(stiffness=1e3, steps_per_tau=200, chunks=21),
    "window": Form(stiffness=1e4, steps_per_tau=700, chunks=1, keys=("fines.count=20000",)),
}
"""Whole invasions are run at 1e3 N/m, so that many seeds fit into some minutes."""
_LOOKS = (1.0, 0.5, 2.0)
"""Times, in tau, at which a falling fine is observed; the quick form takes the first alone."""
_SPANS = 3.0


def points(quick: bool) -> list[Point]:
    """Falling fines from long to short intervals, then invasions.

    Invasions go seed by seed, so that the load of the machine is the same for all schemes.
    """
    if quick:
        chosen = [
            point for scheme in SCHEMES for point in _falls(scheme, (0.2, 0.1, 0.05), looks=1)
        ]
        chosen += _falls(IMPLICIT, (10.0,), looks=1) + _falls(EVERY, (2.0,), looks=1)
        return chosen + _invasions((0.05, 1.0), seeds=2, form="small")
    common = (2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
    chosen = [
        point for scheme in (EVERY, HELD, VISCOUS) for point in _falls(scheme, common, looks=3)
    ]
    chosen += _falls(IMPLICIT, (100.0, 30.0, 10.0, 5.0, *common), looks=3)
    chosen += _falls(RESTARTED, (0.05, 0.02, 0.01, 0.005, 0.002), looks=0)
    held = (1.0, 0.5, 0.2, 0.1, HOLD_OVER_RELAXATION, 0.02)
    return (
        chosen + _invasions(held, seeds=8, form="whole") + _invasions(held, seeds=2, form="window")
    )


def _falls(series: str, intervals: Sequence[float], *, looks: int) -> list[Point]:
    settings = {"looks": float(looks)}
    return [
        Point(series=series, knob="interval_over_tau", value=value, settings=settings)
        for value in intervals
    ]


def _invasions(held: Sequence[float], *, seeds: int, form: str) -> list[Point]:
    holding, other = (WINDOW_HOLDING, WINDOW_OTHER) if form == "window" else (HOLDING, OTHER)
    intervals: tuple[Value, ...] = (*held, EVERY)
    values: list[tuple[str, Value]] = [(holding, value) for value in intervals]
    values += [(other, VISCOUS), (other, IMPLICIT)]
    return [
        Point(series=series, knob="drag", value=value, seed=seed, settings={"form": form})
        for seed in range(1, seeds + 1)
        for series, value in values
    ]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One falling fine, or one invasion with the scheme `value`, or held for `value` tau."""
    if "looks" in point.settings:
        assert isinstance(point.value, float)
        return _fall(point.series, point.value, int(point.settings["looks"]), work, point.slug)
    form = str(point.settings["form"])
    case = _invasion_case(point, FORMS[form])
    return (
        window_run(case, work, point.slug)
        if form == "window"
        else invasion_run(case, work, point.slug)
    )


def _invasion_case(point: Point, form: Form) -> InvasionCase:
    tau = invasion_scales(slab_case(point.seed, small=form.small)).relaxation_time[0]
    return slab_case(
        point.seed,
        f"run.stiffness_N_m={form.stiffness!r}",
        f"run.time_step_s={tau / form.steps_per_tau!r}",
        f"run.checkpoint_ms={4e3 * tau!r}",
        f"run.duration_ms={4e3 * tau * form.chunks!r}",
        *form.keys,
        *_scheme_keys(point.value, form.steps_per_tau),
        small=form.small,
    )


def _scheme_keys(value: Value, steps_per_tau: int) -> tuple[str, ...]:
    if isinstance(value, str):
        return _scheme(value)
    return (f"drag.scheme={HELD}", f"drag.refresh_steps={round(value * steps_per_tau)}")


def _scheme(name: str) -> tuple[str, ...]:
    return ("drag.refresh_steps=1",) if name == EVERY else (f"drag.scheme={name}",)


def _fall(series: str, interval: float, looks: int, work: Path, slug: str) -> dict[str, float]:
    """Largest error of a falling fine at the observations, each of which is a run of its own.

    "steps" are evaluations of drag in 3 tau.
    """
    if not looks:
        run = relaxation_run(
            work, slug, f"drag.scheme={IMPLICIT}", over_tau=interval, spans=_SPANS
        )
        return run | {"steps": _SPANS / interval}
    counts = {max(least, round(time / interval)) for least, time in enumerate(_LOOKS[:looks], 1)}
    runs = [
        relaxation_run(
            work,
            f"{slug}-{n}",
            *_scheme(series),
            over_tau=interval,
            spans=n * interval,
            looks=1,
        )
        for n in sorted(counts)
    ]
    return {
        "relaxation_error": max(run["relaxation_error"] for run in runs),
        "core_s": sum(run["core_s"] for run in runs),
        "steps": _SPANS / interval,
    }


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Falling fines against v_T (1 - exp(-t/tau)), invasions against drag at every step.

    Invasions are compared seed by seed.
    """
    falls = [run for run in measured if "looks" in run.point.settings]
    windows = [run for run in measured if run.point.settings.get("form") == "window"]
    invasions = [run for run in measured if run not in falls and run not in windows]
    rows = sizes(falls, "relaxation_error")
    rows += [
        row for name in OBSERVED for row in against_reference(invasions, name, _is_every_step)
    ]
    rows += profile_distance(invasions, BINS, _is_every_step)
    if windows:
        rows += [
            row
            for name in ("invaded", "mean_depth")
            for row in against_reference(windows, name, _is_every_step)
        ]
    return rows


def _is_every_step(run: Measured) -> bool:
    return run.point.value == EVERY


STUDY = Study(
    name="drag",
    title="Drag schemes",
    knob_label="interval between evaluations of drag over tau, or the scheme",
    points=points,
    measure=measure,
    judge=judge,
    inputs=base_inputs,
    needs_liggghts=True,
    panels=(
        Panel(
            quantity="relaxation_error",
            title="a falling fine (steps: evaluations of drag in 3 tau)",
            label="largest error over v_T",
            cost="steps",
        ),
        Panel(quantity="invaded", title="invasion: fines inside", series=(HOLDING, OTHER)),
        Panel(quantity="mean_depth", title="invasion: mean depth", series=(HOLDING, OTHER)),
        Panel(
            quantity="profile", title="invasion: depth profile", label="distance over mean depth"
        ),
        Panel(quantity="porosity_loss", title="invasion: porosity lost"),
        Panel(quantity="k_ratio_first", title="invasion: k/k0 of the first millimetre"),
        Panel(
            quantity="invaded",
            title="fines inside, first 0.1 ms with 20,000 fines",
            series=(WINDOW_HOLDING, WINDOW_OTHER),
        ),
        Panel(
            quantity="mean_depth",
            title="mean depth, first 0.1 ms with 20,000 fines",
            series=(WINDOW_HOLDING, WINDOW_OTHER),
        ),
    ),
    defaults=dict.fromkeys((HELD, HOLDING, WINDOW_HOLDING), HOLD_OVER_RELAXATION),
)
