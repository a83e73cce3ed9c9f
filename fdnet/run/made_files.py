"""Digests of the files that a stage made, kept in its record and checked before they are used."""

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from fdnet.dem.digests import file_digest
from fdnet.errors import CaseError

TABLES = (
    "spheres_initial.csv",
    "spheres_damaged.csv",
    "sections.csv",
    "profile.csv",
    "layers.csv",
    "pores.csv",
    "throats.csv",
    "history.csv",
    "summary.json",
)
"""Files of the analysis whose digests are in the manifest."""
SOME_TABLES = ("spheres_cleaned.csv", "clean_up.csv", "cake.csv", "bridging.csv")
"""Files of the analysis that only some runs have; their digests are in the manifest too."""
MESHES = ("network.vtp", "spheres_initial.vtp", "spheres_damaged.vtp")
"""Files of the report that an opened run reads; their digests are in the manifest too."""
FRAME = re.compile(r"frames/spheres_(\d{1,18})\.vtp")
"""Name of a state of the invasion that a run drew; the number is its step."""
START_OVER = "put the file back, or start over with --force"
ANALYSE_AGAIN = "put the file back, or write it anew with --stages analyse,report --force"


def may_be_gone(name: str) -> bool:
    """A dump, or a mesh for ParaView: one may remove it from a finished run."""
    return name.endswith((".dump", ".vtp"))


def frames_of(names: Iterable[str]) -> dict[int, str]:
    """Those of the names below a run folder that are states of the invasion, by their step."""
    matches = [match for match in map(FRAME.fullmatch, names) if match]
    return {int(match[1]): match[0] for match in matches}


def frames_in(folder: Path) -> dict[int, str]:
    """The states of the invasion that are in a run folder, by their step."""
    return frames_of(f"frames/{path.name}" for path in (folder / "frames").glob("*"))


def digests_of(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """SHA-256 of the files `names` below `folder`; files that do not exist are left out."""
    return {name: file_digest(folder / name) for name in names if (folder / name).is_file()}


def check_files(
    folder: Path,
    record: Mapping[str, Any],
    advice: str,
    *,
    may_lack: Callable[[str], bool] = lambda name: False,
) -> list[str]:
    """Compare files below `folder` with the digests in `record`.

    Returns the names of missing files that `may_lack` allows. A record of a stage without digests,
    as older versions wrote it, is not checked.

    Raises CaseError that names the first file which is missing or is not what the stage made.
    """
    missing = []
    for name, digest in record.get("files", {}).items():
        if (folder / name).exists() or not may_lack(name):
            check_file(folder / name, digest, advice)
        else:
            missing.append(name)
    return missing


def check_one(folder: Path, record: Mapping[str, Any], name: str, advice: str) -> None:
    """Compare one file below `folder` with its digest in `record`, where there is one."""
    digest = record.get("files", {}).get(name)
    if digest is not None:
        check_file(folder / name, digest, advice)


def check_file(path: Path, digest: str, advice: str) -> None:
    """Raises CaseError when the file is missing or its SHA-256 is not `digest`."""
    if not path.is_file():
        what = "is no ordinary file" if path.exists() else "is missing"
        raise CaseError(f"{path}: {what}; {advice}")
    try:
        same = file_digest(path) == digest
    except OSError as error:
        raise CaseError(f"{path}: cannot be read ({error.strerror}); {advice}") from error
    if not same:
        raise CaseError(
            f"{path}: is not the file that the run wrote (its SHA-256 differs from the record); "
            f"{advice}"
        )
