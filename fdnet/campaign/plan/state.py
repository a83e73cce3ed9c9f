"""Which runs of a plan are done, and why the others are not."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.campaign.plan.folder import LOGS, RUNS
from fdnet.campaign.plan.job import Job, Plan
from fdnet.run.mark import MANIFEST, RECORDS, UNFINISHED

NOT_RUN = "not run yet"


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """How a run stands.

    Attributes:
        status: "done", "failed" or "missing".
        reason: why it is not done, in one line; "" when it is.
    """

    status: str
    reason: str = ""


def state_of(path: Path, plan: Plan, job: Job) -> State:
    """How a run of the campaign in `path` stands."""
    if is_done(path, plan, job):
        return State(status="done")
    for name in (job.name, f"pack-{job.case.digest('pack')}"):
        reason = _last_line(path / LOGS / f"{name}.txt")
        if reason:
            return State(status="failed", reason=reason)
    return State(status="missing", reason=NOT_RUN)


def is_done(path: Path, plan: Plan, job: Job) -> bool:
    """Whether the run has a manifest of its own case with all stages of the plan."""
    folder = path / RUNS / job.name
    manifest = _json_of(folder / MANIFEST)
    if manifest is None or (folder / UNFINISHED).exists():
        return False
    done = manifest.get("stages", [])
    same = manifest.get("digests", {}).get("analyse") == job.case.digest()
    asked = {stage for stage in plan.stages if stage in job.case.stages}
    return same and asked <= set(done) and (folder / "summary.json").is_file()


def pack_is_done(folder: Path) -> bool:
    """Whether the run folder has a finished pack."""
    return (folder / RECORDS["pack"]).is_file()


def _json_of(path: Path) -> dict[str, Any] | None:
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _last_line(path: Path) -> str:
    """The last line of a log that says something, without the name of the program."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("fdnet: ") and "warning:" not in line]
    last = (errors or lines or [""])[-1]
    return last.removeprefix("fdnet: ")
