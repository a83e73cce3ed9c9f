"""What the forces of the fluid change in an invasion, and what they cost.

`effect_rows` runs the quick specimens with and without the force of the pressure gradient.
`cost_rows` measures the time of one step with each force, by the CPU time of LIGGGHTS in two runs
of different length, so that its start is not counted.
"""

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from fdnet.case.case import with_fines
from fdnet.case.file import read_case
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.run.open_run import run_case
from fdnet.scales.scales import scales_of
from fdnet.studies.dem.runs import grains_of, slab_case, the_binary
from fdnet.studies.engine.runner import child_core_seconds

STAGES = ("pack", "invade", "analyse")
FORCES = {
    "drag": (),
    "drag, gradient": ("drag.pressure_gradient=true",),
    "drag, inertia": ("drag.inertia=schiller-naumann",),
    "drag, gradient, inertia": ("drag.pressure_gradient=true", "drag.inertia=schiller-naumann"),
}
"""Settings of the measured forces on top of Stokes's drag."""
UNEQUAL = "fines.radius_mm=[0.04, 0.055]"
"""Fines of many sizes, whose force of the gradient is a formula."""
SHORT, LONG = 0.25, 1.25
"""Lengths of the two runs of a cost, over the steps that are counted."""


def effect_rows(
    cases: Sequence[Path], seeds: Sequence[int], work: Path
) -> Iterator[dict[str, object]]:
    """One row a case, seed and setting: what entered, how deep, and the permeability left."""
    for path in cases:
        for seed in seeds:
            for acts in (False, True):
                yield _effect(path, seed, acts, work)


def _effect(path: Path, seed: int, acts: bool, work: Path) -> dict[str, object]:
    settings = [f"seed={seed}", f"drag.pressure_gradient={str(acts).lower()}"]
    case = with_fines(read_case(path, assignments=settings))
    folder = work / f"{case.name}-seed{seed}-{'with' if acts else 'without'}"
    summary = run_case(case, folder, stages=STAGES, resume=folder.exists()).summary
    return {
        "case": case.name,
        "seed": seed,
        "pressure_gradient": acts,
        "gradient_over_drag": scales_of(case).gradient_over_drag,
        "supplied": summary["supplied_count"],
        "invaded": summary["invaded_count"],
        "passed": summary["passed_count"],
        "depth_p95_mm": 1e3 * summary["invasion_depth_p95_m"],
        "k_ratio": summary["k_damaged_m2"] / summary["k_initial_m2"],
        "max_overlap": summary["max_overlap_fraction"],
        "stop_reason": summary["stop_reason"],
    }


def cost_rows(
    counts: Sequence[int], fine_steps: float, repeats: int, work: Path
) -> Iterator[dict[str, object]]:
    """One row a number of fines, kind of fines, forces and repeat: steps a second of one core.

    Args:
        counts: numbers of fines.
        fine_steps: steps times fines of each measurement.
        repeats: measurements of each; the forces take turns, so that a busy machine slows all.
        work: folder of the runs.
    """
    for count in counts:
        steps = max(20, round(fine_steps / count))
        for kind, size in (("one size", ()), ("many sizes", (UNEQUAL,))):
            for repeat in range(repeats):
                for name, settings in FORCES.items():
                    rate = _rate(count, steps, (*size, *settings), work)
                    yield {
                        "fines": count,
                        "sizes": kind,
                        "forces": name,
                        "repeat": repeat,
                        "steps_per_s": rate,
                    }


def _rate(count: int, steps: int, settings: tuple[str, ...], work: Path) -> float:
    seconds = [
        _core_seconds(count, round(share * steps), settings, work) for share in (SHORT, LONG)
    ]
    return (round(LONG * steps) - round(SHORT * steps)) / (seconds[1] - seconds[0])


def _core_seconds(count: int, steps: int, settings: tuple[str, ...], work: Path) -> float:
    """CPU seconds of LIGGGHTS for `steps` steps in one chunk."""
    step = 1e-8
    duration = f"{1e3 * step * steps!r}"
    case = slab_case(
        1,
        f"fines.count={count}",
        "drag.scheme=every_step",
        f"run.time_step_s={step}",
        f"run.duration_ms={duration}",
        f"run.checkpoint_ms={duration}",
        *settings,
    )
    folder, grains = work / "cost", grains_of(case, work)
    shutil.rmtree(folder, ignore_errors=True)
    before = child_core_seconds()
    invade(case, scales_of(case), grains, folder, Launch(binary=the_binary()))
    return child_core_seconds() - before
