"""Files that are either the old one or the complete new one, never half of it."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FULL_BYTES = 1 << 16


def disk_is_full(folder: str | Path) -> bool:
    """Less than 64 kB are free where `folder` is."""
    return shutil.disk_usage(folder).free < _FULL_BYTES


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a name in the folder of `path` to write to; on leaving without error it becomes `path`.

    The temporary name is hidden, holds the process id and keeps the suffix (VTK chooses the format
    by it). When the body raises, the temporary file is removed and `path` stays as it was.
    """
    final = Path(path)
    part = final.with_name(f".{final.stem}.{os.getpid()}.part{final.suffix}")
    try:
        yield part
        os.replace(part, final)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> Path:
    """Write `text` as UTF-8 with `\\n` line ends, atomically; returns the path."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def write_bytes(path: str | Path, content: bytes) -> Path:
    """Write `content`, atomically; returns the path."""
    with replacing(path) as part:
        part.write_bytes(content)
    return Path(path)
