"""The folder of a campaign: one plan, and the case of each of its runs."""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from fdnet.campaign.plan.job import Job, Plan
from fdnet.errors import CaseError
from fdnet.files import refuse_folder_name, write_text
from fdnet.report.tables import JsonObject, read_json

PLAN, CASES, RUNS, PACKS, LOGS, LOCK = "plan.json", "cases", "runs", "packs", "logs", ".lock"
FORMAT = 1


FolderName = Annotated[str, Field(pattern=r"^[A-Za-z0-9=+_-][A-Za-z0-9.=+_-]*$")]


class _Variant(JsonObject):
    name: FolderName
    keys: dict[str, Any]


class _Run(JsonObject):
    name: FolderName
    variant: FolderName
    seed: Annotated[int, Field(ge=0, lt=2**31)]


class PlanRecord(JsonObject):
    """What plan.json holds."""

    fdnet_campaign: Literal[1]
    name: str
    digest: str
    seeds: Annotated[list[Annotated[int, Field(ge=0, lt=2**31)]], Field(min_length=1)]
    variants: Annotated[list[_Variant], Field(min_length=1)]
    runs: Annotated[list[_Run], Field(min_length=1)]


def read_plan_record(folder: Path) -> dict[str, Any] | None:
    """What plan.json of a folder says; None where there is none.

    Raises CaseError when it cannot be read.
    """
    path = folder / PLAN
    if not path.exists():
        return None
    return read_json(path, PlanRecord, noun="plan of this fdnet", advice="give another folder")


@contextlib.contextmanager
def campaign_folder(path: Path, plan: Plan) -> Iterator[Plan]:
    """Hold the lock of the folder while the block runs; gives the plan with all its seeds.

    A folder keeps its plan. The same plan with further seeds extends it, and seeds that are
    there already stay.

    Raises CaseError, with nothing changed, when the folder holds another plan or something else,
    or when another campaign is writing there.
    """
    refuse_folder_name(path)
    _refuse_foreign(path)
    try:
        for below in (LOGS, CASES):
            (path / below).mkdir(parents=True, exist_ok=True)
        lock = os.open(path / LOCK, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be made or written: {error.strerror}; give another --out"
        ) from error
    try:
        _take(lock, path)
        yield _admitted(path, plan)
    finally:
        os.close(lock)


def extended(path: Path, plan: Plan, seeds: tuple[int, ...]) -> Plan:
    """The plan with further seeds, written to its folder."""
    longer = replace(plan, seeds=tuple(dict.fromkeys([*plan.seeds, *seeds])))
    _write(path, longer)
    return longer


def case_path(job: Job) -> Path:
    """The case file of a run, below the folder."""
    return Path(CASES) / f"{job.name}.toml"


def _refuse_foreign(path: Path) -> None:
    if path.exists() and not path.is_dir():
        raise CaseError(f"{path}: is a file, expected a folder for --out")
    if not path.is_dir() or read_plan_record(path) is not None:
        return
    others = {child.name for child in path.iterdir()} - {LOCK, LOGS, CASES}
    if others:
        raise CaseError(
            f"{path}: is not empty and holds no campaign of fdnet; give another --out (nothing "
            "was changed)"
        )


def _take(lock: int, path: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise CaseError(
            f"{path}: another fdnet is running jobs here; wait for it or give another --out"
        ) from error


def _admitted(path: Path, plan: Plan) -> Plan:
    record = read_plan_record(path)
    if record is None:
        _write(path, plan)
        return plan
    if record["digest"] != plan.digest:
        names = ", ".join(one["name"] for one in record["variants"][:3])
        raise CaseError(
            f"{path}: holds another plan ({record['name']}: {names}...; digest "
            f"{record['digest']}, this one {plan.digest}); give another --out (nothing was "
            "changed)"
        )
    seeds = tuple(dict.fromkeys([*record["seeds"], *plan.seeds]))
    longer = replace(plan, seeds=seeds)
    _write(path, longer)
    return longer


def _write(path: Path, plan: Plan) -> None:
    """The cases first, so that a plan never names a case that is not there."""
    for job in plan.jobs:
        file, text = path / case_path(job), job.case.toml()
        if not file.is_file() or file.read_bytes() != text.encode():
            write_text(file, text)
    record = {
        "fdnet_campaign": FORMAT,
        "name": plan.name,
        "digest": plan.digest,
        "seeds": list(plan.seeds),
        "ranks": plan.ranks,
        "stages": list(plan.stages),
        "variants": [
            {"name": one.name, "keys": dict(one.keys), "pack": one.case.digest("pack")}
            for one in plan.variants
        ],
        "runs": [
            {"name": job.name, "variant": job.variant.name, "seed": job.seed} for job in plan.jobs
        ],
    }
    write_text(path / PLAN, json.dumps(record, indent=1, default=str) + "\n")
