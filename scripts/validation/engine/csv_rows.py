"""Tables as CSV files: the only place where the studies write and read them."""

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.errors import CaseError
from fdnet.files import write_text

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

DIGITS = 9
"""Significant digits of a number unless a writer is given others."""


def write_csv(path: Path, columns: Sequence[str], lines: Iterable[Sequence[object]]) -> Path:
    """A header of `columns` and one line each of `lines`; None and nan become empty cells."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([_cell(value) for value in line] for line in lines)
    return write_text(path, text.getvalue())


def write_flat(
    path: Path, kind: "type[DataclassInstance]", rows: "Sequence[DataclassInstance]"
) -> Path:
    """Rows of one dataclass whose fields are plain values, one column a field."""
    return write_csv(path, [one.name for one in fields(kind)], [astuple(row) for row in rows])


def write_named(
    path: Path,
    rows: Sequence[Mapping[str, object]],
    *,
    columns: Sequence[str] = (),
    digits: int = 6,
) -> Path:
    """Rows by column name, whole or not at all; nan is written as such.

    Args:
        path: the file, whose folder is made.
        rows: values by column; what a row lacks is left empty.
        columns: names and order of the columns; those of the first row if not given.
        digits: significant digits of numbers.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    names = list(columns) or list(rows[0])
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_named_cell(row.get(name), digits) for name in names] for row in rows)
    return write_text(path, text.getvalue())


def read_csv(path: Path, columns: Sequence[str]) -> list[list[str]]:
    """The lines below the header.

    Raises:
        CaseError: the file has other columns.
    """
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        header = next(reader, [])
        lines = list(reader)
    if header != list(columns) or any(len(line) != len(header) for line in lines):
        raise CaseError(
            f"{path}: columns {header}, expected {list(columns)} in every line; "
            "run the study again to write the file anew"
        )
    return lines


def read_named(path: Path) -> list[dict[str, str]]:
    """The rows of a file by column name."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def parsed(text: str, kind: Any) -> Any:
    """A cell as `kind` str, int or float (nan for an empty one)."""
    return math.nan if kind is float and not text else kind(text)


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.{DIGITS}g}"
    return "" if value is None else value


def _named_cell(value: object, digits: int) -> object:
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return "" if value is None else value
