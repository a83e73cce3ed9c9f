"""A run folder: who may write into it, which stages are done, and when it is complete."""

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.case.case import Case
from fdnet.case.difference import difference_text
from fdnet.case.file import recorded_case
from fdnet.case.stages import STAGES
from fdnet.errors import CaseError
from fdnet.files.atomic import remove_half_written, write_text
from fdnet.files.paths import refuse_folder_name
from fdnet.run.mark import (
    CASE,
    LOCK,
    MANIFEST,
    MARK,
    RECORD_FORMAT,
    RECORDS,
    UNFINISHED,
    is_run_folder,
    is_unused,
    mark_folder,
)
from fdnet.run.record_files import OUTPUTS, read_manifest, read_record, write_json

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
