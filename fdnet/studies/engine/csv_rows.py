"""Tables as CSV: floats with 9 digits, what is not known left empty."""

import csv
import io
import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.atomic import write_text
from fdnet.errors import CaseError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def write_csv(path: Path, columns: Sequence[str], lines: Iterable[Sequence[object]]) -> Path:
    """A header of `columns` and one line each of `lines`."""
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


def read_csv(path: Path, columns: Sequence[str]) -> list[list[str]]:
    """The lines below the header. Raises CaseError when the file has other columns."""
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        header = next(reader, [])
        lines = list(reader)
    if header != list(columns) or any(len(line) != len(header) for line in lines):
        raise CaseError(
            f"{path}: columns {header}, expected {list(columns)} in every line; run the study anew"
        )
    return lines


def parsed(text: str, kind: Any) -> Any:
    """A cell as `kind` str, int or float (nan for an empty one)."""
    return math.nan if kind is float and not text else kind(text)


def _cell(value: object) -> object:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.9g}"
    return "" if value is None else value
