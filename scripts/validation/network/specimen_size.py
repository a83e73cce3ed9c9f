"""Specimen size and seed: how k, porosity and damage converge with the number of grains."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.network.permeability import analyse
from validation.dem.runs import grains_of, invasion_run, slab_case
from validation.engine.error_rows import against_reference
from validation.engine.study import Measured, Panel, Point, Row, Study, Value

PERIODIC, WALLS = "periodic sides", "walls at the sides"
INTACT, INVADED = "intact", "invaded"
NAMED: Mapping[str, tuple[str, int]] = {
    "tests' tiny case": ("3.0,1.6,1.6", 70),
    "quick case": ("4.0,2.4,2.4", 211),
    "specimen 5": ("8.0,4.0,4.0", 1173),
}
"""Boxes in use, mm, and their grains at porosity 0.40: a quick case next to a real one."""
_BOXES = {f"invaded, {name}" for name in NAMED}
_SIDES = {PERIODIC: "periodic", WALLS: "walls"}
_GRAIN_MM3 = 4 / 3 * 3.141592653589793 * 0.25**3
_FINES_PER_MM2 = 122.0
_LENGTH_MM = 3.0
_STIFFNESS = 1e3
_QUANTITIES = {
    INTACT: ("porosity_initial", "k_initial"),
    INVADED: ("porosity_loss_first", "count_per_mm2", "k_ratio_first"),
}


def points(quick: bool) -> list[Point]:
    """Cubes for the intact pack, slabs of equal length for the invasion, then the boxes in use."""
    if quick:
        return [*_cubes((1.25, 1.75, 2.5), 4, PERIODIC), *_faces((1.25, 1.75), 3, PERIODIC)]
    chosen = []
    for sides in (PERIODIC, WALLS):
        chosen += _cubes((1.25, 1.5, 2.0, 2.5, 3.0, 4.0), 10, sides) + _cubes((5.5, 8.0), 5, sides)
        chosen += _faces((1.25, 1.6, 2.4, 3.4), 10, sides) + _faces((4.8, 6.8), 6, sides)
    return chosen + [
        Point(
            series=f"{INVADED}, {name}",
            knob="grains",
            value=float(n),
            seed=seed,
            settings={"size_mm": size, "count": n},
        )
        for name, (size, n) in NAMED.items()
        for seed in range(1, 7)
    ]


def _cubes(edges: Sequence[float], seeds: int, sides: str) -> list[Point]:
    return [
        _point(INTACT, sides, (edge, edge, edge), seed)
        for edge in edges
        for seed in range(1, seeds + 1)
    ]


def _faces(edges: Sequence[float], seeds: int, sides: str) -> list[Point]:
    return [
        _point(INVADED, sides, (_LENGTH_MM, edge, edge), seed)
        for edge in edges
        for seed in range(1, seeds + 1)
    ]


def _point(what: str, sides: str, size: tuple[float, float, float], seed: int) -> Point:
    count = round(0.6 * size[0] * size[1] * size[2] / _GRAIN_MM3)
    settings: dict[str, Value] = {"size_mm": ",".join(f"{s:g}" for s in size), "count": count}
    return Point(
        series=f"{what}, {sides}", knob="grains", value=float(count), seed=seed, settings=settings
    )


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One pack, or one invasion of 2 ms with 122 fines of 0.10 mm a mm2 of face."""
    what, sides = point.series.split(", ")
    size = str(point.settings["size_mm"])
    length, width, height = (float(s) for s in size.split(","))
    assignments = (
        f"box.size_mm=[{size}]",
        f"box.sides={_SIDES.get(sides, 'walls')}",
        f"grains.count={point.settings['count']}",
        f"fines.count={round(_FINES_PER_MM2 * width * height)}",
        f"run.stiffness_N_m={_STIFFNESS}",
        f"analysis.sections={round(length)}",
    )
    case = slab_case(point.seed, *assignments)
    if what == INTACT:
        intact = analyse(grains_of(case, work), None, periodic=case.periodic)
        return {"porosity_initial": intact.porosity_initial, "k_initial": intact.k_initial}
    run = invasion_run(case, work, point.slug)
    return run | {"count_per_mm2": run["count_first"] / (width * height)}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Everything against the mean of the largest periodic specimens.

    Rows hold the bias of the mean, and by how much one run is off.
    """
    rows = []
    for what, names in _QUANTITIES.items():
        runs = [
            run
            for run in measured
            if run.point.series.startswith(what) or run.point.series in _BOXES
        ]
        largest = max(run.point.value for run in runs if run.point.series == f"{what}, {PERIODIC}")

        def is_largest(run: Measured, what: str = what, largest: Value = largest) -> bool:
            return run.point.series == f"{what}, {PERIODIC}" and run.point.value == largest

        for name in names:
            rows += against_reference(runs, name, is_largest, paired=False)
            rows += against_reference(runs, name, is_largest, paired=False, magnitude=True)
    return rows


STUDY = Study(
    name="specimen-size",
    title="Specimen size and seed",
    knob_label="grains",
    points=points,
    measure=measure,
    judge=judge,
    panels=(
        Panel(quantity="k_initial", title="permeability: bias of the mean"),
        Panel(
            quantity="one run's k_initial",
            title="permeability: one run",
            label="mean |relative error|",
        ),
        Panel(
            quantity="one run's porosity_initial",
            title="porosity: one run",
            label="mean |relative error|",
        ),
        Panel(
            quantity="one run's porosity_loss_first",
            title="porosity lost, first mm: one run",
            label="mean |relative error|",
        ),
        Panel(
            quantity="one run's count_per_mm2",
            title="fines a mm² of face, first mm: one run",
            label="mean |relative error|",
        ),
        Panel(quantity="k_ratio_first", title="k/k0 of the first mm: bias of the mean"),
        Panel(
            quantity="one run's k_ratio_first",
            title="k/k0 of the first mm: one run",
            label="mean |relative error|",
        ),
    ),
)
