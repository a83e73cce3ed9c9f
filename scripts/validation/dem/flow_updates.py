"""What makes a flow that follows its deposit cheaper: fewer updates and solves, heavier fines.

A run with more updates is nearer to a flow that follows at every moment, and costs more. What
counts as standing has no exact value; there the study shows how much hangs on it. Fines of m times
their mass take a time step that is longer by the root of m; their way is the same as far as their
inertia does not matter.
"""

import shutil
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, case_path, read_case, set_keys
from fdnet.case.tables import FLOW_TRAVEL
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.run.fluid import STANDING, NetworkFluid
from fdnet.run.network_flow import RENEWED
from fdnet.scales.scales import invasion_scales
from validation.dem.runs import grains_of, the_binary
from validation.engine.error_rows import against_reference
from validation.engine.runner import child_core_seconds
from validation.engine.study import Measured, Panel, Point, Row, Study

TRAVEL, SOLVED, STOOD = "way between updates", "deposit changed before a solve", "standing below"
FIFTH, TENTH = "mass over its own, fines of 1/5", "mass over its own, fines of 1/10"
TRIED: Mapping[str, tuple[float, ...]] = {
    TRAVEL: (0.125, 0.25, 0.5, 1.0, 2.0),
    SOLVED: (0.0, 0.02, 0.1, RENEWED, 0.3),
    STOOD: (0.25, STANDING, 0.75),
    FIFTH: (1.0, 2.0, 4.0, 16.0),
    TENTH: (1.0, 2.0, 4.0),
}
"""Diameters of a fine; share of the deposit by volume; share of the velocity given; factors."""
REFERENCE: Mapping[str, float] = {
    TRAVEL: 0.125,
    SOLVED: 0.0,
    STOOD: STANDING,
    FIFTH: 1.0,
    TENTH: 1.0,
}
NETWORK = (
    "fines.supply=slab",
    "drag.upstream=darcy",
    "fluid.velocity_m_s=5.4",
    "run.duration_ms=2.0",
    "drag.scheme=implicit",
    "drag.crowd=beetstra",
    "drag.field=network",
    "drag.pressure_gradient=true",
)
"""The flow of the network, at the pressure that drives the Darcy velocity over the specimen."""
OBSERVED = ("filtrate", "rate", "invaded", "mean_depth")
_WORDS: Mapping[str, str] = {
    "filtrate": "filtrate",
    "rate": "rate at the end",
    "invaded": "fines inside",
    "mean_depth": "mean depth",
}
_SIZES: Mapping[str, tuple[str, ...]] = {
    "whole": ("fines.count=960", "run.duration_ms=1.0"),
    "small": (
        "box.size_mm=[1.6,1.0,1.0]",
        "grains.count=15",
        "fines.count=60",
        "run.duration_ms=0.2",
        "run.checkpoint_ms=0.1",
    ),
}


def points(quick: bool) -> list[Point]:
    """Every value of every series, seed by seed."""
    size = "small" if quick else "whole"
    return [
        Point(series=series, knob="value", value=value, seed=seed, settings={"size": size})
        for seed in range(1, 2 if quick else 4)
        for series, values in TRIED.items()
        for value in ((REFERENCE[series], values[-1]) if quick else values)
    ]


def case_of(point: Point) -> InvasionCase:
    """The quick specimen 5 in the flow of the network, with half its fines for half its time."""
    travel = point.value if point.series == TRAVEL else 0.5
    keys = [
        *NETWORK,
        *_SIZES[str(point.settings["size"])],
        f"seed={point.seed}",
        f"drag.update_travel={travel}",
    ]
    plain = with_fines(read_case(case_path("quick-specimen5"), assignments=keys))
    return _heavier(plain, point) if point.series in (FIFTH, TENTH) else plain


def _heavier(plain: InvasionCase, point: Point) -> InvasionCase:
    """The case with heavier fines and springs as stiff as specimens of full size have.

    Fines of 1/10 are four times as many, and have half the volume in all.
    """
    density = float(point.value) * plain.fines.density_kg_m3
    keys = [f"fines.density_kg_m3={density!r}", "run.stiffness_N_m=auto"]
    if point.series == TENTH:
        keys += ["fines.radius_mm=0.025", f"fines.count={4 * (plain.fines.count or 0)}"]
    return with_fines(case_from(set_keys(plain.data(), keys)))


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One invasion; its seconds are those of LIGGGHTS and of the updates together."""
    case = case_of(point)
    scales, grains, folder = invasion_scales(case), grains_of(case, work), work / point.slug
    shutil.rmtree(folder, ignore_errors=True)
    fluid = NetworkFluid(
        case=case,
        scales=scales,
        grains=grains,
        standing=float(point.value) if point.series == STOOD else STANDING,
        renewed=float(point.value) if point.series == SOLVED else RENEWED,
    )
    assert len(fluid.pack.clean)  # the intact pack costs the same whatever the updates
    before = child_core_seconds() + time.process_time()
    result = invade(case, scales, grains, folder, Launch(binary=the_binary()), fluid=fluid)
    depth = result.damaged.fines().position[:, 0]
    inside = depth[(depth >= 0) & (depth < case.size_m[0])]
    last = result.updates[-1]
    return {
        "filtrate": last["filtrate_m3"],
        "rate": last["rate_over_initial"],
        "invaded": float(result.history[-1].invaded),
        "mean_depth": float(np.mean(inside)) if len(inside) else 0.0,
        "max_overlap": result.overlap.fraction,
        "updates": float(len(result.updates)),
        "core_s": child_core_seconds() + time.process_time() - before,
        "steps": float(result.history[-1].step),
    }


def inputs() -> str:
    """The cases of all points, as text: whose numbers a record holds."""
    return "\n".join(case_of(point).toml() for quick in (True, False) for point in points(quick))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Each run against the one of the same seed with the reference's value."""
    return [
        row
        for series in TRIED
        for name in (*OBSERVED, "updates", "max_overlap")
        for row in against_reference(
            [run for run in measured if run.point.series == series], name, _is_reference
        )
    ]


def _is_reference(run: Measured) -> bool:
    return run.point.value == REFERENCE[run.point.series]


STUDY = Study(
    name="flow-updates",
    title="Updates of the flow that follows the deposit",
    knob_label="value of the series",
    points=points,
    measure=measure,
    judge=judge,
    inputs=inputs,
    needs_liggghts=True,
    panels=tuple(
        Panel(quantity=name, title=title, series=series)
        for series in ((TRAVEL, SOLVED, STOOD), (FIFTH, TENTH))
        for name, title in _WORDS.items()
    ),
    defaults={TRAVEL: FLOW_TRAVEL, SOLVED: RENEWED, STOOD: STANDING, FIFTH: 1.0, TENTH: 1.0},
)
