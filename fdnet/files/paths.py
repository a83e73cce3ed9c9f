"""Paths as a user gives them, made fit for every library before they are used."""

import argparse
import os
from pathlib import Path

from fdnet.errors import CaseError


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
