"""What both scenes share in a deck: header, walls, and the data file of spheres."""

from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.contact_lines import wall_law
from fdnet.dem.deck import LeftOut, number
from fdnet.errors import DumpError
from fdnet.files.atomic import write_text
from fdnet.spheres.dump import Frame
from fdnet.spheres.snapshot import Array, Kind, Snapshot


def header_variables(
    case: Case, stage: str, left_out: list[LeftOut], ranks: int
) -> dict[str, Any]:
    """Variables of `_header.in.j2`.

    Several ranks never cut the box across the flow, because the fines crowd at the face.
    """
    sideways = "p p" if case.box.sides == "periodic" else "f f"
    return {
        "stage": stage,
        "case_name": case.name,
        "digest": case.digest(stage),
        "left_out": left_out,
        "boundary": f"f {sideways}",
        "processors": "1 * *" if ranks > 1 else "",
    }


def wall_variables(case: Case, stage: str, *, friction: bool) -> list[dict[str, Any]]:
    """Planes at the sides, and at both ends for grains that move; fines pass the ends freely."""
    size, law = case.size_m, wall_law(case, stage, friction=friction)
    ends_hold = "all" if stage == "pack" else ("grains" if case.grains.motion == "mobile" else "")
    sides_hold = (
        ""
        if case.box.sides == "periodic"
        else ("all" if stage == "pack" or ends_hold else "fines")
    )
    walls = []
    for axis, held in ((0, ends_hold), (1, sides_hold), (2, sides_hold)):
        for end, position in enumerate((0.0, size[axis])):
            if held:
                walls.append(_wall(f"w{'xyz'[axis]}{end}", held, position) | law)
    return walls


def _wall(name: str, group: str, position: float) -> dict[str, Any]:
    return {
        "id": name,
        "group": group,
        "plane": f"{name[1]}plane",
        "position": number(position),
    }


def write_data(
    path: Path, spheres: Snapshot, *, bounds: Array, density: Array, types: int
) -> None:
    """Write the spheres (N) as a LIGGGHTS data file.

    `bounds` (3, 2) m are those of the simulation box, `density` (N,) is in kg/m3, `types` is the
    number of atom types.
    """
    lines = ["spheres", "", f"{len(spheres)} atoms", f"{types} atom types", ""]
    lines += [
        f"{number(low)} {number(high)} {axis}lo {axis}hi"
        for (low, high), axis in zip(bounds, "xyz", strict=True)
    ]
    lines += ["", "Atoms", ""]
    table = np.column_stack(
        [spheres.id, spheres.kind, 2 * spheres.radius, density, spheres.position]
    )
    lines += [
        f"{atom:.0f} {kind:.0f} " + " ".join(f"{value:.17g}" for value in rest)
        for atom, kind, *rest in table
    ]
    write_text(path, "\n".join(lines) + "\n")


def box_of(case: Case) -> Array:
    """Corners (3, 2) m of the specimen's box."""
    return np.column_stack([np.zeros(3), case.size_m])


def _check_spheres(frame: Frame) -> None:
    """Raise DumpError on a type that is neither grain nor fine, or a radius not above 0."""
    for name, good, expected in (
        ("type", np.isin(frame.column("type"), list(Kind)), "1 (grain) or 2 (fine)"),
        ("radius", frame.column("radius") > 0, "a number above 0"),
    ):
        bad = np.flatnonzero(~good)
        if len(bad):
            raise DumpError(
                f"dump at step {frame.step}: the sphere with id {frame.column('id')[bad[0]]:.0f} "
                f"has {name} {frame.column(name)[bad[0]]:g}, expected {expected}; the file was "
                "changed, start over with --force"
            )


def snapshot_of(frame: Frame, case: Case, *, time_s: float) -> Snapshot:
    """A frame of a dump as a Snapshot in the specimen's box.

    Positions beyond a periodic side are moved into the box.
    """
    position = np.column_stack([frame.column(c) for c in "xyz"])
    _check_spheres(frame)
    for axis, periodic in enumerate(case.periodic):
        if periodic:
            position[:, axis] = np.mod(position[:, axis], case.size_m[axis])
    return Snapshot(
        step=frame.step,
        time_s=time_s,
        box=box_of(case),
        id=frame.column("id"),
        kind=frame.column("type"),
        position=position,
        radius=frame.column("radius"),
        velocity=np.column_stack([frame.column(f"v{c}") for c in "xyz"]),
    )
