"""Files that a command makes for the user: none is ever replaced unasked."""

from pathlib import Path

from fdnet.errors import CaseError
from fdnet.files.atomic import write_text


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
