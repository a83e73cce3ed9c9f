"""Size ratio: how many of sixty dilute fines a pack holds, by stiffness, step and shear stiffness.

No fine of 1/10 of a grain or smaller is held by the geometry of this pack, so those held are
locked between two grains. The pack is that of the quick case of specimen 6.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from scipy.stats import binomtest

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from
from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import invasion_scales
from validation.dem.runs import window_run
from validation.engine.error_rows import sizes
from validation.engine.markdown import markdown_table
from validation.engine.study import DONE, Measured, Panel, Point, Row, Study, Value

DEFAULT, MATERIAL = "default shear", "the materials' shear"
SHEARS: Mapping[str, tuple[float, float] | None] = {DEFAULT: None, MATERIAL: (34.0e9, 26.0e9)}
"""Tangential stiffness of grains and fines, N/m; None leaves it to fdnet."""
STIFFNESS, STEP = "stiffness_N_m", "dt_over_sqrt_m_k"
FINES = 60
RATIOS = (5, 10, 20, 30)
_GRAIN_MM, _SIDE_MM, _LENGTH_MM, _SLAB_MM = 0.25, 1.6, 4.0, 0.8
_OWN_STIFFNESS, _OWN_FACTOR = 1e4, 0.1
HELD, BY_STEP = "held_share", ", by step"


def points(quick: bool) -> list[Point]:
    """Stiffness and step, by size ratio and shear stiffness; cheapest first."""
    if quick:
        return [_point(20, shear, STEP, 0.2) for shear in SHEARS]
    return [
        _point(ratio, shear, knob, value)
        for knob, values in ((STIFFNESS, (1e3, 1e4, 1e5)), (STEP, (0.2, 0.05)))
        for value in values
        for ratio in RATIOS
        for shear in SHEARS
    ]


def _point(ratio: int, shear: str, knob: str, value: float) -> Point:
    settings: dict[str, Value] = {"ratio": float(ratio), "shear": shear}
    return Point(
        series=_series(ratio, shear, knob), knob=knob, value=value, seed=1, settings=settings
    )


def _series(ratio: int, shear: str, knob: str) -> str:
    return f"1/{ratio}, {shear}" + (BY_STEP if knob == STEP else "")


def case_of(point: Point) -> InvasionCase:
    """Sixty fines in a slab as dilute as they are few, followed for three passages."""
    ratio, given = float(point.settings["ratio"]), SHEARS[str(point.settings["shear"])]
    radius = _GRAIN_MM / ratio
    volume = sphere_mass(radius, 1.0)
    knobs = {STIFFNESS: _OWN_STIFFNESS, STEP: _OWN_FACTOR, point.knob: float(point.value)}
    material = [{} if given is None else {"shear_stiffness_N_m": one} for one in given or (0, 0)]
    return with_fines(
        case_from(
            {
                "name": "size-ratio",
                "seed": point.seed,
                "box": {"size_mm": [_LENGTH_MM, *[_SIDE_MM] * 2], "wall_friction": 0.0},
                "grains": {"radius_mm": _GRAIN_MM, "porosity": 0.40, **material[0]},
                "fines": {
                    "radius_mm": radius,
                    "count": FINES,
                    "concentration": FINES * volume / (_SIDE_MM**2 * _SLAB_MM),
                    "supply": "slab",
                    **material[1],
                },
                "fluid": {"darcy_length_mm": 8.0},
                "drag": {
                    "upstream": "interstitial",
                    "scheme": "viscous",
                    "pressure_gradient": False,
                },
                "run": {
                    "duration_ms": 2.4,
                    "checkpoint_ms": 0.6,
                    "stiffness_N_m": knobs[STIFFNESS],
                    "time_step_factor": knobs[STEP],
                },
            }
        )
    )


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Share of the fines that are held, the scales of their sticking, and costs."""
    case = case_of(point)
    sticking = invasion_scales(case).sticking
    seen = window_run(case, work, point.slug)
    return {
        HELD: seen["invaded"] / FINES,
        "false_force": sticking.false_force,
        "push": sticking.push,
    } | {name: seen[name] for name in ("steps", "core_s", "wall_s")}


def inputs() -> str:
    """The cases of all points, as text: whose numbers a record holds."""
    return "\n".join(case_of(point).toml() for quick in (True, False) for point in points(quick))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """The share that is held, as it is, with the false force of the integrator and the push."""
    return [row for name in (HELD, "false_force", "push") for row in sizes(measured, name)]


def summary(rows: Sequence[Row]) -> str:
    """A table of all points: how many of sixty fines are held, with the binomial 95 % band."""
    heads = (
        "fine over grain, tangential springs",
        "stiffness, N/m",
        "step over sqrt(m/k)",
        "push F/(k r)",
        "false force over push",
        "held of 60",
        "95 % (binomial)",
        "core s",
    )
    scales = {(row.run, row.quantity): row.observed for row in rows}
    lines = [
        (
            row.series.removesuffix(BY_STEP),
            f"{row.value if row.knob == STIFFNESS else _OWN_STIFFNESS:g}",
            f"{row.value if row.knob == STEP else _OWN_FACTOR:g}",
            f"{scales[row.run, 'push']:.1e}",
            f"{scales[row.run, 'false_force']:.2g}",
            f"{held_of(row)}",
            "{} to {}".format(*held_band(held_of(row))),
            f"{row.core_s:.3g}",
        )
        for row in rows
        if row.quantity == HELD and row.status == DONE
    ]
    return markdown_table(heads, sorted(lines, key=lambda line: _order(line[0])))


def _order(series: str) -> tuple[str, float]:
    ratio, shear, *_ = series.split(", ")
    return shear, float(ratio.removeprefix("1/"))


def held_of(row: Row) -> int:
    """Number of fines held in a run."""
    return round(row.observed * FINES)


def held_band(held: int) -> tuple[int, int]:
    """The 95 % band of that number of the sixty (Clopper and Pearson 1934), widened to counts."""
    band = binomtest(held, FINES).proportion_ci(0.95, method="exact")
    return math.floor(FINES * band.low + 1e-9), math.ceil(FINES * band.high - 1e-9)


def _panel(knob: str, label: str, fixed: str) -> Panel:
    return Panel(
        quantity=HELD,
        title=f"held of {FINES} fines, {fixed}",
        series=tuple(_series(ratio, shear, knob) for shear in SHEARS for ratio in RATIOS),
        label="share held",
        cost="value",
        common=BY_STEP if knob == STEP else "",
        knob=label,
    )


STUDY = Study(
    name="size-ratio",
    title="Size ratio: dilute fines held in a pack",
    knob_label="setting",
    points=points,
    measure=measure,
    judge=judge,
    inputs=inputs,
    needs_liggghts=True,
    panels=(
        _panel(STIFFNESS, "stiffness, N/m", "step 0.1 sqrt(m/k)"),
        _panel(STEP, "step over sqrt(m/k)", "stiffness 1e4 N/m"),
    ),
    summary=summary,
)
