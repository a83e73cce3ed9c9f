"""Digests of the files that LIGGGHTS wrote, and the record that a checkpoint keeps of its own."""

import hashlib
import json
import re
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from fdnet.files.atomic import write_text

_NAME = re.compile(r"invade_(\d{1,18})\.(dump|restart|unreadable|record)")


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckpointRecord:
    """What a checkpoint was when its files were whole.

    Attributes:
        case: digest of the case's invasion.
        ranks: MPI ranks of LIGGGHTS.
        row: line of history.csv.
        overlap: digest of the rows of overlap.csv since the checkpoint before.
        dump: digest of the dump.
        restart: digest of the restart.
        updates: digest of the updates of a coupled invasion before the checkpoint; "" without any.
    """

    case: str
    ranks: int
    row: str
    overlap: str
    dump: str
    restart: str
    updates: str = ""


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits. Raises OSError when it cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def checkpoint_files(folder: Path) -> Iterator[tuple[int, Path]]:
    """Step and path of each file of a checkpoint in `folder`/post; other files are passed over."""
    for path in sorted((folder / "post").glob("invade_*")):
        name = _NAME.fullmatch(path.name)
        if name:
            yield int(name[1]), path


def store_record(folder: Path, step: int, record: CheckpointRecord) -> None:
    """Write the record of a checkpoint, whole or not at all."""
    text = json.dumps(asdict(record), indent=1) + "\n"
    write_text(folder / "post" / f"invade_{step}.record", text)


def read_record(folder: Path, step: int) -> CheckpointRecord | None:
    """The record of a checkpoint; None where there is none, or none that can be understood."""
    path = folder / "post" / f"invade_{step}.record"
    try:
        record = CheckpointRecord(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    texts = (
        record.case,
        record.row,
        record.overlap,
        record.dump,
        record.restart,
        record.updates,
    )
    sound = type(record.ranks) is int and all(isinstance(text, str) for text in texts)
    return record if sound and record.row.split(",")[1:2] == [str(step)] else None


def dump_is_changed(folder: Path, step: int) -> bool:
    """Whether the dump of a checkpoint is another one than was recorded.

    False where nothing was recorded. Raises OSError when the dump cannot be read.
    """
    record = read_record(folder, step)
    return (
        record is not None and file_digest(folder / "post" / f"invade_{step}.dump") != record.dump
    )
