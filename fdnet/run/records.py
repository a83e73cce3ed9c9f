"""A run as it is carried out: its session, records of its stages, and a shared pack."""

import hashlib
import math
import os
import platform
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from fdnet.case.case import Case, InvasionCase
from fdnet.dem.checkpoint import HISTORY, UPDATES, WATCH, Checkpoint, Deepest, overlap_text
from fdnet.dem.invasion import Invasion
from fdnet.dem.liggghts import (
    KNOWN_VERSION,
    Binary,
    Execution,
    Launch,
    find_binary,
    peak_resident_bytes,
)
from fdnet.dem.packing import Pack
from fdnet.errors import CaseError, Doubt, explained
from fdnet.names import STAGES
from fdnet.run.folder import (
    LOCK,
    RECORD_FORMAT,
    RECORDS,
    START_OVER,
    RunFolder,
    check_files,
    digests_of,
    read_record,
)
from fdnet.run.progress import Progress
from fdnet.scales.scales import InvasionScales, Scales, invasion_scales
from fdnet.spheres.geometry import overlap_doubts
from fdnet.spheres.snapshot import Snapshot

PACK_DUMP = "post/pack.dump"
MOMENTUM_LIMIT = 0.01
"""Largest difference of the forces in the pack and its drop of pressure times area, over it."""
POROSITY_WARNING = 0.02
_PACKAGES = ["fdnet", "numpy", "scipy", "pandas", "jinja2", "pyvista", "matplotlib", "pydantic"]
_PACKAGES += ["overlap", "pymetis"]


def pack_record(pack: Pack, folder: Path, *, assumed: float) -> dict[str, Any]:
    """pack/stage.json: how the pack in `folder` was reached."""
    return {
        "porosity_assumed": assumed,
        "porosity": pack.porosity,
        "porosity_error": pack.porosity_error,
        "porosity_sum": pack.porosity_sum,
        "max_overlap": pack.max_overlap,
        "creep_m_s": pack.creep,
        "restless": sum(row.get("restless", 0) for row in pack.attempts),
        "steps": pack.steps,
        "dt_s": pack.step_s,
        "attempts": list(pack.attempts),
        "ranks": pack.run.ranks,
        "files": digests_of(folder, [PACK_DUMP]),
        "runs": [run_record(pack.run)],
        "left_out": [str(item) for item in pack.left_out],
    }


def invade_record(case: InvasionCase, result: Invasion, folder: Path) -> dict[str, Any]:
    """invade/stage.json: how the invasion in `folder` ended."""
    dumps = [f"post/invade_{row.step}.dump" for row in result.history]
    finer = finer_file(result.history[-1].step)
    return {
        "stop_reason": result.stop_reason,
        "max_overlap": result.overlap.fraction,
        "max_overlap_step": result.overlap.step,
        "steps": result.history[-1].step,
        "dt_s": result.step_s,
        "springs": {
            "dem_dt_last_s": result.last.time_step,
            "stiffness_N_m": [invasion_scales(case).stiffness, result.last.stiffness],
        },
        "supplied": result.supplied,
        "warnings": [explained(one) for one in result.warnings],
        "ranks": result.ranks,
        **_updates(result.updates),
        "files": digests_of(folder, [HISTORY, WATCH, UPDATES, finer, *dumps]),
        "runs": [run_record(run) for run in result.runs],
        "left_out": [str(item) for item in result.left_out],
    }


def finer_file(step: int) -> str:
    """Where an invasion of spheres and finer classes keeps the classes at a checkpoint."""
    return f"post/invade_{step}.npz"


def _updates(rows: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """How often a fluid was computed anew, its last update, and where momentum did not close."""
    if not rows:
        return {}
    result: dict[str, Any] = {"count": len(rows), "last": dict(rows[-1])}
    defects = [row["momentum_defect"] for row in rows if "momentum_defect" in row]
    if defects:
        result["momentum_defect_most"] = max(defects)
        result["momentum_open"] = sum(defect > MOMENTUM_LIMIT for defect in defects)
    return {"updates": result}


def run_record(run: Execution) -> dict[str, Any]:
    """One LIGGGHTS execution, with the digests of its decks."""
    decks = {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(run.directory.glob("in.*"))
    }
    return {
        "command": shlex.join(run.command),
        "version": run.version,
        "seconds": run.seconds,
        **({"waited": run.waited} if run.waited else {}),
        "cpu_seconds": run.cpu_seconds,
        "peak_memory_bytes": run.peak_memory_bytes,
        "ranks": run.ranks,
        "deck_sha256": decks,
    }


def record_warnings(
    case: Case, pack: Mapping[str, Any], invasion: Mapping[str, Any]
) -> Iterator[str]:
    """Doubts about the DEM runs, from the records of their stages.

    They are another LIGGGHTS than fdnet was measured with, large overlaps, and how the runs ended.
    """
    version = pack["runs"][0]["version"]
    yield from invasion.get("warnings", [])
    if version != KNOWN_VERSION:
        yield Doubt(
            "another-liggghts",
            f"LIGGGHTS {version}: fdnet was measured and tested with {KNOWN_VERSION}",
        )
    yield from overlap_doubts(pack["max_overlap"])
    if pack.get("restless"):
        yield Doubt(
            "restless-pack",
            f"{pack['restless']} packs did not come to rest and were made again from other random "
            "places: the pack is not that of the seed's first places",
        )
    if pack.get("creep_m_s"):
        yield Doubt(
            "creeping-pack",
            f"the pack is barely jammed and still creeps, at {pack['creep_m_s']:.2g} m/s; it is "
            "used as it is",
        )
    if abs(pack["porosity"] - pack["porosity_assumed"]) > POROSITY_WARNING:
        yield Doubt(
            "assumed-porosity",
            "the fluid's velocity follows from a porosity of "
            f"{pack['porosity_assumed']:.3f} (plain sum of grains.count), the pack has "
            f"{pack['porosity']:.3f}: give grains.porosity instead of the count",
        )
    if not invasion:
        return
    step = invasion.get("max_overlap_step", invasion["steps"])
    deepest = Deepest(step=step, fraction=invasion["max_overlap"])
    if deepest.fraction > case.run.max_overlap:
        assert isinstance(case, InvasionCase)
        springs = invasion.get("springs", {"stiffness_N_m": [invasion_scales(case).stiffness]})
        yield Doubt("overlap", overlap_text(case, deepest, springs["stiffness_N_m"][-1]))
    updates = invasion.get("updates", {})
    if updates.get("momentum_open"):
        yield Doubt(
            "momentum",
            "the forces on fines and grains differ from the drop of pressure times area by up to "
            f"{100 * updates['momentum_defect_most']:.2g} %, and by more than "
            f"{100 * MOMENTUM_LIMIT:g} % in {updates['momentum_open']} of {updates['count']} "
            "updates (history.csv, momentum_defect)",
        )


def stage_costs(
    records: Mapping[str, dict[str, Any] | None], session: "Session"
) -> dict[str, dict[str, Any]]:
    """Keys of the summary: seconds, processor seconds and peak memory.

    They are those of the session that finished a stage. The memory of fdnet is that of this
    process so far, of LIGGGHTS that of its largest run.
    """
    done = {stage: record for stage, record in records.items() if record}
    runs = [run for record in done.values() for run in record["runs"]]
    waited = sum(run.get("waited", 0.0) for run in runs)
    failed = sum(row["liggghts_s"] for row in done["pack"]["attempts"][:-1])
    peaks = [run.get("peak_memory_bytes") for run in runs]
    return {
        "seconds": {
            **{stage: (one or {}).get("seconds", 0.0) for stage, one in records.items()},
            **{stage: session.seconds.get(stage, 0.0) for stage in ("analyse", "report")},
            "liggghts": sum(run["seconds"] for run in runs) + failed - waited,
            **({"updates": waited} if waited else {}),
        },
        "cpu_seconds": processor_seconds(done.values(), session.cpu_seconds),
        "peak_memory_bytes": {
            "liggghts": None if None in peaks else max(peaks, default=0),
            "python": peak_resident_bytes(),
        },
    }


def processor_seconds(
    records: Iterable[dict[str, Any] | None], own: Mapping[str, float]
) -> dict[str, float]:
    """Of LIGGGHTS and of fdnet in stages with these records, and in those of this session."""
    done = [record for record in records if record]
    runs = [run for record in done for run in record["runs"]]
    earlier = [row for record in done for row in record.get("attempts", [])[:-1]]
    return {
        "liggghts": sum(run.get("cpu_seconds", 0.0) for run in runs)
        + sum(row.get("liggghts_cpu_s", 0.0) for row in earlier),
        "python": sum(record.get("cpu_seconds", 0.0) for record in done)
        + sum(own.get(stage, 0.0) for stage in ("analyse", "report")),
    }


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FinishedInvasion:
    """A finished invasion."""

    case: InvasionCase  # what was run
    scales: InvasionScales  # of the case
    history: tuple[Checkpoint, ...]  # one row a checkpoint
    damaged: Snapshot  # grains and all remaining fines at the end
    # the record of a coupled invasion, one row an update; empty of others
    updates: tuple[Mapping[str, float], ...] = ()
    # of history.csv, and the fines at some of its steps, where the fast model made them
    rows: tuple[dict[str, float], ...] = ()
    states: tuple[tuple[Checkpoint, Snapshot], ...] = ()


# ---- One session of a run: what is run, where, and how long each stage took.
@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How to run a case, as opposed to what it is: the options of `fdnet run`."""

    out: Path
    ranks: int = 1
    resume: bool = False
    force: bool = False
    stages: tuple[str, ...] = STAGES
    liggghts: str | None = None
    # template that starts several ranks, as "srun -n {ranks}"; None: mpirun
    launcher: str | None = None
    # run folder whose finished pack is taken; None: the pack is made
    pack_from: Path | None = None
    timeout: float | None = None  # s, after which LIGGGHTS is stopped in each stage; None: never
    show_progress: bool = True
    command: str = ""  # command line that started the run, for its records
    # takes the summary when the analysis is done, before the pictures are drawn
    answered: Callable[[Mapping[str, Any]], None] = lambda summary: None

    def __post_init__(self) -> None:
        """Raise CaseError on a time limit or a number of ranks that means nothing."""
        if self.timeout is not None and not 0 < self.timeout < math.inf:
            raise CaseError(
                f"timeout: {self.timeout}, expected a number of seconds above 0; leave it out for "
                "no limit"
            )
        most = max(256, 64 * cores())  # more would only exhaust the machine
        if not 1 <= self.ranks <= most:
            raise CaseError(
                f"ranks: {self.ranks}, expected 1 to {most} on the {cores()} cores of this machine"
            )


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


@dataclass(slots=True)
class Session:
    """A run while it goes on."""

    case: Case  # what is run
    scales: Scales  # of the case
    folder: RunFolder  # where it is run; this process holds its lock
    options: RunOptions  # how it is run
    # s, that each stage took in this session
    seconds: dict[str, float] = field(default_factory=dict)
    # s of processors, that this process spent on each of them
    cpu_seconds: dict[str, float] = field(default_factory=dict)
    _binary: Binary | None = None

    @property
    def path(self) -> Path:
        """The run folder."""
        return self.folder.path

    def wants(self, stage: str) -> bool:
        """Whether the stage was asked for and belongs to the case."""
        return stage in self.options.stages and stage in self.case.stages

    def versions(self) -> dict[str, str]:
        """Versions of everything that shaped the run."""
        packages = {}
        for name in _PACKAGES:
            try:
                packages[name] = metadata.version(name)
            except metadata.PackageNotFoundError:
                packages[name] = "not installed as a package"
        pack, python = self.folder.record("pack") or {}, sys.version.split()[0]
        liggghts, system = pack["runs"][0]["version"], platform.platform()
        return {**packages, "python": python, "liggghts": liggghts, "system": system}

    def launch(self, progress: Progress) -> Launch:
        """How a stage that begins now starts LIGGGHTS, within its time limit."""
        options = self.options
        if self._binary is None:
            self._binary = find_binary(options.liggghts, launcher=options.launcher)
        return Launch(
            binary=self._binary,
            ranks=options.ranks,
            deadline=options.timeout and time.monotonic() + options.timeout,
            follow=progress,
        )

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time inside the `with` block to the seconds of the stage."""
        start, cpu = time.monotonic(), time.process_time()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.monotonic() - start
        used = time.process_time() - cpu
        self.cpu_seconds[stage] = self.cpu_seconds.get(stage, 0.0) + used

    def finish(self, stage: str, record: dict[str, Any]) -> None:
        """Mark a stage as done, with the time that it took in this session."""
        own = {"format": RECORD_FORMAT, "digest": self.case.digest(stage)}
        own |= {"seconds": self.seconds[stage], "cpu_seconds": self.cpu_seconds[stage]}
        self.folder.finish(stage, own | record)


# ---- A pack that several runs share: made once, and copied into each of them.
def take_pack(session: Session, source: Path) -> None:
    """Copy the finished pack of the run folder `source`, as if this run had made it.

    Its record counts no seconds of LIGGGHTS, which belong to the run that made the pack.

    Raises CaseError when `source` holds no finished pack, or one of another case or seed, or
    when its files are not those that the stage made.
    """
    record = read_record(source, "pack")
    if record is None:
        raise CaseError(
            f"--pack-from {source}: holds no finished pack; make it with fdnet run CASE.toml "
            f"--stages pack --out {shlex.quote(str(source))}"
        )
    if record["digest"] != session.case.digest("pack"):
        raise CaseError(
            f"--pack-from {source}: its pack is that of another case or seed (digest "
            f"{record['digest']}, this case {session.case.digest('pack')}); leave the option out"
        )
    check_files(source / "pack", record, START_OVER)
    with session.timed("pack"):
        shutil.copytree(
            source / "pack",
            session.path / "pack",
            ignore=shutil.ignore_patterns(LOCK, Path(RECORDS["pack"]).name),
            dirs_exist_ok=True,
        )
    nothing = ("liggghts_s", "liggghts_cpu_s")
    own = {
        "cpu_seconds": session.cpu_seconds["pack"],
        "seconds": session.seconds["pack"],
        "taken_from": str(source),
        "made_in_seconds": record["seconds"],
        "runs": [row | {"seconds": 0.0, "cpu_seconds": 0.0} for row in record["runs"]],
        "attempts": [row | dict.fromkeys(nothing, 0.0) for row in record["attempts"]],
    }
    session.finish("pack", record | own)
