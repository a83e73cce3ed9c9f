"""A run folder: who may write into it, which stages are done, and when it is complete."""

import fcntl
import json
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.atomic import write_text
from fdnet.case import Case
from fdnet.errors import CaseError

STAGES = ("pack", "invade", "analyse", "report")
_OUTPUTS = {
    "pack": ("pack",),
    "invade": ("invade",),
    "analyse": ("spheres_initial.csv", "spheres_damaged.csv", "sections.csv", "profile.csv", "pores.csv", "throats.csv",
                "summary.json"),
    "report": ("figures", "frames", "network.vtp", "spheres_initial.vtp", "spheres_damaged.vtp", "spheres.pvd",
               "invasion.pvd", "report.html"),
}
MANIFEST, CASE = "manifest.json", "case.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFolder:
    """A folder this process holds the lock of."""

    path: Path
    lock: int

    def record(self, stage: str) -> dict[str, Any] | None:
        """What a finished stage left behind, or None."""
        return _read_json(self._record_path(stage))

    def finish(self, stage: str, record: dict[str, Any]) -> None:
        """Mark a stage as done; its presence means whole."""
        write_json(self._record_path(stage), record)

    def _record_path(self, stage: str) -> Path:
        return self.path / stage / "stage.json" if stage in ("pack", "invade") else self.path / f"{stage}.json"

    def manifest(self) -> dict[str, Any] | None:
        """The manifest of a complete run, or None."""
        return _read_json(self.path / MANIFEST)

    def clear(self, stages: tuple[str, ...]) -> None:
        """Remove the outputs of these stages; the manifest goes first, so a half-cleared run is never complete."""
        (self.path / MANIFEST).unlink(missing_ok=True)
        for name in (name for stage in stages for name in _OUTPUTS[stage]):
            target = self.path / name
            if target.is_dir():
                shutil.rmtree(target)
            else:
                target.unlink(missing_ok=True)

    def close(self) -> None:
        """Give the lock back."""
        os.close(self.lock)


def open_folder(path: Path, case: Case, *, stages: tuple[str, ...], resume: bool, force: bool) -> RunFolder:
    """Lock the folder for this case, making it if need be, and write case.toml.

    Raises CaseError when another run is writing there, when it holds another case or an unfinished run and neither
    resume nor force was asked for, or when it holds something that is not a run.
    """
    _refuse_foreign(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        lock = os.open(path / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise CaseError(f"{path}: cannot be made or written: {error.strerror}; give another --out") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        folder = RunFolder(path=path, lock=lock)
        _admit(folder, case, stages, resume, force)
    except OSError as error:
        os.close(lock)
        raise CaseError(f"{path}: another fdnet run is writing here; wait for it or give another --out") from error
    except BaseException:
        os.close(lock)
        raise
    return folder


def _refuse_foreign(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise CaseError(f"{path}: is a file, expected a folder for --out")
    if path.is_dir() and not (path / CASE).exists() and any(p.name != ".lock" for p in path.iterdir()):
        raise CaseError(f"{path}: is not empty and holds no fdnet run; give another --out (nothing was changed)")


def _admit(folder: RunFolder, case: Case, stages: tuple[str, ...], resume: bool, force: bool) -> None:
    written = folder.path / CASE
    if force and written.exists():
        _force(folder, case, stages)
    elif written.exists() and written.read_text(encoding="utf-8") != case.toml():
        raise CaseError(f"{folder.path}: holds a run of another case (see {written}); give another --out, or --force to "
                        "replace it")
    elif written.exists() and folder.manifest() is None and not resume:
        raise CaseError(f"{folder.path}: holds an unfinished run; continue it with --resume or start over with --force")
    write_text(written, case.toml())


def _force(folder: RunFolder, case: Case, stages: tuple[str, ...]) -> None:
    """Clear the stages asked for, every later one, and every earlier one that belongs to another case."""
    first = min(STAGES.index(stage) for stage in stages)
    stale = [i for i, stage in enumerate(STAGES[:2])
             if (record := folder.record(stage)) is not None and record["digest"] != case.digest(stage)]
    folder.clear(STAGES[min([first, *stale]):])


def write_json(path: Path, value: Any) -> None:
    """Write a mapping as JSON, whole or not at all."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def _read_json(path: Path) -> dict[str, Any] | None:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise CaseError(f"{path}: cannot be read ({error}); start over with --force") from error
