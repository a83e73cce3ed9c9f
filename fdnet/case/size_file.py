"""Curves of sizes in CSV files: tables of sieves and of laser instruments."""

import csv
import re
from pathlib import Path

from fdnet.case.units import length_factor
from fdnet.files.paths import expanded

_BRACKETS = re.compile(r"[(\[]([^)\]]*)[)\]]")
_FINER = ("passing", "finer", "under", "cumulative", "cum.")
_COARSER = ("retained", "over", "coarser")
_MOST_BYTES = 1_000_000


def read_size_file(folder: Path, name: str) -> tuple[list[float], list[float]]:
    """Diameters, mm, that rise, and the percentage finer than each, from a CSV file.

    The first line that is no comment (#) names the columns, with their units: one of sizes
    ("size_um", "Diameter (mm)") and one cumulative percentage ("passing %", "cumulative % finer",
    or "cumulative % retained", which is turned around). The rows may rise or fall.

    Raises ValueError, with the file and what was expected, where it cannot be read so.
    """
    path = expanded(name)
    path = path if path.is_absolute() else folder / path
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise ValueError(f"{path}: more than {_MOST_BYTES} bytes, expected a table of sizes")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read as a table of sizes: {error}") from error
    try:
        return parse_sizes(text)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_sizes(text: str) -> tuple[list[float], list[float]]:
    """As `read_size_file`, of the text of a file."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) < 3:
        raise ValueError("expected a line of column names and at least two rows")
    delimiter = next((one for one in (";", "\t", ",") if one in lines[0]), ",")
    header, *rows = list(csv.reader(lines, delimiter=delimiter))
    sizes, factor = _size_column(header)
    percents, retained = _percent_column(header, sizes)
    points = [_row(row, sizes, percents, comma=delimiter != ",") for row in rows]
    if points[0][0] > points[-1][0]:
        points.reverse()
    finer = [100 - share if retained else share for _, share in points]
    return [size * factor for size, _ in points], finer


def _size_column(header: list[str]) -> tuple[int, float]:
    """Index of the column of sizes and the factor of its unit to mm."""
    columns = []
    for index, name in enumerate(header):
        units = [*_BRACKETS.findall(name), re.split(r"[\s_,]+", name.strip())[-1]]
        factors = [factor for unit in units if (factor := length_factor(unit)) is not None]
        if factors and "%" not in name:
            columns.append((index, factors[0]))
    if len(columns) != 1:
        raise ValueError(
            f"{len(columns)} columns of {header} have a unit of length, expected one, named such "
            "as 'size_um' or 'Diameter (mm)'"
        )
    return columns[0]


def _percent_column(header: list[str], sizes: int) -> tuple[int, bool]:
    """Index of the column of cumulative percentages, and whether it counts what is coarser."""
    columns = []
    for index, name in enumerate(header):
        words = name.lower()
        percent = "%" in words or "percent" in words
        cumulative = "cum" in words
        finer = any(word in words for word in _FINER)
        coarser = any(word in words for word in _COARSER) and "under" not in words
        if index != sizes and percent and (finer or coarser):
            if coarser and not cumulative:
                raise ValueError(
                    f"column {name!r}: is it the share on each sieve, or on it and all above? "
                    "Name it 'cumulative % retained' if it is the latter"
                )
            columns.append((index, coarser))
    if len(columns) != 1:
        raise ValueError(
            f"{len(columns)} columns of {header} are cumulative percentages, expected one, named "
            "such as 'passing %', 'cumulative % finer' or 'cumulative % retained'"
        )
    return columns[0]


def _row(row: list[str], sizes: int, percents: int, *, comma: bool) -> tuple[float, float]:
    values = []
    for index in (sizes, percents):
        cell = row[index].strip() if index < len(row) else ""
        try:
            values.append(float(cell.replace(",", ".") if comma else cell))
        except ValueError:
            raise ValueError(
                f"row {row}: {cell!r} is no number; units stand in the names of the columns"
            ) from None
    return values[0], values[1]
