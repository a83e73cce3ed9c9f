"""The story of a run: pack, invade, analyse, report; each stage is kept when done and continued when cut."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fdnet.case.case import Case
from fdnet.dem.checkpoint import has_history, read_history, state_at
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Binary, Launch, find_binary
from fdnet.dem.packing import make_pack
from fdnet.dem.scene import snapshot_of
from fdnet.dem.supply import refuse_crowded_supply
from fdnet.errors import CaseError
from fdnet.network.permeability import analyse
from fdnet.run.folder import STAGES, RunFolder, open_folder
from fdnet.run.outputs import Results, draw_figures, write_paraview, write_tables
from fdnet.run.progress import Progress
from fdnet.run.records import invade_record, pack_record, record_warnings, stage_seconds, versions
from fdnet.run.summary import summarise
from fdnet.scales.cost import refuse_long
from fdnet.scales.scales import PACK_RELAX_STEPS, PACK_STAGE_STEPS, PACK_STAGES, Scales, scales_of
from fdnet.scales.table import scale_rows
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How to run, as opposed to what: where, on how many ranks, which stages, with which binary."""

    out: Path
    ranks: int = 1
    resume: bool = False
    force: bool = False
    stages: tuple[str, ...] = STAGES
    liggghts: str | None = None
    timeout: float | None = None
    show_progress: bool = True
    command: str = ""


@dataclass(slots=True)
class _Story:
    """What is known so far in this run."""

    case: Case
    scales: Scales
    folder: RunFolder
    options: RunOptions
    seconds: dict[str, float] = field(default_factory=dict)
    _binary: Binary | None = None

    def launch(self, progress: Progress) -> Launch:
        """How this run starts LIGGGHTS; the binary is looked up only when a stage needs it."""
        if self._binary is None:
            self._binary = find_binary(self.options.liggghts)
        return Launch(
            binary=self._binary,
            ranks=self.options.ranks,
            timeout=self.options.timeout,
            follow=progress,
        )

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        start = time.monotonic()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.monotonic() - start

    @property
    def path(self) -> Path:
        return self.folder.path


def run_case(case: Case, options: RunOptions) -> dict[str, Any]:
    """Run the stages asked for; returns the summary ({} when neither analysis nor report was asked for).

    A finished run is not repeated: its summary is returned. Raises the FdnetError of the stage that fails; what was
    written stays and `resume` continues from it.
    """
    scales = scales_of(case)
    needed = _stages_to_run(case, options)
    refuse_long(case, scales, pack="pack" in needed, invade="invade" in needed)
    if "invade" in needed and (options.force or not has_history(options.out / "invade")):
        refuse_crowded_supply(case, scales)
    if needed:
        find_binary(options.liggghts)
    folder = open_folder(
        options.out, case, stages=options.stages, resume=options.resume, force=options.force
    )
    try:
        story = _Story(case=case, scales=scales, folder=folder, options=options)
        if folder.manifest() is not None and folder.holds(case, options.stages):
            return _read_summary(folder)
        return _run_stages(story)
    except CaseError as error:
        left = folder.discard()
        if left:
            raise CaseError(f"{error}; {left}") from error
        raise
    finally:
        folder.close()


def _stages_to_run(case: Case, options: RunOptions) -> list[str]:
    """The stages that will need LIGGGHTS: a run is refused for them before anything is written."""
    asked = [
        stage
        for stage in ("pack", "invade")
        if stage in options.stages and (stage == "pack" or case.fines)
    ]
    return [s for s in asked if options.force or not (options.out / s / "stage.json").exists()]


def _read_summary(folder: RunFolder) -> dict[str, Any]:
    path = folder.path / "summary.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _run_stages(story: _Story) -> dict[str, Any]:
    stages = story.options.stages
    if story.folder.manifest() is not None:
        story.folder.clear(tuple(stage for stage in ("analyse", "report") if stage in stages))
    if "pack" in stages:
        _pack_stage(story)
    if "invade" in stages and story.case.fines:
        _invade_stage(story)
    if not {"analyse", "report"} & set(stages):
        story.folder.complete(None)
        return {}
    summary = _analyse_and_report(story)
    story.folder.complete(_manifest(story))
    return summary


def _manifest(story: _Story) -> dict[str, Any]:
    pack, invasion = story.folder.record("pack"), story.folder.record("invade")
    assert pack is not None
    return {
        "case": story.case.name,
        "digests": {stage: story.case.digest(stage) for stage in STAGES[:3]},
        "seed": story.case.seed,
        "stages": [
            stage for stage in STAGES if stage != "report" or stage in story.options.stages
        ],
        "command": story.options.command,
        "seconds": stage_seconds(pack, invasion, story.seconds),
        "versions": versions(pack),
        "pack": pack,
        "invade": invasion,
    }


def _pack_stage(story: _Story) -> None:
    if _done(story, "pack"):
        return
    case, scales = story.case, story.scales
    with (
        story.timed("pack"),
        Progress("pack", _pack_steps(), show=story.options.show_progress) as progress,
    ):
        pack = make_pack(case, scales, story.path / "pack", story.launch(progress))
    story.folder.finish("pack", pack_record(case, pack, scales.porosity, story.seconds["pack"]))


def _pack_steps() -> int:
    return PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS // 2


def _done(story: _Story, stage: str) -> bool:
    record = story.folder.record(stage)
    if record is None:
        return False
    if record["digest"] != story.case.digest(stage):
        raise CaseError(
            f"{story.path / stage}: belongs to another case; give another --out, or --force to replace it"
        )
    return True


def _packed_grains(story: _Story) -> Snapshot:
    return snapshot_of(
        read_frame(story.path / "pack" / "post" / "pack.dump"), story.case, time_s=0.0
    )


def _invade_stage(story: _Story) -> None:
    if _done(story, "invade"):
        return
    case, scales, folder = story.case, story.scales, story.path / "invade"
    grains = _packed_grains(story)
    expected = round(
        min(scales.cap_time, scales.slab_length / scales.upstream_velocity + 2 * scales.plug_time)
        / scales.time_step
    )
    with (
        story.timed("invade"),
        Progress("invade", expected, show=story.options.show_progress) as progress,
    ):
        result = invade(case, scales, grains, folder, story.launch(progress))
    story.folder.finish("invade", invade_record(case, result, story.seconds["invade"]))


def _analyse_and_report(story: _Story) -> dict[str, Any]:
    case, path = story.case, story.path
    grains = _packed_grains(story)
    history = read_history(path / "invade") if case.fines else ()
    damaged = (
        state_at(path / "invade", history[-1], case, story.scales, grains) if history else None
    )
    with story.timed("analyse"):
        analysis = analyse(grains, damaged, periodic=case.periodic, options=case.analysis)
        results = Results(
            path=path,
            case=case,
            scales=story.scales,
            grains=grains,
            damaged=damaged,
            history=history,
            analysis=analysis,
        )
        write_tables(results)
    figures: list[tuple[Path, str]] = []
    notes: list[str] = []
    if "report" in story.options.stages:
        with story.timed("report"):
            write_paraview(results)
            figures, notes = draw_figures(results)
    return _write_summary(story, results, figures, notes)


def _write_summary(
    story: _Story, results: Results, figures: list[tuple[Path, str]], notes: list[str]
) -> dict[str, Any]:
    from fdnet.report import html, tables

    history = results.history
    pack, invasion = (
        story.folder.record("pack"),
        story.folder.record("invade") if history else None,
    )
    assert pack is not None
    summary = summarise(
        story.case,
        results.analysis,
        pack=pack,
        invasion=invasion,
        last=history[-1] if history else None,
        seconds=stage_seconds(pack, invasion, story.seconds),
        warnings=[*story.scales.warnings, *record_warnings(story.case, pack, invasion), *notes],
    )
    summary = tables.write_summary(story.path / "summary.json", summary)
    if "report" in story.options.stages:
        parts = html.ReportParts(
            figures=figures,
            case_text=story.case.toml(),
            scales=scale_rows(story.case, story.scales),
            versions=versions(pack),
            commands=[story.options.command] if story.options.command else [],
        )
        html.write_report(story.path / "report.html", summary, parts=parts)
    return summary
