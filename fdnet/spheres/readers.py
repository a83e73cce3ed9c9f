"""Spheres from a file of any known format, with grains distinguished from fines."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.files.paths import LARGE, MARKS, expanded, file_bytes, text_of, unzipped
from fdnet.spheres.arrays import Array
from fdnet.spheres.directions import Directions, periodic_axes
from fdnet.spheres.rows import SphereRows
from fdnet.spheres.snapshot import KIND_NAMES, Kind, Snapshot, checked_box, grain_box

OWN_TYPES = {int(kind): name for name, kind in KIND_NAMES.items()}
"""Atom types of fdnet's own dumps: 1 a grain, 2 a fine."""

_START = 1000
"""Bytes at the start of a file that tell its format."""
_SAME_BOX = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SphereFile:
    """What a file of spheres holds.

    Attributes:
        spheres: the spheres, SI units.
        assumptions: what the reader assumed where neither the file nor the caller says it.
        around_grains: whether the box is the one around all grains, for want of another.
        periodic: which of the sides across x, y and z repeat: those that the caller gives, else
            those that the file gives for its own box, else none.
        warnings: what is wrong with the file or contradicts it, one sentence each.
    """

    spheres: Snapshot
    assumptions: tuple[str, ...]
    around_grains: bool
    periodic: tuple[bool, bool, bool] = (False, False, False)
    warnings: tuple[str, ...] = ()


def read_spheres(
    path: str | Path,
    *,
    units: str | None = None,
    box: Any = None,
    fines_below: float | None = None,
    types: Mapping[int, str] | None = None,
    step: int | None = None,
) -> Snapshot:
    """Grains and fines from a file: text, LIGGGHTS or LAMMPS text dump, or VTK.

    The format follows from the content; a file compressed by gzip is read as what it holds. All
    formats share the names of their columns, in which capitals do not matter: `x y z` (or
    `xu yu zu`; in dumps also `xs ys zs`, `xsu ysu zsu`), `radius`, `radii` or `r`, or `diameter`
    or `d`, and, if there, `kind` (grain or fine), `type` and `id`. Other columns are not read.

    - Text: cells between commas, semicolons, tabs or spaces. Names may carry the unit (`x_m`,
      `radius (mm)`). Without a header four columns are x, y, z and radius; a comment with names
      (`#format x_y_z_r`) is a header.
    - Dump: the box is that of the dump. A frame that is cut is left out with a warning.
    - VTK: `.vtp`, `.vtu` or legacy `.vtk`; the columns are the data of its points.

    Args:
        path: the file.
        units: unit of its lengths: "m", "cm", "mm" or "um". CSV columns without a unit need it; a
            dump or VTK file is in m without it, unless the dump names its units.
        box: (3, 2) bounds of the specimen, or x0, x1, y0, y1, z0, z1, in the unit of the file.
            Without it the box of the dump, or the box around all grains.
        fines_below: spheres of a smaller radius are fines, in the unit of the file.
        types: which atom types are "grain" and which "fine", for example {1: "grain", 3: "fine"}.
            Without it type 1 is a grain and type 2 a fine, as in fdnet's own dumps.
        step: time step of the frame of a dump. Without it the last frame that is whole.

    Returns:
        The spheres in SI units. A file that does not tell kinds apart holds grains alone.

    Raises:
        CaseError: the file is missing or malformed, a value is impossible, or the choices do not
            fit the file. The message names file and line.
        DumpError: the dump is malformed, or each of its frames is cut.

    Examples:
        >>> import fdnet, pathlib
        >>> rows = ["x,y,z,radius", "0,0,0,0.25", "0.5,0,0,0.25", "0.25,0.2,0,0.05"]
        >>> _ = pathlib.Path("pack.csv").write_text("\\n".join(rows))
        >>> fdnet.read_spheres("pack.csv", units="mm", fines_below=0.1)
        Snapshot(2 grains, 1 fine, step 0, box 1 x 0.5 x 0.5 mm)
    """
    given = read_sphere_file(
        path, units=units, box=box, fines_below=fines_below, types=types, step=step
    )
    for text in given.warnings:
        warnings.warn(text, stacklevel=2)
    return given.spheres


def read_sphere_file(
    path: str | Path,
    *,
    units: str | None = None,
    box: Any = None,
    fines_below: float | None = None,
    types: Mapping[int, str] | None = None,
    step: int | None = None,
    periodic: Directions | None = None,
) -> SphereFile:
    """As `read_spheres`, with what was assumed.

    Without `periodic` the sides are those that the file gives (BOX BOUNDS of a dump), where the
    box is its own.
    """
    rows = _read_rows(path, units, step)
    kind, notes = _kinds(rows, fines_below, types)
    bounds = rows.box if box is None else rows.scale * checked_box(box)
    around = bounds is None
    if bounds is None:
        bounds = grain_box(rows.position, rows.radius, kind)
        notes = [*notes, "The specimen is the box around all grains."]
    elif box is None:
        notes = [*notes, f"The specimen is the box of {rows.source}."]
    around_it, side_notes, side_warnings = _sides(rows, bounds, periodic)
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
    return SphereFile(
        spheres=spheres,
        assumptions=(*rows.notes, *notes, *side_notes),
        around_grains=around,
        periodic=around_it,
        warnings=(*rows.warnings, *side_warnings),
    )


def _sides(
    rows: SphereRows, box: Array, given: Directions | None
) -> tuple[tuple[bool, bool, bool], list[str], list[str]]:
    """Which sides repeat, what was assumed of them, and where the file contradicts that."""
    if not rows.boundary or rows.box is None:
        return ((False, False, False) if given is None else periodic_axes(given)), [], []
    said: list[bool] = [flag == "pp" for flag in rows.boundary]
    near = np.isclose(box, rows.box, rtol=_SAME_BOX, atol=_SAME_BOX * np.ptp(rows.box))
    same: list[bool] = list(np.all(near, axis=1).tolist())
    own = " ".join(rows.boundary)
    if given is not None:
        chosen = periodic_axes(given)
        other = [axis for axis, a, b in zip("xyz", chosen, said, strict=True) if a and not b]
        text = (
            f"{rows.source} says BOX BOUNDS {own}, so that {', '.join(other)} has walls, but "
            "periodic sides are given there; spheres stay a radius away from walls, and such a "
            "pack taken as periodic has gaps and too high a permeability"
        )
        return chosen, [], [text] if other else []
    x, y, z = (a and b for a, b in zip(said, same, strict=True))
    names = ["periodic" if one else "walls" for one in (x, y, z)]
    text = ", ".join(f"{axis} {name}" for axis, name in zip("xyz", names, strict=True))
    cut = [axis for axis, a, b in zip("xyz", said, same, strict=True) if a and not b]
    why = f", but the box given is another across {', '.join(cut)}" if cut else ""
    note = f"The sides of the box are those of {rows.source} (BOX BOUNDS {own}{why}): {text}."
    return (x, y, z), [note], []


def _read_rows(path: str | Path, units: str | None, step: int | None) -> SphereRows:
    source = str(expanded(path))
    data = file_bytes(path, most=LARGE, what="a file of spheres")
    data = unzipped(data, source, most=LARGE)
    if data.startswith(MARKS):
        data = text_of(data, source).encode()
    if data[:_START].lstrip().startswith(b"ITEM:"):
        from fdnet.spheres.dump_file import dump_spheres

        return dump_spheres(data, source, units=units, step=step)
    if step is not None:
        raise CaseError(f"{source}: is no dump, so it has no step {step}; leave out the step")
    from fdnet.spheres import vtk_file

    name = source.lower().removesuffix(".gz")
    if (
        data.startswith(vtk_file.LEGACY)
        or vtk_file.XML in data[:_START]
        or name.endswith(vtk_file.SUFFIXES)
    ):
        return vtk_file.vtk_spheres(data, source, units=units)
    from fdnet.spheres.csv_file import table_rows

    return table_rows(data, source, units=units)


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
    present, which = np.unique(rows.type, return_inverse=True)
    missing = sorted(set(present.tolist()) - set(types))
    if missing:
        raise CaseError(
            f"{rows.source}: type {missing[0]} is neither grain nor fine; name it, for example "
            f"types 1=grain,{missing[0]}=fine"
        )
    return np.array([KIND_NAMES[types[number]] for number in present.tolist()], np.int64)[which]
