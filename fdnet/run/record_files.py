"""The records of a run folder: of its finished stages, and the manifest of the whole run."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from fdnet.case.stages import STAGES
from fdnet.errors import CaseError
from fdnet.files.atomic import write_text
from fdnet.run.made_files import SOME_TABLES
from fdnet.run.mark import MANIFEST, RECORD_FORMAT, RECORDS

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

_NUMBER, _TEXTS, _ROWS = "a number", "a list of texts", "a list of tables"
_COMMON = {
    "digest": "a text",
    "seconds": _NUMBER,
    "max_overlap": _NUMBER,
    "steps": _NUMBER,
    "dt_s": _NUMBER,
    "runs": _ROWS,
    "left_out": _TEXTS,
}
_SHAPES: Mapping[str, Mapping[str, str]] = {
    "pack": _COMMON | {"porosity": _NUMBER, "porosity_assumed": _NUMBER, "attempts": _ROWS},
    "invade": _COMMON | {"stop_reason": "a text", "supplied": _NUMBER, "warnings": _TEXTS},
    "clean_up": _COMMON
    | {"stop_reason": "a text", "physical_time_s": _NUMBER, "warnings": _TEXTS},
    "runs": {"version": "a text", "seconds": _NUMBER},
    "attempts": {"liggghts_s": _NUMBER},
    "manifest": {"stages": _TEXTS, "invade": "a table or null"},
}
"""What each key of a record must hold; further keys are not looked at."""


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
    return _read_record(folder / RECORDS[stage], stage)


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """The manifest of the analysed run in `folder`, or None.

    Raises CaseError when it cannot be understood, or when a file that it implies is missing.
    """
    manifest = _read_record(folder / MANIFEST, "manifest")
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


def _read_record(path: Path, shape: str) -> dict[str, Any] | None:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise CaseError(
            f"{path}: cannot be read ({error.strerror}); mend that, then repeat the command with "
            "--resume"
        ) from error
    except (ValueError, RecursionError) as error:
        raise CaseError(f"{path}: cannot be read ({error}); start over with --force") from error
    if not isinstance(record, dict) or record.get("format") != RECORD_FORMAT:
        raise CaseError(
            f"{path}: is no record of this fdnet (format {RECORD_FORMAT} expected); start over "
            "with --force"
        )
    problem = next(_problems(record, shape), None)
    if problem is not None:
        raise CaseError(f"{path}: {problem}; start over with --force")
    return record


def _problems(record: Mapping[str, Any], shape: str) -> Iterator[str]:
    """What is missing in a record or has another type than it must have."""
    for key, expected in _SHAPES[shape].items():
        if key not in record:
            yield f"the key {key} is missing"
        elif not _is(record[key], expected):
            yield f"{key} is {str(record[key])[:40]!r}, expected {expected}"
        elif expected == _ROWS:
            if not record[key] and shape not in (
                "invade",
                "clean_up",
            ):  # cut after its last checkpoint: no run
                yield f"{key} is empty, expected at least one table"
            for row in record[key]:
                yield from (f"{key}: {problem}" for problem in _problems(row, key))


def _is(value: Any, expected: str) -> bool:
    if expected == _NUMBER:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if expected in (_TEXTS, _ROWS):
        kind = str if expected == _TEXTS else dict
        return isinstance(value, list) and all(isinstance(one, kind) for one in value)
    if expected == "a text":
        return isinstance(value, str)
    return value is None or isinstance(value, dict)
