"""Time step: over sqrt(m/k) in contacts, over the relaxation time tau in Stokes drag."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fdnet.case.case import Run as RunControl
from validation.dem.collisions import collision_run, energy_run
from validation.dem.runs import OBSERVED, base_inputs, invasion_run, relaxation_run, slab_case
from validation.engine.error_rows import against_reference, sizes
from validation.engine.study import Measured, Panel, Point, Row, Study, Value, ladder

COLLISION, ENERGY, INVASION, DRAG = "collision", "undamped pack", "invasion", "drag relaxation"
LONGEST = "invasion, 24 seeds"
"""The longest step and the default with more seeds, against a step of 0.1."""
_SPAN, _SPANS = 1e-5, 300.0
_STIFFNESS = 1e4
_INVASION_STIFFNESS = 1e3


def points(quick: bool) -> list[Point]:
    """Steps from coarse to fine. Packs and invasions have seeds."""
    if quick:
        chosen = _ladder(COLLISION, (0.4, 0.2, 0.1, 0.05), 1) + _ladder(
            ENERGY, (0.4, 0.2, 0.1, 0.05), 1
        )
        return (
            chosen
            + _ladder(DRAG, (0.2, 0.1, 0.05, 0.025), 1)
            + _ladder(INVASION, (0.2, 0.1, 0.05), 2, size="small")
        )
    chosen = _ladder(COLLISION, (0.8, 0.4, 0.2, 0.1, 0.05, 0.025, 0.0125, 0.00625), 1)
    chosen += _ladder(ENERGY, (1.2, 0.8, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.05, 0.025, 0.0125), 3)
    chosen += _ladder(DRAG, (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002), 1)
    chosen += _ladder(INVASION, (0.3, 0.2, 0.14, 0.1, 0.07, 0.05, 0.025, 0.0125), 6)
    return chosen + _ladder(LONGEST, (0.3, 0.2, 0.1), 24)


def _ladder(series: str, values: Sequence[float], seeds: int, size: str = "whole") -> list[Point]:
    knob = "dt_over_tau" if series == DRAG else "dt_over_sqrt_m_k"
    settings: dict[str, Value] = {"size": size} if series in (INVASION, LONGEST) else {}
    return ladder(series, knob, values, seeds=seeds, settings=settings)


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One collision, pack, relaxation or invasion with this step."""
    assert isinstance(point.value, float)
    if point.series == COLLISION:
        return _worst_collision(point, work)
    if point.series == ENERGY:
        return energy_run(work, point.slug, factor=point.value, seed=point.seed, spans=_SPANS)
    if point.series == DRAG:
        return relaxation_run(work, point.slug, "drag.refresh_steps=1", over_tau=point.value)
    step = (f"run.stiffness_N_m={_INVASION_STIFFNESS!r}", f"run.time_step_factor={point.value!r}")
    return invasion_run(
        slab_case(point.seed, *step, small=point.settings["size"] == "small"), work, point.slug
    )


def _worst_collision(point: Point, work: Path) -> Mapping[str, float]:
    """Largest errors of four collisions that begin at four places within a step; mean costs."""
    assert isinstance(point.value, float)
    runs = [
        collision_run(
            work,
            f"{point.slug}-{phase}",
            stiffness=_STIFFNESS,
            factor=point.value,
            phase=phase,
            span=_SPAN,
        )
        for phase in (0.125, 0.375, 0.625, 0.875)
    ]
    worst = {
        name: max(abs(run[name]) for run in runs)
        for name in ("overlap_error", "restitution_error")
    }
    return worst | {
        name: sum(run[name] for run in runs) / len(runs) for name in ("steps", "core_s")
    }


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Closed forms for the small systems; invasions against the smallest step of their series."""

    def of(series: str) -> list[Measured]:
        return [run for run in measured if run.point.series == series]

    rows = []
    for series, names in (
        (COLLISION, ("overlap_error", "restitution_error")),
        (ENERGY, ("energy_drift",)),
        (DRAG, ("relaxation_error",)),
    ):
        rows += [row for name in names for row in sizes(of(series), name)]
    for series in (INVASION, LONGEST):
        finest = min((run.point.value for run in of(series)), default=None)
        rows += [
            row
            for name in OBSERVED
            if finest is not None
            for row in against_reference(of(series), name, _has(finest))
        ]
    return rows


def _has(value: Value) -> Callable[[Measured], bool]:
    return lambda run: run.point.value == value


_FACTOR = RunControl().time_step_factor
STUDY = Study(
    name="time-step",
    title="Time step",
    knob_label="step over sqrt(m/k), or over tau for drag",
    points=points,
    measure=measure,
    judge=judge,
    inputs=base_inputs,
    needs_liggghts=True,
    panels=(
        Panel(quantity="overlap_error", title="deepest overlap of two fines", cost="steps"),
        Panel(quantity="restitution_error", title="restitution of two fines", cost="steps"),
        Panel(
            quantity="energy_drift",
            title="energy of an undamped pack, 300 sqrt(m/k)",
            cost="steps",
        ),
        Panel(
            quantity="relaxation_error",
            title="Stokes drag, every step",
            cost="steps",
            label="error over v_T",
        ),
        Panel(quantity="invaded", title="invasion: fines inside"),
        Panel(quantity="k_ratio_first", title="invasion: k/k0 of the first millimetre"),
    ),
    defaults={COLLISION: _FACTOR, ENERGY: _FACTOR, INVASION: _FACTOR, LONGEST: _FACTOR},
)
