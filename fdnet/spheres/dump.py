"""LIGGGHTS text dumps: the one strict parser, and the columns fdnet writes."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.errors import DumpError
from fdnet.files.atomic import disk_is_full
from fdnet.spheres.arrays import Array, frozen, one_line

CUT = "The run was cut; continue it with --resume."
COLUMNS = "id type x y z vx vy vz radius"
FORMAT = "%d %d %.17g %.17g %.17g %.9g %.9g %.9g %.17g"
_UNITS, _TIME = b"ITEM: UNITS\n", b"ITEM: TIME\n"
_ITEMS = (b"ITEM: TIMESTEP", b"ITEM: NUMBER OF ATOMS", b"ITEM: BOX BOUNDS", b"ITEM: ATOMS")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame:
    """One frame of a dump, in the units of the dump.

    Attributes:
        step: time step of the simulation.
        box: (3, 2) bounds of the simulation box.
        columns: names of the C columns.
        rows: (N, C) values, sorted by the column id where there is one.
        units: name of the units that the dump gives ("si", "lj"), empty where it gives none.
    """

    step: int
    box: Array
    columns: tuple[str, ...]
    rows: Array
    units: str = ""

    __repr__ = one_line

    def column(self, name: str) -> Array:
        """The values (N,) of one column. Raises DumpError when the dump has no such column."""
        if name not in self.columns:
            raise DumpError(
                f"dump at step {self.step}: no column {name} among {' '.join(self.columns)}"
            )
        return self.rows[:, self.columns.index(name)]


def read_dump(path: Path) -> list[Frame]:
    """All frames of a dump file.

    Raises DumpError that names path, line and step where it is malformed or cut.
    """
    return list(parse_dump(bytes_of(path), str(path)))


def bytes_of(path: Path) -> bytes:
    """What a dump file holds. Raises DumpError where it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise DumpError(
            f"{path}: cannot be read: {error.strerror}; the run did not write it"
        ) from error


def read_frame(path: Path) -> Frame:
    """The only frame of a dump file. Raises DumpError, also when there are none or several."""
    with full_disk_named(path.parent):
        frames = read_dump(path)
        if len(frames) != 1:
            raise DumpError(f"{path}: {len(frames)} frames, expected one. {CUT}")
    return frames[0]


@contextmanager
def full_disk_named(folder: Path) -> Iterator[None]:
    """Adds to a DumpError that the disk of the `folder` is full, where it is."""
    try:
        yield
    except DumpError as error:
        if folder.exists() and disk_is_full(folder):
            raise DumpError(f"{error} Make room first: the disk is full.") from error
        raise


def parse_dump(data: bytes, source: str) -> Iterator[Frame]:
    """Frames of the bytes of a dump; `source` names it in errors. Raises DumpError."""
    reader = _Reader(data, source)
    while reader.position < len(data):
        yield reader.frame()


class _Reader:
    """A position in the bytes of a dump; knows the line it stands on."""

    def __init__(self, data: bytes, source: str) -> None:
        self.data, self.source, self.position, self.line = data, source, 0, 1
        self.step: int | None = None
        self.units = ""

    def fail(self, what: str, line: int | None = None) -> DumpError:
        step = "" if self.step is None else f" step {self.step}:"
        return DumpError(f"{self.source}:{line or self.line}:{step} {what}")

    def take(self) -> bytes:
        end = self.data.find(b"\n", self.position)
        if end < 0:
            raise self.fail(f"the file ends in the middle of a line. {CUT}")
        text = self.data[self.position : end]
        self.position, self.line = end + 1, self.line + 1
        return text

    def item(self, expected: bytes) -> bytes:
        line = self.line
        if self.position >= len(self.data):
            raise self.fail(f"the file ends before {expected.decode()}. {CUT}")
        text = self.take()
        if not text.startswith(expected):
            raise self.fail(f"{text[:60]!r}, expected {expected.decode()!r}", line)
        return text[len(expected) :]

    def whole(self, what: str) -> int:
        line, text = self.line, self.take()
        try:
            value = int(text) if len(text) < 19 else -1
        except ValueError:
            value = -1
        if value < 0:
            raise self.fail(f"{what} is {text[:40]!r}, expected a whole number, 0 or more", line)
        return value

    def frame(self) -> Frame:
        self.step = None
        self.skip_optional()
        self.item(_ITEMS[0])
        self.step = self.whole("step")
        self.item(_ITEMS[1])
        count = self.whole("number of atoms")
        if b"xy" in self.item(_ITEMS[2]):
            raise self.fail(
                "the box is slanted (triclinic), expected sides along the axes",
                self.line - 1,
            )
        box = [self.bounds() for _ in range(3)]
        columns = tuple(self.item(_ITEMS[3]).decode("ascii", "replace").split())
        if not columns:
            raise self.fail("ITEM: ATOMS names no columns", self.line - 1)
        return Frame(
            step=self.step,
            box=frozen(box, float),
            columns=columns,
            rows=self.rows(count, columns),
            units=self.units,
        )

    def skip_optional(self) -> None:
        """Read what LAMMPS may write before the step: the units and the time (not used)."""
        for item in (_UNITS, _TIME):
            if self.data.startswith(item, self.position):
                self.take()
                text = self.take().decode("ascii", "replace").strip()
                self.units = text if item == _UNITS else self.units

    def bounds(self) -> list[float]:
        line, text = self.line, self.take()
        try:
            low, high = (float(part) for part in text.split())
        except ValueError:
            low = high = np.nan
        if not (np.isfinite(high - low) and low < high):
            raise self.fail(
                f"box bounds {text[:60]!r}, expected two numbers, the lower one first", line
            )
        return [low, high]

    def rows(self, count: int, columns: tuple[str, ...]) -> Array:
        end = self.data.find(b"ITEM: ", self.position)
        end = len(self.data) if end < 0 else end
        body, first = self.data[self.position : end], self.line
        complete = body.count(b"\n")
        if complete != count or (body and not body.endswith(b"\n")):
            what = "then the file ends" if end == len(self.data) else "then the next frame begins"
            raise self.fail(
                f"{complete} of {count} rows, {what}. {CUT}",
                first + complete,
            )
        self.position, self.line = end, first + complete
        table = _table(body, columns) if count else np.empty((0, len(columns)))
        if table is None:
            raise self.fail(*_bad_row(body, columns, first))
        return frozen(
            table[np.argsort(table[:, columns.index("id")], kind="stable")]
            if "id" in columns
            else table
        )


def exact_numbers() -> dict[str, Any]:
    """The option with which pandas reads every digit; from pandas 3 on that is the default."""
    import pandas as pd

    return {"float_precision": "round_trip"} if int(pd.__version__.split(".")[0]) < 3 else {}


def _table(body: bytes, columns: tuple[str, ...]) -> Array | None:
    """The rows as numbers (N, C), or None when one is short, long, not a number or not finite."""
    import pandas as pd

    trailing = ["trailing space"] if body[: body.index(b"\n")].endswith(b" ") else []
    try:
        table = pd.read_csv(
            io.BytesIO(body),
            sep=" ",
            header=None,
            names=[*columns, *trailing],
            usecols=list(columns),
            dtype=np.float64,
            engine="c",
            na_filter=False,
            index_col=False,
            on_bad_lines="error",
            skip_blank_lines=False,
            **exact_numbers(),
        )
    except (ValueError, pd.errors.ParserError):
        return None
    values = table.to_numpy()
    whole = body.count(b" ") == len(values) * (len(columns) - 1 + len(trailing))
    return values if whole and np.all(np.isfinite(values)) else None


def _bad_row(body: bytes, columns: tuple[str, ...], first: int) -> tuple[str, int]:
    for index, row in enumerate(body.split(b"\n")):
        parts = row.split()
        if len(parts) != len(columns):
            return (
                f"{len(parts)} values, expected {len(columns)} ({' '.join(columns)})",
                first + index,
            )
        for name, part in zip(columns, parts, strict=True):
            try:
                finite = np.isfinite(float(part))
            except ValueError:
                finite = False
            if not finite:
                return (
                    f"column {name} holds {part[:40]!r}, expected a finite number",
                    first + index,
                )
    return "rows are not separated by single spaces", first
