"""Defaults: what each one changes in the quick specimens 1, 5 and 6, against its value before."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_path, read_case
from fdnet.studies.dem.runs import invasion_run
from fdnet.studies.engine.bands import half_width
from fdnet.studies.engine.error_rows import against_reference
from fdnet.studies.engine.levels import levels, percent
from fdnet.studies.engine.markdown import markdown_table
from fdnet.studies.engine.study import DONE, Measured, Panel, Point, Row, Study

SERIES = ("specimen 1", "specimen 5", "specimen 6")
NOW, WALLS, SMOOTH, FAST, SHORT, AT_ONCE, BEFORE = (
    "all defaults",
    "walls with friction",
    "walls without friction",
    "upstream as in the pores",
    "step 0.1",
    "slab at once",
    "all as before",
)
_NOW: Mapping[str, str] = {
    "box.sides": "periodic",
    "box.wall_friction": "0.55",
    "drag.upstream": "darcy",
    "run.time_step_factor": "0.2",
    "fines.supply": "batches",
}
"""The defaults, written out; the friction of walls is that of the grains."""
_CHANGES: Mapping[str, Mapping[str, str]] = {
    NOW: {},
    WALLS: {"box.sides": "walls"},
    SMOOTH: {"box.sides": "walls", "box.wall_friction": "0.0"},
    FAST: {"drag.upstream": "interstitial"},
    SHORT: {"run.time_step_factor": "0.1"},
    AT_ONCE: {"fines.supply": "slab"},
}
_BEFORE = {key: value for keys in _CHANGES.values() for key, value in keys.items()}
OBSERVED = ("invaded", "depth_p95", "k_ratio")
_WORDS: Mapping[str, str] = {
    "invaded": "fines inside",
    "depth_p95": "95 % above, mm",
    "k_ratio": "k/k0",
}
_SHORT = ("fines.count=4000", "run.cap_ms=0.5")
"""Specimen 6 is followed for half of its quick form, since its fines are the most."""
_SMALL = ("box.size_mm=[2.0,1.2,1.2]", "grains.count=28", "fines.count=60", "run.cap_ms=0.4")


def points(quick: bool) -> list[Point]:
    """Every default alone and all together, seed by seed."""
    size = "small" if quick else "whole"
    return [
        Point(series=series, knob="setting", value=value, seed=seed, settings={"size": size})
        for seed in range(1, 3 if quick else 4)
        for series in (SERIES[:1] if quick else SERIES)
        for value in ((NOW, SHORT) if quick else (*_CHANGES, BEFORE))
    ]


def case_of(point: Point) -> InvasionCase:
    """The quick form of a specimen of the thesis with some settings as before."""
    changed = _BEFORE if point.value == BEFORE else _CHANGES[str(point.value)]
    keys = {**_NOW, **changed, "seed": str(point.seed)}
    small: tuple[str, ...] = _SHORT if point.series == SERIES[2] else ()
    if point.settings["size"] == "small":
        small = _SMALL
    path = case_path(f"quick-{point.series.replace(' ', '')}")
    assignments = [*(f"{key}={value}" for key, value in keys.items()), *small]
    return with_fines(read_case(path, assignments=assignments))


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One invasion."""
    return invasion_run(case_of(point), work, point.slug)


def inputs() -> str:
    """The cases of all points, as text: whose numbers a record holds."""
    return "\n".join(case_of(point).toml() for quick in (True, False) for point in points(quick))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Each run against that of the same seed with all defaults."""
    rows = []
    for series in SERIES:
        runs = [run for run in measured if run.point.series == series]
        if runs:
            rows += [row for name in OBSERVED for row in against_reference(runs, name, _is_now)]
    return rows


def _is_now(run: Measured) -> bool:
    return run.point.value == NOW


def summary(rows: Sequence[Row]) -> str:
    """A table of every setting: what it gives, and how that differs from the defaults."""
    heads = ["specimen, setting", "seeds", "core s"]
    for name in OBSERVED:
        heads += [_WORDS[name], "change"]
    lines = []
    for series in SERIES:
        by_quantity = {
            name: {one.value: one for one in levels(rows, series, name)} for name in OBSERVED
        }
        for value, first in by_quantity[OBSERVED[0]].items():
            cells = [f"{series}, {value}", str(first.runs), f"{first.cost:.2g}"]
            for name in OBSERVED:
                level = by_quantity[name][value]
                seen = [
                    row.observed
                    for row in rows
                    if (row.series, row.value, row.quantity) == (series, value, name)
                    and row.status == DONE
                ]
                cells += [_mean(name, seen), "-" if level.reference else percent(level)]
            lines.append(cells)
    return markdown_table(heads, lines)


def _mean(name: str, seen: Sequence[float]) -> str:
    scale = 1e3 if name == "depth_p95" else 1.0
    band = f" ± {scale * half_width(seen):.2g}" if len(seen) > 1 else ""
    return f"{scale * float(np.mean(seen)):.3g}{band}"


STUDY = Study(
    name="defaults",
    title="Defaults of an invasion",
    knob_label="setting",
    points=points,
    measure=measure,
    judge=judge,
    inputs=inputs,
    needs_liggghts=True,
    panels=tuple(Panel(quantity=name, title=_WORDS[name]) for name in OBSERVED),
    defaults=dict.fromkeys(SERIES, NOW),
    summary=summary,
)
