"""Benches: a few spheres in a deck of the invasion's own lines, and what is dumped of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.deck import (
    contact_variables,
    drag_variables,
    number,
    render_text,
    wall_variables,
    write_data,
)
from fdnet.dem.liggghts import Launch, find_binary, run_deck
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import COLUMNS, Frame, read_dump
from fdnet.spheres.snapshot import Array, Snapshot


def bench(
    case: Case,
    spheres: Snapshot,
    folder: Path,
    *,
    density: float | Sequence[float],
    step: float,
    steps: int,
    every: int,
    commands: str = "",
    moving: str = "all",
    friction: bool = False,
    walls: Sequence[str] = (),
    bounds: Array | None = None,
    boundary: str = "f f f",
) -> list[Frame]:
    """Frames of N spheres with the contacts of `case`, one in `every` so many of the `steps`.

    The first are grains. `density` kg/m3 is of each or of all, `step` s, `bounds` (3, 2) m,
    `commands` are further lines of the deck, `moving` is the group that is integrated, `walls`
    are the ids of side walls that stand ("wz0"). Frames hold all spheres by id, with forces.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_data(
        folder / "bench.data",
        spheres,
        bounds=spheres.box if bounds is None else bounds,
        density=np.broadcast_to(density, len(spheres)),
        types=3,
    )
    with (folder / "bench.data").open("a") as data:
        data.write("\nVelocities\n\n")
        for atom, velocity in zip(spheres.id, spheres.velocity, strict=True):
            data.write(f"{atom:.0f} " + " ".join(map(number, velocity)) + " 0.0 0.0 0.0\n")
    contacts = contact_variables(case, scales_of(case), "invade", friction=friction)
    planes = wall_variables(case, "invade", friction=friction)
    stand = [wall | {"group": moving} for wall in planes if wall["id"] in walls]
    head = {"stage": "test", "case_name": "bench", "digest": "-", "left_out": [], "processors": ""}
    text = render_text("_header.in.j2", head | {"boundary": boundary})
    text += f"read_data bench.data\nneighbor {number(float(spheres.radius.min()))} bin\n"
    text += "neigh_modify delay 0\ngroup grains type 1\ngroup fines type 2\n"
    text += render_text("_contacts.in.j2", {"contacts": contacts, "time_step": number(step)})
    text += render_text("_walls.in.j2", {"walls": stand})
    text += f"fix integ {moving} nve/sphere\n{commands}\n"
    text += f"dump d all custom {every} d.dump {COLUMNS} fx fz\n"
    text += f'dump_modify d sort id format "%d %d {" ".join(["%.17g"] * 9)}"\n'
    (folder / "in.bench").write_text(text + f'run {steps}\nprint "DECK_DONE"\n')
    run_deck(folder, "in.bench", Launch(binary=find_binary()))
    return list(read_dump(folder / "d.dump"))


def drag_text(case: Any) -> str:
    """The lines of the drag of `case`."""
    drag = drag_variables(case, scales_of(case))
    return render_text("_drag.in.j2", {"drag": drag, "resume": False})
