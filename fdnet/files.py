"""Files, each the old one or the complete new one and never half of it, and paths of users."""

import argparse
import codecs
import gzip
import io
import os
import re
import shutil
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fdnet.errors import CaseError

_FULL_BYTES = 1 << 16
_PART = re.compile(r"\..+\.\d+\.part(\.[^.]*)?")
"""The temporary name of a file; the number is that of the process that writes it."""


def disk_is_full(folder: str | Path) -> bool:
    """Less than 64 kB, or no further file, are free where `folder` is."""
    inodes = os.statvfs(folder)
    full = inodes.f_files > 0 and inodes.f_favail == 0
    return full or shutil.disk_usage(folder).free < _FULL_BYTES


def remove_half_written(folder: Path) -> None:
    """Remove the temporary files in and below a folder that no other process writes to."""
    for path in folder.rglob(".*.part*"):
        if _PART.fullmatch(path.name) and path.is_file():
            path.unlink(missing_ok=True)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a name in the folder of `path` to write to; on leaving without error it becomes `path`.

    The temporary name is hidden, holds the process id and keeps the suffix (VTK chooses the format
    by it). When the body raises, the temporary file is removed and `path` stays as it was. Raises
    CaseError where a device, a pipe or a folder has the name.
    """
    final = Path(path)
    if final.exists() and not final.is_file():
        raise CaseError(
            f"{final}: is no ordinary file (a folder, a device or a pipe); give another"
        )
    part = final.with_name(f".{final.stem}.{os.getpid()}.part{final.suffix}")
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


# ---- Files that a command makes for the user: none is ever replaced unasked.
def refuse_present(path: Path, *, force: bool) -> None:
    """Raise CaseError where a file is there and may not be replaced, or its folder is missing."""
    if path.exists() and not force:
        raise CaseError(f"{path}: is there already; give another --out, or --force to replace it")
    if not path.absolute().parent.is_dir():
        raise CaseError(f"{path}: the folder {path.absolute().parent} does not exist; make it")


def write_new(path: Path, text: str, *, force: bool) -> None:
    """Write a text file that is not there yet, or any with `force`.

    Raises CaseError as `refuse_present` does, and when it cannot be written.
    """
    refuse_present(path, force=force)
    write_text(path, text)


# ---- Paths and files as a user gives them, made fit for every library before they are used.
SMALL, LARGE = 16 * 2**20, 4 * 2**30
"""Most bytes of a case, a sweep or a table of sizes, and of a file of spheres."""
_ZIPPED = b"\x1f\x8b"
MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF8)
"""Bytes at the start of a text that name its encoding."""
_PACKED = {b"PK\x03\x04": "a zip archive or a spreadsheet", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}
_PACKED |= {b"(\xb5/\xfd": "zstd", b"7z\xbc\xaf": "7-Zip", b"\xd0\xcf\x11\xe0": "a spreadsheet"}
_CONTROLS = dict.fromkeys([*range(9), *range(14, 26), *range(27, 32), 127])


def file_bytes(path: str | Path, *, most: int, what: str) -> bytes:
    """What an ordinary file holds; `what` names it in messages ("a case file").

    Nothing is read of a folder, a device, a pipe or a socket, nor of a file of the system that
    has no size, because they may never end. Raises CaseError for these, for a file of more than
    `most` bytes, and for one that is missing or cannot be read.
    """
    place, start = expanded(path), f"{path}: cannot be read as {what}:"
    try:
        _refuse_endless(os.stat(place), start, most)
        with os.fdopen(os.open(place, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            status = os.fstat(file.fileno())
            _refuse_endless(status, start, most)
            return (status.st_size and file.read(status.st_size)) or b""
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"{start} {reason}; give the path of {what}") from error


def _refuse_endless(status: os.stat_result, start: str, most: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        kinds = {stat.S_IFDIR: "is a directory", stat.S_IFIFO: "is a pipe"}
        kind = kinds.get(stat.S_IFMT(status.st_mode), "is a device or a socket")
        raise CaseError(f"{start} it {kind}, expected an ordinary file")
    if status.st_size > most:
        raise CaseError(
            f"{start} it has {status.st_size} bytes, expected at most {most} ({most >> 20} MiB)"
        )


def unzipped(data: bytes, path: str | Path, *, most: int) -> bytes:
    """`data`, decompressed where they are those of gzip. Raises CaseError where they are cut."""
    if not data.startswith(_ZIPPED):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as file:
            plain = file.read(most + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise CaseError(
            f"{path}: cannot be decompressed by gzip ({error}); unzip what can be saved of it"
        ) from error
    if len(plain) > most:
        raise CaseError(f"{path}: decompressed, it has more than {most >> 20} MiB, the most read")
    return plain


def text_of(data: bytes, path: str | Path) -> str:
    """The text of a file in UTF-8, UTF-16 with its mark, or Windows-1252.

    Raises CaseError where the bytes are no text.
    """
    for start, name in _PACKED.items():
        if data.startswith(start):
            raise CaseError(f"{path}: is compressed or no text ({name}); save it as plain text")
    try:
        text = data.decode("utf-16" if data.startswith(MARKS[:2]) else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", "replace")
    if len(text.translate(_CONTROLS)) < len(text) or "\ufffd" in text:
        raise CaseError(f"{path}: is no text in UTF-8, UTF-16 or Windows-1252; save it as UTF-8")
    return text


def expanded(path: str | Path) -> Path:
    """The path with a `~` or `~user` at its start replaced by the home folder.

    A shell leaves the tilde of `--out=~/runs/a` as it is, and some libraries expand it where
    others do not. Raises CaseError when the home folder is not known.
    """
    result = Path(os.path.expanduser(path))
    if not result.parts or not result.parts[0].startswith("~"):
        return result
    if str(path).startswith("~"):
        raise CaseError(
            f"{path}: the home folder of {result.parts[0]} is not known; give the whole path"
        )
    return Path.cwd() / result


def path_option(text: str) -> Path:
    """An option of the command line that is a path; the type of the argument for argparse."""
    try:
        return expanded(text)
    except CaseError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def refuse_folder_name(path: Path) -> None:
    """Raise CaseError when `path` is no folder that a run can be written to.

    A folder with the name `~` is never made, and VTK takes no path that is not UTF-8.
    """
    try:
        str(path.absolute()).encode("utf-8")
    except UnicodeEncodeError as error:
        raise CaseError(
            f"{path}: the name of the folder is not UTF-8, which VTK needs; give another --out"
        ) from error
    for folder in (path, *path.parents):
        if folder.name == "~" and not folder.exists():
            raise CaseError(
                f"{path}: would make a folder with the name ~; write the home folder as ~ at the "
                "start of the path alone, or give the whole path"
            )
