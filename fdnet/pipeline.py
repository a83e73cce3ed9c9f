"""The story of a run: pack, invade, analyse, report; each stage is kept when done and continued when cut."""

import hashlib
import json
import platform
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from fdnet.case import Case
from fdnet.dem.checkpoint import Checkpoint, read_history, state_at
from fdnet.dem.dump import read_frame
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import KNOWN_VERSION, Binary, Run, find_binary
from fdnet.dem.packing import Pack, make_pack, render_pack
from fdnet.dem.scene import snapshot_of
from fdnet.errors import CaseError
from fdnet.network.permeability import AnalysisOptions, analyse
from fdnet.outputs import Results, draw_figures, write_paraview, write_tables
from fdnet.progress import Progress
from fdnet.run_folder import STAGES, RunFolder, open_folder, write_json
from fdnet.scale_table import scale_rows
from fdnet.scales import PACK_RELAX_STEPS, PACK_STAGE_STEPS, PACK_STAGES, Scales, scales_of
from fdnet.snapshot import Snapshot
from fdnet.summary import summarise

OVERLAP_WARNING = 0.03


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

    def binary(self) -> Binary:
        """The binary, looked up only when a stage needs it."""
        if self._binary is None:
            self._binary = find_binary(self.options.liggghts)
        return self._binary

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        start = time.monotonic()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.monotonic() - start

    @property
    def path(self) -> Path:
        return self.folder.path


def run_case(case: Case, options: RunOptions) -> dict[str, Any]:
    """Run the stages asked for; returns the summary ({} when the analysis was not asked for).

    A finished run is not repeated: its summary is returned. Raises the FdnetError of the stage that fails; what was
    written stays and `resume` continues from it.
    """
    scales = scales_of(case)
    if any(stage in options.stages for stage in ("pack", "invade")) and not _finished_before(options.out):
        find_binary(options.liggghts)
    folder = open_folder(options.out, case, stages=options.stages, resume=options.resume, force=options.force)
    try:
        story = _Story(case=case, scales=scales, folder=folder, options=options)
        manifest = folder.manifest()
        if manifest is not None and set(options.stages) <= set(manifest["stages"]):
            return _read_summary(folder)
        return _run_stages(story, manifest)
    finally:
        folder.close()


def _finished_before(out: Path) -> bool:
    return (out / "manifest.json").exists()


def _read_summary(folder: RunFolder) -> dict[str, Any]:
    path = folder.path / "summary.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _run_stages(story: _Story, manifest: dict[str, Any] | None) -> dict[str, Any]:
    stages = story.options.stages
    if manifest:
        story.folder.clear(tuple(s for s in ("analyse", "report") if s in stages))
    done = [stage for stage in STAGES if stage in stages or (manifest and stage in manifest["stages"])]
    summary: dict[str, Any] = {}
    if "pack" in stages:
        _pack_stage(story)
    if "invade" in stages and story.case.fines:
        _invade_stage(story)
    if "analyse" in stages or "report" in stages:
        summary = _analyse_and_report(story)
        done = [stage for stage in STAGES if stage in {*done, "analyse"}]
    write_json(story.path / "manifest.json", _manifest(story, done))
    return summary


def _pack_stage(story: _Story) -> None:
    if _done(story, "pack"):
        return
    case, scales = story.case, story.scales
    with story.timed("pack"), Progress("pack", _pack_steps(), show=story.options.show_progress) as progress:
        pack = make_pack(case, scales, story.path / "pack", binary=story.binary(), ranks=story.options.ranks, follow=progress)
    story.folder.finish("pack", _pack_record(case, pack, story.seconds["pack"]))


def _pack_steps() -> int:
    return PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS // 2


def _done(story: _Story, stage: str) -> bool:
    record = story.folder.record(stage)
    if record is None:
        return False
    if record["digest"] != story.case.digest(stage):
        raise CaseError(f"{story.path / stage}: belongs to another case; give another --out, or --force to replace it")
    return True


def _pack_record(case: Case, pack: Pack, seconds: float) -> dict[str, Any]:
    return {"digest": case.digest("pack"), "seconds": seconds, "porosity": pack.porosity, "porosity_error": pack.porosity_error,
            "porosity_sum": pack.porosity_sum, "max_overlap": pack.max_overlap, "steps": pack.steps, "dt_s": pack.step_s,
            "attempts": list(pack.attempts), "run": _run_record(pack.run),
            "left_out": [str(item) for item in render_pack(case, scales_of(case), count=len(pack.grains)).left_out]}


def _run_record(run: Run) -> dict[str, Any]:
    return {"command": " ".join(run.command), "version": run.version, "seconds": run.seconds, "ranks": run.ranks,
            "deck_sha256": {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in sorted(run.directory.glob("in.*"))}}


def packed_grains(story_path: Path, case: Case) -> Snapshot:
    """The grains of a finished pack stage. Raises CaseError when there is none, DumpError when its dump is cut."""
    dump = story_path / "pack" / "post" / "pack.dump"
    if not (story_path / "pack" / "stage.json").exists():
        raise CaseError(f"{story_path}: no finished pack here; run the stage pack first (--stages pack,...)")
    return snapshot_of(read_frame(dump), case, time_s=0.0)


def _invade_stage(story: _Story) -> None:
    if _done(story, "invade"):
        return
    case, scales, folder = story.case, story.scales, story.path / "invade"
    grains = packed_grains(story.path, case)
    expected = round(min(scales.cap_time, scales.slab_length / scales.upstream_velocity + 2 * scales.plug_time) / scales.time_step)
    with story.timed("invade"), Progress("invade", expected, show=story.options.show_progress) as progress:
        result = invade(case, scales, grains, folder, binary=story.binary(), ranks=story.options.ranks, follow=progress,
                        timeout=story.options.timeout)
    story.folder.finish("invade", {
        "digest": case.digest("invade"), "seconds": story.seconds["invade"], "stop_reason": result.stop_reason,
        "max_overlap": result.max_overlap, "steps": result.history[-1].step, "dt_s": result.step_s,
        "supplied": scales.supplied_count, "warnings": list(result.warnings), "left_out": [str(item) for item in result.left_out],
        "runs": [_run_record(run) for run in result.runs]})


def _analyse_and_report(story: _Story) -> dict[str, Any]:
    case, path = story.case, story.path
    grains = packed_grains(path, case)
    history = _history(story)
    damaged = state_at(path / "invade", history[-1], case, story.scales, grains) if history else None
    with story.timed("analyse"):
        analysis = analyse(grains, damaged, periodic=case.periodic, options=_analysis_options(case))
        results = Results(path=path, case=case, scales=story.scales, grains=grains, damaged=damaged, history=history,
                          analysis=analysis)
        write_tables(results)
    figures: list[tuple[Path, str]] = []
    notes: list[str] = []
    if "report" in story.options.stages:
        with story.timed("report"):
            write_paraview(results)
            figures, notes = draw_figures(results)
    return _write_summary(story, results, figures, notes)


def _analysis_options(case: Case) -> AnalysisOptions:
    chosen = case.analysis
    return AnalysisOptions(sections=chosen.sections, law=chosen.law, damage_law=chosen.damage_law,
                           threshold=chosen.clogging_threshold, middle_band=chosen.middle_band, overlap=chosen.throat_overlap,
                           profile_bin=chosen.profile_bin_mm * 1e-3)


def _history(story: _Story) -> tuple[Checkpoint, ...]:
    if story.case.fines is None:
        return ()
    if story.folder.record("invade") is None:
        raise CaseError(f"{story.path}: no finished invasion here; run the stage invade first (--stages invade,...)")
    return read_history(story.path / "invade")


def _write_summary(story: _Story, results: Results, figures: list[tuple[Path, str]], notes: list[str]) -> dict[str, Any]:
    from fdnet.report import html, tables

    history = results.history
    pack, invasion = story.folder.record("pack"), story.folder.record("invade") if history else None
    assert pack is not None
    seconds = _seconds(story, pack, invasion)
    warnings = [*story.scales.warnings, *_version_warnings(pack), *(invasion["warnings"] if invasion else []), *_overlap_warnings(invasion), *notes]
    summary = summarise(story.case, results.analysis, pack=pack, invasion=invasion, last=history[-1] if history else None,
                        seconds=seconds, warnings=warnings)
    summary = tables.write_summary(story.path / "summary.json", summary)
    if "report" in story.options.stages:
        parts = html.ReportParts(figures=figures, case_text=story.case.toml(), scales=scale_rows(story.case, story.scales),
                                 versions=_versions(pack), commands=[story.options.command] if story.options.command else [])
        html.write_report(story.path / "report.html", summary, parts=parts)
    return summary


def _version_warnings(pack: dict[str, Any]) -> list[str]:
    version = pack["run"]["version"]
    return [] if version == KNOWN_VERSION else [f"LIGGGHTS {version}: fdnet was measured and tested with {KNOWN_VERSION}"]


def _overlap_warnings(invasion: dict[str, Any] | None) -> list[str]:
    if invasion and invasion["max_overlap"] > OVERLAP_WARNING:
        return [f"largest overlap of a fine at a checkpoint is {100 * invasion['max_overlap']:.1f} % of a diameter (above "
                f"{100 * OVERLAP_WARNING:.0f} %): raise run.stiffness_N_m"]
    return []


def _seconds(story: _Story, pack: dict[str, Any], invasion: dict[str, Any] | None) -> dict[str, float]:
    inside = pack["run"]["seconds"] + sum(run["seconds"] for run in (invasion["runs"] if invasion else []))
    return {"pack": pack["seconds"], "invade": invasion["seconds"] if invasion else 0.0,
            "analyse": story.seconds.get("analyse", 0.0), "report": story.seconds.get("report", 0.0), "liggghts": inside}


def _versions(pack: dict[str, Any]) -> dict[str, str]:
    names = ("fdnet", "numpy", "scipy", "pandas", "jinja2", "pyvista", "matplotlib", "pydantic", "overlap", "pymetis")
    found = {}
    for name in names:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed as a package"
    return {**found, "python": sys.version.split()[0], "liggghts": pack["run"]["version"], "system": platform.platform()}


def _manifest(story: _Story, stages: list[str]) -> dict[str, Any]:
    pack = story.folder.record("pack")
    invasion = story.folder.record("invade")
    return {"case": story.case.name, "digests": {s: story.case.digest(s) for s in ("pack", "invade", "analyse")},
            "seed": story.case.seed, "stages": stages, "command": story.options.command, "seconds": story.seconds,
            "versions": _versions(pack) if pack else {}, "pack": pack, "invade": invasion}


