"""Spheres from files: tables in text, dumps and VTK."""

import csv
import io
import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import CaseError, DumpError
from fdnet.files import LARGE, MARKS, expanded, file_bytes, replacing, text_of, unzipped
from fdnet.spheres import snapshot
from fdnet.spheres.dump import DumpReader, Head
from fdnet.spheres.rows import Columns, SphereRows, columns_of, rows_from, scale_of
from fdnet.spheres.snapshot import KIND_NAMES, UNITS, Array, Directions, Kind, Snapshot

PLAIN = ("x", "y", "z", "radius")
OWN_TYPES = {int(kind): name for name, kind in KIND_NAMES.items()}
"""Atom types of fdnet's own dumps: 1 a grain, 2 a fine."""
_BEFORE_UNIT = re.compile(r"\s*([(\[])\s*")
_FRACTION = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


def write_spheres(path: str | Path, spheres: Snapshot) -> Path:
    """Write x_m, y_m, z_m, radius_m, kind, id; one row per sphere, atomically.

    Coordinates are the shortest decimals that read back to the same number (`repr`), so that a
    count by `lo <= x < hi` is the same from the file as from memory.
    """
    import pandas as pd

    lengths = zip(PLAIN, (*spheres.position.T, spheres.radius), strict=True)
    frame = pd.DataFrame({f"{name}_m": values for name, values in lengths})
    kinds = [OWN_TYPES[kind] for kind in spheres.kind.tolist()]
    frame = frame.assign(kind=kinds, id=spheres.id)
    with replacing(path) as part:
        frame.to_csv(part, index=False, lineterminator="\n")
    return Path(path)


def table_rows(data: bytes, source: str, *, units: str | None = None) -> SphereRows:
    """The spheres of a table in text, in metres; `read_spheres` says what it may look like.

    Blank lines and lines that start with `#` are skipped. Raises CaseError that names the file,
    the line, what it holds and what was expected.
    """
    lines: list[tuple[int, str]] = []
    comment = ""
    for number, line in enumerate(io.StringIO(text_of(data, source), newline=None), start=1):
        if line.lstrip().startswith("#"):
            comment = comment if lines else line.strip().lstrip("#").strip()
        elif line.strip():
            lines.append((number, line))
    if not lines:
        raise CaseError(f"{source}: the file is empty; expected a header {','.join(PLAIN)}")
    mark = next((mark for mark in ";\t," if mark in lines[0][1]), "\t")
    where, comma = f"{source}:{lines[0][0]}", mark == ","
    first = _cells(lines[0][1], mark, where)
    titled = any(_float(cell, comma=comma) is None for cell in first)
    names, rows = first if titled else _names(first, comment, where), lines[titled:]
    columns = columns_of(names, where)
    scale = scale_of(columns, units, where)
    if scale is None:
        raise CaseError(
            f"{where}: the columns {','.join(PLAIN)} have no unit; give --units mm on the command "
            f'line, units="mm" in Python (one of {", ".join(UNITS)}), or name them '
            "x_m,y_m,z_m,radius_m"
        )
    if not rows:
        raise CaseError(f"{source}: no spheres after the header; expected at least one row")
    table = []
    for number, line in rows:
        cells, where = _cells(line, mark, f"{source}:{number}"), f"{source}:{number}"
        if len(cells) != len(names):
            raise CaseError(
                f"{where}: {len(cells)} values, expected {len(names)} as in the header"
            )
        table.append([_value(cells[k], columns, k, where, comma=comma) for k in columns.needed])
    notes = []
    if names is PLAIN:
        notes.append(f"{source} has no header: its four columns are x, y, z and radius.")
    if columns.ignored:
        notes.append(f"Columns of {source} that are not read: {', '.join(columns.ignored)}.")
    return rows_from(
        columns,
        dict(zip(columns.needed, np.array(table).T, strict=True)),
        lambda row: f"{source}:{rows[row][0]}",
        scale=scale,
        source=source,
        notes=tuple(notes),
    )


def _cells(line: str, mark: str, where: str) -> list[str]:
    """The cells of a line between marks; a tab stands for any blank space."""
    if mark == "\t":
        return [cell.strip('"') for cell in _BEFORE_UNIT.sub(r"\1", line).split()]
    try:
        return next(csv.reader([line], delimiter=mark, strict=True))
    except csv.Error as error:
        raise CaseError(f"{where}: {error}; expected comma-separated values") from error


def _names(first: list[str], comment: str, where: str) -> Sequence[str]:
    """Names of the columns under a `first` line of numbers: those of the comment, or PLAIN."""
    words = re.split(r"[\s,;]+", comment)
    if len(words) == 2 and words[0].lower() == "format":
        words = words[1].split("_")
        words += ["further"] * (len(first) - len(words))
    if len(words) == len(first) and not all(_float(word, comma=False) for word in words):
        return words
    if len(first) != len(PLAIN) or "diam" in comment.lower():
        raise CaseError(
            f"{where}: no header above {len(first)} columns of numbers; expected a line of names, "
            f"{','.join(PLAIN)} or {','.join(PLAIN[:3])},diameter"
        )
    return PLAIN


def _value(cell: str, columns: Columns, index: int, where: str, *, comma: bool) -> float:
    name, text = columns.names[index].strip(), cell.strip()
    if index == columns.others.get("kind"):
        kind = KIND_NAMES.get(text.lower()) or {str(int(k)): k for k in Kind}.get(text)
        if kind is None:
            expected = " or ".join(KIND_NAMES)
            raise CaseError(f"{where}: {name} is {text[:40]!r}, expected {expected}")
        return float(kind)
    value = _float(text, comma=comma)
    if value is None or not math.isfinite(value):
        expected = "a whole number" if index in columns.others.values() else "a finite number"
        raise CaseError(f"{where}: {name} is {text[:40]!r}, expected {expected} (decimal point)")
    return value


def _float(text: str, *, comma: bool) -> float | None:
    """The number of a cell; None where it is none. A `comma` parts cells, else fractions."""
    plain = text.strip()
    if not comma and _FRACTION.fullmatch(plain):
        plain = plain.replace(",", ".")
    try:
        return None if "_" in plain else float(plain)
    except ValueError:
        return None


# ---- Spheres of a LIGGGHTS or LAMMPS text dump.
DUMP_UNITS = {"si": 1.0, "cgs": 1e-2, "micro": 1e-6}
"""Metres in the unit of length of the unit systems that a dump may name."""
_MOST_NAMED, _MOST_SHOWN = 5, 40


def dump_spheres(
    data: bytes, source: str, *, units: str | None = None, step: int | None = None
) -> SphereRows:
    """The spheres of one frame of a dump, in metres: the last whole frame, or the one of `step`.

    Without `units` the unit of length is that of the dump's own unit system, or m where it names
    none. Raises DumpError where the file is malformed or holds no whole frame, CaseError where
    `step`, a column or the unit is missing.
    """
    reader = DumpReader(data, source, own=False)
    heads, cut = _heads(reader)
    head = _chosen(heads, cut, source, step)
    where = f"{source}: step {head.step}"
    if units is None and head.units and head.units not in DUMP_UNITS:
        raise CaseError(
            f"{where}: its units are {head.units!r}, which fdnet cannot convert to m; give the "
            "unit of length of the file (units)"
        )
    scale = DUMP_UNITS.get(head.units, 1.0) if units is None else snapshot.metres_per(units)
    columns = columns_of(head.columns, where, dump=True)
    frame = reader.frame(head, columns.needed)
    notes = [f"The lengths of {source} are in m."] if units is None and not head.units else []
    if len(heads) > 1 and step is None:
        notes.append(f"The last of {len(heads)} frames of {source} was used, step {head.step}.")
    left = f"; this frame was left out and that of step {head.step} used"
    warnings = [f"{error}{left}" for error in cut] if step is None else []
    end = data[head.body][-_MOST_SHOWN:]
    if end and not end[-1:].isspace():
        last = end.split()[-1].decode("utf-8", "replace")
        warnings.append(f"{source} ends without a line feed: its last number, {last}, may be cut")
    return rows_from(
        columns,
        dict(zip(columns.needed, frame.rows.T, strict=True)),
        lambda row: f"{where}: row {row + 1} by id",
        scale=scale,
        box=frame.box,
        boundary=head.boundary,
        source=source,
        step=head.step,
        notes=tuple(notes),
        warnings=tuple(warnings),
    )


def _heads(reader: DumpReader) -> tuple[list[Head], list[DumpError]]:
    """The whole frames, and what is wrong with each that is cut. Raises where all are."""
    heads, cut = [], []
    while reader.goes_on():
        before = reader.position
        try:
            heads.append(reader.head())
        except DumpError as error:
            if not error.cut:
                raise
            cut.append(error)
            reader.to_next(before)
    if cut and not heads:
        raise cut[0]
    return heads, cut


def _chosen(heads: list[Head], cut: list[DumpError], source: str, step: int | None) -> Head:
    chosen = heads if step is None else [head for head in heads if head.step == step]
    if not chosen:
        known = ", ".join(str(head.step) for head in heads[:_MOST_NAMED])
        known += ", ..." if len(heads) > _MOST_NAMED else ""
        more = f" ({cut[-1]})" if cut else ""
        raise CaseError(f"{source}: no frame of step {step}; the file has {known}{more}")
    if not chosen[-1].count:
        raise CaseError(f"{source}: step {chosen[-1].step} holds no spheres; choose another step")
    return chosen[-1]


# ---- Spheres from a file of any known format, with grains distinguished from fines.
_START = 1000  # Bytes at the start of a file that tell its format
_SAME_BOX = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SphereFile:
    """What a file of spheres holds."""

    spheres: Snapshot  # the spheres, SI units
    # what the reader assumed where neither the file nor the caller says it
    assumptions: tuple[str, ...]
    around_grains: bool  # whether the box is the one around all grains, for want of another
    # what is wrong with the file or contradicts it, one sentence each
    warnings: tuple[str, ...] = ()

    @property
    def periodic(self) -> tuple[bool, bool, bool]:
        """Which of the sides across x, y and z repeat; none where no one says it."""
        return self.spheres.periodic or (False, False, False)


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
        box: the specimen, in the unit of the file, as `Snapshot.from_arrays` takes it. Without it
            the box of the dump, or the box around all grains.
        fines_below: spheres of a smaller radius are fines, in the unit of the file.
        types: which atom types are "grain" and which "fine", for example {1: "grain", 3: "fine"}.
            Without it type 1 is a grain and type 2 a fine, as in fdnet's own dumps.
        step: time step of the frame of a dump. Without it the last frame that is whole.

    Returns:
        The spheres in SI units, with the sides that a dump says are periodic. A file that does
        not tell kinds apart holds grains alone.

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
    bounds = rows.box if box is None else rows.scale * snapshot.checked_box(box)
    around = bounds is None
    if bounds is None:
        bounds = snapshot.grain_box(rows.position, rows.radius, kind)
        notes = [*notes, "The specimen is the box around all grains."]
    elif box is None:
        notes = [*notes, f"The specimen is the box of {rows.source}."]
    sides, side_notes, side_warnings = _sides(rows, bounds, periodic)
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
        periodic=sides,
    )
    return SphereFile(
        spheres=spheres,
        assumptions=(*rows.notes, *notes, *side_notes),
        around_grains=around,
        warnings=(*rows.warnings, *side_warnings),
    )


def _sides(
    rows: SphereRows, box: Array, given: Directions | None
) -> tuple[tuple[bool, bool, bool] | None, list[str], list[str]]:
    """Which sides repeat, what was assumed of them, and where the file contradicts that."""
    chosen = None if given is None else snapshot.periodic_axes(given)
    if not rows.boundary or rows.box is None:
        return chosen, [], []
    said, own = np.array(rows.boundary) == "pp", " ".join(rows.boundary)
    if chosen is not None:
        other = [axis for axis, wrong in zip("xyz", chosen & ~said, strict=True) if wrong]
        text = (
            f"{rows.source} says BOX BOUNDS {own}, so that {', '.join(other)} has walls, but "
            "periodic sides are given there; spheres stay a radius away from walls, and such a "
            "pack taken as periodic has gaps and too high a permeability"
        )
        return chosen, [], [text] if other else []
    near = np.isclose(box, rows.box, rtol=_SAME_BOX, atol=_SAME_BOX * np.ptp(rows.box))
    same = np.all(near, axis=1)
    x, y, z = (said & same).tolist()
    names = zip("xyz", (x, y, z), strict=True)
    text = ", ".join(f"{axis} {'periodic' if one else 'walls'}" for axis, one in names)
    cut = [axis for axis, lost in zip("xyz", said & ~same, strict=True) if lost]
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
    return table_rows(data, source, units=units)


def _kinds(
    rows: SphereRows, fines_below: float | None, types: Mapping[int, str] | None
) -> tuple[Array, list[str]]:
    """Kind (N,) of each sphere, and what was assumed. Raises CaseError on choices at odds."""
    if fines_below is not None:
        return _by_radius(rows, fines_below, types), []
    if types is not None:
        return _by_type(rows, types), []
    if rows.kind is not None:
        return rows.kind, []
    if rows.type is not None:
        note = f"In {rows.source} type 1 is a grain and type 2 a fine."
        return _by_type(rows, OWN_TYPES), [note]
    note = f"{rows.source} does not tell grains from fines: all its spheres are grains."
    return np.full(len(rows.radius), Kind.GRAIN), [note]


def _by_radius(rows: SphereRows, limit: float, types: Mapping[int, str] | None) -> Array:
    if types is not None or rows.kind is not None:
        other = "types" if types is not None else f"the column kind of {rows.source}"
        raise CaseError(
            f"fines_below: {limit:g} and {other} both tell grains from fines; give one of the two"
        )
    if not (np.isfinite(limit) and limit > 0):
        raise CaseError(f"fines_below: {limit:g}, expected a radius above 0, in the file's unit")
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
        raise CaseError(f"{rows.source}: has no types; give a column of kinds, or fines_below")
    present, which = np.unique(rows.type, return_inverse=True)
    missing = sorted(set(present.tolist()) - set(types))
    if missing:
        raise CaseError(
            f"{rows.source}: type {missing[0]} is neither grain nor fine; name it, for example "
            f"types 1=grain,{missing[0]}=fine"
        )
    return np.array([KIND_NAMES[types[number]] for number in present.tolist()], np.int64)[which]
