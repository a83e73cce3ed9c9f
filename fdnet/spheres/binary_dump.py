"""Binary dumps of one frame, which LIGGGHTS writes in a tenth of the time of text.

The file does not name its columns, so the caller gives them.
"""

from pathlib import Path

import numpy as np

from fdnet.errors import DumpError
from fdnet.spheres.arrays import Array, frozen
from fdnet.spheres.dump import CUT, Frame, bytes_of, full_disk_named

_HEADER = np.dtype(
    [
        ("step", "<i8"),
        ("count", "<i8"),
        ("slanted", "<i4"),
        ("boundary", "<i4", (6,)),
        ("box", "<f8", (3, 2)),
        ("columns", "<i4"),
        ("blocks", "<i4"),
    ]
)
"""`DumpCustom::header_binary` of LIGGGHTS 3.8; a block for each rank follows, with its number of
values (int) before them."""


def read_binary_frame(path: Path, columns: tuple[str, ...]) -> Frame:
    """The frame of a binary dump with these `columns`, its rows sorted by the column id.

    Raises DumpError that names the path where the file is missing, cut, longer than its frame, or
    holds other columns, a slanted box, or a number that is not finite.
    """
    with full_disk_named(path.parent):
        return _frame(bytes_of(path), columns, str(path))


def _frame(data: bytes, columns: tuple[str, ...], source: str) -> Frame:
    if len(data) < _HEADER.itemsize:
        raise DumpError(f"{source}: the file ends in its header. {CUT}")
    header = np.frombuffer(data, _HEADER, count=1)[0]
    step, width = int(header["step"]), int(header["columns"])
    if header["slanted"] or width != len(columns) or header["count"] < 0:
        raise DumpError(
            f"{source}: step {step}: {width} columns of {header['count']} atoms, slanted box "
            f"{header['slanted']}; expected {len(columns)} columns ({' '.join(columns)}) "
            "and slanted box 0, which has its sides along the axes"
        )
    values = _values(data, int(header["blocks"]), f"{source}: step {step}")
    if len(values) != header["count"] * width:
        raise DumpError(
            f"{source}: step {step}: {len(values)} values, expected {width} for each of "
            f"{header['count']} atoms. {CUT}"
        )
    if not np.all(np.isfinite(values)):
        raise DumpError(f"{source}: step {step}: a value is not finite, expected numbers")
    rows = values.reshape(-1, width)
    order = np.argsort(rows[:, columns.index("id")], kind="stable")
    return Frame(step=step, box=frozen(header["box"]), columns=columns, rows=frozen(rows[order]))


def _values(data: bytes, blocks: int, source: str) -> Array:
    """All values of the blocks, in their order."""
    parts, at = [np.empty(0)], _HEADER.itemsize
    for _ in range(blocks):
        count = int.from_bytes(data[at : at + 4], "little", signed=True)
        end = at + 4 + 8 * count
        if count < 0 or at + 4 > len(data) or end > len(data):
            raise DumpError(f"{source}: the file ends in a block of {count} values. {CUT}")
        parts.append(np.frombuffer(data, "<f8", count=count, offset=at + 4))
        at = end
    if at != len(data):
        raise DumpError(f"{source}: {len(data) - at} bytes follow the frame, expected none. {CUT}")
    return np.concatenate(parts)
