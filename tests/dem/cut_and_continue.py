"""Cut an invasion and continue it: is the result that of an uncut one, in every column?"""

from pathlib import Path
from typing import Any

import pytest
from builders import tiny

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import read_watch
from fdnet.dem.invasion import Invasion
from fdnet.dem.supply import batches_of
from fdnet.scales.scales import scales_of


class StopError(Exception):
    """Stands for any sudden end."""


def cell_case(sides: str, motion: str, supply: str, scheme: str, *keys: str) -> InvasionCase:
    """15 grains, 500 fines in four batches, 6 checkpoints."""
    return tiny(
        f"box.sides={sides}",
        f"grains.motion={motion}",
        f"fines.supply={supply}",
        f"drag.scheme={scheme}",
        "drag.pressure_gradient=true",
        *("box.size_mm=[1.6,1.0,1.0]", "grains.count=15", "fines.count=500"),
        *("run.time_step_factor=0.2", "run.cap_ms=0.15", "run.checkpoint_ms=0.025"),
        *keys,
    )


def places(case: InvasionCase, chunks: int) -> dict[str, tuple[int, ...]]:
    """Where an invasion of so many `chunks` is cut: the checkpoints, which one after another."""
    batches = len(batches_of(case, scales_of(case)).counts)
    whole = 1 if batches == 1 else batches - 1
    return {
        "at every checkpoint": tuple(range(1, chunks + 1)),
        "in the first chunk": (0,),
        "after the first chunk": (1,),
        "between batches": (max(1, whole - 1),),
        "after the last batch": (whole,),
        "in the last chunk": (chunks - 1,),
    }


def differences(go, case, folder: Path, *, ranks: int = 1, everywhere: bool = False) -> list[str]:
    """What differs between the uncut and continued invasions; empty when nothing does.

    One is cut at every checkpoint; `everywhere` adds one for each other place. All that they say
    and every column of the spheres at the end are compared bit for bit.
    """
    whole, different = go(case, folder / "whole", ranks=ranks), []
    cuts = places(case, len(whole.history))
    for place in cuts if everywhere else ("at every checkpoint",):
        for chunk in cuts[place]:

            def stop(line: str, mark: str = f"FDNET checkpoint {chunk} " if chunk else "Step "):
                if line.lstrip().startswith(mark):
                    raise StopError

            with pytest.raises(StopError):
                go(case, folder / place, ranks=ranks, follow=stop)
        again = go(case, folder / place, ranks=ranks)
        ends = [end_of(one, folder / name) for one, name in ((again, place), (whole, "whole"))]
        different += [f"{place}: {name}" for name in ends[0] if ends[0][name] != ends[1][name]]
    return different


def end_of(result: Invasion, folder: Path) -> dict[str, Any]:
    """All that a finished invasion in `folder` has to say, in parts that can be compared."""
    names = ("history", "stop_reason", "supplied", "overlap", "warnings", "updates")
    columns = ("id", "kind", "position", "radius", "velocity")
    restart = folder / "post" / f"invade_{result.history[-1].step}.restart"
    return {
        **{name: getattr(result, name) for name in names},
        **{name: getattr(result.state, name).tolist() for name in columns},
        "overlaps": list(read_watch(folder)),
        "restart": restart.read_bytes(),
    }
