"""The run folder: its records, the digests of its files, and who may write into it."""

import fcntl
import json
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fdnet.case.case import Case, InvasionCase, difference_text
from fdnet.case.file import recorded_case
from fdnet.dem.checkpoint import file_digest, read_rows
from fdnet.errors import CaseError
from fdnet.files import refuse_folder_name, remove_half_written, write_text
from fdnet.names import LIGGGHTS_STAGES, STAGES
from fdnet.report.tables import JsonObject, read_json

RECORD_FORMAT = 1
MANIFEST, CASE, LOCK, UNFINISHED = "manifest.json", "case.toml", ".lock", ".unfinished"
MARK = ".fdnet-run"
RECORDS: dict[str, str] = {stage: f"{stage}/stage.json" for stage in LIGGGHTS_STAGES}
_MARK_TEXT = "fdnet run folder, format 1\n"


# ---- Digests of the files that a stage made, kept in its record and checked before they are used.
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


def digests_of_results(folder: Path) -> dict[str, str]:
    """Those of all that an opened run reads, as the manifest has them."""
    frames = frames_in(folder).values()
    return digests_of(folder, [*TABLES, *SOME_TABLES, *MESHES, *frames, *RECORDS.values()])


def check_files(
    folder: Path,
    record: Mapping[str, Any],
    advice: str,
    *,
    may_lack: Callable[[str], bool] = lambda name: False,
) -> None:
    """Compare files below `folder` with the digests in `record`; some it `may_lack`.

    Raises CaseError that names the first file which is missing or is not what the stage made.
    """
    for name, digest in record.get("files", {}).items():
        if (folder / name).exists() or not may_lack(name):
            check_file(folder / name, digest, advice)


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


# ---- The records of a run folder: of its finished stages, and the manifest of the whole run.
OUTPUTS = {
    "pack": ("pack", "mechanics"),
    "invade": ("invade", "stokes"),
    "clean_up": ("clean_up",),
    "analyse": (*TABLES, *SOME_TABLES, "formation"),
    "report": (
        "figures",
        "frames",
        *MESHES,
        "spheres.pvd",
        "invasion.pvd",
        "report.html",
        "paraview_view.py",
    ),
}
"""Files and folders that each stage writes, below the run folder."""


class StageRecord(JsonObject):
    """What the record of every stage holds; `runs` are those of LIGGGHTS."""

    format: Literal[1]
    digest: str
    seconds: float
    cpu_seconds: float = 0.0
    max_overlap: float
    steps: int
    dt_s: float
    ranks: int
    files: Annotated[Mapping[str, str], Field(min_length=1)]
    runs: list[dict[str, Any]]
    left_out: list[str]


class Manifest(JsonObject):
    """The manifest of a run that is analysed."""

    format: Literal[1]
    case: str = ""
    stages: list[str]
    digests: Mapping[str, str] = {}
    files: Annotated[Mapping[str, str], Field(min_length=1)]
    invade: StageRecord | None


ANEW = "start over with --force"


def read_record(folder: Path, stage: str) -> dict[str, Any] | None:
    """The record of a finished stage ("pack", "invade") of the run in `folder`, or None.

    Raises CaseError when it cannot be understood.
    """
    path, noun = folder / RECORDS[stage], "record of a stage"
    return read_json(path, StageRecord, noun=noun, advice=ANEW) if path.exists() else None


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of the analysed run in `folder`, or None.

    Raises CaseError when it cannot be understood.
    """
    path, noun = folder / MANIFEST, "manifest of a run"
    return read_json(path, Manifest, noun=noun, advice=ANALYSE_AGAIN) if path.exists() else None


def finished_manifest(folder: Path) -> tuple[dict[str, Any], Case]:
    """The manifest and the case of the finished run in `folder`.

    Raises CaseError where there is no folder, it holds no run or an unfinished one, its records
    cannot be understood, or its case is not the one that was run.
    """
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "does not exist"
        raise CaseError(f"{folder}: {what}; give the folder of a finished fdnet run")
    if not is_run_folder(folder):
        raise CaseError(
            f"{folder}: holds no fdnet run ({MANIFEST} is missing); give the folder that fdnet "
            "run wrote"
        )
    manifest = read_manifest(folder)
    if manifest is None:
        raise CaseError(
            f"{folder}: holds an unfinished run; continue it with fdnet run CASE.toml --out "
            f"{shlex.quote(str(folder))} --resume, then open it"
        )
    case = recorded_case(folder / CASE)
    same = manifest.get("digests", {}).get("analyse") == case.digest()
    if not same or (isinstance(case, InvasionCase) and manifest["invade"] is None):
        raise CaseError(
            f"{folder / CASE}: is not the case that the run in this folder had (its digest "
            f"differs from {MANIFEST}); {ANALYSE_AGAIN}"
        )
    return manifest, case


def check_finished(folder: Path) -> tuple[dict[str, Any], Case]:
    """The manifest and the case of the finished run in `folder`, with all its files as it wrote
    them; dumps and meshes for ParaView may be gone.

    This is what every command asks before it takes the numbers of a run. Raises CaseError as
    `finished_manifest` does, and where a file is missing or was changed.
    """
    manifest, case = finished_manifest(folder)
    check_files(folder, manifest, ANALYSE_AGAIN, may_lack=may_be_gone)
    for stage in RECORDS:
        record = read_record(folder, stage) or {}
        check_files(folder / stage, record, START_OVER, may_lack=may_be_gone)
    return manifest, case


# ---- A run folder: who may write into it, which stages are done, and when it is complete.
def mark_folder(folder: Path) -> None:
    """Write the mark that makes `folder` a run folder, unless it is there."""
    if not _holds_mark(folder):
        write_text(folder / MARK, _MARK_TEXT)


def _holds_mark(folder: Path) -> bool:
    with suppress(OSError):
        return (folder / MARK).is_file() and (folder / MARK).read_bytes() == _MARK_TEXT.encode()
    return False


def is_run_folder(folder: Path) -> bool:
    """Whether fdnet made this folder: by its mark, or, in a copy without it, by its records.

    Names alone are no proof.
    """
    if _holds_mark(folder):
        return True
    for name in (MANIFEST, *RECORDS.values()):
        with suppress(CaseError):
            model = Manifest if name == MANIFEST else StageRecord
            read_json(folder / name, model, noun="", advice="")
            return True
    return False


def is_unused(folder: Path) -> bool:
    """Whether `folder` is empty but for the empty lock of a session just killed."""
    return all(child.name == LOCK and child.stat().st_size == 0 for child in folder.iterdir())


_OWN = (CASE, MANIFEST, UNFINISHED, LOCK, MARK)  # Files of fdnet that belong to no stage


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFolder:
    """A run folder whose lock this process holds."""

    path: Path  # of the folder
    lock: int  # descriptor of the locked file
    was_empty: bool  # whether it was empty, or not there, before
    made: tuple[Path, ...]  # folders that were made for it, innermost first

    def record(self, stage: str) -> dict[str, Any] | None:
        """The record of a finished stage ("pack", "invade"), or None.

        Raises CaseError when it cannot be understood.
        """
        return read_record(self.path, stage)

    def finish(self, stage: str, record: dict[str, Any]) -> None:
        """Mark a stage as done: its record is only there when the stage is complete."""
        _write_json(self.path / RECORDS[stage], record)

    def holds(self, case: Case, stages: tuple[str, ...]) -> bool:
        """Whether all of `stages` are done. Raises CaseError as `read_manifest` does."""
        manifest = read_manifest(self.path)
        if manifest is not None:
            asked = [stage for stage in stages if stage in (*case.stages, "invade")]
            return set(asked) <= set(manifest["stages"])
        needed = [stage for stage in stages if stage in case.stages]
        return set(needed) <= set(RECORDS) and all(
            self.record(stage) is not None for stage in needed
        )

    def complete(self, manifest: dict[str, Any] | None) -> None:
        """End this session; a manifest makes the run complete (None: it is not analysed yet)."""
        if manifest is not None:
            _write_json(self.path / MANIFEST, {"format": RECORD_FORMAT} | manifest)
        (self.path / UNFINISHED).unlink(missing_ok=True)

    def clear(self, stages: tuple[str, ...]) -> None:
        """Remove the outputs of these stages.

        The manifest goes first, so that a half-cleared run is never complete.
        """
        (self.path / MANIFEST).unlink(missing_ok=True)
        for name in (name for stage in stages for name in OUTPUTS[stage]):
            _remove(self.path / name)

    def discard(self) -> str:
        """Clear a folder that was new, unless a stage was finished in it.

        Only files that fdnet writes are removed; one that another program put there stays.
        Returns what could not be cleared, in words; "" when all could.
        """
        if not self.was_empty or any((self.path / name).exists() for name in RECORDS.values()):
            return ""
        try:
            for name in (*(name for names in OUTPUTS.values() for name in names), *_OWN):
                _remove(self.path / name)
            for folder in self.made:
                if any(folder.iterdir()):
                    break
                folder.rmdir()
        except OSError as error:
            return (
                f"{self.path} could not be cleared ({error.strerror}): remove what is left in it"
            )
        return ""

    def close(self) -> None:
        """Give the lock back."""
        os.close(self.lock)


def _write_json(path: Path, value: Any) -> None:
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def open_folder(
    path: Path, case: Case, *, stages: tuple[str, ...], resume: bool, force: bool
) -> RunFolder:
    """Lock the folder for this case; it is made if need be.

    case.toml is written when anything is left to run.

    Raises CaseError, with nothing changed, when one of `stages` lacks the stage before it (with
    `resume` an analysis takes a cut invasion as it is), when
    another run is writing there, when the folder holds another case or an unfinished run and
    neither `resume` nor `force` is set, or when it holds something that is not a run.
    """
    refuse_folder_name(path)
    if path.exists() and not path.is_dir():
        raise CaseError(f"{path}: is a file, expected a folder for --out")
    # names alone do not make a folder ours: case.toml, manifest.json or pack may be the user's
    if path.is_dir() and not is_run_folder(path) and not is_unused(path):
        raise CaseError(
            f"{path}: is not empty and holds no fdnet run; give another --out (nothing was "
            "changed)"
        )
    analysed = bool({"analyse", "report"} & set(stages))
    cleaned = "clean_up" in case.stages
    needed = {
        "pack": stages != ("pack",),
        "invade": "invade" in case.stages and (analysed or (cleaned and "clean_up" in stages)),
        "clean_up": cleaned and analysed,
    }
    so_far = (  # a cut invasion is analysed as it is
        resume
        and "clean_up" not in stages
        and not (path / RECORDS["invade"]).exists()
        and bool(read_rows(path / "invade"))
    )
    for stage, what in (("pack", "pack"), ("invade", "invasion"), ("clean_up", "clean-up")):
        if so_far and stage != "pack":
            continue
        if needed[stage] and stage not in stages and not (path / RECORDS[stage]).exists():
            raise CaseError(
                f"{path}: no finished {what} here; run the stage {stage} first "
                f"(--stages {stage},...)"
            )
    made = tuple(folder for folder in (path, *path.parents) if not folder.exists())
    was_empty = bool(made) or is_unused(path)
    lock = _take_lock(path, make=True)
    folder = RunFolder(path=path, lock=lock, was_empty=was_empty, made=made)
    try:
        if was_empty:
            mark_folder(path)
        remove_half_written(path)
        _admit(folder, case, stages, resume, force)
        mark_folder(path)
    except BaseException:
        folder.close()
        raise
    return folder


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Holds the lock of the run folder `path` while the block runs.

    Raises CaseError when another command is writing there, or the folder cannot be written.
    """
    lock = _take_lock(path)
    try:
        yield
    finally:
        os.close(lock)


def _take_lock(path: Path, *, make: bool = False) -> int:
    """The descriptor of the locked file; `make` makes the folder."""
    try:
        if make:
            path.mkdir(parents=True, exist_ok=True)
        lock = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        what, do = ("made or written", "; give another --out") if make else ("written", "")
        raise CaseError(f"{path}: cannot be {what}: {error.strerror}{do}") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock)
        raise CaseError(
            f"{path}: another fdnet run, or fdnet stokes, is writing here; wait for it, or give "
            "another --out to a run"
        ) from error
    return lock


def _admit(
    folder: RunFolder, case: Case, stages: tuple[str, ...], resume: bool, force: bool
) -> None:
    """Raise CaseError unless the folder is free for this case; with `force` clear it first."""
    written = folder.path / CASE
    if force:
        first = min(STAGES.index(stage) for stage in stages)
        for stage in RECORDS:
            record = folder.record(stage) if STAGES.index(stage) < first else None
            if record is not None and record["digest"] != case.digest(stage):
                raise CaseError(
                    f"{folder.path / stage}: belongs to another case; add {stage} to --stages, or "
                    "give another --out (nothing was changed)"
                )
        folder.clear(STAGES[first:])
    elif written.exists() and not case.same_specimen(written.read_bytes()):
        keys = f"see {written}"
        with suppress(CaseError):
            keys = difference_text(case, recorded_case(written).data()) or keys
        raise CaseError(
            f"{folder.path}: holds a run of another case ({keys}); give "
            f"another --out, {'repeat the --set of these keys, ' if resume else ''}or --force to "
            "replace it"
        )
    elif (folder.path / UNFINISHED).exists() and not resume:
        raise CaseError(
            f"{folder.path}: holds an unfinished run; continue it with --resume or start over "
            "with --force"
        )
    if force or read_manifest(folder.path) is None:
        write_text(folder.path / UNFINISHED, " ".join(stages) + "\n")
    if force or not written.exists() or not folder.holds(case, stages):
        write_text(written, case.toml())
