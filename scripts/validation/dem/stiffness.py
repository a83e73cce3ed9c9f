"""Contact stiffness: what soft springs change in collisions and in whole invasions."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.case.case import Run as RunControl
from fdnet.errors import CaseError
from validation.dem.collisions import collision_run
from validation.dem.runs import BINS, base_inputs, invasion_run, slab_case
from validation.engine.error_rows import against_reference, profile_distance, sizes
from validation.engine.study import DONE, Measured, Panel, Point, Row, Study, Value, ladder

COLLISION, LONG, COARSE, SHORT = (
    "collision",
    "invasion, 0.10 mm",
    "invasion, 0.16 mm",
    "first 0.2 ms, 0.10 mm",
)
KNOB = "stiffness_N_m"
NOMINAL = 94.3e9
_SETTINGS: Mapping[str, tuple[str, ...]] = {
    LONG: (),
    COARSE: ("fines.radius_mm=0.08", "fines.count=400"),
    SHORT: ("run.duration_ms=0.2",),
}
_PLAIN = (
    "invaded",
    "mean_depth",
    "porosity_loss",
    "porosity_loss_first",
    "k_ratio",
    "k_ratio_first",
)
_SPAN = 1e-5


def points(quick: bool) -> list[Point]:
    """Collisions up to the nominal value, invasions up to 1e7 N/m; cheapest first."""
    if quick:
        return _ladder(COLLISION, (1e2, 1e4, NOMINAL), 1) + _ladder(
            LONG, (1e2, 1e3, 1e4), 2, size="small"
        )
    softer = (1e2, 3e2, 1e3, 3e3, 1e4, 3e4, 1e5)
    chosen = _ladder(COLLISION, (1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, NOMINAL), 1)
    chosen += (
        _ladder(LONG, softer, 6)
        + _ladder(COARSE, softer, 6)
        + _ladder(SHORT, (1e2, 1e3, 1e4, 1e5), 3)
    )
    chosen += (
        _ladder(LONG, (1e6,), 6) + _ladder(COARSE, (1e6,), 6) + _ladder(SHORT, (1e6, 1e7, 1e8), 3)
    )
    return (
        chosen
        + _ladder(COARSE, (1e7,), 3)
        + _ladder(LONG, (1e7,), 3)
        + _ladder(SHORT, (1e9, 1e10), 2)
        + _ladder(SHORT, (NOMINAL,), 1)
    )


def _ladder(series: str, values: Sequence[float], seeds: int, size: str = "whole") -> list[Point]:
    settings: dict[str, Value] = {} if series == COLLISION else {"size": size}
    return ladder(series, KNOB, values, seeds=seeds, settings=settings)


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One collision or one invasion at this stiffness of the stiffest pair."""
    assert isinstance(point.value, float)
    if point.series == COLLISION:
        return collision_run(
            work, point.slug, stiffness=point.value, factor=0.1, phase=0.5, span=_SPAN
        )
    small = point.settings["size"] == "small"
    case = slab_case(
        point.seed, *_SETTINGS[point.series], f"run.{KNOB}={point.value!r}", small=small
    )
    return invasion_run(case, work, point.slug)


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Collisions against rigid spheres and exact restitution, invasions against stiff springs."""
    collisions = [run for run in measured if run.point.series == COLLISION]
    rows = sizes(collisions, "overlap_over_diameter")
    rows += sizes(collisions, "restitution_error")
    for series in _SETTINGS:
        runs = [run for run in measured if run.point.series == series]
        if runs:
            rows += _invasion_rows(runs)
    return rows


def _invasion_rows(runs: Sequence[Measured]) -> list[Row]:
    best = _reference_value(runs)

    def is_best(run: Measured) -> bool:
        return run.point.value == best

    rows = [row for name in _PLAIN for row in against_reference(runs, name, is_best)]
    rows += sizes(runs, "max_overlap")
    return rows + profile_distance(runs, BINS, is_best)


def _reference_value(runs: Sequence[Measured]) -> float:
    """The stiffest value among those with the most seeds: its mean is the best known."""
    seeds: dict[float, int] = {}
    for run in runs:
        if run.status == DONE:
            assert isinstance(run.point.value, float)
            seeds[run.point.value] = seeds.get(run.point.value, 0) + 1
    if not seeds:
        raise CaseError(
            f"stiffness: no run was done ({runs[0].status}); mend the cause and repeat the command"
        )
    most = max(seeds.values())
    return max(value for value, count in seeds.items() if count == most)


_DEFAULT = RunControl().stiffness_N_m
STUDY = Study(
    name="stiffness",
    title="Contact stiffness",
    knob_label="stiffness, N/m",
    points=points,
    measure=measure,
    judge=judge,
    inputs=base_inputs,
    needs_liggghts=True,
    panels=(
        Panel(quantity="invaded", title="fines inside"),
        Panel(quantity="mean_depth", title="mean depth of the fines inside"),
        Panel(quantity="profile", title="depth profile", label="distance over mean depth"),
        Panel(quantity="porosity_loss", title="porosity lost"),
        Panel(quantity="k_ratio", title="k/k0 of the specimen"),
        Panel(quantity="k_ratio_first", title="k/k0 of the first millimetre"),
        Panel(
            quantity="max_overlap",
            title="largest overlap of a fine",
            label="overlap over diameter",
        ),
        Panel(
            quantity="overlap_over_diameter",
            title="overlap of two fines at 5 m/s",
            label="overlap over diameter",
            cost="steps",
        ),
        Panel(quantity="restitution_error", title="restitution of two fines", cost="steps"),
    ),
    defaults={name: _DEFAULT for name in (COLLISION, *_SETTINGS) if isinstance(_DEFAULT, float)},
)
