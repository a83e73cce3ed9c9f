"""Paths and files as a user gives them, made fit for every library before they are used."""

import argparse
import codecs
import gzip
import io
import os
import stat
import zlib
from pathlib import Path

from fdnet.errors import CaseError

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
