"""Spheres from a file of any known format, with grains distinguished from fines."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.paths import expanded
from fdnet.spheres.arrays import Array
from fdnet.spheres.rows import SphereRows
from fdnet.spheres.snapshot import KIND_NAMES, Kind, Snapshot, checked_box, grain_box

OWN_TYPES = {int(kind): name for name, kind in KIND_NAMES.items()}
"""Atom types of fdnet's own dumps: 1 a grain, 2 a fine."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SphereFile:
    """What a file of spheres holds.

    Attributes:
        spheres: the spheres, SI units.
        assumptions: what the reader assumed where neither the file nor the caller says it.
        around_grains: whether the box is the one around all grains, for want of another.
    """

    spheres: Snapshot
    assumptions: tuple[str, ...]
    around_grains: bool


def read_spheres(
    path: str | Path,
    *,
    units: str | None = None,
    box: Any = None,
    fines_below: float | None = None,
    types: Mapping[int, str] | None = None,
    step: int | None = None,
) -> Snapshot:
    """Grains and fines from a file: CSV, LIGGGHTS or LAMMPS text dump, `.vtp` or `.vtu`.

    The format follows from the content (a dump begins with "ITEM:") and the suffix.

    - CSV: columns `x,y,z,radius[,kind][,id]` in `units`, or `x_m,y_m,z_m,radius_m[,kind][,id]`.
    - Dump: columns `type`, `x y z` (or `xu yu zu`, `xs ys zs`), `radius` or `diameter`, `id` if
      there; the box is that of the dump.
    - VTK: points with the data `radius` or `diameter`, and `kind`, `type`, `id` if there.

    Args:
        path: the file.
        units: unit of its lengths: "m", "cm", "mm" or "um". CSV columns without a unit need it; a
            dump or VTK file is in m without it, unless the dump names its units.
        box: (3, 2) bounds of the specimen, or x0, x1, y0, y1, z0, z1, in the unit of the file.
            Without it the box of the dump, or the box around all grains.
        fines_below: spheres of a smaller radius are fines, in the unit of the file.
        types: which atom types are "grain" and which "fine", for example {1: "grain", 3: "fine"}.
            Without it type 1 is a grain and type 2 a fine, as in fdnet's own dumps.
        step: time step of the frame of a dump. Without it the last frame.

    Returns:
        The spheres in SI units. A file that does not tell kinds apart holds grains alone.

    Raises:
        CaseError: the file is missing or malformed, a value is impossible, or the choices do not
            fit the file. The message names file and line.
        DumpError: the dump is malformed or cut.

    Examples:
        >>> import fdnet, pathlib
        >>> rows = ["x,y,z,radius", "0,0,0,0.25", "0.5,0,0,0.25", "0.25,0.2,0,0.05"]
        >>> _ = pathlib.Path("pack.csv").write_text("\\n".join(rows))
        >>> fdnet.read_spheres("pack.csv", units="mm", fines_below=0.1)
        Snapshot(2 grains, 1 fine, step 0, box 1 x 0.5 x 0.5 mm)
    """
    return read_sphere_file(
        path, units=units, box=box, fines_below=fines_below, types=types, step=step
    ).spheres


def read_sphere_file(
    path: str | Path,
    *,
    units: str | None = None,
    box: Any = None,
    fines_below: float | None = None,
    types: Mapping[int, str] | None = None,
    step: int | None = None,
) -> SphereFile:
    """As `read_spheres`, with what was assumed."""
    rows = _read_rows(expanded(path), units, step)
    kind, notes = _kinds(rows, fines_below, types)
    bounds = rows.box if box is None else rows.scale * checked_box(box)
    around = bounds is None
    if bounds is None:
        bounds = grain_box(rows.position, rows.radius, kind)
        notes = [*notes, "The specimen is the box around all grains."]
    elif box is None:
        notes = [*notes, f"The specimen is the box of {rows.source}."]
    count = len(rows.radius)
    spheres = Snapshot(
        step=rows.step,
        time_s=0.0,
        box=bounds,
        id=np.arange(1, count + 1) if rows.id is None else rows.id,
        kind=kind,
        position=rows.position,
        radius=rows.radius,
        velocity=np.zeros((count, 3)),
    )
    return SphereFile(spheres=spheres, assumptions=(*rows.notes, *notes), around_grains=around)


def _read_rows(path: Path, units: str | None, step: int | None) -> SphereRows:
    if _is_dump(path):
        from fdnet.spheres.dump_file import read_dump_spheres

        return read_dump_spheres(path, units=units, step=step)
    if step is not None:
        raise CaseError(f"{path}: is no dump, so it has no step {step}; leave out the step")
    if path.suffix.lower() in (".vtp", ".vtu"):
        from fdnet.spheres.vtk_file import read_vtk

        return read_vtk(path, units=units)
    from fdnet.spheres.csv_file import read_csv

    return read_csv(path, units=units)


def _is_dump(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(5) == b"ITEM:"
    except OSError:
        return False


def _kinds(
    rows: SphereRows, fines_below: float | None, types: Mapping[int, str] | None
) -> tuple[Array, list[str]]:
    """Kind (N,) of each sphere, and what was assumed.

    Raises CaseError on choices that contradict each other.
    """
    count = len(rows.radius)
    if fines_below is not None:
        return _by_radius(rows, fines_below, types), []
    if types is not None:
        return _by_type(rows, types), []
    if rows.kind is not None:
        return rows.kind, []
    if rows.type is None:
        note = f"{rows.source} does not tell grains from fines: all its spheres are grains."
        return np.full(count, Kind.GRAIN), [note]
    note = f"In {rows.source} type 1 is a grain and type 2 a fine."
    return _by_type(rows, OWN_TYPES), [note]


def _by_radius(rows: SphereRows, limit: float, types: Mapping[int, str] | None) -> Array:
    if types is not None or rows.kind is not None:
        other = "types" if types is not None else f"the column kind of {rows.source}"
        raise CaseError(
            f"fines_below: {limit:g} and {other} both tell grains from fines; give one of the two"
        )
    if not (np.isfinite(limit) and limit > 0):
        raise CaseError(
            f"fines_below: {limit:g}, expected a radius above 0 in the unit of the file"
        )
    kind = np.where(rows.radius < rows.scale * limit, Kind.FINE, Kind.GRAIN)
    if not np.any(kind == Kind.GRAIN):
        largest = rows.radius.max() / rows.scale
        raise CaseError(
            f"fines_below: {limit:g} makes every sphere of {rows.source} a fine; the largest "
            f"radius is {largest:g} in its unit"
        )
    return kind


def _by_type(rows: SphereRows, types: Mapping[int, str]) -> Array:
    unknown = [name for name in types.values() if name not in KIND_NAMES]
    if unknown:
        raise CaseError(f"types: {unknown[0]!r}, expected grain or fine for each type")
    if rows.type is None:
        raise CaseError(
            f"{rows.source}: has no types; name kinds in a column, or give fines_below"
        )
    missing = sorted(set(rows.type.tolist()) - set(types))
    if missing:
        raise CaseError(
            f"{rows.source}: type {missing[0]} is neither grain nor fine; name it, for example "
            f"types 1=grain,{missing[0]}=fine"
        )
    kinds = {number: int(KIND_NAMES[name]) for number, name in types.items()}
    return np.array([kinds[number] for number in rows.type.tolist()], dtype=np.int64)
