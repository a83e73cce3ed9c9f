"""Curves of sizes in CSV files: tables of sieves and of laser instruments."""

import csv
import re
from pathlib import Path

from fdnet.case.units import length_factor
from fdnet.errors import CaseError
from fdnet.files.paths import SMALL, expanded, file_bytes, text_of

_BRACKETS = re.compile(r"[(\[]([^)\]]*)[)\]]")
_FINER = r"passing|finer|under|smaller|less|<"
_COARSER = r"retained|over|coarser|larger|greater|>"
_SIZES = (
    r"size|diam|sieve|mesh|opening|apertur|screen|particle|grain|durchm|korn|masch|sieb|tamis"
    r"|maill|taille|tamiz|tama|^[dx]?$"
)
_RADII = r"radi|rayon|^r$"
_POWERS = {
    "mass": r"mass|weight|\bwt|vol|q3",
    "number": r"number|count|\bnum|\bno\b|\bnr\b|q0",
    "surface": r"surface|area|q2",
    "length or intensity": r"length|intensity|q1",
}
"""What the shares of a column may count, with the words that say it."""
_AS_MASS = {"mass", "volume"}
_MOST_FRACTION = 1.0 + 1e-9


def read_size_file(
    folder: Path, name: str, *, by: str = "mass"
) -> tuple[list[float], list[float]]:
    """Diameters, mm, that rise, and the percentage finer than each, from a CSV file.

    The first line that is no comment (#) names the columns, with their units: one of sizes
    ("size_um", "Diameter (mm)", or "Radius (mm)", which is doubled) and one cumulative percentage
    ("passing %", "cumulative % finer", or "cumulative % retained", which is turned around; shares
    from 0 to 1 are named "fraction finer"). The rows may rise or fall. The text is UTF-8, UTF-16
    or Windows-1252. `by` is what the case says that the percentages count; a column that says
    another thing is refused.

    Raises ValueError, with the file and what was expected, where it cannot be read so.
    """
    path = expanded(name)
    path = path if path.is_absolute() else folder / path
    try:
        text = text_of(file_bytes(path, most=SMALL, what="a table of sizes"), path)
    except CaseError as error:
        raise ValueError(str(error)) from error
    try:
        return parse_sizes(text, by=by)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def parse_sizes(text: str, *, by: str = "mass") -> tuple[list[float], list[float]]:
    """As `read_size_file`, of the text of a file."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) < 3:
        raise ValueError("expected a line of column names and at least two rows")
    delimiter = next((one for one in (";", "\t", ",") if one in lines[0]), ",")
    try:
        header, *rows = list(csv.reader(lines, delimiter=delimiter))
    except csv.Error as error:
        raise ValueError(f"{error}; expected comma-separated values") from error
    sizes, factor = _size_column(header)
    percents, retained, whole = _share_column(header, sizes, by)
    points = [_row(row, sizes, percents, comma=delimiter != ",") for row in rows]
    if points[0][0] > points[-1][0]:
        points.reverse()
    largest = max(share for _, share in points)
    if whole == 100 and 0 < largest <= _MOST_FRACTION:
        raise ValueError(
            f"column {header[percents]!r}: its numbers end at {largest:g} and look like fractions "
            "of 1, expected percentages that end at 100; multiply them by 100, or name the column "
            "'fraction finer' or 'cumulative fraction retained'"
        )
    if whole == 1 and not largest <= _MOST_FRACTION:
        raise ValueError(
            f"column {header[percents]!r}: holds {largest:g}, expected fractions from 0 to 1; "
            "name the column with % where it holds percentages"
        )
    finer = [100 * (whole - share if retained else share) / whole for _, share in points]
    return [size * factor for size, _ in points], finer


def _size_column(header: list[str]) -> tuple[int, float]:
    """Index of the column of sizes and the factor that makes diameters, mm, of its numbers."""
    columns = []
    for index, name in enumerate(header):
        last = re.split(r"[\s_,]+", name.strip())[-1]
        for unit in (*_BRACKETS.findall(name), last):
            factor = length_factor(unit)
            if factor is not None and "%" not in name:
                columns.append((index, factor, name.replace(unit, "").strip(" _,()[]").lower()))
                break
    if len(columns) != 1:
        raise ValueError(
            f"{len(columns)} columns of {header} have a unit of length, expected one, named such "
            "as 'size_um' or 'Diameter (mm)'"
        )
    index, factor, words = columns[0]
    if re.search(_RADII, words):
        return index, 2 * factor
    if not re.search(_SIZES, words):
        raise ValueError(
            f"column {header[index]!r}: not known as sizes of grains; name it such as 'size_um', "
            "'Diameter (mm)' or 'Radius (mm)'"
        )
    return index, factor


def _share_column(header: list[str], sizes: int, by: str) -> tuple[int, bool, float]:
    """Index of the column of cumulative shares, whether it counts what is coarser, its whole."""
    columns = []
    for index, name in enumerate(header):
        words = name.lower()
        percent = "%" in words or "percent" in words
        cumulative = "cum" in words
        finer, coarser = bool(re.search(_FINER, words)), bool(re.search(_COARSER, words))
        if index == sizes or not (percent or "fraction" in words):
            continue
        if finer and coarser:
            raise ValueError(f"column {name!r}: finer or coarser? Name it 'passing %', or so")
        if coarser and not cumulative:
            raise ValueError(
                f"column {name!r}: is it the share on each sieve, or on it and all above? "
                "Name it 'cumulative % retained' if it is the latter"
            )
        if finer or coarser or cumulative:
            columns.append((index, coarser, 100.0 if percent else 1.0))
    if len(columns) != 1:
        raise ValueError(
            f"{len(columns)} columns of {header} are cumulative percentages, expected one, named "
            "such as 'passing %', 'cumulative % finer' or 'cumulative % retained'"
        )
    _refuse_other_shares(header[columns[0][0]], by)
    return columns[0]


def _refuse_other_shares(name: str, by: str) -> None:
    """Raise ValueError where a column says that it counts another thing than `by`."""
    said = {power for power, words in _POWERS.items() if re.search(words, name.lower())}
    own = "mass" if by in _AS_MASS else by
    if said - {own}:
        known = "mass, volume, surface or number"
        raise ValueError(
            f"column {name!r}: counts {' and '.join(sorted(said))}, but the case says by "
            f"{by!r}; give by = what the column counts ({known}) next to the file"
        )


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
