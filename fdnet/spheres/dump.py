"""Dumps of LIGGGHTS and LAMMPS in text, and of LIGGGHTS in binary; the columns fdnet writes."""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.errors import CaseError, DumpError
from fdnet.files import LARGE, disk_is_full, file_bytes
from fdnet.spheres.snapshot import Array, frozen, one_line

CUT = "The run was cut; continue it with --resume."
COLUMNS = "id type x y z vx vy vz radius"
FORMAT = "%d %d %.17g %.17g %.17g %.9g %.9g %.9g %.17g"
_OPTIONAL = (b"ITEM: UNITS", b"ITEM: TIME\n", b"ITEM: TIME\r", b"ITEM: TIME ", b"ITEM: LABEL")
_BLANK = re.compile(rb"\s+")
_TILTS = ("xy", "xz", "yz")
_SIDES = re.compile("pp|[fsm]{2}")
_ITEMS = (b"ITEM: TIMESTEP", b"ITEM: NUMBER OF ATOMS", b"ITEM: BOX BOUNDS", b"ITEM: ATOMS")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame:
    """One frame of a dump, in the units of the dump."""

    step: int  # time step of the simulation
    box: Array  # (3, 2) bounds of the simulation box
    columns: tuple[str, ...]  # names of the C columns
    rows: Array  # (N, C) values, sorted by the column id where there is one

    __repr__ = one_line

    def column(self, name: str) -> Array:
        """The values (N,) of one column. Raises DumpError when the dump has no such column."""
        if name not in self.columns:
            raise DumpError(
                f"dump at step {self.step}: no column {name} among {' '.join(self.columns)}"
            )
        return self.rows[:, self.columns.index(name)]


def read_dump(path: Path) -> list[Frame]:
    """All frames of a dump that fdnet's own LIGGGHTS wrote.

    Raises DumpError that names path, line and step where it is malformed or cut.
    """
    return list(parse_dump(bytes_of(path), str(path)))


def bytes_of(path: Path) -> bytes:
    """What a dump of a run holds. Raises DumpError where it cannot be read."""
    try:
        return file_bytes(path, most=LARGE, what="a dump")
    except CaseError as error:
        raise DumpError(f"{error}; the run did not write it") from error


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
    reader = DumpReader(data, source)
    while reader.goes_on():
        head = reader.head()
        yield reader.frame(head, range(len(head.columns)))


@dataclass(frozen=True, slots=True, eq=False)
class Head:
    """What stands before the rows of a frame, and where they stand."""

    step: int  # as those of a `Frame`
    box: list[list[float]]
    columns: tuple[str, ...]
    units: str  # name of the units that the dump gives ("si", "lj"), empty where it gives none
    # what the file says of the sides across x, y and z ("pp", "ff"), else empty
    boundary: tuple[str, ...]
    count: int  # number of rows
    body: slice  # where the rows stand in the bytes
    line: int  # line of the first of them


class DumpReader:
    """A position in the bytes of a dump; knows the line it stands on.

    `own` dumps are those of fdnet's own LIGGGHTS: the last line ends with a line feed, and a cut
    one tells to continue the run. What other programs wrote is bad input where it is malformed.
    """

    def __init__(self, data: bytes, source: str, *, own: bool = True) -> None:
        self.data, self.source, self.position, self.line = data, source, 0, 1
        self.own, self.step, self.units = own, -1, ""

    def fail(self, what: str, line: int | None = None, *, cut: bool = False) -> DumpError:
        step = "" if self.step < 0 else f" step {self.step}:"
        advice = f". {CUT}" if self.own and cut else ""
        error = DumpError(f"{self.source}:{max(1, line or self.line)}:{step} {what}{advice}")
        error.exit_code = DumpError.exit_code if self.own else CaseError.exit_code
        error.cut = cut
        return error

    def goes_on(self) -> bool:
        """Whether anything but blank lines follows; they are passed over."""
        rest = _BLANK.match(self.data, self.position)
        if rest is not None:
            self.line += rest[0].count(b"\n")
            self.position = rest.end()
        return self.position < len(self.data)

    def to_next(self, before: int) -> None:
        """Go on to the frame after the one that begins at `before`, or to the end."""
        following = self.data.find(b"ITEM: TIMESTEP", self.data.find(_ITEMS[0], before) + 1)
        self.position = following if following > before else len(self.data)
        self.line = self.data.count(b"\n", 0, self.position) + 1

    def take(self) -> bytes:
        end = self.data.find(b"\n", self.position)
        if end < 0:
            raise self.fail("the file ends in the middle of a line", cut=True)
        text = self.data[self.position : end].strip()
        if b"ITEM:" in text[1:]:
            raise self.fail("the next frame begins in the middle of this line", cut=True)
        self.position, self.line = end + 1, self.line + 1
        return text

    def item(self, expected: bytes) -> bytes:
        line, text = self.line, self.value(expected.decode())
        if not text.startswith(expected):
            raise self.fail(f"{_shown(text)}, expected {expected.decode()!r}", line)
        return text[len(expected) :]

    def value(self, what: str) -> bytes:
        if self.position >= len(self.data):
            raise self.fail(f"the file ends before {what}", self.line - 1, cut=True)
        return self.take()

    def whole(self, what: str) -> int:
        line, text = self.line, self.value(f"the {what}")
        if not (text.isdigit() and len(text) < 19):
            raise self.fail(f"{what} is {_shown(text)}, expected a whole number, 0 or more", line)
        return int(text)

    def head(self) -> Head:
        """What stands before the rows of the next frame; goes on to the end of its rows."""
        self.step = -1
        self.goes_on()
        while self.data.startswith(_OPTIONAL, self.position):
            name, text = self.take(), self.value("the value of an item")
            self.units = text.decode("ascii", "replace") if name == _OPTIONAL[0] else self.units
        self.item(_ITEMS[0])
        self.step = self.whole("step")
        self.item(_ITEMS[1])
        count = self.whole("number of atoms")
        flags = tuple(self.item(_ITEMS[2]).decode("ascii", "replace").split())
        slanted, boundary = flags[:3] == _TILTS, flags[3:] if flags[:3] == _TILTS else flags
        if boundary and not (len(boundary) == 3 and all(map(_SIDES.fullmatch, boundary))):
            raise self.fail(
                f"box bounds {' '.join(flags)[:60]!r}, expected a box with sides along the axes, "
                "each side pp, ff, ss or mm (a general slanted box is not read)",
                self.line - 1,
            )
        box = [self.bounds(3 if slanted else 2) for _ in range(3)]
        columns = tuple(self.item(_ITEMS[3]).decode("utf-8", "replace").split())
        if not columns:
            raise self.fail("ITEM: ATOMS names no columns", self.line - 1)
        end = self.data.find(b"ITEM: ", self.position)
        end = len(self.data) if end < 0 else end
        rows = slice(self.position, end)
        head = Head(self.step, box, columns, self.units, boundary, count, rows, self.line)
        self.refuse_cut(head, self.data[rows], last=end == len(self.data))
        self.position, self.line = end, self.line + self.data[rows].count(b"\n")
        return head

    def bounds(self, numbers: int) -> list[float]:
        line, text = self.line, self.value("the bounds of the box")
        try:
            low, high, *tilt = (float(part) for part in text.split())
        except ValueError:
            low = high = np.nan
            tilt = [0.0] * numbers
        if not (np.isfinite(high - low) and low < high) or len(tilt) != numbers - 2:
            further = "" if numbers == 2 else ", and the tilt of a slanted box"
            raise self.fail(
                f"box bounds {_shown(text)}, expected two numbers, the lower one first{further}",
                line,
            )
        if any(tilt):
            slant = f"the box is slanted (triclinic) by {tilt[0]:g}"
            raise self.fail(f"{slant}, expected sides along the axes", line)
        return [low, high]

    def refuse_cut(self, head: Head, body: bytes, *, last: bool) -> None:
        """Raise DumpError unless all rows of the frame are there and whole."""
        whole = ended = body.endswith(b"\n") or not body
        rows = body.count(b"\n") + (not ended)
        if rows != head.count:
            rows = sum(1 for row in body.split(b"\n") if row.strip())
        if last and not ended and not self.own:
            end = body[body.rfind(b"\n") + 1 :].split()
            whole = not end or len(end) >= len(head.columns)
        if rows > head.count and whole:
            raise self.fail(f"{rows} rows, expected {head.count}", head.line + head.count)
        if rows < head.count or not whole:
            what = "then the file ends" if last else "then the next frame begins"
            raise self.fail(
                f"{rows - (not whole)} of {head.count} rows, {what}",
                head.line + max(0, body.rstrip().count(b"\n") - (not body.strip())),
                cut=True,
            )

    def frame(self, head: Head, needed: Sequence[int]) -> Frame:
        """The frame of a head, with the columns of the indices `needed` alone."""
        self.step = head.step
        names = tuple(head.columns[index] for index in needed)
        body = self.data[head.body]
        table = _table(head, body, needed) if head.count else np.empty((0, len(needed)))
        if table is None:
            table = self.careful(head, body, needed)
        if "id" in names:
            table = table[np.argsort(table[:, names.index("id")], kind="stable")]
        box = frozen(head.box, float)
        return Frame(step=head.step, box=box, columns=names, rows=frozen(table))

    def careful(self, head: Head, body: bytes, needed: Sequence[int]) -> Array:
        """The rows as numbers, one by one; names the first that is bad."""
        rows = []
        for line, row in enumerate(body.split(b"\n"), start=head.line):
            parts = row.split()
            if not parts:
                continue
            if len(parts) != len(head.columns):
                expected = f"expected {len(head.columns)} ({' '.join(head.columns)})"
                raise self.fail(f"{len(parts)} values, {expected}", line)
            rows.append([_number(parts[index]) for index in needed])
            for index, value in zip(needed, rows[-1], strict=True):
                if not np.isfinite(value):
                    what = f"column {head.columns[index]} holds {_shown(parts[index])}"
                    raise self.fail(f"{what}, expected a finite number", line)
        return np.array(rows)


def _shown(text: bytes) -> str:
    return repr(text[:60].decode("utf-8", "replace"))


def _number(text: bytes) -> float:
    try:
        return np.nan if b"_" in text else float(text)
    except ValueError:
        return np.nan


def _table(head: Head, body: bytes, needed: Sequence[int]) -> Array | None:
    """The rows as numbers (N, needed), or None unless each has its values and all are finite."""
    marks = np.frombuffer(body.rstrip() + b"\n", np.uint8)
    printed = marks > ord(" ")
    begun = np.cumsum(printed & ~np.append(False, printed[:-1]))
    values = np.diff(begun[marks == ord("\n")], prepend=0)
    if np.any((values != 0) & (values != len(head.columns))):
        return None
    try:
        table = np.loadtxt(io.BytesIO(body), comments=None, usecols=list(needed), ndmin=2)
    except ValueError:
        return None
    return table if len(table) == head.count and np.all(np.isfinite(table)) else None


# ------------------------------------------------------------------------------------------------
# Binary dumps of one frame, which LIGGGHTS writes in a tenth of the time of text.
#
# The file does not name its columns, so the caller gives them.


_HEADER = np.dtype("<i8, <i8, <i4, (6,)<i4, (3,2)<f8, <i4, <i4")
_HEADER.names = ("step", "count", "slanted", "boundary", "box", "columns", "blocks")
"""`DumpCustom::header_binary` of LIGGGHTS 3.8; a block for each rank follows, with its number of
values (int) before them."""


def read_binary_frame(path: Path, columns: tuple[str, ...]) -> Frame:
    """The frame of a binary dump with these `columns`, its rows sorted by the column id.

    Raises DumpError that names the path where the file is missing, cut, longer than its frame, or
    holds other columns, a slanted box, or a number that is not finite.
    """
    with full_disk_named(path.parent):
        data = bytes_of(path)
        if len(data) < _HEADER.itemsize:
            raise DumpError(f"{path}: the file ends in its header. {CUT}")
        header = np.frombuffer(data, _HEADER, count=1)[0]
        step, width, where = int(header["step"]), len(columns), f"{path}: step {header['step']}"
        if header["slanted"] or header["columns"] != width or header["count"] < 0:
            raise DumpError(
                f"{where}: {header['columns']} columns of {header['count']} atoms, slanted box "
                f"{header['slanted']}; expected {width} columns ({' '.join(columns)}) and slanted "
                "box 0, which has its sides along the axes"
            )
        parts, at = [np.empty(0)], _HEADER.itemsize
        for _ in range(header["blocks"]):
            count, at = int.from_bytes(data[at : at + 4], "little", signed=True), at + 4
            if count < 0 or at + 8 * count > len(data):
                raise DumpError(f"{where}: the file ends in a block of {count} values. {CUT}")
            parts.append(np.frombuffer(data, "<f8", count=count, offset=at))
            at += 8 * count
        values = np.concatenate(parts)
        if at != len(data):
            raise DumpError(f"{where}: {len(data) - at} bytes follow the frame, expected 0. {CUT}")
        if len(values) != header["count"] * width:
            raise DumpError(
                f"{where}: {len(values)} values, expected {width} for each of {header['count']} "
                f"atoms. {CUT}"
            )
        if not np.all(np.isfinite(values)):
            raise DumpError(f"{where}: a value is not finite, expected numbers")
    rows = values.reshape(-1, width)
    rows = frozen(rows[np.argsort(rows[:, columns.index("id")], kind="stable")])
    return Frame(step=step, box=frozen(header["box"]), columns=columns, rows=rows)
