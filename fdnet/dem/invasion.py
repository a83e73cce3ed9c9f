"""The invasion: fines driven into the pack until plugged, with a checkpoint after every chunk of steps."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.atomic import write_text
from fdnet.case import Case
from fdnet.contacts import max_overlap, touching_pairs
from fdnet.dem.deck import Deck, LeftOut, number, render_text
from fdnet.dem.dump import COLUMNS, FORMAT, read_frame
from fdnet.dem.liggghts import Binary, Run, run_deck
from fdnet.dem.packing import snapshot_of
from fdnet.dem.scene import contact_variables, header_variables, wall_variables, write_data
from fdnet.dem.supply import front_of, place_fines
from fdnet.errors import CaseError, DumpError, LiggghtsError
from fdnet.scales import Scales
from fdnet.snapshot import Array, Kind, Snapshot

HISTORY = "history.csv"
_HISTORY_HEADER = "chunk,step,upstream,invaded,passed,removed_upstream,most_crossed,quiet"


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """Counts after one chunk. `upstream` includes `removed_upstream`; `most_crossed` the most crossings so far."""

    chunk: int
    step: int
    upstream: int
    invaded: int
    passed: int
    removed_upstream: int
    most_crossed: int
    quiet: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Invasion:
    """A finished invasion: the last state (grains and fines, fines upstream included) and how it ended."""

    damaged: Snapshot
    history: tuple[Checkpoint, ...]
    stop_reason: str
    max_overlap: float
    step_s: float
    left_out: tuple[LeftOut, ...]
    warnings: tuple[str, ...]
    runs: tuple[Run, ...]


def invade(case: Case, scales: Scales, grains: Snapshot, folder: Path, *, binary: Binary, ranks: int = 1,
           follow: Callable[[str], None] | None = None, timeout: float | None = None) -> Invasion:
    """Drive the fines in; continues from the last whole checkpoint when `folder` holds one.

    Raises LiggghtsError when a run fails or fines are lost, CaseError when the fines cannot be placed.
    """
    (folder / "post").mkdir(parents=True, exist_ok=True)
    last = last_checkpoint(folder, case, grains)
    deck = _prepare(case, scales, grains, folder, last, ranks)
    runs = []
    if not _over(case, scales, last):
        name = "in.invade" if last is None else "in.invade.resume"
        keeper = _Keeper(folder, follow)
        runs.append(run_deck(folder, name, binary=binary, ranks=ranks, follow=keeper, timeout=timeout))
    history = read_history(folder)
    damaged = state_at(folder, history[-1], case, scales, grains)
    _check_counts(folder, history[-1], damaged, scales.supplied_count)
    overlaps = [max_overlap(state_at(folder, row, case, scales, grains), case.periodic, only_fines=True) for row in history]
    reason, warnings = _ending(case, scales, history)
    return Invasion(damaged=damaged, history=history, stop_reason=reason, max_overlap=max(overlaps),
                    step_s=scales.time_step, left_out=deck.left_out, warnings=warnings, runs=tuple(runs))


class _Keeper:
    """Follows the screen: keeps only the two newest restarts, passes every line on."""

    def __init__(self, folder: Path, follow: Callable[[str], None] | None) -> None:
        self.folder, self.follow = folder, follow

    def __call__(self, line: str) -> None:
        if line.startswith("FDNET checkpoint"):
            files = sorted((self.folder / "post").glob("invade_*.restart"), key=_step_of)
            for old in files[:-2]:
                old.unlink(missing_ok=True)
        if self.follow:
            self.follow(line)


def _step_of(path: Path) -> int:
    return int(path.stem.rsplit("_", 1)[1])


def chunks_of(scales: Scales) -> int:
    """Number of chunks until the cap."""
    return max(1, math.ceil(scales.cap_time / (scales.checkpoint_steps * scales.time_step) - 1e-9))


def quiet_chunks(scales: Scales) -> int:
    """Chunks without a crossing that make the plug time."""
    return max(1, math.ceil(scales.plug_time / (scales.checkpoint_steps * scales.time_step) - 1e-9))


def empty_chunks(case: Case, scales: Scales) -> int:
    """Chunks without a fine leaving once the slab is empty: twice the fluid's passage, at least the plug time."""
    passage = 2 * case.size_m[0] / scales.interstitial_velocity
    return max(quiet_chunks(scales), math.ceil(passage / (scales.checkpoint_steps * scales.time_step)))


def _quiet_enough(case: Case, scales: Scales, row: Checkpoint) -> bool:
    return row.quiet >= (quiet_chunks(scales) if row.upstream > 0 else empty_chunks(case, scales))


def _over(case: Case, scales: Scales, last: Checkpoint | None) -> bool:
    if last is None:
        return False
    return (case.run.duration_ms is None and _quiet_enough(case, scales, last)) or last.chunk >= chunks_of(scales)


def _prepare(case: Case, scales: Scales, grains: Snapshot, folder: Path, last: Checkpoint | None, ranks: int) -> Deck:
    if last is None:
        for stale in [folder / HISTORY, *(folder / "post").glob("invade_*")]:
            stale.unlink(missing_ok=True)
        deck = write_invade_inputs(case, scales, grains, folder, ranks=ranks)
        write_text(folder / HISTORY, _HISTORY_HEADER + "\n")
        return deck
    rows = [row for row in read_history(folder) if row.step <= last.step]
    write_text(folder / HISTORY, "\n".join([_HISTORY_HEADER, *(_csv(row) for row in rows)]) + "\n")
    for path in (folder / "post").glob("invade_*"):
        if _step_of(path) > last.step:
            path.unlink()
    deck = render_invade(case, scales, grains, ranks=ranks, resume=last)
    write_text(folder / "in.invade.resume", deck.text)
    return deck


def _csv(row: Checkpoint) -> str:
    return ",".join(str(getattr(row, name)) for name in _HISTORY_HEADER.split(","))


def write_invade_inputs(case: Case, scales: Scales, grains: Snapshot, folder: Path, *, ranks: int = 1) -> Deck:
    """Write in.invade and invade.data (grains and the slab of fines) into `folder`."""
    assert case.fines is not None
    spheres = grains.joined(place_fines(case, scales, grains))
    pairs, _ = touching_pairs(spheres, case.periodic)
    if np.any(spheres.kind[pairs] == Kind.FINE):
        raise CaseError("fines: a fine would start in contact; this is an fdnet fault, please report the case and seed")
    density = np.where(spheres.kind == Kind.GRAIN, case.grains.density_kg_m3, case.fines.density_kg_m3)
    write_data(folder / "invade.data", spheres, bounds=_bounds(case, scales, grains), density=density, types=3)
    deck = render_invade(case, scales, grains, ranks=ranks)
    write_text(folder / "in.invade", deck.text)
    return deck


def _margin(case: Case, scales: Scales) -> float:
    """How far a fine could go in one chunk at twice the fluid's velocity, plus two diameters."""
    assert case.fines is not None
    travel = 2 * scales.interstitial_velocity * scales.checkpoint_steps * scales.time_step
    return travel + 4 * case.fines.radius_range_m[1]


def _bounds(case: Case, scales: Scales, grains: Snapshot) -> Array:
    """The simulation box (3, 2): it extends past the outlet and upstream of the slab, where fines are removed."""
    assert case.fines is not None
    start = front_of(grains) - 2 * case.fines.radius_range_m[1] - scales.slab_length
    margin = _margin(case, scales)
    size = case.size_m
    return np.array([[start - 2 * margin, size[0] + 2 * margin], [0.0, size[1]], [0.0, size[2]]])


def render_invade(case: Case, scales: Scales, grains: Snapshot, *, ranks: int = 1, resume: Checkpoint | None = None) -> Deck:
    """The invasion deck, fresh or continued from a checkpoint's restart."""
    assert case.fines is not None
    mobile = case.grains.motion == "mobile"
    frictional = [c for name, c in scales.contacts.items() if "fine" in name or mobile]
    friction = any(c.friction > 0 for c in frictional)
    wall_friction = any(c.friction > 0 for c in frictional if "wall" in c.pair)
    gravity, left_out = _gravity(case, scales)
    left_out += _left_out(case, friction=friction, ranks=ranks)
    text = render_text("invade.in.j2", header_variables(case, "invade", left_out, ranks) | {
        "resume": {"restart": f"post/invade_{resume.step}.restart"} if resume else None,
        "skin": number(case.fines.radius_range_m[0]),
        "contacts": contact_variables(case, scales, "invade", friction=friction), "time_step": number(scales.time_step),
        "walls": wall_variables(case, "invade", friction=wall_friction), "fixed_grains": not mobile,
        "moving": "all" if mobile else "fines", "gravity": gravity, "dump_group": "all" if mobile else "fines",
        "start_velocity": number(scales.upstream_velocity), "fluid_velocity": number(scales.interstitial_velocity),
        "drag": _drag(case, scales), "regions": _regions(case, scales, grains),
        "thermo_steps": max(1, scales.checkpoint_steps // 4), "quiet_checkpoints": quiet_chunks(scales),
        "empty_checkpoints": empty_chunks(case, scales),
        "start": _start(resume), "chunks": chunks_of(scales), "chunk_steps": scales.checkpoint_steps,
        "stop_when_plugged": case.run.duration_ms is None, "dump_columns": COLUMNS, "dump_format": FORMAT})
    return Deck(text=text, stage="invade", digest=case.digest("invade"), left_out=tuple(left_out))


def _start(resume: Checkpoint | None) -> dict[str, int]:
    if resume is None:
        return {"chunk": 1, "passed": 0, "behind": 0, "most": 0, "quiet": 0}
    return {"chunk": resume.chunk + 1, "passed": resume.passed, "behind": resume.removed_upstream,
            "most": resume.most_crossed, "quiet": resume.quiet}


def _drag(case: Case, scales: Scales) -> dict[str, Any]:
    coefficient = 6 * math.pi * case.fluid.viscosity_cP * 1e-3 * case.drag.multiplier
    slower = scales.interstitial_velocity - scales.upstream_velocity
    fluid = f"(f_uf[1]-(x<0.0)*{number(slower)})" if slower else "f_uf[1]"
    return {"coefficient": number(coefficient), "fluid_x": fluid, "hold_steps": scales.hold_steps if scales.hold_steps > 1 else 0}


def _regions(case: Case, scales: Scales, grains: Snapshot) -> dict[str, str]:
    bounds, length, margin = _bounds(case, scales, grains), case.size_m[0], _margin(case, scales)
    behind = bounds[0, 0] + margin
    sides = "INF INF INF INF"
    return {"specimen": f"0.0 {number(np.nextafter(length, 0))} {sides}",
            "upstream": f"{number(np.nextafter(behind, 0))} {number(-5e-324)} {sides}",
            "beyond": f"{number(length)} INF {sides}", "behind": f"INF {number(behind)} {sides}"}


def _gravity(case: Case, scales: Scales) -> tuple[dict[str, Any] | None, list[LeftOut]]:
    mode, vector = case.gravity.mode, case.gravity.acceleration_m_s2
    magnitude = math.hypot(*vector)
    if mode == "off" or magnitude == 0:
        return None, [LeftOut(what="gravity and buoyancy", why="switched off")]
    if mode == "auto" and scales.gravity_over_drag < case.gravity.negligible_below:
        return None, [LeftOut(what="gravity and buoyancy",
                              why=f"gravity is {scales.gravity_over_drag:.1e} of the drag, below {case.gravity.negligible_below:g}")]
    if not case.gravity.buoyancy:
        return _pull(vector, 1.0), [LeftOut(what="buoyancy", why="switched off")]
    along = [axis for axis in range(3) if vector[axis] != 0]
    if len(along) > 1:
        raise CaseError(f"gravity.acceleration_m_s2: {list(vector)}: LIGGGHTS's buoyancy needs gravity along one axis; "
                        "turn the vector, or set gravity.buoyancy = false")
    if vector[along[0]] > 0:
        raise CaseError(f"gravity.acceleration_m_s2: {list(vector)}: LIGGGHTS's buoyancy needs gravity pointing down its "
                        "axis (negative); turn the vector, or set gravity.buoyancy = false")
    buoyancy = {"density": number(case.fluid.density_kg_m3), "axis": "xyz"[along[0]], "level": "1.0"}
    return _pull(vector, 1.0) | {"buoyancy": buoyancy}, []


def _pull(vector: tuple[float, float, float], factor: float) -> dict[str, Any]:
    magnitude = math.hypot(*vector)
    return {"magnitude": number(factor * magnitude), "direction": " ".join(number(c / magnitude) for c in vector),
            "buoyancy": None}


def _left_out(case: Case, *, friction: bool, ranks: int) -> list[LeftOut]:
    found = []
    if case.grains.motion == "fixed":
        found.append(LeftOut(what="contacts between grains, end planes", why="grains are fixed"))
    if not friction:
        found.append(LeftOut(what="tangential history", why="no pair has friction"))
    if case.box.sides == "periodic":
        found.append(LeftOut(what="side walls", why="sides are periodic"))
    if ranks == 1:
        found.append(LeftOut(what="MPI processor grid", why="one rank"))
    return found


def read_history(folder: Path) -> tuple[Checkpoint, ...]:
    """All checkpoints recorded in history.csv; an unfinished last line is left out. Raises LiggghtsError if there are none."""
    try:
        text = (folder / HISTORY).read_text(errors="replace")
    except OSError:
        text = ""
    rows = []
    for line in text[: text.rfind("\n") + 1].splitlines()[1:]:
        parts = line.split(",")
        if len(parts) == len(_HISTORY_HEADER.split(",")) and all(_is_count(p) for p in parts):
            rows.append(Checkpoint(**{n: int(float(p)) for n, p in zip(_HISTORY_HEADER.split(","), parts, strict=True)}))
    if not rows:
        raise LiggghtsError(f"{folder / HISTORY}: no checkpoint recorded; see {folder}/screen.txt, run again")
    return tuple(rows)


def _is_count(text: str) -> bool:
    try:
        return float(text) == int(float(text))
    except (ValueError, OverflowError):
        return False


def last_checkpoint(folder: Path, case: Case, grains: Snapshot) -> Checkpoint | None:
    """The newest checkpoint whose dump and restart are whole; None when there is none."""
    try:
        rows = read_history(folder)
    except LiggghtsError:
        return None
    for row in reversed(rows):
        if _whole(folder, row, len(grains)):
            return row
    return None


def _whole(folder: Path, row: Checkpoint, grain_number: int) -> bool:
    restart = folder / "post" / f"invade_{row.step}.restart"
    try:
        frame = read_frame(folder / "post" / f"invade_{row.step}.dump")
        size = restart.stat().st_size
    except (DumpError, OSError):
        return False
    fines = int(np.count_nonzero(frame.column("type") == Kind.FINE))
    remaining = row.upstream - row.removed_upstream + row.invaded
    return fines == remaining and size > 100 * (fines + grain_number)


def state_at(folder: Path, row: Checkpoint, case: Case, scales: Scales, grains: Snapshot) -> Snapshot:
    """Grains and remaining fines at a checkpoint. Raises DumpError when its dump is missing or cut."""
    frame = read_frame(folder / "post" / f"invade_{row.step}.dump")
    moved = snapshot_of(frame, case, time_s=row.step * scales.time_step)
    return moved if case.grains.motion == "mobile" else grains.joined(moved)


def _check_counts(folder: Path, row: Checkpoint, damaged: Snapshot, supplied: int) -> None:
    fines, length = damaged.fines(), damaged.box[0, 1]
    inside = int(np.count_nonzero((fines.position[:, 0] >= 0) & (fines.position[:, 0] < length)))
    upstream = int(np.count_nonzero(fines.position[:, 0] < 0))
    if inside != row.invaded or upstream != row.upstream - row.removed_upstream:
        raise LiggghtsError(f"{folder}/post/invade_{row.step}.dump: {inside} fines inside and {upstream} upstream, expected "
                            f"{row.invaded} and {row.upstream - row.removed_upstream} as in {HISTORY}")
    if row.upstream + row.invaded + row.passed != supplied:
        raise LiggghtsError(f"{folder / HISTORY}: step {row.step}: upstream {row.upstream} + invaded {row.invaded} + passed "
                            f"{row.passed} is not the {supplied} supplied: fines were lost; lower run.time_step_factor")


def _ending(case: Case, scales: Scales, history: tuple[Checkpoint, ...]) -> tuple[str, tuple[str, ...]]:
    """stop_reason and warnings. An empty slab decides nothing about plugging, so it is its own reason."""
    last = history[-1]
    warnings = []
    if case.run.duration_ms is not None:
        reason = "duration"
    elif _quiet_enough(case, scales, last):
        reason = "plugged" if last.upstream > 0 else "supply_exhausted"
    else:
        reason = "cap"
        warnings.append(f"invasion stopped at its cap of {1e3 * scales.cap_time:.3g} ms, fines still crossed the face: raise "
                        "run.cap_ms")
    if last.upstream == 0:
        warnings.append("all fines supplied entered the specimen: the end was decided by an empty slab, raise fines.count or "
                        "fines.slab_mm")
    before = history[-min(len(history), quiet_chunks(scales) + 1)]
    if reason == "plugged" and last.passed > before.passed:
        warnings.append(f"the face was plugged, but {last.passed - before.passed} fines still left through the outlet meanwhile: "
                        "raise run.plug_time_ms to follow them")
    if last.removed_upstream:
        warnings.append(f"{last.removed_upstream} fines bounced out upstream and were removed")
    return reason, tuple(warnings)
