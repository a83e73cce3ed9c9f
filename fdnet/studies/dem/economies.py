"""Economies: what each setting that makes full-scale invasions affordable costs and saves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.studies.dem.runs import OBSERVED, invasion_run, slab_case
from fdnet.studies.engine.error_rows import against_reference
from fdnet.studies.engine.levels import Level, levels, percent
from fdnet.studies.engine.markdown import markdown_table
from fdnet.studies.engine.study import DONE, Measured, Panel, Point, Row, Study, Value

EQUAL, LONG, UNEQUAL = "equal fines", "long supply", "unequal fines"
SERIES = (EQUAL, LONG, UNEQUAL)
PLAIN, BATCHES, STEP, HELD, VISCOUS, IMPLICIT, ALL = (
    "plain",
    "batches",
    "step 0.2",
    "held",
    "viscous",
    "implicit",
    "all",
)
SOFT, SOFTER = "3e3 N/m", "1e3 N/m"
_PLAIN: Mapping[str, str] = {
    "drag.scheme": "held",
    "fines.supply": "slab",
    "run.time_step_factor": "0.1",
    "run.stiffness_N_m": "1e4",
}
_KEYS: Mapping[str, Mapping[str, str]] = {
    PLAIN: {},
    BATCHES: {"fines.supply": "batches"},
    STEP: {"run.time_step_factor": "0.2"},
    SOFT: {"run.stiffness_N_m": "3e3"},
    SOFTER: {"run.stiffness_N_m": "1e3"},
    HELD: {},
    VISCOUS: {"drag.scheme": "viscous"},
    IMPLICIT: {"drag.scheme": "implicit"},
}
_TOGETHER: Mapping[str, tuple[str, ...]] = {
    EQUAL: (BATCHES, STEP, VISCOUS),
    LONG: (BATCHES, STEP, VISCOUS),
    UNEQUAL: (BATCHES, STEP, HELD),
}
"""The economies that "all" stands for: those of the thesis's cases, apart from their stiffness.

Equal fines are those of specimens 1 to 6, unequal ones those of 7 and 8.
"""
_FINES: Mapping[str, Mapping[str, str]] = {
    EQUAL: {},
    LONG: {},
    UNEQUAL: {"fines.radius_mm": "[0.025,0.05]"},
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """Invasions for one series.

    The supply arrives for most of the duration. The long supply would arrive for eight times the
    duration, as where a case supplies many more fines than its stop rule turns out to need.

    Attributes:
        fines: number of fines that are supplied.
        duration_ms: duration of the invasion, ms.
        tried: the economies.
        seeds: number of seeds of each.
        keys: further settings.
    """

    fines: int
    duration_ms: float
    tried: tuple[str, ...]
    seeds: int
    keys: Mapping[str, str] = field(default_factory=dict)


_SHORT_CHUNKS = {"run.checkpoint_ms": "0.01"}
FORMS: Mapping[tuple[str, str], Form] = {
    ("small", EQUAL): Form(
        fines=300,
        duration_ms=0.12,
        tried=(PLAIN, BATCHES, STEP, VISCOUS, ALL),
        seeds=2,
        keys=_SHORT_CHUNKS,
    ),
    ("small", LONG): Form(
        fines=1000, duration_ms=0.05, tried=(PLAIN, BATCHES), seeds=2, keys=_SHORT_CHUNKS
    ),
    ("small", UNEQUAL): Form(
        fines=300, duration_ms=0.06, tried=(PLAIN, HELD, ALL), seeds=2, keys=_SHORT_CHUNKS
    ),
    ("whole", EQUAL): Form(
        fines=5000,
        duration_ms=0.75,
        tried=(PLAIN, BATCHES, STEP, SOFT, SOFTER, HELD, VISCOUS, ALL),
        seeds=4,
    ),
    ("whole", LONG): Form(fines=20_000, duration_ms=0.3, tried=(PLAIN, BATCHES, ALL), seeds=4),
    ("whole", UNEQUAL): Form(
        fines=6000, duration_ms=0.36, tried=(PLAIN, HELD, IMPLICIT, ALL), seeds=3
    ),
}


def points(quick: bool) -> list[Point]:
    """Invasions seed by seed, the economies in turn.

    So the load of the machine is the same for all of them.
    """
    size = "small" if quick else "whole"
    forms = {series: FORMS[size, series] for series in SERIES}
    return [
        Point(series=series, knob="economy", value=value, seed=seed, settings={"size": size})
        for seed in range(1, max(form.seeds for form in forms.values()) + 1)
        for series, form in forms.items()
        for value in form.tried
        if seed <= form.seeds
    ]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One invasion with this economy."""
    return invasion_run(case_of(point), work, point.slug)


def case_of(point: Point) -> InvasionCase:
    """The plain case with an economy, or with all of them together."""
    size, series = str(point.settings["size"]), point.series
    form = FORMS[size, series]
    keys = {"fines.count": str(form.fines), "run.duration_ms": repr(form.duration_ms), **form.keys}
    keys |= {**_PLAIN, **_FINES[series]}
    economies = _TOGETHER[series] if point.value == ALL else (str(point.value),)
    if HELD not in economies:
        keys["drag.refresh_steps"] = "1"
    for economy in economies:
        keys |= _KEYS[economy]
    return slab_case(
        point.seed, *(f"{key}={text}" for key, text in keys.items()), small=size == "small"
    )


def inputs() -> str:
    """What the plain runs start from, as text: whose numbers a record holds."""
    plain = [
        point
        for quick in (True, False)
        for point in points(quick)
        if point.seed == 1 and point.value == PLAIN
    ]
    return "\n".join(case_of(point).toml() for point in plain)


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Errors from the mean of the plain runs.

    Other fines are drawn for batches, so seeds are not paired.
    """
    rows = []
    for series in SERIES:
        runs = [run for run in measured if run.point.series == series]
        rows += [
            row
            for name in OBSERVED
            for row in against_reference(runs, name, _is_plain, paired=False)
        ]
    return rows


def _is_plain(run: Measured) -> bool:
    return run.point.value == PLAIN


def speed_ups(rows: Sequence[Row], series: str) -> dict[Value, list[float]]:
    """Core seconds of the plain run over those with each economy, seed by seed."""
    seconds: dict[Value, dict[int, float]] = {}
    for row in rows:
        if row.series == series and row.quantity == OBSERVED[0] and row.status == DONE:
            seconds.setdefault(row.value, {})[row.seed] = row.core_s
    plain = seconds.get(PLAIN, {})
    return {
        value: [plain[seed] / cost for seed, cost in by_seed.items() if seed in plain]
        for value, by_seed in seconds.items()
    }


def summary(rows: Sequence[Row]) -> str:
    """A table of every economy: its speed-up with scatter, and each error with its band."""
    heads = (
        "economy",
        "runs",
        "core s",
        "speed-up (sd over seeds)",
        *(_WORDS[name] for name in OBSERVED),
    )
    lines = []
    for series in SERIES:
        by_quantity = {
            name: {level.value: level for level in levels(rows, series, name)} for name in OBSERVED
        }
        for value, ratios in speed_ups(rows, series).items():
            errors = [by_quantity[name][value] for name in OBSERVED]
            speed = "1" if value == PLAIN else _ratio(ratios)
            cells = (f"{series}, {value}", str(errors[0].runs), f"{errors[0].cost:.3g}", speed)
            lines.append((*cells, *(_error(level) for level in errors)))
    return markdown_table(heads, lines)


def _ratio(ratios: Sequence[float]) -> str:
    if not ratios:
        return "-"
    return f"{np.mean(ratios):.2f}" + (
        f" ± {np.std(ratios, ddof=1):.2f}" if len(ratios) > 1 else ""
    )


def _error(level: Level) -> str:
    if not level.reference:
        return percent(level)
    return f"reference ± {100 * level.half_width:.2g} %" if level.half_width else "reference"


_WORDS: Mapping[str, str] = {
    "invaded": "fines inside",
    "mean_depth": "mean depth",
    "porosity_loss": "porosity lost",
    "k_ratio_first": "k/k0 of the first millimetre",
}
STUDY = Study(
    name="economies",
    title="Economies of full-scale invasions",
    knob_label="economy",
    points=points,
    measure=measure,
    judge=judge,
    inputs=inputs,
    needs_liggghts=True,
    panels=(
        *(Panel(quantity=name, title=_WORDS[name], series=(EQUAL, UNEQUAL)) for name in OBSERVED),
        *(
            Panel(quantity=name, title=_WORDS[name], series=(LONG,))
            for name in ("invaded", "porosity_loss")
        ),
    ),
    defaults=dict.fromkeys((EQUAL, UNEQUAL), HELD),
    summary=summary,
)
