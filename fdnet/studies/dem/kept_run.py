"""Runs of a study that are made once and read ever after."""

from pathlib import Path

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.run.finished import FinishedRun
from fdnet.run.open_run import open_run, run_case


def is_finished(out: Path) -> bool:
    """Whether the folder holds a run that was carried to its end."""
    return (out / "manifest.json").exists()


def kept_run(case: Case, out: Path) -> FinishedRun:
    """The run of a case in the folder `out`, made or continued where it is not finished.

    Raises CaseError where `out` holds a finished run of another case, and what `run_case` raises.
    """
    if not is_finished(out):
        stages = ("pack", "invade", "analyse")
        run_case(case, out, stages=stages, resume=out.exists(), progress=False)
    run = open_run(out)
    if run.case.digest() != case.digest():
        raise CaseError(
            f"{out}: holds a finished run of another case, expected that of {case.name} with "
            f"seed {case.seed} as it is set up now; move the folder away, or choose another --out"
        )
    return run
