"""Sphere tables: written at full precision, read back strictly."""

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from fdnet.errors import CaseError
from fdnet.files.atomic import replacing
from fdnet.spheres.rows import UNITS, SphereRows, metres_per
from fdnet.spheres.snapshot import KIND_NAMES, Kind, Snapshot, frozen

PLAIN = ("x", "y", "z", "radius")
METRES = ("x_m", "y_m", "z_m", "radius_m")
OPTIONAL = ("kind", "id")


def write_spheres(path: str | Path, snapshot: Snapshot) -> Path:
    """Write x_m, y_m, z_m, radius_m, kind, id; one row per sphere, atomically.

    Coordinates are the shortest decimals that read back to the same number (`repr`), so that a
    count by `lo <= x < hi` is the same from the file as from memory.
    """
    import pandas as pd

    names = {int(kind): name for name, kind in KIND_NAMES.items()}
    columns = dict(zip(METRES, (*snapshot.position.T, snapshot.radius), strict=True))
    frame = pd.DataFrame(
        columns | {"kind": [names[int(k)] for k in snapshot.kind], "id": snapshot.id}
    )
    with replacing(path) as part:
        frame.to_csv(part, index=False, lineterminator="\n")
    return Path(path)


def read_csv(path: str | Path, *, units: str | None = None) -> SphereRows:
    """The spheres of a CSV table, in metres.

    Columns, in any order: `x,y,z,radius[,kind][,id]` in `units` (one of `UNITS`), or
    `x_m,y_m,z_m,radius_m[,kind][,id]`, where `units` must be None. `kind` is grain or fine. Blank
    lines and lines that start with `#` are skipped. Raises CaseError that names the file, the
    line, what it holds and what was expected.
    """
    source = Path(path)
    if units is not None:
        metres_per(units)
    lines = _Lines(source)
    reader = csv.reader(lines, strict=True)
    try:
        header = _header(next(reader, None), lines.where(), units)
        rows = [_row(fields, header, lines.where()) for fields in reader]
    except csv.Error as error:
        raise CaseError(f"{lines.where()}: {error}; expected comma-separated values") from error
    if not rows:
        raise CaseError(f"{source}: no spheres after the header; expected at least one row")
    values = np.array([row[:4] for row in rows])
    return SphereRows(
        source=str(source),
        scale=header.scale,
        position=frozen(values[:, :3]),
        radius=frozen(values[:, 3]),
        kind=None if header.kind is None else frozen([row[4] for row in rows], np.int64),
        id=None if header.id is None else frozen([row[5] for row in rows], np.int64),
    )


class _Lines:
    """The lines of a text file that carry data, counting all of them from 1."""

    def __init__(self, source: Path) -> None:
        self.source, self.number = source, 0

    def where(self) -> str:
        return f"{self.source}:{self.number}" if self.number else str(self.source)

    def __iter__(self) -> Iterator[str]:
        try:
            with self.source.open(encoding="utf-8-sig", newline=None) as handle:
                for self.number, line in enumerate(handle, start=1):
                    if line.strip() and not line.lstrip().startswith("#"):
                        yield line
        except UnicodeDecodeError as error:
            raise CaseError(
                f"{self.source}: not UTF-8 text ({error.reason}); expected CSV"
            ) from error
        except OSError as error:
            raise CaseError(
                f"{self.source}: {error.strerror}; expected a CSV file of spheres"
            ) from error


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Header:
    """Where each column stands.

    Attributes:
        width: number of columns.
        names: names of the columns x, y, z, radius.
        numbers: places of these four.
        kind: place of the column kind; None without one.
        id: place of the column id; None without one.
        scale: metres in the unit of the four columns.
    """

    width: int
    names: tuple[str, ...]
    numbers: tuple[int, ...]
    kind: int | None
    id: int | None
    scale: float


def _header(fields: list[str] | None, where: str, units: str | None) -> _Header:
    if fields is None:
        raise CaseError(f"{where}: the file is empty; expected a header {','.join(PLAIN)}[,kind]")
    names = tuple(field.strip() for field in fields)
    wanted = METRES if any(name in METRES for name in names) else PLAIN
    _refuse_columns(names, wanted, where)
    if wanted is METRES and units is not None:
        raise CaseError(
            f"{where}: the columns {','.join(METRES)} are in metres already, "
            f"but units {units!r} were given; leave out --units"
        )
    if wanted is PLAIN and units is None:
        raise CaseError(
            f"{where}: the columns {','.join(PLAIN)} have no unit; give --units mm "
            f'on the command line, units="mm" in Python (one of {", ".join(UNITS)}), or name them '
            f" {','.join(METRES)}"
        )
    return _Header(
        width=len(names),
        names=wanted,
        numbers=tuple(names.index(name) for name in wanted),
        kind=names.index("kind") if "kind" in names else None,
        id=names.index("id") if "id" in names else None,
        scale=UNITS[units or "m"],
    )


def _refuse_columns(names: tuple[str, ...], wanted: tuple[str, ...], where: str) -> None:
    expected = f"expected {','.join(wanted)}[,kind][,id]"
    missing = [name for name in wanted if name not in names]
    if missing:
        raise CaseError(
            f"{where}: no column {', '.join(missing)} in header {','.join(names)!r}; {expected}"
        )
    for name in names:
        if name not in (*wanted, *OPTIONAL):
            near = get_close_matches(name.lower(), (*wanted, *OPTIONAL), n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else "; remove it"
            raise CaseError(f"{where}: unknown column {name!r}{hint}; {expected}")
        if names.count(name) > 1:
            raise CaseError(f"{where}: column {name!r} occurs twice; {expected}")


def _row(
    fields: list[str], header: _Header, where: str
) -> tuple[float, float, float, float, int, int]:
    if len(fields) != header.width:
        raise CaseError(f"{where}: {len(fields)} values, expected {header.width} as in the header")
    x, y, z, radius = (
        _number(fields[i], name, where) * header.scale
        for i, name in zip(header.numbers, header.names, strict=True)
    )
    if radius <= 0:
        given = fields[header.numbers[3]].strip()
        raise CaseError(f"{where}: {header.names[3]} is {given}, expected a number above 0")
    kind = Kind.GRAIN if header.kind is None else _kind(fields[header.kind], where)
    number = 0 if header.id is None else _id(fields[header.id], where)
    return x, y, z, radius, int(kind), number


def _id(text: str, where: str) -> int:
    if not text.strip().isdecimal() or len(text.strip()) > 18:
        raise CaseError(
            f"{where}: id is {text.strip()[:40]!r}, expected a whole number from 0 to 18 digits"
        )
    return int(text)


def _number(text: str, name: str, where: str) -> float:
    try:
        value = math.nan if "_" in text else float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CaseError(
            f"{where}: {name} is {text.strip()!r}, expected a finite number (decimal point)"
        )
    return value


def _kind(text: str, where: str) -> Kind:
    kind = KIND_NAMES.get(text.strip())
    if kind is None:
        raise CaseError(f"{where}: kind is {text.strip()!r}, expected {' or '.join(KIND_NAMES)}")
    return kind
