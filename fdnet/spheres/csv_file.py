"""Sphere tables: written at full precision, read back strictly."""

import csv
import io
import math
import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from fdnet.errors import CaseError
from fdnet.files.atomic import replacing
from fdnet.files.paths import LARGE, file_bytes, text_of
from fdnet.spheres.rows import UNITS, Columns, SphereRows, columns_of, rows_from, scale_of
from fdnet.spheres.snapshot import KIND_NAMES, Kind, Snapshot

PLAIN = ("x", "y", "z", "radius")
METRES = ("x_m", "y_m", "z_m", "radius_m")
_BEFORE_UNIT = re.compile(r"\s*([(\[])\s*")
_FRACTION = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


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
    """The spheres of a table in a text file, in metres; see `table_rows`."""
    data = file_bytes(path, most=LARGE, what="a file of spheres")
    return table_rows(data, str(path), units=units)


def table_rows(data: bytes, source: str, *, units: str | None = None) -> SphereRows:
    """The spheres of a table in text, in metres.

    Columns stand between commas, semicolons, tabs or spaces, in any order: the centre x, y, z, a
    size (radius, r, diameter or d) and, if there, kind (grain or fine), type and id; others are
    not read. Lengths are in `units` (one of `UNITS`), or in the unit at the end of their names
    ("x_m"), where `units` must be None. Names may also stand in the comment before the first row,
    as Yade writes them (`#format x_y_z_r`); four columns without any name are x, y, z and radius.
    Blank lines and lines that start with `#` are skipped. Raises CaseError that names the file,
    the line, what it holds and what was expected.
    """
    lines = _Lines(text_of(data, source), source)
    cells = lines.cells()
    try:
        first = next(cells, None)
        if first is None:
            raise CaseError(f"{source}: the file is empty; expected a header {','.join(PLAIN)}")
        names, notes = _names(first, lines)
        columns = columns_of(names, lines.where())
        scale = scale_of(columns, units, lines.where())
        if scale is None:
            raise CaseError(
                f"{lines.where()}: the columns {','.join(PLAIN)} have no unit; give --units mm "
                f'on the command line, units="mm" in Python (one of {", ".join(UNITS)}), or name '
                "them x_m,y_m,z_m,radius_m"
            )
        rows = cells if first is names else chain([first], cells)
        table, numbers = [], []
        for row in rows:
            if len(row) != len(names):
                raise CaseError(
                    f"{lines.where()}: {len(row)} values, expected {len(names)} as in the header"
                )
            table.append([_value(row[k], columns, k, lines) for k in columns.needed])
            numbers.append(lines.number)
    except csv.Error as error:
        raise CaseError(f"{lines.where()}: {error}; expected comma-separated values") from error
    if not table:
        raise CaseError(f"{source}: no spheres after the header; expected at least one row")
    if columns.ignored:
        notes.append(f"Columns of {source} that are not read: {', '.join(columns.ignored)}.")
    return rows_from(
        columns,
        dict(zip(columns.needed, np.array(table).T, strict=True)),
        lambda row: f"{source}:{numbers[row]}",
        scale=scale,
        source=source,
        notes=tuple(notes),
    )


class _Lines:
    """The lines of a text that carry data, counting all of them from 1."""

    def __init__(self, text: str, source: str) -> None:
        self.text, self.source, self.number = text, source, 0
        self.comment = ""
        self.comma = False

    def where(self) -> str:
        return f"{self.source}:{self.number}" if self.number else self.source

    def cells(self) -> Iterator[list[str]]:
        """The cells of each line, parted as the first of them is.

        Where that is not by commas, a comma is that of a decimal fraction.
        """
        lines = self._lines()
        first = next(lines, None)
        if first is None:
            return
        marks = [mark for mark in (";", "\t", ",") if mark in first]
        self.comma = marks[:1] == [","]
        whole = chain([first], lines)
        if marks and marks[0] != "\t":
            yield from csv.reader(whole, delimiter=marks[0], strict=True)
        else:
            for line in whole:
                yield [cell.strip('"') for cell in _BEFORE_UNIT.sub(r"\1", line).split()]

    def _lines(self) -> Iterator[str]:
        started = False
        for line in io.StringIO(self.text, newline=None):
            self.number += 1
            if line.lstrip().startswith("#"):
                self.comment = self.comment if started else line.strip().lstrip("#").strip()
            elif line.strip():
                started = True
                yield line


def _names(first: list[str], lines: _Lines) -> tuple[list[str], list[str]]:
    """Names of the columns, and what was assumed of them.

    They are the `first` line itself unless it holds numbers alone; then those of the comment
    before it, or x, y, z, radius. Raises CaseError where there are none.
    """
    if any(_float(cell, comma=lines.comma) is None for cell in first):
        return first, []
    words = re.split(r"[\s,;]+", lines.comment)
    if len(words) == 2 and words[0].lower() == "format":
        words = words[1].split("_")
        words += ["further"] * (len(first) - len(words))
    if len(words) == len(first) and not all(_float(word, comma=False) for word in words):
        return words, []
    if len(first) != len(PLAIN) or "diam" in lines.comment.lower():
        raise CaseError(
            f"{lines.where()}: no header above {len(first)} columns of numbers; expected a line "
            f"of names, {','.join(PLAIN)} or {','.join(PLAIN[:3])},diameter"
        )
    note = f"{lines.source} has no header: its four columns are x, y, z and radius."
    return list(PLAIN), [note]


def _value(cell: str, columns: Columns, index: int, lines: _Lines) -> float:
    name = columns.names[index].strip()
    text = cell.strip()
    if index == columns.others.get("kind"):
        kind = KIND_NAMES.get(text.lower()) or {str(int(k)): k for k in Kind}.get(text)
        if kind is None:
            raise CaseError(
                f"{lines.where()}: {name} is {text[:40]!r}, expected {' or '.join(KIND_NAMES)}"
            )
        return float(kind)
    value = _float(text, comma=lines.comma)
    if value is None or not math.isfinite(value):
        expected = "a whole number" if index in columns.others.values() else "a finite number"
        raise CaseError(
            f"{lines.where()}: {name} is {text[:40]!r}, expected {expected} (decimal point)"
        )
    return value


def _float(text: str, *, comma: bool) -> float | None:
    """The number of a cell; None where it is none. `comma` parts cells, else fractions."""
    plain = text.strip()
    if not comma and _FRACTION.fullmatch(plain):
        plain = plain.replace(",", ".")
    try:
        return None if "_" in plain else float(plain)
    except ValueError:
        return None
