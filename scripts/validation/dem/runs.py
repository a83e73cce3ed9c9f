"""What the studies of the DEM half run: small invasions and single fines.

They use fdnet's own decks and the real LIGGGHTS.
"""

import math
import re
import resource
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from fdnet.case.case import Case, InvasionCase, with_fines
from fdnet.case.file import read_case
from fdnet.dem.checkpoint import Checkpoints, state_at
from fdnet.dem.deck import snapshot_of, specimen_box
from fdnet.dem.invade_deck import write_invade_inputs
from fdnet.dem.invasion import InvadeStage, Invasion, invade
from fdnet.dem.liggghts import Binary, Execution, Launch, find_binary, run_deck
from fdnet.dem.packing import make_pack
from fdnet.files import write_text
from fdnet.scales.clock import relaxation_time
from fdnet.scales.scales import invasion_scales, scales_of
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting

SLAB = Path(__file__).parents[1] / "studies" / "slab.toml"
"""The case of the invasions of the studies."""
HELD_STEPS = 20
"""Steps for which held drag is held in relaxation_run."""


def slab_case(seed: int, *assignments: str) -> InvasionCase:
    """The studies' invasion with other settings, "key=value"."""
    return with_fines(read_case(SLAB, assignments=[f"seed={seed}", *assignments]))


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
        make_pack(plain, scales_of(plain), folder, Launch(binary=the_binary()))
    return snapshot_of(read_frame(folder / "post" / "pack.dump"), plain, time_s=0.0)


def window_run(case: InvasionCase, work: Path, slug: str) -> dict[str, float]:
    """One invasion without its permeability: count and mean depth (m) of the fines, and costs."""
    result, costs = _fresh(case, grains_of(case, work), work / slug)
    return {
        "invaded": float(result.history[-1].invaded),
        "mean_depth": _mean(_depths(case, result)),
    } | costs


def child_core_seconds() -> float:
    """CPU seconds, user and system, of the children this process has waited for."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


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


def edited_run(
    case: InvasionCase, grains: Snapshot, folder: Path, launch: Launch, edit: tuple[str, str]
) -> Execution:
    """The whole invasion with one line of its deck replaced; `invade` then reads the folder.

    `edit` is the pattern of the line and what takes its place. Raises AssertionError when not
    exactly one line of the deck has the pattern.
    """
    (folder / "post").mkdir(parents=True)
    scales = invasion_scales(case)
    deck = write_invade_inputs(case, scales, grains, folder, ranks=launch.ranks).text
    text, count = re.subn(f"(?m){edit[0]}", edit[1], deck)
    assert count == 1, f"{count} lines of the deck have the pattern {edit[0]}, expected 1"
    write_text(folder / "in.invade", text)
    points = Checkpoints(folder=folder, digest=case.digest("invade"))
    points.cut(None)
    stage = InvadeStage(case=case, scales=scales, grains=grains, points=points, launch=launch)
    return run_deck(folder, "in.invade", replace(launch, follow=stage.keeper()))


def _depths(case: InvasionCase, result: Invasion) -> Array:
    depth = result.damaged.fines().position[:, 0]
    return depth[(depth >= 0) & (depth < case.size_m[0])]


def _mean(depth: Array) -> float:
    return float(np.mean(depth)) if len(depth) else 0.0


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
