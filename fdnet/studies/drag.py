"""Drag: four schemes against the exact relaxation of one fine, and in whole invasions against drag at every step."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.case import Case
from fdnet.scales import scales_of
from fdnet.studies.dem_runs import PROFILE_BINS, invasion_run, relaxation_run, slab_case
from fdnet.studies.judge import against_exact, against_reference, profile_distance
from fdnet.studies.study import Measured, Panel, Point, Row, Study, Value
from fdnet.time_step import HOLD_OVER_RELAXATION

EVERY, HELD, IMPLICIT, VISCOUS = "every_step", "held", "implicit", "viscous"
SCHEMES = (EVERY, HELD, IMPLICIT, VISCOUS)
HOLDING, OTHER = "invasion, held", "invasion, not held"
RESTARTED = "implicit, a run every tau/4"
STIFFNESS = 1e3
"""Of the invasions, N/m, so that six seeds of every scheme fit into some minutes."""
STEPS_PER_TAU = 200
"""Of the invasions: 0.1 sqrt(m/k) at that stiffness, to 1 %."""
_BINS = tuple(f"bin_{number:02d}" for number in range(PROFILE_BINS))
_PLAIN = ("invaded", "mean_depth", "porosity_loss", "k_ratio_first")
_LOOKS = (1.0, 0.5, 2.0)
"""Times, in tau, at which a falling fine is looked at; the quick form takes the first alone."""
_SPANS = 3.0


def points(quick: bool) -> list[Point]:
    """Falling fines, the interval from long to short; then invasions, seed by seed, so that load meets all alike."""
    if quick:
        found = [point for scheme in SCHEMES for point in _falls(scheme, (0.2, 0.1, 0.05), looks=1)]
        found += _falls(IMPLICIT, (10.0,), looks=1) + _falls(EVERY, (2.0,), looks=1)
        return found + _invasions((0.05, 1.0), seeds=2, size="small")
    common = (2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
    found = [point for scheme in (EVERY, HELD, VISCOUS) for point in _falls(scheme, common, looks=3)]
    found += _falls(IMPLICIT, (100.0, 30.0, 10.0, 5.0, *common), looks=3)
    found += _falls(RESTARTED, (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002), looks=0)
    return found + _invasions((1.0, 0.5, 0.2, 0.1, HOLD_OVER_RELAXATION, 0.02), seeds=6, size="whole")


def _falls(series: str, intervals: Sequence[float], *, looks: int) -> list[Point]:
    settings = {"looks": float(looks)}
    return [Point(series=series, knob="interval_over_tau", value=value, settings=settings) for value in intervals]


def _invasions(held: Sequence[float], *, seeds: int, size: str) -> list[Point]:
    values: list[tuple[str, Value]] = [
        (HOLDING, EVERY),
        *((HOLDING, value) for value in held),
        (OTHER, VISCOUS),
        (OTHER, IMPLICIT),
    ]
    return [
        Point(series=series, knob="drag", value=value, seed=seed, settings={"size": size})
        for seed in range(1, seeds + 1)
        for series, value in values
    ]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One falling fine, or one invasion with the scheme `value`, or held for `value` tau."""
    if "looks" in point.settings:
        assert isinstance(point.value, float)
        return _fall(point.series, point.value, int(point.settings["looks"]), work, point.slug)
    return invasion_run(_invasion_case(point), work, point.slug)


def _invasion_case(point: Point) -> Case:
    """Step, chunk (4 tau) and duration are whole fractions and multiples of tau: all schemes run the same steps."""
    small = point.settings["size"] == "small"
    tau = scales_of(slab_case(point.seed, small=small)).relaxation_time[0]
    return slab_case(
        point.seed,
        f"run.stiffness_N_m={STIFFNESS!r}",
        f"run.time_step_s={tau / STEPS_PER_TAU!r}",
        f"run.checkpoint_ms={4e3 * tau!r}",
        f"run.duration_ms={4e3 * tau * (5 if small else 21)!r}",
        *_scheme_keys(point.value),
        small=small,
    )


def _scheme_keys(value: Value) -> tuple[str, ...]:
    if isinstance(value, str):
        return (f"drag.scheme={value}",)
    return (f"drag.scheme={HELD}", f"drag.refresh_steps={round(value * STEPS_PER_TAU)}")


def _fall(series: str, interval: float, looks: int, work: Path, slug: str) -> dict[str, float]:
    """Largest error of a falling fine at the looks, each a run of its own; "steps" are evaluations of drag in 3 tau."""
    if not looks:
        found = relaxation_run(work, slug, f"drag.scheme={IMPLICIT}", over_tau=interval, spans=_SPANS)
        return found | {"steps": _SPANS / interval}
    counts = {max(least, round(time / interval)) for least, time in enumerate(_LOOKS[:looks], 1)}
    runs = [
        relaxation_run(work, f"{slug}-{n}", f"drag.scheme={series}", over_tau=interval, spans=n * interval, looks=1)
        for n in sorted(counts)
    ]
    return {
        "relaxation_error": max(run["relaxation_error"] for run in runs),
        "core_s": sum(run["core_s"] for run in runs),
        "steps": _SPANS / interval,
    }


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Falling fines against v_T (1 - exp(-t/tau)); invasions against drag at every step, seed by seed."""
    falls = [run for run in measured if "looks" in run.point.settings]
    invasions = [run for run in measured if "looks" not in run.point.settings]
    rows = against_exact(falls, "relaxation_error", lambda _: 0.0, scale=lambda _: 1.0)
    rows += [row for name in _PLAIN for row in against_reference(invasions, name, _is_every_step)]
    return rows + profile_distance(invasions, _BINS, _is_every_step)


def _is_every_step(run: Measured) -> bool:
    return run.point.value == EVERY


STUDY = Study(
    name="drag",
    title="Drag schemes",
    knob_label="interval between evaluations of drag over tau, or the scheme",
    points=points,
    measure=measure,
    judge=judge,
    panels=(
        Panel(
            quantity="relaxation_error",
            title="a falling fine (steps: evaluations of drag in 3 tau)",
            label="largest error over v_T",
            cost="steps",
        ),
        Panel(quantity="invaded", title="invasion: fines inside"),
        Panel(quantity="mean_depth", title="invasion: mean depth"),
        Panel(quantity="profile", title="invasion: depth profile", label="distance over mean depth"),
        Panel(quantity="porosity_loss", title="invasion: porosity lost"),
        Panel(quantity="k_ratio_first", title="invasion: k/k0 of the first millimetre"),
    ),
    defaults={HELD: HOLD_OVER_RELAXATION, HOLDING: HOLD_OVER_RELAXATION},
)
