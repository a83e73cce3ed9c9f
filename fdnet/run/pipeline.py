"""A run from the case to the report: pack, invade, analyse, report.

Each stage is kept when it is done and continued when it was cut.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.case.case import Case, InvasionCase
from fdnet.case.tables import AnalysisChoices
from fdnet.dem.checkpoint import read_rows
from fdnet.dem.liggghts import find_binary
from fdnet.dem.supply import refuse_crowded_supply
from fdnet.errors import CaseError
from fdnet.names import AUTO, DEFAULT_LAW, LIGGGHTS_STAGES, STAGES, off_by_factors
from fdnet.report.permeability_text import thesis_law_warning
from fdnet.run.added_results import added_results
from fdnet.run.answer import case_words, with_answer
from fdnet.run.clean_up import Returned, clean_up_stage, compared, returned
from fdnet.run.dem_stages import (
    file_warnings,
    invade_stage,
    invaded,
    pack_stage,
    packed_grains,
)
from fdnet.run.folder import (
    MESHES,
    RECORDS,
    SOME_TABLES,
    TABLES,
    RunFolder,
    check_finished,
    digests_of,
    frames_in,
    open_folder,
)
from fdnet.run.outputs import (
    Results,
    draw_figures,
    placed_sizes,
    size_summary,
    write_paraview,
    write_tables,
)
from fdnet.run.records import RunOptions, Session, record_warnings, stage_seconds, versions
from fdnet.run.stokes_sections import report_section
from fdnet.run.summary import summarise
from fdnet.scales.check import every_finding
from fdnet.scales.cost import over_limit
from fdnet.scales.pack import grain_count, refuse_unreachable
from fdnet.scales.scales import InvasionScales, Scales, back_flow, scales_of
from fdnet.scales.table import scale_rows
from fdnet.spheres.snapshot import Directions, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis


def run_stages(case: Case, options: RunOptions) -> dict[str, Any]:
    """Run the stages asked for; returns the summary.

    The summary is {} when neither analysis nor report was asked for. A finished run is not
    repeated: its summary is returned.

    Raises the FdnetError of the stage that fails; what was written stays, and `resume` continues
    from it.
    """
    refuse(case, options)
    folder = open_folder(
        options.out, case, stages=options.stages, resume=options.resume, force=options.force
    )
    try:
        session = Session(case=case, scales=scales_of(case), folder=folder, options=options)
        if folder.manifest() is not None and folder.holds(case, options.stages):
            check_finished(folder.path)
            return _read_summary(folder)
        return _carry_out(session)
    except CaseError as error:
        left = folder.discard()
        if left:
            raise CaseError(f"{error}; {left}") from error
        raise
    finally:
        folder.close()


def refuse(case: Case, options: RunOptions) -> None:
    """Raise, before anything is written, what would stop the run later."""
    if "clean_up" in set(options.stages) - set(case.stages) and options.stages != STAGES:
        raise CaseError(
            f"--stages clean_up: case {case.name} has no table [clean_up]; add it with "
            "drawdown_MPa, or leave the stage out"
        )
    needed = _stages_to_run(case, options)
    fresh = options.force or not read_rows(options.out / "invade")
    for refusal in refusals(
        case, scales_of(case), needed=needed, stages=options.stages, supply=fresh
    ):
        raise CaseError(refusal)
    if needed:
        find_binary(options.liggghts, launcher=options.launcher)


def refusals(
    case: Case,
    scales: Scales,
    *,
    needed: Sequence[str] = LIGGGHTS_STAGES,
    stages: Sequence[str] = STAGES,
    supply: bool = True,
) -> Iterator[str]:
    """Why a case that can be read is not run, one sentence each: what `fdnet check` says too.

    `needed` are the stages that will run LIGGGHTS, `stages` all that are asked for; `supply` says
    whether the fines are still to be placed.
    """
    count = grain_count(case)
    if count < 4 and {"analyse", "report"} & set(stages):
        yield (
            f"grains: the case has {count} grains, expected at least 4 for a pore network; raise "
            "grains.count or enlarge the box"
        )
    yield from _refused(refuse_unreachable, case)
    if text := over_limit(case, scales, pack="pack" in needed, invade="invade" in needed):
        yield text
    if isinstance(case, InvasionCase) and isinstance(scales, InvasionScales):
        if "clean_up" in case.stages:
            yield from _refused(back_flow, case)
        if "invade" in needed and supply:
            yield from _refused(refuse_crowded_supply, case, scales)


def _refused(check: Callable[..., object], *arguments: Any) -> Iterator[str]:
    """What a check raises, in words."""
    try:
        check(*arguments)
    except CaseError as error:
        yield str(error)


def _stages_to_run(case: Case, options: RunOptions) -> list[str]:
    """The stages that will need LIGGGHTS."""
    asked = [s for s in LIGGGHTS_STAGES if s in options.stages and s in case.stages]
    if options.pack_from is not None:
        asked = [s for s in asked if s != "pack"]
    return [s for s in asked if options.force or not (options.out / s / "stage.json").exists()]


def _read_summary(folder: RunFolder) -> dict[str, Any]:
    from fdnet.report.tables import read_summary

    path = folder.path / "summary.json"
    return read_summary(path) if path.exists() else {}


def _carry_out(session: Session) -> dict[str, Any]:
    import fdnet.network.permeability  # noqa: F401  a library that is missing is named first

    stages = session.options.stages
    if session.folder.manifest() is not None:
        session.folder.clear(tuple(stage for stage in ("analyse", "report") if stage in stages))
    if session.wants("pack"):
        pack_stage(session)
    if isinstance(session.case, InvasionCase) and session.wants("invade"):
        invade_stage(session, session.case)
    if isinstance(session.case, InvasionCase) and session.wants("clean_up"):
        clean_up_stage(session, session.case)
    if not {"analyse", "report"} & set(stages):
        session.folder.complete(None)
        return {}
    summary = _analyse_and_report(session)
    session.folder.complete(_manifest(session))
    return summary


def _pack_record(session: Session) -> dict[str, Any]:
    record = session.folder.record("pack")
    if record is None:
        raise CaseError(f"{session.path}: no finished pack here; run the stage pack first")
    return record


def _manifest(session: Session) -> dict[str, Any]:
    pack, invasion = _pack_record(session), session.folder.record("invade")
    cleaned = _clean_up_record(session)
    left_out = set() if cleaned else {"clean_up"}
    done = [stage for stage in STAGES if stage not in left_out]
    return {
        "case": session.case.name,
        "digests": {stage: session.case.digest(stage) for stage in done if stage != "report"},
        "seed": session.case.seed,
        "stages": [s for s in done if s != "report" or s in session.options.stages],
        "command": session.options.command,
        "seconds": stage_seconds(pack, invasion, session.seconds, cleaned=cleaned),
        "versions": versions(pack),
        "files": digests_of(
            session.path,
            [
                *TABLES,
                *SOME_TABLES,
                *MESHES,
                *frames_in(session.path).values(),
                *RECORDS.values(),
            ],
        ),
        "pack": pack,
        "invade": invasion,
        **({"clean_up": cleaned} if cleaned else {}),
    }


def _clean_up_record(session: Session) -> dict[str, Any] | None:
    """The record of the clean-up; None of a case without one."""
    return session.folder.record("clean_up") if "clean_up" in session.case.stages else None


def _analyse_and_report(session: Session) -> dict[str, Any]:
    case, grains = session.case, packed_grains(session)
    invasion = invaded(session, case, grains) if isinstance(case, InvasionCase) else None
    damaged = None if invasion is None else invasion.damaged
    supplied = (session.folder.record("invade") or {}).get("supplied", 0)
    with session.timed("analyse"):
        first = with_default_laws(grains, damaged, periodic=case.periodic, options=case.analysis)
        after = _returned(session, grains, damaged, first)
        results = Results(
            path=session.path,
            grains=grains,
            invasion=invasion,
            analysis=first,
            sizes=tuple(placed_sizes(case, grains, damaged, supplied)),
            cleaned=None if after is None else after.state,
        )
        added = added_results(results, after, _clean_up_record(session))
        results = replace(results, added=tuple(added))
        write_tables(results)
    figures: list[tuple[Path, str]] = []
    notes: list[str] = []
    if "report" in session.options.stages:
        with session.timed("report"):
            write_paraview(results)
            figures, notes = draw_figures(results)
    return _write_summary(session, results, figures, notes)


def with_default_laws(
    grains: Snapshot,
    damaged: Snapshot | None,
    *,
    periodic: Directions,
    options: AnalysisChoices,
) -> "Analysis":
    """The analysis; by laws that are off by factors, a warning has the numbers by the default."""
    from fdnet.network.permeability import compare

    laws = (options.law, options.damage_law)
    off = off_by_factors(*laws, fines=damaged is not None)
    pairs = [laws, *([(DEFAULT_LAW, AUTO)] if off else [])]
    first, *others = compare(grains, damaged, periodic=periodic, options=options, laws=pairs)
    said = [thesis_law_warning(first, other) for other in others]
    return replace(first, warnings=(*said, *first.warnings))


def _returned(
    session: Session, grains: Snapshot, damaged: Snapshot | None, first: "Analysis"
) -> Returned | None:
    """The state after the clean-up, measured by the damage law of the first analysis."""
    from fdnet.network.permeability import analyse

    case = session.case
    if damaged is None or not isinstance(case, InvasionCase) or "clean_up" not in case.stages:
        return None
    state = returned(session, case, grains)
    options = case.analysis.changed(damage_law=first.damage_law_used)
    analysis = analyse(grains, state, periodic=case.periodic, options=options)
    return compared(damaged, state, analysis)


def _write_summary(
    session: Session, results: Results, figures: list[tuple[Path, str]], notes: list[str]
) -> dict[str, Any]:
    from fdnet.report import html, tables
    from fdnet.report.html import mechanics_html as section_html
    from fdnet.report.vtk import view_of

    case, scales = session.case, session.scales
    pack = _pack_record(session)
    invasion = session.folder.record("invade") if results.history else None
    cleaned = _clean_up_record(session)
    summary = summarise(
        case,
        results.analysis,
        pack=pack,
        invasion=invasion,
        sizes=size_summary(results.sizes),
        last=results.history[-1] if results.history else None,
        physical_time_s=results.physical_time_s,
        seconds=stage_seconds(pack, invasion, session.seconds, cleaned=cleaned),
        warnings=[
            *(one.sentence for one in every_finding(case, scales)),
            *record_warnings(case, pack, invasion),
            *(cleaned["warnings"] if cleaned else []),
            *file_warnings(session),
            *notes,
        ],
    )
    for one in results.added:
        summary |= one.summary
    summary = with_answer(summary, case, results.analysis, results.shown)
    summary = tables.write_summary(session.path / "summary.json", summary)
    if "report" in session.options.stages:
        parts = html.ReportParts(
            figures=figures,
            case_words=case_words(case, scales),
            view=view_of(results.shown),
            case_text=case.toml(),
            scales=scale_rows(case, scales),
            versions=versions(pack),
            commands=[session.options.command] if session.options.command else [],
            tables=[one.page for one in results.added if one.page is not None],
            stokes=report_section(session.path, case, summary),
            mechanics=section_html(session.path / "mechanics"),
        )
        html.write_report(session.path / "report.html", summary, parts=parts)
    return summary
