"""Which folders are run folders of fdnet, and so may be written to and cleared."""

import json
import re
from pathlib import Path
from typing import Any

from fdnet.case.stages import LIGGGHTS_STAGES, STAGES
from fdnet.files.atomic import write_text

RECORD_FORMAT = 1
MANIFEST, CASE, LOCK, UNFINISHED = "manifest.json", "case.toml", ".lock", ".unfinished"
MARK = ".fdnet-run"
RECORDS: dict[str, str] = {stage: f"{stage}/stage.json" for stage in LIGGGHTS_STAGES}
_MARK_TEXT = "fdnet run folder, format 1\n"
_MANIFEST_KEYS = {"case", "digests", "stages"}
_RECORD_KEYS = {"digest", "seconds", "runs"}
_HALF_MARK = re.compile(r"\.\.fdnet-run\.\d+\.part")


def mark_folder(folder: Path) -> None:
    """Write the mark that makes `folder` a run folder, unless it is there."""
    if not _holds_mark(folder):
        write_text(folder / MARK, _MARK_TEXT)


def is_run_folder(folder: Path) -> bool:
    """Whether fdnet made this folder.

    The mark says so. A folder of an fdnet that wrote no mark yet is known by the content of its
    manifest, of a stage's record, or of the list of unfinished stages; names alone are no proof.
    """
    return (
        _holds_mark(folder)
        or _holds_keys(folder / MANIFEST, _MANIFEST_KEYS)
        or any(_holds_keys(folder / name, _RECORD_KEYS) for name in RECORDS.values())
        or _names_stages(folder)
    )


def is_unused(folder: Path) -> bool:
    """Whether `folder` is empty but for the empty lock and half mark of a session just killed."""
    return all(
        (child.name == LOCK and child.is_file() and child.stat().st_size == 0)
        or _HALF_MARK.fullmatch(child.name) is not None
        for child in folder.iterdir()
    )


def _holds_mark(folder: Path) -> bool:
    return _start_of(folder / MARK) == _MARK_TEXT


def _names_stages(folder: Path) -> bool:
    """A list of unfinished stages next to a case is the start of a run."""
    words = _start_of(folder / UNFINISHED).split()
    return bool(words) and set(words) <= set(STAGES) and (folder / CASE).is_file()


def _start_of(path: Path) -> str:
    try:
        if not path.is_file():
            return ""
        with path.open("rb") as file:
            return file.read(200).decode("utf-8", "replace")
    except OSError:
        return ""


def _holds_keys(path: Path, keys: set[str]) -> bool:
    record = _json_of(path)
    return (
        isinstance(record, dict) and record.get("format") == RECORD_FORMAT and keys <= set(record)
    )


def _json_of(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    except (OSError, ValueError, RecursionError):
        return None
