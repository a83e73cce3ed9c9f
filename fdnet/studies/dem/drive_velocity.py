"""Drive velocity: does a deposit depend on how fast its fines are driven around a well?"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, case_path, read_case, set_keys
from fdnet.scales.scales import invasion_scales
from fdnet.studies.dem.runs import invasion_run
from fdnet.studies.engine.error_rows import against_reference
from fdnet.studies.engine.study import Measured, Panel, Point, Row, Study

SERIES = "specimen 5 at a well"
_WELL = "well={radius_mm=108.0, drainage_radius_m=100.0}"
OWN = 1.0
FACTORS = (OWN, 3.0, 9.0, 18.0)
"""Velocity of the simulation over that of the fluid."""
_STIFFNESS_N_M = 30.0
"""At the fluid's own velocity. It grows with the velocity, so that the push over the stiffness,
and with it every overlap of fines at rest, is the same."""
_FINES, _PLUG_RATE = 1200, 0.02
"""Fines that are supplied, more than twice as many as enter, and the trickle that ends a run."""
OBSERVED = ("invaded", "mean_depth", "depth_p95", "porosity_loss", "k_ratio")
_WORDS: Mapping[str, str] = {
    "invaded": "fines inside",
    "mean_depth": "mean depth",
    "depth_p95": "depth above which 95 % lie",
    "porosity_loss": "porosity lost",
    "k_ratio": "k/k0",
}
_SMALL = (
    "box.size_mm=[1.5,1.2,1.2]",
    "grains.count=19",
    "fines.count=60",
    "run.duration_ms=12.0",
)


def points(quick: bool) -> list[Point]:
    """Every velocity, seed by seed, the cheapest first."""
    size = "small" if quick else "whole"
    return [
        Point(series=SERIES, knob="factor", value=factor, seed=seed, settings={"size": size})
        for seed in range(1, 3 if quick else 5)
        for factor in ((3.0, OWN) if quick else FACTORS[::-1])
    ]


def case_of(point: Point) -> InvasionCase:
    """The quick form of specimen 5 at the face of a well, with the defaults of everything else."""
    data = read_case(case_path("quick-specimen5")).data()
    for name in ("fluid", "drag"):
        del data[name]
    plain = with_fines(case_from(set_keys(data, [_WELL, f"seed={point.seed}"])))
    velocity = float(point.value) * invasion_scales(plain).interstitial_velocity
    keys = (
        _WELL,
        f"seed={point.seed}",
        "drag.scheme=viscous",
        f"fines.count={_FINES}",
        f"run.plug_rate={_PLUG_RATE}",
        f"drag.drive_velocity_m_s={velocity!r}",
        f"run.stiffness_N_m={_STIFFNESS_N_M * float(point.value)!r}",
        *(_SMALL if point.settings["size"] == "small" else ()),
    )
    return with_fines(case_from(set_keys(data, list(keys))))


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """One invasion, with the impact Stokes number and the physical duration."""
    case = case_of(point)
    scales = invasion_scales(case)
    run = invasion_run(case, work, point.slug)
    seconds = run["steps"] * scales.time_step * scales.force_factor
    return run | {"impact_stokes": scales.impact_stokes, "physical_time_s": seconds}


def inputs() -> str:
    """The cases of all points, as text: whose numbers a record holds."""
    return "\n".join(case_of(point).toml() for quick in (True, False) for point in points(quick))


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Each run against that of the same pack at the fluid's own velocity."""
    names = (*OBSERVED, "physical_time_s", "max_overlap", "impact_stokes")
    return [row for name in names for row in against_reference(measured, name, _is_own)]


def _is_own(run: Measured) -> bool:
    return run.point.value == OWN


STUDY = Study(
    name="drive-velocity",
    title="Fines that are driven faster than the fluid",
    knob_label="velocity of the simulation over that of the fluid",
    points=points,
    measure=measure,
    judge=judge,
    inputs=inputs,
    needs_liggghts=True,
    panels=tuple(Panel(quantity=name, title=title) for name, title in _WORDS.items()),
)
