"""The checkpoints of a clean-up: counts after each chunk of steps, and their states on disk."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import HISTORY
from fdnet.dem.digests import file_digest
from fdnet.dem.scene import snapshot_of
from fdnet.errors import CaseError
from fdnet.files.atomic import write_text
from fdnet.scales.clean_up import BackFlow
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Snapshot

_NAMES = ("chunk", "step", "inside", "out", "passed", "quiet")
CLEANED_HEADER = ",".join(_NAMES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cleaned:
    """Numbers of fines after one chunk of a clean-up.

    Attributes:
        chunk: number of the chunk, from 1.
        step: last step of the chunk; it counts on from those of the invasion.
        inside: fines inside the specimen.
        out: fines that have come out since the clean-up began.
        passed: fines that have left through the other end.
        quiet: chunks since a fine came out.
    """

    chunk: int
    step: int
    inside: int
    out: int
    passed: int
    quiet: int

    def line(self) -> str:
        """The checkpoint as a line of history.csv."""
        return ",".join(str(getattr(self, name)) for name in _NAMES)


def read_cleaned(folder: Path) -> tuple[Cleaned, ...]:
    """All whole rows of the history of a clean-up; none without the file."""
    try:
        text = (folder / HISTORY).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    lines = [line.split(",") for line in text[: text.rfind("\n") + 1].splitlines()[1:]]
    return tuple(
        Cleaned(**{name: int(count) for name, count in zip(_NAMES, line, strict=True)})
        for line in lines
        if len(line) == len(_NAMES) and all(count.isdecimal() for count in line)
    )


def dump_name(step: int) -> str:
    """The dump of a checkpoint, below the folder of the stage."""
    return f"post/clean_{step}.dump"


def restart_name(step: int) -> str:
    """The restart of a checkpoint, below the folder of the stage."""
    return f"post/clean_{step}.restart"


def cleaned_state(folder: Path, row: Cleaned, flow: BackFlow, grains: Snapshot) -> Snapshot:
    """Grains and remaining fines at a checkpoint. Raises DumpError without its dump."""
    case = flow.case
    frame = read_frame(folder / dump_name(row.step))
    moved = snapshot_of(frame, case, time_s=row.step * flow.step)
    return moved if case.grains.motion == "mobile" else grains.joined(moved)


def keep_record(folder: Path, row: Cleaned, digest: str, *, ranks: int) -> None:
    """Record a checkpoint whose files are whole, and keep its restart and the one before.

    LIGGGHTS may have written later checkpoints meanwhile, which are recorded in their turn.
    """
    record = _record(folder, row, digest) | {"ranks": ranks}
    write_text(_record_path(folder, row), json.dumps(record, indent=1) + "\n")
    before = [one for one in read_cleaned(folder) if one.step < row.step]
    for old in before[:-1]:
        (folder / restart_name(old.step)).unlink(missing_ok=True)


def newest_whole(folder: Path, digest: str, *, ranks: int) -> Cleaned | None:
    """The newest checkpoint whose files are what was recorded of this case; None without one.

    Raises CaseError when it was made on another number of MPI ranks.
    """
    for row in reversed(read_cleaned(folder)):
        record = _read(_record_path(folder, row))
        if not record or not _matches(folder, row, digest, record):
            continue
        if record["ranks"] != ranks:
            raise CaseError(
                f"{folder}: this clean-up was begun with --np {record['ranks']}, and --np {ranks} "
                f"would give neither result; continue with --np {record['ranks']}, or start over "
                "with --force"
            )
        return row
    return None


def _record_path(folder: Path, row: Cleaned) -> Path:
    return folder / f"post/clean_{row.step}.record"


def _record(folder: Path, row: Cleaned, digest: str) -> dict[str, Any]:
    rows = [one.line() for one in read_cleaned(folder) if one.step <= row.step]
    return {
        "case": digest,
        "history": hashlib.sha256("\n".join(rows).encode()).hexdigest(),
        "dump": file_digest(folder / dump_name(row.step)),
        "restart": file_digest(folder / restart_name(row.step)),
    }


def _matches(folder: Path, row: Cleaned, digest: str, record: dict[str, Any]) -> bool:
    try:
        return {**record, **_record(folder, row, digest)} == record
    except OSError:
        return False


def _read(path: Path) -> dict[str, Any]:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) and isinstance(record.get("ranks"), int) else {}


def invasion_restart(folder: Path, step: int, case: InvasionCase) -> Path:
    """The restart at the end of the invasion in `folder`, checked against its record.

    Raises CaseError where it is missing or changed.
    """
    from fdnet.dem.digests import read_record

    path, record = folder / "post" / f"invade_{step}.restart", read_record(folder, step)
    try:
        same = record is not None and file_digest(path) == record.restart
    except OSError:
        same = False
    if not same:
        raise CaseError(
            f"{path}: the clean-up begins with this file, and it is missing or is not the one "
            "that the invasion wrote; put it back, or run the invasion again with --stages "
            "invade,clean_up,analyse,report --force"
        )
    return path
