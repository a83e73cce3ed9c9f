"""A run from Python: carried out, or opened again."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fdnet.case.case import Case
from fdnet.case.file import read_case
from fdnet.errors import CaseError
from fdnet.files import expanded
from fdnet.run.finished import FinishedRun
from fdnet.run.folder import STAGES, finished_manifest


def open_run(path: str | Path) -> FinishedRun:
    """A finished run, read from its folder.

    Args:
        path: the run folder, for example "runs/quick".

    Returns:
        The run, with `summary` (mapping), `sections`, `profile`, `pores`, `throats` and `history`
        (pandas, units in the column names, SI), `spheres()`, `network()`, `to_openpnm()`,
        `network_mesh()`, `sphere_mesh()`. It prints itself in mD and m2, mm and percent.

    Raises:
        CaseError: there is no folder, it holds no run or an unfinished one, or its records cannot
            be read. The message names the path and what to do.

    Examples:
        >>> import fdnet
        >>> run = fdnet.open_run("runs/quick")
        >>> run.summary["k_damaged_m2"] < run.summary["k_initial_m2"]
        True
        >>> list(run.sections.columns[:5])
        ['section', 'x_lo_m', 'x_hi_m', 'porosity_initial', 'porosity_damaged']
        >>> axes = run.sections.plot(x="x_lo_m", y=["k_initial_m2", "k_damaged_m2"])
    """
    folder = expanded(path)
    manifest, case = finished_manifest(folder)
    return FinishedRun(path=folder, case=case, manifest=manifest)


def run_case(
    case: Case | str | Path,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    force: bool = False,
    stages: Sequence[str] = STAGES,
    ranks: int = 1,
    liggghts: str | None = None,
    timeout: float | None = None,
    progress: bool = False,
) -> FinishedRun:
    """Pack the grains, drive the fines in, analyse the result and write the report.

    It needs LIGGGHTS. A finished run is not repeated: it is opened.

    Args:
        case: a `Case`, or the path of a case file.
        out: the run folder. Without it "runs/NAME", by the name of the case.
        resume: continue an unfinished run in `out`.
        force: replace what is in `out`.
        stages: some of "pack", "invade", "analyse", "report", one of the last two among them.
        ranks: number of MPI processes of LIGGGHTS.
        liggghts: path of the LIGGGHTS program, if not the one that the set-up installed.
        timeout: longest run time of LIGGGHTS, s.
        progress: whether to show the progress on the terminal.

    Returns:
        The finished run, as `open_run` gives it; lengths in m, permeabilities in m2.

    Raises:
        CaseError: the case, `out` or `stages` cannot be used.
        LiggghtsError: LIGGGHTS is missing or failed; `resume` continues from what was written.

    Examples:
        >>> import fdnet
        >>> run = fdnet.run_case("cases/quick.toml", "runs/quick")
        >>> run.summary["case"], run.summary["invaded_count"] > 0
        ('quick', True)
    """
    from fdnet.run.pipeline import run_stages
    from fdnet.run.records import RunOptions

    given = case if isinstance(case, Case) else read_case(case)
    folder = Path("runs") / given.name if out is None else expanded(out)
    options = RunOptions(out=folder, ranks=ranks, resume=resume, force=force)
    options = replace(options, stages=_checked_stages(stages), command="fdnet.run_case")
    options = replace(options, liggghts=liggghts, timeout=timeout, show_progress=progress)
    run_stages(given, options)
    return open_run(folder)


def _checked_stages(stages: Sequence[str]) -> tuple[str, ...]:
    unknown = [stage for stage in stages if stage not in STAGES]
    if isinstance(stages, str) or unknown or not {"analyse", "report"} & set(stages):
        raise CaseError(
            f"stages: {stages!r}, expected some of {', '.join(STAGES)} with analyse or report "
            "among them; for the pack or the invasion alone use fdnet run CASE.toml --stages"
        )
    return tuple(stage for stage in STAGES if stage in stages)
