"""Dumps as LAMMPS and LIGGGHTS write them, made in code."""

import numpy as np

from fdnet.spheres.snapshot import Snapshot

COLUMNS = "id type x y z radius"
PLACES = np.indices((3, 3, 3)).reshape(3, -1).T + 0.5
"""Centres of touching spheres of radius 0.5 on a simple cubic lattice."""


def dump_text(pack: Snapshot, columns: str = COLUMNS, *, step: int = 7) -> str:
    """The spheres as LAMMPS and LIGGGHTS dump them."""
    low, size = pack.box[:, 0], np.ptp(pack.box, axis=1)
    parts = (pack.position - low) / size
    values = {"id": pack.id, "type": pack.kind, "radius": pack.radius, "diameter": 2 * pack.radius}
    for k, axis in enumerate("xyz"):
        values |= {axis: pack.position[:, k], f"{axis}u": pack.position[:, k]}
        values |= {f"{axis}s": parts[:, k]}
    rows = zip(*(values[name].tolist() for name in columns.split()), strict=True)
    lines = ["ITEM: TIMESTEP", str(step), "ITEM: NUMBER OF ATOMS", str(len(pack))]
    lines += ["ITEM: BOX BOUNDS pp pp ff"] + [f"{a!r} {b!r}" for a, b in pack.box.tolist()]
    lines += [f"ITEM: ATOMS {columns}"] + [" ".join(map(repr, row)) for row in rows]
    return "\n".join(lines) + "\n"


def lattice_dump(
    columns=COLUMNS, *, step=0, bounds="pp pp pp", sides="0 3", rows=27, end=" \n", gap=" "
):
    """The lattice at PLACES as LIGGGHTS dumps it, with cells between `gap`."""
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n27\nITEM: BOX BOUNDS {bounds}\n"
    lines = [head + f"{sides}\n" * 3 + f"ITEM: ATOMS {columns} \n"]
    plain = {"type": 1, "radius": 0.5, "diameter": 1.0, "element": "Q", "f": "nan"}
    for number, place in list(enumerate(PLACES.tolist(), start=1))[:rows]:
        cells = plain | {"id": number}
        for axis, x in zip("xyz", place, strict=True):
            cells |= {axis: x, f"{axis}su": x / 3}
        lines.append(gap.join(str(cells[name]) for name in columns.split()) + end)
    return "".join(lines)
