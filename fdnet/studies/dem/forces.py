"""What the forces of the fluid change in an invasion, and what they cost.

`effect_rows` runs the quick specimens with and without the force of the pressure gradient.
`cost_rows` measures the time of one step with each force.
"""

import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import read_case
from fdnet.dem.invade_deck import render_invade, write_invade_inputs
from fdnet.dem.liggghts import SCREEN, Launch, run_deck
from fdnet.files import write_text
from fdnet.run.pipeline import run_case
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.snapshot import Array, Snapshot
from fdnet.studies.dem.runs import grains_of, slab_case, the_binary

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
        "gradient_over_drag": invasion_scales(case).gradient_over_drag,
        "supplied": summary["supplied_count"],
        "invaded": summary["invaded_count"],
        "passed": summary["passed_count"],
        "depth_p95_mm": 1e3 * summary["invasion_depth_p95_m"],
        "k_ratio": summary["k_damaged_m2"] / summary["k_initial_m2"],
        "max_overlap": summary["max_overlap_fraction"],
        "stop_reason": summary["stop_reason"],
    }


def cost_rows(
    counts: Sequence[int], fine_steps: float, rounds: int, work: Path
) -> Iterator[dict[str, object]]:
    """One row a number of fines, kind of fines and forces: steps a second of one core.

    The forces take turns in one process, a few steps each in every round. The fastest turn of each
    counts, because other programs can only slow a turn. "dearer" is its time over that of drag
    alone, less 1.

    Args:
        counts: numbers of fines.
        fine_steps: steps times fines of one turn.
        rounds: how often the forces take turns.
        work: folder of the runs.
    """
    for count in counts:
        for kind, size in (("one size", ()), ("many sizes", (UNEQUAL,))):
            steps = max(2, round(fine_steps / count))
            seconds = _turns(count, size, (steps, rounds), work)
            for name, own in zip(FORCES, seconds, strict=True):
                yield {
                    "fines": count,
                    "sizes": kind,
                    "forces": name,
                    "steps_per_s": steps / float(np.min(own)),
                    "dearer": float(np.min(own) / np.min(seconds[0])) - 1,
                }


def _turns(count: int, size: tuple[str, ...], turns: tuple[int, int], work: Path) -> Array:
    """(F, R) s of each force in each round; `turns` are the steps of one and the rounds."""
    folder, (steps, rounds) = work / "cost", turns
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "post").mkdir(parents=True)
    cases = [_case(count, *size, *settings) for settings in FORCES.values()]
    grains = grains_of(cases[0], work)
    write_invade_inputs(cases[0], invasion_scales(cases[0]), grains, folder)
    parts = [_deck(case, grains) for case in cases]
    lines = [parts[0][0], f"variable turn loop {rounds}", "label turn"]
    for _, block in parts:
        lines += [block, f"run {steps}", *_taken_back(block)]
    lines += ["next turn", "jump SELF turn", 'print "DECK_DONE"', ""]
    write_text(folder / "in.cost", "\n".join(lines))
    run_deck(folder, "in.cost", Launch(binary=the_binary()))
    screen = (folder / SCREEN).read_text(encoding="utf-8", errors="replace")
    times = re.findall(rf"Loop time of (\S+) on 1 procs for {steps} steps", screen)
    return np.array(times, float).reshape(rounds, len(parts)).T


def _case(count: int, *settings: str) -> InvasionCase:
    return slab_case(1, f"fines.count={count}", "drag.refresh_steps=1", *settings)


def _deck(case: InvasionCase, grains: Snapshot) -> tuple[str, str]:
    """The deck of one case up to the forces of the fluid, and these."""
    deck = render_invade(case, invasion_scales(case), grains).text
    start, end = deck.index("# Stokes drag"), deck.index("region specimen")
    return f"{deck[:start]}thermo_modify lost error norm no", deck[start:end]


def _taken_back(block: str) -> list[str]:
    """Commands that remove what a block has defined, the last first."""
    made = [line.split()[:2] for line in block.splitlines() if line.startswith(("fix", "region"))]
    return [
        f"unfix {name}" if command == "fix" else f"region {name} delete"
        for command, name in reversed(made)
    ]
