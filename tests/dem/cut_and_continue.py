"""Cut an invasion and continue it: is the result that of an uncut one, in every column?"""

from itertools import product
from pathlib import Path

import numpy as np
from builders import tiny

from fdnet.case.case import InvasionCase
from fdnet.dem.binary import Binary
from fdnet.dem.invasion import Invasion, invade
from fdnet.dem.liggghts import Launch
from fdnet.dem.overlap import read_watch
from fdnet.run.fluid.fluid_of import fluid_of
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Snapshot

SIDES, MOTIONS = ("walls", "periodic"), ("fixed", "mobile")
SUPPLIES = ("slab", "batches")
SCHEMES = ("every_step", "held", "implicit", "viscous")
MATRIX = tuple(product(SIDES, MOTIONS, SUPPLIES, SCHEMES))
"""All 32 cells: sides, motion of the grains, supply of the fines, scheme of the drag."""
CUT_AT = 4
"""Checkpoint at which the invasion is cut: batches still come then."""


class StopError(Exception):
    """Stands for any sudden end."""


def cell_case(sides: str, motion: str, supply: str, scheme: str, *keys: str) -> InvasionCase:
    """The small case of one cell: 15 grains, 1,500 fines in batches, 5 checkpoints."""
    return tiny(
        f"box.sides={sides}",
        f"grains.motion={motion}",
        f"fines.supply={supply}",
        f"drag.scheme={scheme}",
        "box.size_mm=[1.6,1.0,1.0]",
        "grains.count=15",
        "fines.count=1500",
        "run.cap_ms=0.2",
        "run.checkpoint_ms=0.04",
        *keys,
    )


def differences(
    case: InvasionCase, grains: Snapshot, folder: Path, binary: Binary, *, ranks: int = 1
) -> list[str]:
    """What differs between the uncut and the continued invasion; empty when nothing does.

    Both are run below `folder`. All counts of the history, all overlaps that were watched, and
    every column of the spheres at the end, are compared bit for bit.
    """
    launch = Launch(binary=binary, ranks=ranks)
    scales = scales_of(case)
    whole = invade(
        case, scales, grains, folder / "whole", launch, fluid=fluid_of(case, scales, grains)
    )
    again = cut_and_continue(case, grains, folder / "cut", launch)
    columns = ("id", "kind", "position", "radius", "velocity")
    different = [
        name
        for name in columns
        if not np.array_equal(getattr(again.damaged, name), getattr(whole.damaged, name))
    ]
    if again.history != whole.history:
        different.append("history")
    if again.updates != whole.updates:
        different.append("updates")
    if list(read_watch(folder / "cut")) != list(read_watch(folder / "whole")):
        different.append("overlaps")
    return different


def cut_and_continue(
    case: InvasionCase, grains: Snapshot, folder: Path, launch: Launch
) -> Invasion:
    """The invasion, cut at checkpoint `CUT_AT` and continued."""

    def stop(line: str) -> None:
        if line.startswith(f"FDNET checkpoint {CUT_AT} "):
            raise StopError

    cut = Launch(binary=launch.binary, ranks=launch.ranks, follow=stop)
    scales = scales_of(case)
    try:
        invade(case, scales, grains, folder, cut, fluid=fluid_of(case, scales, grains))
    except StopError:
        return invade(case, scales, grains, folder, launch, fluid=fluid_of(case, scales, grains))
    raise AssertionError(f"the invasion ended before checkpoint {CUT_AT}")
