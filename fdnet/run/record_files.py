"""The records of a run folder: of its finished stages, and the manifest of the whole run."""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fdnet.case.case import Case, InvasionCase
from fdnet.case.file import recorded_case
from fdnet.case.stages import STAGES
from fdnet.errors import CaseError
from fdnet.files.atomic import write_text
from fdnet.report.read_tables import Checked, read_json
from fdnet.run.made_files import (
    ANALYSE_AGAIN,
    SOME_TABLES,
    START_OVER,
    check_files,
    may_be_gone,
)
from fdnet.run.mark import CASE, MANIFEST, RECORDS, is_run_folder

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
    ranks: int | None = None
    files: Mapping[str, str] = {}
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
