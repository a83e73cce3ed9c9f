"""Which runs of a plan are done, and why the others are not."""

from dataclasses import dataclass
from pathlib import Path

from fdnet.campaign.plan.folder import LOGS, RUNS
from fdnet.campaign.plan.job import Job, Plan
from fdnet.errors import CaseError
from fdnet.report.tables import read_summary
from fdnet.run.folder import MANIFEST, RECORDS, check_finished

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
    """How a run of the campaign in `path` stands.

    It is done where it has all stages of the plan and every file as the run wrote it, and has
    failed where one of its files was changed, cut or removed afterwards.
    """
    folder = path / RUNS / job.name
    if (folder / MANIFEST).exists():
        try:
            return _finished(folder, plan, job)
        except CaseError as error:
            return State(status="failed", reason=str(error))
    for name in (job.name, f"pack-{job.case.digest('pack')}"):
        reason = _last_line(path / LOGS / f"{name}.txt")
        if reason:
            return State(status="failed", reason=reason)
    return State(status="missing", reason=NOT_RUN)


def _finished(folder: Path, plan: Plan, job: Job) -> State:
    """A run with a manifest. Raises CaseError where its files are not what it wrote."""
    manifest, case = check_finished(folder)
    if case.digest() != job.case.digest():
        raise CaseError(
            f"{folder}: holds the run of another case than the plan has under this name; remove "
            "the folder, and it is run again"
        )
    read_summary(folder / "summary.json")
    missing = {stage for stage in plan.stages if stage in job.case.stages}
    missing -= set(manifest["stages"])
    if missing:
        return State(status="missing", reason=f"not run yet: {', '.join(sorted(missing))}")
    return State(status="done")


def pack_is_done(folder: Path) -> bool:
    """Whether the run folder has a finished pack."""
    return (folder / RECORDS["pack"]).is_file()


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
