"""What the studies of the DEM half run: small invasions and single fines.

They use fdnet's own decks and the real LIGGGHTS.
"""

import math
import shutil
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import Case, InvasionCase, with_fines
from fdnet.case.file import case_from, set_keys
from fdnet.dem.checkpoint import state_at
from fdnet.dem.deck import snapshot_of, specimen_box
from fdnet.dem.invasion import Invasion, invade
from fdnet.dem.liggghts import Binary, Launch, find_binary
from fdnet.dem.packing import make_pack
from fdnet.names import SECTION_ARCHIE
from fdnet.network.permeability import analyse
from fdnet.scales.clock import relaxation_time
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting
from validation.engine.runner import child_core_seconds

SLAB: dict[str, Any] = {
    "name": "study",
    "box": {"size_mm": [4.0, 2.86, 2.86], "sides": "walls", "wall_friction": 0.0},
    "grains": {"radius_mm": 0.25, "count": 300, "shear_stiffness_N_m": 34.0e9},
    "fines": {
        "radius_mm": 0.05,
        "count": 1000,
        "shear_stiffness_N_m": 26.0e9,
        "supply": "slab",
    },
    "fluid": {"darcy_length_mm": 8.0},
    "drag": {"upstream": "interstitial", "scheme": "viscous", "pressure_gradient": False},
    "run": {"duration_ms": 2.0, "time_step_factor": 0.1},
    "analysis": {"sections": 4},
}
"""The invasion of the studies: 300 fixed grains at porosity 0.40, 1,000 fines of 0.10 mm, 2 ms.

The velocity (5.4 m/s) and the shear stiffnesses are those of the thesis's specimen 5. The duration
is given, so that every run follows the same span of time. Drag has no error of its own (see the
study of drag).
"""
PROFILE_BINS = 16
"""Equal bins of depth over the specimen in which invaded fines are counted."""
BINS = tuple(f"bin_{number:02d}" for number in range(PROFILE_BINS))
OBSERVED = ("invaded", "mean_depth", "porosity_loss", "k_ratio_first")
"""The results of an invasion that most studies compare."""
HELD_STEPS = 20
"""Steps for which held drag is held in relaxation_run."""
_SMALL: dict[str, Any] = {
    "grains": {"count": 60},
    "box": {"size_mm": [2.4, 1.7, 1.7]},
    "fines": {"count": 120},
}


def base_inputs() -> str:
    """The case that all invasions of the studies start from, as text.

    A record of points is continued only with the same case.
    """
    return slab_case(1).toml()


def slab_case(seed: int, *assignments: str, small: bool = False) -> InvasionCase:
    """The studies' invasion with other settings, "key=value".

    `small` is a fifth of it, for the quick forms.
    """
    data = {key: dict(value) if isinstance(value, dict) else value for key, value in SLAB.items()}
    if small:
        for part, values in _SMALL.items():
            data[part] |= values
        data["run"] |= {"duration_ms": 0.5}
    return with_fines(case_from(set_keys(data, [f"seed={seed}", *assignments])))


@cache
def the_binary() -> Binary:
    """LIGGGHTS, looked up once. Raises LiggghtsError when there is none."""
    return find_binary()


def grains_of(case: Case, work: Path) -> Snapshot:
    """The case's grains, packed once for all points that share seed, box and grains.

    They are packed at the default stiffness. This holds for fixed grains only, whose place does
    not depend on the stiffness (docs/physics.md).
    """
    plain = case.model_copy(update={"run": type(case.run)()})
    folder = work / f"pack-{plain.digest('pack')}"
    if not (folder / "attempts.json").exists():
        make_pack(plain, folder, Launch(binary=the_binary()))
    return snapshot_of(read_frame(folder / "post" / "pack.dump"), plain, time_s=0.0)


def invasion_run(case: InvasionCase, work: Path, slug: str) -> dict[str, float]:
    """One invasion: counts, depths (m), profile, porosity, k, largest overlap, costs."""
    grains = grains_of(case, work)
    result, costs = _fresh(case, grains, work / slug)
    return invasion_observed(case, grains, result) | costs


def window_run(case: InvasionCase, work: Path, slug: str) -> dict[str, float]:
    """One invasion without its permeability: count and mean depth (m) of the fines, and costs."""
    result, costs = _fresh(case, grains_of(case, work), work / slug)
    return {
        "invaded": float(result.history[-1].invaded),
        "mean_depth": _mean(_depths(case, result)),
    } | costs


def _fresh(
    case: InvasionCase, grains: Snapshot, folder: Path
) -> tuple[Invasion, dict[str, float]]:
    """An invasion and its costs.

    One that an earlier session left unfinished starts anew, so that its costs are complete.
    """
    shutil.rmtree(folder, ignore_errors=True)
    scales, before = invasion_scales(case), child_core_seconds()
    result = invade(case, scales, grains, folder, Launch(binary=the_binary()))
    return result, {
        "steps": float(result.history[-1].step),
        "core_s": child_core_seconds() - before,
        "wall_s": sum(run.seconds for run in result.runs),
    }


def invasion_observed(case: InvasionCase, grains: Snapshot, result: Invasion) -> dict[str, float]:
    """Numbers of a finished invasion, SI; `bin_00`... are invaded fines by equal bins of depth.

    "grain_shift" is the root-mean-square displacement of the grains since they were packed, over
    their radius.
    """
    last, depth = result.history[-1], _depths(case, result)
    bins = np.histogram(depth, PROFILE_BINS, (0.0, case.size_m[0]))[0]
    analysis = analyse(
        grains,
        result.damaged,
        periodic=case.periodic,
        sections=case.analysis.sections,
        walls=case.analysis.walls,
        damage_law=SECTION_ARCHIE,
    )
    first = analysis.sections[0]
    return {
        "invaded": float(last.invaded),
        "passed": float(last.passed),
        "mean_depth": _mean(depth),
        "depth_p95": analysis.invasion_depth_p95,
        "count_first": float(first.fines_count),
        "porosity_initial": analysis.porosity_initial,
        "k_initial": analysis.k_initial,
        "porosity_loss": analysis.porosity_initial - analysis.porosity_damaged,
        "porosity_loss_first": first.porosity_initial - first.porosity_damaged,
        "k_ratio": analysis.k_damaged / analysis.k_initial,
        "k_ratio_first": first.k_damaged / first.k_initial,
        "max_overlap": result.overlap.fraction,
        "grain_shift": _shift(grains, result.damaged.grains()),
    } | {f"bin_{number:02d}": float(count) for number, count in enumerate(bins)}


def _depths(case: InvasionCase, result: Invasion) -> Array:
    depth = result.damaged.fines().position[:, 0]
    return depth[(depth >= 0) & (depth < case.size_m[0])]


def _mean(depth: Array) -> float:
    return float(np.mean(depth)) if len(depth) else 0.0


def _shift(before: Snapshot, after: Snapshot) -> float:
    moved = after.position[np.argsort(after.id)] - before.position[np.argsort(before.id)]
    return float(np.sqrt(np.mean(np.sum(moved**2, axis=1))) / np.mean(before.radius))


def relaxation_run(
    work: Path,
    slug: str,
    *assignments: str,
    over_tau: float,
    spans: float = 3.0,
    looks: int | None = None,
) -> dict[str, float]:
    """Largest error of the velocity of one free fine that falls, over its terminal velocity v_T.

    The exact velocity is v_T (1 - exp(-t / tau)) with the relaxation time tau (Stokes 1851).

    Args:
        work: folder of the runs.
        slug: name of this run's folder.
        assignments: further settings, "key=value".
        over_tau: time step over tau; where the scheme is "held", the time for which drag is held
            over tau (the step is then a twentieth of it).
        spans: duration, tau.
        looks: number of observations, each the end of a `run` of its own; one every quarter of
            tau if not given.
    """
    radius, density, viscosity = 0.05e-3, 2146.0, 0.05
    tau = relaxation_time(radius, density, viscosity)
    held = any("scheme=held" in text for text in assignments)
    step = over_tau * tau / (HELD_STEPS if held else 1)
    stiffness = 4 / 3 * math.pi * radius**3 * density * (0.1 / step) ** 2
    gravity = -0.005 / tau
    case = slab_case(
        1,
        "fines.count=1",
        "fluid.velocity_m_s=1e-6",
        "gravity.mode=on",
        "gravity.buoyancy=false",
        f"gravity.acceleration_m_s2=[0.0,0.0,{gravity!r}]",
        f"run.stiffness_N_m={stiffness!r}",
        f"run.time_step_s={step!r}",
        f"run.duration_ms={1e3 * spans * tau!r}",
        f"run.checkpoint_ms={1e3 * tau * (1.001 * spans / looks if looks else 0.25)!r}",
        *([f"drag.refresh_steps={HELD_STEPS}"] if held else []),
        *assignments,
    )
    return _relaxed(case, work / slug, terminal=gravity * tau, tau=tau)


def _relaxed(case: InvasionCase, folder: Path, *, terminal: float, tau: float) -> dict[str, float]:
    scales, far = invasion_scales(case), np.array([[3.5e-3, 1.4e-3, 1.4e-3]])
    lonely = resting(far, 2.5e-4, specimen_box(case), Kind.GRAIN)
    result, costs = _fresh(case, lonely, folder)
    errors = []
    for row in result.history:
        velocity = state_at(folder, row, case, scales, lonely).fines().velocity[0, 2]
        exact = terminal * (1 - math.exp(-row.step * scales.time_step / tau))
        errors.append(abs(velocity - exact) / abs(terminal))
    return {"relaxation_error": max(errors), "steps": costs["steps"], "core_s": costs["core_s"]}
