"""Points that are no invasions: collisions, an undamped pack, falling fines; closed forms."""

from collections.abc import Mapping
from pathlib import Path

from validation.dem.collisions import collision_run, energy_run
from validation.dem.runs import relaxation_run
from validation.study import Point

STIFFNESS = 1e4
SPAN, SPANS = 1e-5, 300.0
"""Duration of collisions, s, and of the undamped pack, sqrt(m/k): costs are for the same time."""
LOOKS = (1.0, 0.5, 2.0)
"""Times, in tau, at which a falling fine is looked at, as far as `looks` of them are asked for."""


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """The errors of one small system, and its costs."""
    system, value = str(point.settings["system"]), float(point.value)
    slug = f"{point.series}-{value:g}-{point.seed}".replace(" ", "_")
    if system == "collision":
        return _collision(work, slug, stiffness=value, factor=0.1, phase=0.5)
    if system == "four collisions":
        return _worst_collision(work, slug, value)
    if system == "undamped pack":
        found = energy_run(work, slug, factor=value, seed=int(point.seed), spans=SPANS)
        return {name: found[name] for name in ("energy_drift", "steps", "core_s")}
    scheme = str(point.settings.get("scheme", "every step"))
    return _fall(work, slug, scheme, value, int(point.settings.get("looks", 0)))


def _collision(
    work: Path, slug: str, *, stiffness: float, factor: float, phase: float
) -> dict[str, float]:
    found = collision_run(work, slug, stiffness=stiffness, factor=factor, phase=phase, span=SPAN)
    kept = ("overlap_over_diameter", "overlap_error", "restitution_error", "steps", "core_s")
    return {name: found[name] for name in kept}


def _worst_collision(work: Path, slug: str, factor: float) -> dict[str, float]:
    """Largest errors of four collisions that begin at four places within a step; mean costs."""
    runs = [
        _collision(work, f"{slug}-{phase}", stiffness=STIFFNESS, factor=factor, phase=phase)
        for phase in (0.125, 0.375, 0.625, 0.875)
    ]
    worst = {
        name: max(abs(run[name]) for run in runs)
        for name in ("overlap_error", "restitution_error")
    }
    return worst | {name: sum(run[name] for run in runs) / 4 for name in ("steps", "core_s")}


def _fall(work: Path, slug: str, scheme: str, interval: float, looks: int) -> dict[str, float]:
    """Largest error of a falling fine; each of `looks` ends a run of its own, "steps" of drag."""
    keys = ["drag.refresh_steps=1" if scheme == "every step" else f"drag.scheme={scheme}"]
    if not looks:
        return relaxation_run(work, slug, *keys, over_tau=interval)
    counts = {max(least, round(time / interval)) for least, time in enumerate(LOOKS[:looks], 1)}
    runs = [
        relaxation_run(work, f"{slug}-{n}", *keys, over_tau=interval, spans=n * interval, looks=1)
        for n in sorted(counts)
    ]
    return {
        "relaxation_error": max(run["relaxation_error"] for run in runs),
        "core_s": sum(run["core_s"] for run in runs),
        "steps": 3.0 / interval,
    }
