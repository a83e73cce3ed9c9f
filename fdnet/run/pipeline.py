"""A run from the case to the report: pack, invade, analyse, report.

Each stage is kept when it is done and continued when it was cut.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fdnet.case.case import Case, InvasionCase
from fdnet.case.file import read_case
from fdnet.case.tables import AnalysisChoices
from fdnet.dem.checkpoint import read_rows
from fdnet.dem.liggghts import find_binary
from fdnet.dem.supply import refuse_crowded_supply
from fdnet.errors import CaseError, explained
from fdnet.files import expanded
from fdnet.names import AUTO, DEFAULT_LAW, LIGGGHTS_STAGES, STAGES, off_by_factors
from fdnet.network.warm_up import compiling
from fdnet.report import html, tables
from fdnet.report.text import case_words, thesis_law_warning
from fdnet.run import outputs
from fdnet.run.by_classes import (
    analysed_classes,
    class_model,
    class_summary,
    finished_classes,
    read_classes,
    spheres_at_the_end,
)
from fdnet.run.clean_up import clean_up_stage, compared, returned
from fdnet.run.dem_stages import invade_stage, invaded, invasion_record, pack_stage, packed_grains
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import (
    RECORDS,
    START_OVER,
    check_files,
    check_finished,
    digests_of_results,
    open_folder,
    read_manifest,
)
from fdnet.run.records import RunOptions, Session, cores, finer_file, stage_costs
from fdnet.run.stokes_sections import report_section
from fdnet.run.summary import summarise
from fdnet.scales.cost import over_limit
from fdnet.scales.pack import grain_count, refuse_unreachable
from fdnet.scales.scales import InvasionScales, Scales, back_flow, invasion_scales, scales_of
from fdnet.scales.table import scale_rows
from fdnet.spheres.snapshot import Directions, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis


Records = Mapping[str, dict[str, Any] | None]
"""Of the stages of LIGGGHTS: "pack", "invade" (None without fines), and "clean_up" if any."""


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
        The finished run, as `open_run` gives it; lengths in m, permeabilities in m2. With `resume`
        and without the stage "invade", an invasion that was cut is analysed as far as it is: the
        `stop_reason` of this provisional run is "unfinished".

    Raises:
        CaseError: the case, `out` or `stages` cannot be used.
        LiggghtsError: LIGGGHTS is missing or failed; `resume` continues from what was written.

    Examples:
        >>> import fdnet
        >>> run = fdnet.run_case("cases/quick.toml", "runs/quick")
        >>> run.summary["case"], run.summary["invaded_count"] > 0
        ('quick', True)
    """
    unknown = [stage for stage in stages if stage not in STAGES]
    if isinstance(stages, str) or unknown or not {"analyse", "report"} & set(stages):
        raise CaseError(
            f"stages: {stages!r}, expected some of {', '.join(STAGES)} with analyse or report "
            "among them; for the pack or the invasion alone use fdnet run CASE.toml --stages"
        )
    given = case if isinstance(case, Case) else read_case(case)
    options = RunOptions(
        out=Path("runs") / given.name if out is None else expanded(out),
        ranks=ranks,
        resume=resume,
        force=force,
        stages=tuple(stage for stage in STAGES if stage in stages),
        liggghts=liggghts,
        timeout=timeout,
        show_progress=progress,
        command="fdnet.run_case",
    )
    if run_stages(given, options).get("stop_reason") != "unfinished":
        return open_run(options.out)
    manifest = {"files": digests_of_results(options.out), "invade": {}}
    return FinishedRun(path=options.out, case=given, manifest=manifest)


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
        if read_manifest(folder.path) is not None and folder.holds(case, options.stages):
            check_finished(folder.path)
            return tables.read_summary(folder.path / "summary.json")
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
    needed = [
        stage
        for stage in by_liggghts(case)
        if stage in options.stages
        and not (stage == "pack" and options.pack_from is not None)
        and (options.force or not (options.out / RECORDS[stage]).exists())
    ]
    fresh = options.force or not read_rows(options.out / "invade")
    for one in refusals(case, scales_of(case), needed=needed, stages=options.stages, supply=fresh):
        raise CaseError(one)
    if needed:
        find_binary(options.liggghts, launcher=options.launcher)


def by_liggghts(case: Case) -> tuple[str, ...]:
    """The stages of a case that LIGGGHTS carries out."""
    fast = isinstance(case, InvasionCase) and case.by_classes
    stages = LIGGGHTS_STAGES[: 1 if fast else None]
    return tuple(stage for stage in stages if stage in case.stages)


def refusals(
    case: Case,
    scales: Scales,
    *,
    needed: Sequence[str] | None = None,
    stages: Sequence[str] = STAGES,
    supply: bool = True,
) -> Iterator[str]:
    """Why a case that can be read is not run, one sentence each: what `fdnet check` says too.

    `needed` are the stages that will run LIGGGHTS (all of the case), `stages` all that are asked
    for; `supply` says whether the fines are still to be placed.
    """
    needed = by_liggghts(case) if needed is None else needed
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


def _carry_out(session: Session) -> dict[str, Any]:
    import fdnet.network.permeability  # noqa: F401  a library that is missing is named first

    stages = session.options.stages
    if read_manifest(session.path) is not None:
        session.folder.clear(tuple(stage for stage in ("analyse", "report") if stage in stages))
    else:  # a provisional analysis may be there
        session.folder.clear(("analyse", "report"))
    analysed = bool({"analyse", "report"} & set(stages))
    sides = "".join(axis for axis, yes in zip("xyz", session.case.periodic, strict=True) if yes)
    free = cores() > session.options.ranks
    with compiling(sides, wanted=analysed and free and session.wants("pack")) as wait:
        if session.wants("pack"):
            pack_stage(session)
        if isinstance(session.case, InvasionCase) and session.wants("invade"):
            invade_stage(session, session.case)
        if isinstance(session.case, InvasionCase) and session.wants("clean_up"):
            clean_up_stage(session, session.case)
        wait()
    if not analysed:
        session.folder.complete(None)
        return {}
    case = session.case
    records = {
        "pack": session.folder.record("pack"),
        "invade": invasion_record(session, case) if isinstance(case, InvasionCase) else None,
    }
    if "clean_up" in case.stages:
        records["clean_up"] = session.folder.record("clean_up")
    summary = _analyse_and_report(session, records)
    if summary["stop_reason"] != "unfinished":
        session.folder.complete(_manifest(session, records, summary))
    return summary


def _manifest(session: Session, records: Records, summary: Mapping[str, Any]) -> dict[str, Any]:
    case = session.case
    done = [stage for stage in STAGES if stage in (*records, "analyse", "report")]
    return {
        "case": case.name,
        "digests": {stage: case.digest(stage) for stage in done if stage != "report"},
        "seed": case.seed,
        "stages": [s for s in done if s != "report" or s in session.options.stages],
        "command": session.options.command,
        "seconds": stage_costs(records, session)["seconds"],
        "versions": session.versions(),
        "files": digests_of_results(session.path),
        **records,
    }


def _analyse_and_report(session: Session, records: Records) -> dict[str, Any]:
    """Tables and the summary, which is given out before figures and report are made of them."""
    with session.timed("analyse"):
        results = outputs.with_added(_analysed(session, records), records.get("clean_up"))
        outputs.write_tables(results)
    steps = {f"analyse_{name}": value for name, value in results.analysis.seconds.items()}
    summary = summarise(session, results, records)
    summary["seconds"] |= steps
    summary = tables.write_summary(session.path / "summary.json", summary)
    session.options.answered(summary)
    if "report" in session.options.stages:
        with session.timed("report"):
            lacking = outputs.write_paraview(results)
            figures, notes = outputs.draw_figures(results, solid=not lacking)
        summary["warnings"] += [explained(note) for note in lacking + notes]
        summary |= stage_costs(records, session)
        summary["seconds"] |= steps
        tables.write_summary(session.path / "summary.json", summary)
        _write_page(session, results, summary, figures)
    return summary


def _analysed(session: Session, records: Records) -> outputs.Results:
    """The specimen before, after the invasion if any, and after its clean-up if any."""
    case, record = session.case, records["invade"]
    grains = packed_grains(session.path, case)
    laws = partial(with_default_laws, periodic=case.periodic, options=case.analysis)
    results = partial(outputs.Results, path=session.path, grains=grains)
    if record is None or not isinstance(case, InvasionCase):
        sizes = tuple(outputs.placed_sizes(case, grains, None, 0))
        return results(invasion=None, analysis=laws(grains, None), sizes=sizes)
    folder = session.path / "invade"
    if case.by_classes:
        check_files(folder, record, START_OVER)
        done, model, kept = finished_classes(case, invasion_scales(case), grains, folder)
        return results(
            invasion=done,
            analysis=analysed_classes(model, kept, laws(grains, None), done.damaged),
            sizes=tuple(outputs.placed_sizes(case, grains, None, 0)),
            numbers=class_summary(case, model, kept),
        )
    done, after = invaded(session, case, grains, record), None
    analysis = laws(grains, done.damaged)
    if records.get("clean_up"):
        from fdnet.network.permeability import analyse

        state = returned(session, case, grains)
        options = case.analysis.changed(damage_law=analysis.damage_law_used)
        again = analyse(grains, state, periodic=case.periodic, options=options)
        after = compared(done.damaged, state, again)
    sizes = tuple(outputs.placed_sizes(case, grains, done.damaged, record["supplied"]))
    found = results(invasion=done, analysis=analysis, sizes=sizes, cleaned=after)
    finer = finer_file(record["steps"]) in record["files"]
    return with_finer(found, record["supplied"]) if finer else found


def with_finer(results: outputs.Results, supplied: int) -> outputs.Results:
    """The results with the classes that are finer than the spheres, of which `supplied` came.

    Counts are of spheres and of rows of fines, each of which stands for a mean sphere's volume.
    """
    one, grains = results.invasion, results.grains
    assert one is not None
    case, last = one.case, one.history[-1]
    model = class_model(case, one.scales, grains, network=results.analysis.network)
    kept = read_classes(results.path / "invade" / finer_file(last.step), one.updates[-1])
    counts = model.counted(kept.by_class)
    fines = spheres_at_the_end(case, model, kept)
    numbers = class_summary(case, model, kept) | {
        "supplied_count": supplied + int(counts.rows[-1].sum()),
        "passed_count": last.passed + counts.history[-1].passed,
        "upstream_count": last.upstream + counts.history[-1].upstream,
    }
    everyone = one.damaged.joined(fines)
    analysis = analysed_classes(model, kept, results.analysis, everyone)
    return replace(results, analysis=analysis, finer=fines, numbers=numbers)


def with_default_laws(
    grains: Snapshot, damaged: Snapshot | None, *, periodic: Directions, options: AnalysisChoices
) -> "Analysis":
    """The analysis; by laws that are off by factors, a warning has the numbers by the default."""
    from fdnet.network.permeability import compare

    laws = (options.law, options.damage_law)
    off = off_by_factors(*laws, fines=damaged is not None)
    pairs = [laws, *([(DEFAULT_LAW, AUTO)] if off else [])]
    first, *others = compare(grains, damaged, periodic=periodic, options=options, laws=pairs)
    said = [thesis_law_warning(first, other) for other in others]
    return replace(first, warnings=(*said, *first.warnings))


def _write_page(
    session: Session,
    results: outputs.Results,
    summary: dict[str, Any],
    figures: list[tuple[Path, str]],
) -> None:
    case, command = session.case, session.options.command
    parts = html.ReportParts(
        figures=figures,
        case_words=list(case_words(case, session.scales)),
        case_text=case.toml(),
        scales=scale_rows(case, session.scales),
        versions=session.versions(),
        commands=[command] if command else [],
        tables=[one.page for one in results.added if one.page is not None],
        stokes=report_section(session.path, case, summary),
        mechanics=html.mechanics_html(session.path / "mechanics"),
    )
    html.write_report(session.path / "report.html", summary, parts=parts)
