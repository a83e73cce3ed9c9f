"""Benches: a few spheres in a deck of the invasion's own lines, and what is dumped of them."""

import math
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
    snapshot_of,
    wall_variables,
    write_data,
)
from fdnet.dem.liggghts import Launch, find_binary, run_deck
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import COLUMNS, Frame, read_dump
from fdnet.spheres.snapshot import Array, Snapshot

HEADER = {
    "stage": "test",
    "case_name": "bench",
    "digest": "-",
    "left_out": [],
    "boundary": "f f f",
    "processors": "",
}
"""Variables of the header of a bench."""


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

    The first spheres are grains; all come with their velocities. `density` kg/m3 is of each or of
    all, `step` s, `bounds` (3, 2) m that of the spheres where there is none. `commands` are
    further lines of the deck, `moving` is the group that is integrated, and `walls` are the ids
    of the side walls that stand ("wz0"). A frame holds all spheres by id, with their forces.
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
    text = render_text("_header.in.j2", HEADER | {"boundary": boundary})
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


def states(frames: Sequence[Frame], case: Case) -> list[Snapshot]:
    """The spheres of each frame in the box of `case`."""
    return [snapshot_of(frame, case, time_s=0.0) for frame in frames]


def drag_text(case: Any, resume: bool = False) -> str:
    """The lines of the drag of `case`."""
    return render_text(
        "_drag.in.j2", {"drag": drag_variables(case, scales_of(case)), "resume": resume}
    )


def kinetic_energy(velocity: Array, mass: float | Array) -> float:
    """Sum of m v^2 / 2, J, of N spheres with `velocity` (N, 3) m/s and `mass` kg."""
    return float(0.5 * np.sum(mass * np.sum(velocity**2, axis=1)))


def released(zeta: float) -> float:
    """Restitution of a damped linear contact that ends at zero force (limitForce on).

    exp(-zeta/s (pi - atan2(2 s zeta, 1 - 2 zeta^2))), s^2 = 1 - zeta^2 (Schwager and Poeschel
    2007, eq. 20).
    """
    s = math.sqrt(1 - zeta**2)
    return math.exp(-zeta / s * (math.pi - math.atan2(2 * zeta * s, 1 - 2 * zeta**2)))
