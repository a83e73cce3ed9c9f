"""The run folder: its mark, what it holds, records read from it, and the lock.

Which folders are run folders of fdnet, and so may be written to and cleared.
"""

import fcntl
import json
import os
import re
import shlex
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fdnet.case.case import Case, InvasionCase, difference_text
from fdnet.case.file import recorded_case
from fdnet.dem.checkpoint import file_digest
from fdnet.errors import CaseError
from fdnet.files import refuse_folder_name, remove_half_written, write_text
from fdnet.names import LIGGGHTS_STAGES, STAGES
from fdnet.report.tables import Checked, read_json

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


# ------------------------------------------------------------------------------------------------
# Digests of the files that a stage made, kept in its record and checked before they are used.


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

    Returns the names of missing files that `may_lack` allows.

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


# ------------------------------------------------------------------------------------------------
# The records of a run folder: of its finished stages, and the manifest of the whole run.


OUTPUTS = {
    "pack": ("pack", "mechanics"),
    "invade": ("invade", "stokes"),
    "clean_up": ("clean_up",),
    "analyse": (
        "spheres_initial.csv",
        "spheres_damaged.csv",
        "sections.csv",
        "profile.csv",
        "layers.csv",
        "pores.csv",
        "throats.csv",
        *SOME_TABLES,
        "summary.json",
    ),
    "report": (
        "figures",
        "frames",
        "network.vtp",
        "spheres_initial.vtp",
        "spheres_damaged.vtp",
        "spheres.pvd",
        "invasion.pvd",
        "report.html",
    ),
}
"""Files and folders that each stage writes, below the run folder."""
OPTIONAL = ("layers.csv", *SOME_TABLES)
"""Those of them that a finished stage may lack."""


class _Execution(Checked):
    """One execution of LIGGGHTS."""

    version: str
    seconds: float
    waited: float = 0.0
    ranks: int | None = None


class _Attempt(Checked):
    """One attempt at the porosity of a pack."""

    liggghts_s: float


class _Updates(Checked):
    """How often a flow was computed anew."""

    count: int
    momentum_open: int = 0
    momentum_defect_most: float = 0.0


class StageRecord(Checked):
    """What the record of every stage holds."""

    format: Literal[1]
    digest: str
    seconds: float
    max_overlap: float
    steps: int
    dt_s: float
    ranks: int
    files: Mapping[str, str]
    runs: list[_Execution]
    left_out: list[str]


class PackRecord(StageRecord):
    """The record of a pack."""

    porosity: float
    porosity_assumed: float
    creep_m_s: float = 0.0
    restless: int = 0
    attempts: Annotated[list[_Attempt], Field(min_length=1)]
    runs: Annotated[list[_Execution], Field(min_length=1)]


class InvadeRecord(StageRecord):
    """The record of an invasion; one that was cut after its last checkpoint names no run."""

    stop_reason: str
    max_overlap_step: int | None = None
    supplied: int
    updates: _Updates | None = None
    warnings: list[str]


class CleanUpRecord(StageRecord):
    """The record of a clean-up."""

    stop_reason: str
    physical_time_s: float
    warnings: list[str]


class Manifest(Checked):
    """The manifest of a run that is analysed."""

    format: Literal[1]
    case: str = ""
    stages: list[str]
    digests: Mapping[str, str] = {}
    files: Mapping[str, str] = {}
    invade: InvadeRecord | None


_MODELS: dict[str, type[Checked]] = {
    "pack": PackRecord,
    "invade": InvadeRecord,
    "clean_up": CleanUpRecord,
}


def _expected(manifest: dict[str, Any], stage: str) -> tuple[str, ...]:
    """Files that must exist when `stage` is listed as done."""
    if stage not in manifest["stages"] or (stage == "invade" and manifest["invade"] is None):
        return ()
    if stage in RECORDS:
        return (RECORDS[stage],)
    return tuple(name for name in OUTPUTS[stage] if name not in OPTIONAL)


def write_json(path: Path, value: Any) -> None:
    """Write a mapping as JSON, whole or not at all."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def read_record(folder: Path, stage: str) -> dict[str, Any] | None:
    """The record of a finished stage ("pack", "invade") of the run in `folder`, or None.

    Raises CaseError when it cannot be understood.
    """
    return _read(folder / RECORDS[stage], _MODELS[stage], "record of a stage")


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of the analysed run in `folder`, or None.

    Raises CaseError when it cannot be understood, or when a file that it implies is missing.
    """
    manifest = _read(folder / MANIFEST, Manifest, "manifest of a run")
    if manifest is None:
        return None
    expected = (name for stage in STAGES[:4] for name in _expected(manifest, stage))
    missing = next((name for name in expected if not (folder / name).exists()), None)
    if missing is not None:
        raise CaseError(
            f"{folder}: the run is complete by its {MANIFEST}, but {missing} is missing; start "
            "over with --force"
        )
    return manifest


def _read(path: Path, model: type[Checked], noun: str) -> dict[str, Any] | None:
    if not path.exists():
        return None
    return read_json(path, model, noun=noun, advice="start over with --force")


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
    if not manifest.get("files"):
        raise CaseError(f"{folder / MANIFEST}: holds no digests of files; {ANALYSE_AGAIN}")
    check_files(folder, manifest, ANALYSE_AGAIN, may_lack=may_be_gone)
    for stage in RECORDS:
        record = read_record(folder, stage) or {}
        check_files(folder / stage, record, START_OVER, may_lack=may_be_gone)
    return manifest, case


# ------------------------------------------------------------------------------------------------
# A run folder: who may write into it, which stages are done, and when it is complete.


_OWN = (CASE, MANIFEST, UNFINISHED, LOCK, MARK)
"""Files of fdnet that belong to no stage."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFolder:
    """A run folder whose lock this process holds.

    Attributes:
        path: of the folder.
        lock: descriptor of the locked file.
        was_empty: whether it was empty, or not there, before.
        made: folders that were made for it, innermost first.
    """

    path: Path
    lock: int
    was_empty: bool
    made: tuple[Path, ...]

    def record(self, stage: str) -> dict[str, Any] | None:
        """The record of a finished stage ("pack", "invade"), or None.

        Raises CaseError when it cannot be understood.
        """
        return read_record(self.path, stage)

    def finish(self, stage: str, record: dict[str, Any]) -> None:
        """Mark a stage as done: its record is only there when the stage is complete."""
        write_json(self.path / RECORDS[stage], record)

    def manifest(self) -> dict[str, Any] | None:
        """The manifest of the run, or None. Raises CaseError as `read_manifest` does."""
        return read_manifest(self.path)

    def holds(self, case: Case, stages: tuple[str, ...]) -> bool:
        """Whether all of `stages` are done. Raises CaseError as `manifest` and `record` do."""
        manifest = self.manifest()
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
            write_json(self.path / MANIFEST, {"format": RECORD_FORMAT} | manifest)
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

    Raises CaseError, with nothing changed, when one of `stages` lacks the stage before it, when
    another run is writing there, when the folder holds another case or an unfinished run and
    neither `resume` nor `force` is set, or when it holds something that is not a run.
    """
    _refuse_foreign(path)
    _refuse_gap(path, case, stages)
    made = tuple(folder for folder in (path, *path.parents) if not folder.exists())
    was_empty = bool(made) or is_unused(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        lock = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be made or written: {error.strerror}; give another --out"
        ) from error
    folder = RunFolder(path=path, lock=lock, was_empty=was_empty, made=made)
    try:
        _take_lock(path, lock)
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
    try:
        lock = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise CaseError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        _take_lock(path, lock)
        yield
    finally:
        os.close(lock)


def _take_lock(path: Path, lock: int) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise CaseError(
            f"{path}: another fdnet run, or fdnet stokes, is writing here; wait for it, or give "
            "another --out to a run"
        ) from error


def _refuse_foreign(path: Path) -> None:
    """Raise CaseError unless `path` is new, empty or a run folder.

    Names alone do not make a folder ours: case.toml, manifest.json or pack may be the user's.
    """
    refuse_folder_name(path)
    if path.exists() and not path.is_dir():
        raise CaseError(f"{path}: is a file, expected a folder for --out")
    if path.is_dir() and not is_run_folder(path) and not is_unused(path):
        raise CaseError(
            f"{path}: is not empty and holds no fdnet run; give another --out (nothing was "
            "changed)"
        )


def _refuse_gap(path: Path, case: Case, stages: tuple[str, ...]) -> None:
    """A stage needs the finished ones before it that run LIGGGHTS."""
    analysed = bool({"analyse", "report"} & set(stages))
    cleaned = "clean_up" in case.stages
    needed = {
        "pack": stages != ("pack",),
        "invade": "invade" in case.stages and (analysed or (cleaned and "clean_up" in stages)),
        "clean_up": cleaned and analysed,
    }
    for stage, what in (("pack", "pack"), ("invade", "invasion"), ("clean_up", "clean-up")):
        missing = stage not in stages and not (path / RECORDS[stage]).exists()
        if needed[stage] and missing:
            raise CaseError(
                f"{path}: no finished {what} here; run the stage {stage} first "
                f"(--stages {stage},...)"
            )


def _admit(
    folder: RunFolder, case: Case, stages: tuple[str, ...], resume: bool, force: bool
) -> None:
    written = folder.path / CASE
    if force:
        _force(folder, case, stages)
    elif written.exists() and not case.same_specimen(written.read_bytes()):
        raise CaseError(
            f"{folder.path}: holds a run of another case{_other_keys(written, case)}; give "
            f"another --out, {'repeat the --set of these keys, ' if resume else ''}or --force to "
            "replace it"
        )
    elif (folder.path / UNFINISHED).exists() and not resume:
        raise CaseError(
            f"{folder.path}: holds an unfinished run; continue it with --resume or start over "
            "with --force"
        )
    if force or folder.manifest() is None:
        write_text(folder.path / UNFINISHED, " ".join(stages) + "\n")
    if force or not written.exists() or not folder.holds(case, stages):
        write_text(written, case.toml())


def _other_keys(written: Path, case: Case) -> str:
    """What the case of the folder has otherwise; only its place where it cannot be read."""
    try:
        keys = difference_text(case, recorded_case(written).data())
    except CaseError:
        keys = ""
    return f" ({keys})" if keys else f" (see {written})"


def _force(folder: RunFolder, case: Case, stages: tuple[str, ...]) -> None:
    """Clear these stages and every later one.

    Raises CaseError when an earlier one, which is kept, belongs to another case.
    """
    first = min(STAGES.index(stage) for stage in stages)
    for stage in RECORDS:
        if STAGES.index(stage) >= first:
            continue
        record = folder.record(stage)
        if record is not None and record["digest"] != case.digest(stage):
            raise CaseError(
                f"{folder.path / stage}: belongs to another case; add {stage} to --stages, or "
                "give another --out (nothing was changed)"
            )
    folder.clear(STAGES[first:])
