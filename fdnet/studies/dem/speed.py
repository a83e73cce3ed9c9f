"""Settings that should change the run time alone: motion of grains, skin, bins, MPI ranks."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.studies.dem.runs import (
    BINS,
    OBSERVED,
    SLAB,
    base_inputs,
    invasion_run,
    slab_case,
    window_run,
)
from fdnet.studies.engine.error_rows import against_reference, profile_distance, sizes
from fdnet.studies.engine.study import Measured, Panel, Point, Row, Study, Value

MOTION, STILL = "grains", "mobile grains, no flow"
FIXED, MOBILE = "fixed", "mobile"
SKIN, BIN, RANKS = "skin over fine's radius", "bin over grain's radius", "ranks, processor grid"
OWN_SKIN, OWN_BIN, ONE_RANK = 1.0, 1.1, "1 rank"
"""fdnet's own values: a fine's radius; half the longest cut-off (2 R + skin); one rank.

Half the longest cut-off is LIGGGHTS's own choice of bins.
"""
MOTION_STIFFNESS = 1e3
FEW, MANY = 2000, 20_000
_GRIDS: Mapping[str, tuple[int, ...]] = {
    "1 x 2 x 1": (1, 2, 1),
    "1 x 1 x 2": (1, 1, 2),
    "2 x 1 x 1": (2, 1, 1),
}
_WINDOW_MS = {200: 0.2, FEW: 0.5, MANY: 0.1}
_NO_FLOW = ("fluid.velocity_m_s=1e-6", "fines.count=1", "run.checkpoint_ms=0.1")
_OWN: Mapping[str, Value] = {MOTION: FIXED, SKIN: OWN_SKIN, BIN: OWN_BIN, RANKS: ONE_RANK}


def points(quick: bool) -> list[Point]:
    """Invasions with fixed and mobile grains, then short windows of an invasion.

    Ranks come last, because they need both cores. Values alternate fastest, so that the load of
    the machine is the same for all of them.
    """
    if quick:
        chosen = _motion(2, "small") + _windows(SKIN, (0.25, OWN_SKIN, 4.0), 200, 1)
        return (
            chosen
            + _windows(BIN, (OWN_BIN, 4.0), 200, 1)
            + _windows(RANKS, (ONE_RANK, "1 x 2 x 1"), 200, 1)
        )
    chosen = _motion(6, "whole")
    for fines in (FEW, MANY):
        chosen += _windows(SKIN, (0.1, 0.25, 0.5, OWN_SKIN, 2.0, 4.0), fines, 2)
        chosen += _windows(BIN, (0.5, OWN_BIN, 2.0, 4.0), fines, 2)
    return (
        chosen
        + _windows(RANKS, (ONE_RANK, *_GRIDS), FEW, 1)
        + _windows(RANKS, (ONE_RANK, *_GRIDS), MANY, 1)
    )


def _motion(seeds: int, size: str) -> list[Point]:
    return [
        Point(series=series, knob="motion", value=value, seed=seed, settings={"size": size})
        for seed in range(1, seeds + 1)
        for series, value in ((MOTION, FIXED), (MOTION, MOBILE), (STILL, MOBILE))
    ]


def _windows(setting: str, values: Sequence[Value], fines: int, seeds: int) -> list[Point]:
    return [
        Point(
            series=window_of(setting, fines),
            knob=setting,
            value=value,
            seed=seed,
            settings={"fines": fines},
        )
        for seed in range(1, seeds + 1)
        for value in values
    ]


def window_of(setting: str, fines: int) -> str:
    """The series of one run-time setting with so many fines."""
    return f"{setting}, {fines:,} fines"


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One invasion with fixed or mobile grains, or a window of one with this run-time setting."""
    if point.knob == "motion":
        still = _NO_FLOW if point.series == STILL else ()
        keys = (f"run.stiffness_N_m={MOTION_STIFFNESS!r}", f"grains.motion={point.value}", *still)
        return invasion_run(
            slab_case(point.seed, *keys, small=point.settings["size"] == "small"), work, point.slug
        )
    fines = int(point.settings["fines"])
    keys = (f"fines.count={fines}", f"run.duration_ms={_WINDOW_MS[fines]!r}", *_search_keys(point))
    grid = _GRIDS.get(str(point.value), ())
    return window_run(slab_case(point.seed, *keys, small=fines < FEW), work, point.slug, grid=grid)


def _search_keys(point: Point) -> tuple[str, ...]:
    if isinstance(point.value, str) or point.value == _OWN[point.knob]:
        return ()
    if point.knob == SKIN:
        return (f"run.skin_mm={point.value * SLAB['fines']['radius_mm']!r}",)
    return (f"run.neighbour_bin_mm={point.value * SLAB['grains']['radius_mm']!r}",)


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Everything against fdnet's own value of the same series, seed by seed."""

    def is_own(run: Measured) -> bool:
        return run.point.value == _OWN.get(run.point.series, _OWN.get(run.point.knob))

    motion = [run for run in measured if run.point.series == MOTION]
    rows = [row for name in OBSERVED for row in against_reference(motion, name, is_own)]
    rows += profile_distance(motion, BINS, is_own)
    moving = [run for run in measured if run.point.knob == "motion" and run.point.value == MOBILE]
    rows += sizes(moving, "grain_shift")
    for series in dict.fromkeys(
        run.point.series for run in measured if run.point.knob != "motion"
    ):
        runs = [run for run in measured if run.point.series == series]
        rows += [
            row
            for name in ("invaded", "mean_depth")
            for row in against_reference(runs, name, is_own)
        ]
    return rows


def _windows_panel(settings: Sequence[str], fines: int, *, cost: str = "core_s") -> Panel:
    series = tuple(window_of(setting, fines) for setting in settings)
    window = f"first {_WINDOW_MS[fines]:g} ms with {fines:,} fines"
    title = f"mean depth, {window}" + (": MPI" if RANKS in settings else "")
    return Panel(quantity="mean_depth", title=title, series=series, cost=cost)


STUDY = Study(
    name="speed",
    title="Run-time settings",
    knob_label="setting",
    points=points,
    measure=measure,
    judge=judge,
    inputs=base_inputs,
    needs_liggghts=True,
    panels=(
        Panel(quantity="invaded", title="fines inside", series=(MOTION,)),
        Panel(quantity="mean_depth", title="mean depth", series=(MOTION,)),
        Panel(quantity="profile", title="depth profile", label="distance over mean depth"),
        Panel(quantity="k_ratio_first", title="k/k0 of the first millimetre"),
        Panel(
            quantity="grain_shift",
            title="root-mean-square displacement of the grains",
            label="displacement over radius",
        ),
        _windows_panel((SKIN, BIN), FEW),
        _windows_panel((SKIN, BIN), MANY),
        _windows_panel((RANKS,), FEW, cost="wall_s"),
        _windows_panel((RANKS,), MANY, cost="wall_s"),
    ),
    defaults={MOTION: FIXED}
    | {window_of(name, n): _OWN[name] for name in (SKIN, BIN, RANKS) for n in (FEW, MANY)},
)
