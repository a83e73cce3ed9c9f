"""How a pack grows: stages between small spheres and the pack at rest.

The thesis shows them in its appendix A (Shi 2011, Figures 73 and 74).
"""

from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.deck import snapshot_of, specimen_box
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.dem.packing import write_pack_inputs
from fdnet.errors import CaseError
from fdnet.files import write_bytes
from fdnet.scales.pack import PACK_STAGES
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Kind, Snapshot
from validation.thesis.runs.state import BROKEN, packed_bytes

GROWTH = "growth.npz"
SHOWN = (1, PACK_STAGES)
"""Stages shown with the pack at rest: the first and the last.

At the end of the last stage the spheres have their size and overlap most.
"""


def grow(case: Case, folder: Path, launch: Launch, *, count: int) -> tuple[Snapshot, ...]:
    """The pack of `count` grains after the stages SHOWN, and at rest.

    Raises LiggghtsError when the run fails.
    """
    (folder / "post").mkdir(parents=True, exist_ok=True)
    write_pack_inputs(case, folder, count=count, shown=SHOWN)
    run_deck(folder, "in.pack", launch)
    names = [*(f"grown_{stage}.dump" for stage in SHOWN), "pack.dump"]
    return tuple(
        snapshot_of(read_frame(folder / "post" / name), case, time_s=0.0) for name in names
    )


def write_growth(path: Path, stages: tuple[Snapshot, ...]) -> None:
    """Keep the stages in one file in single precision.

    Each grain has a row: x, y, z and radius in m, and the velocity in m/s.
    """
    tables = [np.column_stack([one.position, one.radius, one.velocity]) for one in stages]
    steps = np.array([one.step for one in stages])
    write_bytes(
        path, packed_bytes({"grains": np.stack(tables).astype(np.float32), "steps": steps})
    )


def read_growth(path: Path, case: Case) -> tuple[Snapshot, ...]:
    """The stages that `write_growth` kept. Raises CaseError when the file is broken."""
    try:
        with np.load(path) as file:
            tables, steps = file["grains"].astype(float), file["steps"]
    except BROKEN as error:
        raise CaseError(
            f"{path}: holds no growth of a pack ({error}); run the study anew to write it"
        ) from error
    return tuple(
        Snapshot(
            step=int(step),
            time_s=0.0,
            box=specimen_box(case),
            id=np.arange(1, len(table) + 1),
            kind=np.full(len(table), Kind.GRAIN),
            position=table[:, :3],
            radius=table[:, 3],
            velocity=table[:, 4:],
        )
        for table, step in zip(tables, steps, strict=True)
    )
