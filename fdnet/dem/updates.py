"""The record of updates of a coupled invasion, updates.csv: one row for each."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.errors import LiggghtsError
from fdnet.files.atomic import write_text
from fdnet.scales.scales import InvasionScales

UPDATES = "updates.csv"


class Updates:
    """The rows of updates.csv; new ones are appended to the file at once.

    Every number is written so that it is read back exactly.
    """

    def __init__(self, folder: Path, names: Sequence[str], *, upto: int) -> None:
        """Keep the rows before step `upto` of an earlier session, or begin a file of `names`."""
        self.path, self.names = folder / UPDATES, ("step", "time_s", *names)
        rows = read_updates(folder) if upto > 0 else []
        rows = [row for row in rows if row["step"] < upto]
        self.first: Mapping[str, float] | None = rows[0] if rows else None
        self.last: Mapping[str, float] | None = rows[-1] if rows else None
        lines = [",".join(self.names), *(self._line(row) for row in rows)]
        write_text(self.path, "\n".join(lines) + "\n")

    def add(self, step: int, time: float, measures: Mapping[str, float]) -> None:
        """Append the row of the update at `step` and `time` s."""
        row = {"step": float(step), "time_s": time, **measures}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(self._line(row) + "\n")
        self.first, self.last = self.first or row, row

    def _line(self, row: Mapping[str, float]) -> str:
        return ",".join(repr(float(row[name])) for name in self.names)


def read_updates(folder: Path) -> list[dict[str, float]]:
    """The whole rows of updates.csv; none without the file.

    Raises LiggghtsError where a row is not one number for each column.
    """
    try:
        text = (folder / UPDATES).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    title, *lines = text[: text.rfind("\n") + 1].splitlines() or [""]
    names = title.split(",")
    try:
        return [
            {name: float(value) for name, value in zip(names, line.split(","), strict=True)}
            for line in lines
        ]
    except ValueError as error:
        raise LiggghtsError(
            f"{folder / UPDATES}: {error}; the file was changed, start over with --force"
        ) from error


def updates_digest(folder: Path, step: int) -> str:
    """SHA-256 of the updates before `step`, in hexadecimal digits; "" without any."""
    try:
        rows = [row for row in read_updates(folder) if row["step"] < step]
    except (LiggghtsError, KeyError):
        return "unreadable"
    text = "".join(f"{sorted(row.items())!r}\n" for row in rows)
    return hashlib.sha256(text.encode()).hexdigest() if rows else ""


def rate_is_low(folder: Path, case: InvasionCase, step: int) -> bool:
    """Whether the rate before `step` was below `run.stop_rate` of the first one."""
    if case.run.stop_rate is None:
        return False
    last = _last_before(folder, step)
    return last is not None and last["rate_over_initial"] < case.run.stop_rate


def volume_has_passed(folder: Path, case: InvasionCase, scales: InvasionScales, step: int) -> bool:
    """Whether the fluid that passed before `step` is `run.stop_pore_volumes` or more."""
    if case.run.stop_pore_volumes is None:
        return False
    last, pores = _last_before(folder, step), scales.porosity * math.prod(case.size_m)
    return last is not None and last["filtrate_m3"] >= case.run.stop_pore_volumes * pores


def _last_before(folder: Path, step: int) -> Mapping[str, float] | None:
    """The last update before `step`, if there is one."""
    rows = [row for row in read_updates(folder) if row["step"] < step]
    return rows[-1] if rows else None
