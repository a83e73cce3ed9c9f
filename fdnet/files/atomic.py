"""Files that are either the old one or the complete new one, never half of it."""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fdnet.errors import CaseError

_FULL_BYTES = 1 << 16
_PART = re.compile(r"\..+\.(\d+)\.part(\.[^.]*)?")
"""The temporary name of a file; the number is that of the process that writes it."""


def disk_is_full(folder: str | Path) -> bool:
    """Less than 64 kB, or no further file, are free where `folder` is."""
    inodes = os.statvfs(folder)
    full = inodes.f_files > 0 and inodes.f_favail == 0
    return full or shutil.disk_usage(folder).free < _FULL_BYTES


def refuse_special(path: Path) -> None:
    """Raise CaseError where `path` is a device, a pipe or a folder, which no file may replace."""
    if path.exists() and not path.is_file():
        raise CaseError(
            f"{path}: is no ordinary file (a folder, a device or a pipe); give another"
        )


def remove_half_written(folder: Path) -> None:
    """Remove the temporary files in and below a folder that no other process writes to."""
    for path in folder.rglob(".*.part*"):
        if _PART.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


def _remove_remains(final: Path) -> None:
    """Remove temporary files of `final` whose processes have ended."""
    with suppress(OSError):
        for path in final.parent.iterdir():
            match = _PART.fullmatch(path.name)
            if match is None or _temporary(final, match.group(1)) != path:
                continue
            if not _is_running(int(match.group(1))):
                path.unlink(missing_ok=True)


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True


def _temporary(final: Path, process: object) -> Path:
    return final.with_name(f".{final.stem}.{process}.part{final.suffix}")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a name in the folder of `path` to write to; on leaving without error it becomes `path`.

    The temporary name is hidden, holds the process id and keeps the suffix (VTK chooses the format
    by it). When the body raises, the temporary file is removed and `path` stays as it was. What a
    process that was killed left of the same file is removed first. Raises CaseError where a
    device, a pipe or a folder has the name.
    """
    final = Path(path)
    refuse_special(final)
    _remove_remains(final)
    part = _temporary(final, os.getpid())
    try:
        yield part
        os.replace(part, final)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> Path:
    """Write `text` as UTF-8 with `\\n` line ends, atomically; returns the path."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")
    return Path(path)


def write_bytes(path: str | Path, content: bytes) -> Path:
    """Write `content`, atomically; returns the path."""
    with replacing(path) as part:
        part.write_bytes(content)
    return Path(path)
