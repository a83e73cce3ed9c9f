"""The mechanics of packs: size and sides, load steps, and the same test in LIGGGHTS."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.case.file import case_from
from fdnet.mechanics.elastic import elastic_of
from fdnet.mechanics.of_case import pack_material
from fdnet.mechanics.springs import Cement
from fdnet.mechanics.triaxial import Sheared, Triaxial, triaxial
from fdnet.spheres.snapshot import Array, Snapshot
from validation.dem.mechanics_figure import Panel, draw_ranges
from validation.dem.mechanics_page import mechanics_page
from validation.dem.runs import grains_of
from validation.dem.servo import Curve, Servo, run_servo, time_step
from validation.engine.error_rows import against_reference
from validation.engine.study import Measured, Point, Row, Study

WALLS, PERIODIC = "moduli, walls at the sides", "moduli, periodic sides"
BARE, BONDED = "load steps, bare", "load steps, bonded"
LIGGGHTS, STATIC = "unbonded test, LIGGGHTS", "unbonded test, quasi-static"
PRESSURE, RATE, STRAIN = 2e4, 2.5, 0.02
"""Confining stress, Pa, strain rate, 1/s, and strain of the unbonded test.

A contact overlaps by 5e-4 of a diameter; the inertial number is below 1e-3."""
_SOFT, _SHEAR = 2e4, 7.2e3
_CONFINED, _TO = 2e4, 0.012
_CEMENT = Cement(
    radius_ratio=0.5, normal=2e10, shear=8e9, tensile_strength=1.2e5, shear_strength=1.2e5
)
_PRESS_STEPS, _POROSITY = 12_000, 0.36
_QUANTITIES = {
    "moduli": ("young", "shear"),
    "load steps": ("peak", "volume_strain"),
    "unbonded test": ("slope", "ratio_half", "ratio_end", "dilation"),
}


def points(quick: bool) -> list[Point]:
    """Cubes with walls and periodic sides, load steps, and seeds of the unbonded test."""
    edges: tuple[float, ...] = (1.9, 2.4, 3.0)
    steps: tuple[int, ...] = (3, 6, 12, 24)
    seeds = 3
    if quick:
        edges, steps, seeds = edges[:2], steps[:2], 1
    chosen = [
        Point(series=sides, knob="edge", value=edge, seed=seed)
        for edge in edges
        for sides in (WALLS, PERIODIC)
        for seed in range(1, seeds + 1)
    ]
    chosen += [
        Point(series=series, knob="load steps", value=float(count), seed=seed)
        for count in steps
        for series in ((BARE,) if quick else (BARE, BONDED))
        for seed in range(1, min(seeds, 2) + 1)
    ]
    return chosen + [
        Point(series=series, knob="seeds", value=0.0, seed=seed)
        for seed in range(1, seeds + 1)
        for series in (STATIC, LIGGGHTS)
    ]


def pack_case(seed: int, edge: float, sides: str) -> Case:
    """A cube of sand of porosity 0.36; its edge is in mm."""
    return case_from(
        {
            "name": "cube",
            "seed": seed,
            "box": {"size_mm": [edge] * 3, "sides": sides, "wall_friction": 0.0},
            "grains": {
                "radius_mm": 0.25,
                "porosity": _POROSITY,
                "density_kg_m3": 2650.0,
                "normal_stiffness_N_m": _SOFT,
                "shear_stiffness_N_m": _SHEAR,
            },
            "run": {"stiffness_N_m": "nominal"},
        }
    )


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Moduli of one cube, one quasi-static test, or one in LIGGGHTS."""
    if point.series in (WALLS, PERIODIC):
        sides = "walls" if point.series == WALLS else "periodic"
        case = pack_case(point.seed, float(point.value), sides)
        grains = grains_of(case, work)
        result = elastic_of(grains, pack_material(case, grains), periodic=case.periodic)
        return {"young": result.averaged.young, "shear": result.averaged.shear}
    if point.series in (BARE, BONDED):
        return _load_steps(point, work)
    case = pack_case(point.seed, 2.4, "walls")
    pressed = _pressed(case, work)
    if point.series == LIGGGHTS:
        steps = round(STRAIN / RATE / time_step(case))
        servo = Servo(stress=PRESSURE, strain_rate=RATE, steps=steps, friction=True)
        curve = run_servo(case, pressed, servo, work / point.slug)
        return _numbers(*_of_servo(curve))
    test = Triaxial(confining=PRESSURE, strain=STRAIN, steps=40, relieved=False)
    material = pack_material(case, pressed)
    return _numbers(*_of_rows(triaxial(pressed, material, test, periodic=(False,) * 3)))


def _load_steps(point: Point, work: Path) -> Mapping[str, float]:
    case = pack_case(point.seed, 1.9, "periodic")
    grains = grains_of(case, work)
    material = pack_material(case, grains)
    if point.series == BONDED:
        material = replace(material, cement=_CEMENT)
    test = Triaxial(confining=_CONFINED, strain=_TO, steps=int(point.value))
    result = triaxial(grains, material, test, periodic=case.periodic)
    return {"peak": result.peak.deviatoric, "volume_strain": result.rows[-1].volume_strain}


def _pressed(case: Case, work: Path) -> Snapshot:
    """The pack pressed by LIGGGHTS on all sides without friction; both tests start from it."""
    grains = grains_of(case, work)
    servo = Servo(stress=PRESSURE, strain_rate=0.0, steps=_PRESS_STEPS, friction=False)
    return run_servo(case, grains, servo, work / f"pressed-{case.seed}").grains


def _of_servo(curve: Curve) -> tuple[Array, Array, Array]:
    strain = -np.log(curve.side / curve.side[0])
    return strain[:, 0], curve.stress[:, 0] / curve.stress[:, 1:].mean(axis=1), strain.sum(axis=1)


def _of_rows(result: Sheared) -> tuple[Array, Array, Array]:
    rows = result.rows
    return (
        np.array([row.axial_strain for row in rows]),
        np.array([row.axial / row.side for row in rows]),
        np.array([row.volume_strain for row in rows]),
    )


def _numbers(strain: Array, ratio: Array, volume: Array) -> Mapping[str, float]:
    """Slope at a strain of 0.2 %, means of axial over side stress, and the final dilation."""
    half = (strain >= 0.25 * STRAIN) & (strain <= 0.6 * STRAIN)
    end = strain >= 0.75 * STRAIN
    return {
        "slope": float(np.interp(0.1 * STRAIN, strain, ratio) - ratio[0]) / (0.1 * STRAIN),
        "ratio_half": float(ratio[half].mean()),
        "ratio_end": float(ratio[end].mean()),
        "dilation": float(-volume[-1]),
    }


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Moduli against the largest periodic cubes, load steps against the most of them.

    The quasi-static test is judged against LIGGGHTS.
    """
    rows = []
    for what, names in _QUANTITIES.items():
        runs = [run for run in measured if run.point.series.startswith(what)]
        for series in (BARE, BONDED) if what == "load steps" else ("",):
            some = [run for run in runs if run.point.series.startswith(series)]
            if not some:
                continue
            for name in names:
                rows += against_reference(
                    some, name, _is_reference(some, what), paired=what == "load steps"
                )
    return rows


def _is_reference(runs: Sequence[Measured], what: str) -> Callable[[Measured], bool]:
    largest = max(float(run.point.value) for run in runs)

    def reference(run: Measured) -> bool:
        if what == "unbonded test":
            return run.point.series == LIGGGHTS
        return float(run.point.value) == largest and run.point.series != WALLS

    return reference


def draw_moduli(rows: Sequence[Row], path: Path) -> None:
    """Young's modulus by size, the peak by load steps, and the unbonded test by seed."""
    both = (LIGGGHTS, STATIC)
    tests = [replace(row, value=float(row.seed)) for row in rows if row.series in both]
    panels: list[Panel] = [
        ("Young's modulus, MPa", "edge of the cube, mm", (WALLS, PERIODIC), "young", _in_MPa),
        ("peak over that of the most steps", "load steps", (BARE, BONDED), "peak", _share),
        ("axial over side stress, 1.5 to 2 %", "seed", (LIGGGHTS, STATIC), "ratio_end", _itself),
    ]
    others = [row for row in rows if row.series not in both]
    draw_ranges([*others, *tests], path, panels)


def _in_MPa(row: Row) -> float:
    return 1e-6 * row.observed


def _share(row: Row) -> float:
    return 1 + row.error


def _itself(row: Row) -> float:
    return row.observed


STUDY = Study(
    name="mechanics",
    title="Mechanics of packs",
    knob_label="edge of the cube, mm, or load steps",
    points=points,
    measure=measure,
    judge=judge,
    panels=(),
    defaults={BARE: 20.0, BONDED: 20.0},
    draw=draw_moduli,
    page=lambda rows: mechanics_page(rows, (WALLS, PERIODIC, BARE, BONDED, LIGGGHTS, STATIC)),
    needs_liggghts=True,
)
