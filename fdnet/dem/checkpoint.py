"""Checkpoints of an invasion: what is kept, its digests, overlaps and updates of the flow.

Digests of the files that LIGGGHTS wrote, and the record that a checkpoint keeps of its own.
"""

import hashlib
import json
import math
import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.dem.deck import LeftOut, number, render_text, snapshot_of
from fdnet.dem.supply import Batches, batches_of
from fdnet.errors import CaseError, Doubt, DumpError, LiggghtsError, explained
from fdnet.files import write_text
from fdnet.names import SECTION_ARCHIE
from fdnet.scales.clock import arrival_time
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.dump import read_frame
from fdnet.spheres.geometry import groups_apart, max_overlap
from fdnet.spheres.snapshot import Snapshot

_NAME = re.compile(r"invade_(\d{1,18})\.(dump|restart|unreadable|record)")


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckpointRecord:
    """What a checkpoint was when its files were whole.

    Attributes:
        case: digest of the case's invasion.
        ranks: MPI ranks of LIGGGHTS.
        row: line of history.csv.
        overlap: digest of the rows of overlap.csv since the checkpoint before.
        dump: digest of the dump.
        restart: digest of the restart.
        updates: digest of the updates of a coupled invasion before the checkpoint; "" without any.
    """

    case: str
    ranks: int
    row: str
    overlap: str
    dump: str
    restart: str
    updates: str = ""


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits. Raises OSError when it cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def checkpoint_files(folder: Path) -> Iterator[tuple[int, Path]]:
    """Step and path of each file of a checkpoint in `folder`/post; other files are passed over."""
    for path in sorted((folder / "post").glob("invade_*")):
        name = _NAME.fullmatch(path.name)
        if name:
            yield int(name[1]), path


def store_record(folder: Path, step: int, record: CheckpointRecord) -> None:
    """Write the record of a checkpoint, whole or not at all."""
    text = json.dumps(asdict(record), indent=1) + "\n"
    write_text(folder / "post" / f"invade_{step}.record", text)


def read_record(folder: Path, step: int) -> CheckpointRecord | None:
    """The record of a checkpoint; None where there is none, or none that can be understood."""
    path = folder / "post" / f"invade_{step}.record"
    try:
        record = CheckpointRecord(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, RecursionError):
        return None
    texts = (
        record.case,
        record.row,
        record.overlap,
        record.dump,
        record.restart,
        record.updates,
    )
    sound = type(record.ranks) is int and all(isinstance(text, str) for text in texts)
    return record if sound and record.row.split(",")[1:2] == [str(step)] else None


def dump_is_changed(folder: Path, step: int) -> bool:
    """Whether the dump of a checkpoint is another one than was recorded.

    False where nothing was recorded. Raises OSError when the dump cannot be read.
    """
    record = read_record(folder, step)
    return (
        record is not None and file_digest(folder / "post" / f"invade_{step}.dump") != record.dump
    )


# ------------------------------------------------------------------------------------------------
# Checkpoints of an invasion: the counts after each chunk of steps, and their states on disk.


HISTORY = "history.csv"
HISTORY_HEADER = "chunk,step,upstream,invaded,passed,removed_upstream,most_crossed,quiet"


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """Numbers of fines after one chunk of steps.

    Attributes:
        chunk: number of the chunk, from 1.
        step: last step of the chunk.
        upstream: fines upstream of the face, with those that were removed there.
        invaded: fines inside the specimen.
        passed: fines that have left through the outlet.
        removed_upstream: fines that bounced out upstream and were removed.
        most_crossed: crossings when the clock of the stop rule last started.
        quiet: chunks since then.
    """

    chunk: int
    step: int
    upstream: int
    invaded: int
    passed: int
    removed_upstream: int
    most_crossed: int
    quiet: int


def chunks_of(case: InvasionCase, scales: InvasionScales) -> int:
    """Number of chunks of the whole run.

    With a duration it is the number that comes nearest to it, so that chunks rounded to whole
    steps never make one too many. Otherwise it is enough to reach the cap.
    """
    chunks = scales.cap_time / (scales.checkpoint_steps * scales.time_step)
    return max(1, round(chunks) if case.run.duration_s is not None else math.ceil(chunks - 1e-9))


def quiet_chunks(scales: InvasionScales) -> int:
    """Chunks without a crossing that make the plug time."""
    return max(
        1, math.ceil(scales.plug_time / (scales.checkpoint_steps * scales.time_step) - 1e-9)
    )


def plug_allowance(case: InvasionCase, scales: InvasionScales) -> int:
    """Fines that may cross the face within the plug time while it counts as plugged.

    They are `run.plug_rate` of those that the undisturbed suspension would bring.
    """
    return math.floor(
        case.run.plug_rate * scales.plug_time / arrival_time(case, scales.upstream_velocity)
    )


def empty_chunks(case: InvasionCase, scales: InvasionScales) -> int:
    """Chunks without a fine that leaves which end an invasion once the slab is empty.

    They take twice the passage of the fluid through the specimen, at least the plug time.
    """
    passage = 2 * case.size_m[0] / scales.drive_velocity
    return max(
        quiet_chunks(scales), math.ceil(passage / (scales.checkpoint_steps * scales.time_step))
    )


def quiet_enough(case: InvasionCase, scales: InvasionScales, row: Checkpoint) -> bool:
    """Whether the stop rule holds at this checkpoint."""
    waiting = row.upstream - row.removed_upstream
    return row.quiet >= (quiet_chunks(scales) if waiting > 0 else empty_chunks(case, scales))


def csv_row(row: Checkpoint) -> str:
    """The checkpoint as a line of history.csv."""
    return ",".join(str(getattr(row, name)) for name in HISTORY_HEADER.split(","))


def entered_by(case: InvasionCase, batches: Batches, row: Checkpoint) -> int:
    """Batches of fines that had entered by a checkpoint.

    In mud that the deposit slows down, their number follows from that of the fines.
    """
    if case.drag.slowed:
        return batches.entered_with(row.upstream + row.invaded + row.passed)
    return batches.entered_at(row.chunk)


def read_history(folder: Path) -> tuple[Checkpoint, ...]:
    """All checkpoints of history.csv, without an unfinished last line.

    Raises LiggghtsError when it holds none.
    """
    try:
        text = (folder / HISTORY).read_text(errors="replace")
    except OSError:
        text = ""
    names = HISTORY_HEADER.split(",")
    lines = [line.split(",") for line in text[: text.rfind("\n") + 1].splitlines()[1:]]
    rows = [
        Checkpoint(**{name: int(float(count)) for name, count in zip(names, line, strict=True)})
        for line in lines
        if len(line) == len(names) and all(_is_count(count) for count in line)
    ]
    if not rows:
        raise LiggghtsError(
            f"{folder / HISTORY}: no checkpoint recorded; see {folder}/screen.txt, run again"
        )
    return tuple(rows)


def has_history(folder: Path) -> bool:
    """Whether history.csv holds any whole line below its title."""
    path = folder / HISTORY
    return path.exists() and path.read_text(errors="replace").count("\n") > 1


def _is_count(text: str) -> bool:
    try:
        return float(text) == int(float(text))
    except (ValueError, OverflowError):
        return False


def state_at(
    folder: Path, row: Checkpoint, case: InvasionCase, scales: InvasionScales, grains: Snapshot
) -> Snapshot:
    """Grains and remaining fines at a checkpoint.

    Raises DumpError when its dump is missing or cut.
    """
    frame = read_frame(folder / "post" / f"invade_{row.step}.dump")
    moved = snapshot_of(frame, case, time_s=row.step * scales.time_step)
    return moved if case.grains.motion == "mobile" else grains.joined(moved)


def check_counts(folder: Path, row: Checkpoint, damaged: Snapshot, supplied: int) -> None:
    """Raises LiggghtsError when a state does not hold the fines that its checkpoint counts."""
    fines, length = damaged.fines(), damaged.box[0, 1]
    inside = int(np.count_nonzero((fines.position[:, 0] >= 0) & (fines.position[:, 0] < length)))
    upstream = int(np.count_nonzero(fines.position[:, 0] < 0))
    if inside != row.invaded or upstream != row.upstream - row.removed_upstream:
        raise LiggghtsError(
            f"{folder}/post/invade_{row.step}.dump: {inside} fines inside and {upstream} "
            f"upstream, expected {row.invaded} and {row.upstream - row.removed_upstream} as in "
            f"{HISTORY}"
        )
    if row.upstream + row.invaded + row.passed != supplied:
        raise LiggghtsError(
            f"{folder / HISTORY}: step {row.step}: upstream {row.upstream} + invaded "
            f"{row.invaded} + passed {row.passed} is not the {supplied} supplied: fines were "
            "lost; lower run.time_step_factor"
        )


def readable_states(
    folder: Path,
    history: Sequence[Checkpoint],
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
) -> Iterator[tuple[Checkpoint, Snapshot]]:
    """The states of the checkpoints in `history`, checked against its counts.

    Dumps that are missing, cut or changed are passed over, except the last one, which raises
    DumpError. Raises LiggghtsError when counts disagree.
    """
    batches = batches_of(case, scales)
    for row in history:
        try:
            state = state_at(folder, row, case, scales, grains)
            _refuse_changed_dump(folder, row)
        except DumpError:
            if row == history[-1]:
                raise
            continue
        check_counts(folder, row, state, batches.supplied(entered_by(case, batches, row)))
        yield row, state


def _refuse_changed_dump(folder: Path, row: Checkpoint) -> None:
    if dump_is_changed(folder, row.step):
        raise DumpError(
            f"{folder}/post/invade_{row.step}.dump: is not the dump that the run wrote; put it "
            "back, or start over with --force"
        )


# ------------------------------------------------------------------------------------------------
# The overlap of fines, watched while an invasion runs.
#
# The deck measures it every few steps, and the dumps of the checkpoints give it as well.


WATCH = "overlap.csv"
GRAINS_APART = "grains_apart.txt"
"""File with the group of each grain; no two grains of a group touch."""

WATCHED = "watched.in"
"""File by which a coupled deck changes the grains that are watched."""

_MOST_DIGITS = 19
EVERY, MOST_ROWS = 50, 200
"""Steps between two measurements by the deck, and most measurements in a chunk. Each costs about a
fifth of a step with contacts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deepest:
    """The largest overlap of a fine with another sphere that was seen.

    Attributes:
        step: when it was measured.
        fraction: over the smaller diameter.
    """

    step: int
    fraction: float


def is_watched(case: InvasionCase) -> bool:
    """Whether the deck can watch the overlap of fines.

    LIGGGHTS takes the largest overlap, in m, of all pairs of a group. So it must be known which
    grains touch each other, and fines must have one diameter.
    """
    return case.grains.motion == "fixed" and case.fines.one_size


def watch_variables(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot
) -> dict[str, Any] | None:
    """Variables of `_overlap.in.j2`; None where the dumps alone must do."""
    if not is_watched(case):
        return None
    turns = int(groups_apart(grains, case.periodic).max())
    return {
        "every": max(EVERY, scales.checkpoint_steps // MOST_ROWS),
        "diameter": number(2 * case.fines.radius_range_m[1]),
        "file": WATCH,
        "groups": range(1, turns + 1),
        "turns": turns,
        "grains": GRAINS_APART,
    }


def watch_left_out(case: InvasionCase, *, packed: bool) -> list[LeftOut]:
    """Why a deck does not watch the overlap, for grains that are `packed` or not yet."""
    if is_watched(case) and packed:
        return []
    if case.grains.motion == "mobile":
        why = "pairs of grains overlap too"
    elif not case.fines.one_size:
        why = "fines are of unequal size"
    else:
        why = "which grains touch is known once they are packed"
    return [LeftOut(what="overlap between checkpoints", why=why)]


def write_watch_parts(case: InvasionCase, grains: Snapshot, folder: Path) -> None:
    """Write the files by which a deck watches the overlap; nothing where it does not."""
    if not is_watched(case):
        return
    groups = groups_apart(grains, case.periodic)
    rows = [f"{grain:.0f} {group}" for grain, group in zip(grains.id, groups, strict=True)]
    write_text(folder / GRAINS_APART, "\n".join([str(len(rows)), *rows, ""]))
    if case.drag.coupled:
        write_text(folder / WATCHED, render_text("watched.in.j2", {}))


def read_watch(folder: Path) -> Iterator[Deepest]:
    """What the deck measured; nothing where it did not watch.

    A half-written last line and the titles are passed over.
    """
    try:
        text = (folder / WATCH).read_text(errors="replace")
    except OSError:
        return
    yield from watch_rows(text)


def watch_rows(text: str) -> Iterator[Deepest]:
    """The whole lines of overlap.csv; titles and other lines are passed over."""
    for line in text[: text.rfind("\n") + 1].splitlines():
        step, comma, fraction = line.partition(",")
        if comma and step.isdecimal() and len(step) < _MOST_DIGITS:
            yield Deepest(step=int(step), fraction=max(0.0, _number(fraction)))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def cut_watch(folder: Path, last_step: int) -> None:
    """Remove what was measured after `last_step`, from which the run goes on."""
    if (folder / WATCH).exists():
        rows = [
            f"{row.step},{row.fraction!r}\n" for row in read_watch(folder) if row.step <= last_step
        ]
        write_text(folder / WATCH, "".join(rows))


def overlap_in(case: Case, state: Snapshot) -> Deepest:
    """The largest overlap of a fine in a state."""
    return Deepest(step=state.step, fraction=max_overlap(state, case.periodic, only_fines=True))


def deepest_of(seen: Iterable[Deepest]) -> Deepest:
    """The largest of several, the first one among equals; step 0 and 0.0 if there is none."""
    return max(seen, key=lambda row: row.fraction, default=Deepest(step=0, fraction=0.0))


def refuse_overlap(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    folder: Path,
    *,
    history: Sequence[Checkpoint],
    last: Checkpoint,
) -> None:
    """Raises LiggghtsError when a fine overlapped too much and `run.on_overlap` is "stop".

    It looks at what the deck measured up to the checkpoint `last`, and at the dumps of `history`.
    Everything up to the checkpoint stays on disk.
    """
    if case.run.on_overlap != "stop":
        return
    seen = [row for row in read_watch(folder) if row.step <= last.step]
    for _, state in readable_states(folder, history, case, scales, grains):
        seen.append(overlap_in(case, state))
    deepest = deepest_of(seen)
    if deepest.fraction > case.run.max_overlap:
        raise LiggghtsError(
            f"{folder}: {overlap_text(case, deepest)}; stopped at checkpoint {last.chunk} (step "
            f"{last.step}) because of run.on_overlap = 'stop'; raise run.stiffness_N_m and start "
            "over with --force, or go on from here with --resume --set run.on_overlap=warn (or a "
            "larger run.max_overlap)"
        )


def overlap_text(case: Case, deepest: Deepest) -> str:
    """The overlap and its limit, in words."""
    return (
        f"a fine overlapped by {100 * deepest.fraction:.3g} % of the smaller diameter at step "
        f"{deepest.step} (limit run.max_overlap, {100 * case.run.max_overlap:.3g} %)"
    )


# ------------------------------------------------------------------------------------------------
# The record of updates of a coupled invasion, updates.csv: one row for each.


UPDATES = "updates.csv"


class Updates:
    """The rows of updates.csv; new ones are appended to the file at once.

    Every number is written so that it is read back exactly.
    """

    def __init__(self, folder: Path, names: Sequence[str], *, upto: int) -> None:
        """Keep the rows before step `upto` of an earlier session, or begin a file of `names`."""
        self.path, self.names = folder / UPDATES, ("step", "time_s", *names)
        rows = read_updates(folder) if upto > 0 else []
        rows = [row for row in rows if row["step"] < upto]
        self.first: Mapping[str, float] | None = rows[0] if rows else None
        self.last: Mapping[str, float] | None = rows[-1] if rows else None
        lines = [",".join(self.names), *(self._line(row) for row in rows)]
        write_text(self.path, "\n".join(lines) + "\n")

    def add(self, step: int, time: float, measures: Mapping[str, float]) -> None:
        """Append the row of the update at `step` and `time` s."""
        row = {"step": float(step), "time_s": time, **measures}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(self._line(row) + "\n")
        self.first, self.last = self.first or row, row

    def _line(self, row: Mapping[str, float]) -> str:
        return ",".join(repr(float(row[name])) for name in self.names)


def read_updates(folder: Path) -> list[dict[str, float]]:
    """The whole rows of updates.csv; none without the file.

    Raises LiggghtsError where a row is not one number for each column.
    """
    try:
        text = (folder / UPDATES).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    title, *lines = text[: text.rfind("\n") + 1].splitlines() or [""]
    names = title.split(",")
    try:
        return [
            {name: float(value) for name, value in zip(names, line.split(","), strict=True)}
            for line in lines
        ]
    except ValueError as error:
        raise LiggghtsError(
            f"{folder / UPDATES}: {error}; the file was changed, start over with --force"
        ) from error


def updates_digest(folder: Path, step: int) -> str:
    """SHA-256 of the updates before `step`, in hexadecimal digits; "" without any."""
    try:
        rows = [row for row in read_updates(folder) if row["step"] < step]
    except (LiggghtsError, KeyError):
        return "unreadable"
    text = "".join(f"{sorted(row.items())!r}\n" for row in rows)
    return hashlib.sha256(text.encode()).hexdigest() if rows else ""


def rate_is_low(folder: Path, case: InvasionCase, step: int) -> bool:
    """Whether the rate before `step` was below `run.stop_rate` of the first one."""
    if case.run.stop_rate is None:
        return False
    last = _last_before(folder, step)
    return last is not None and last["rate_over_initial"] < case.run.stop_rate


def volume_has_passed(folder: Path, case: InvasionCase, scales: InvasionScales, step: int) -> bool:
    """Whether the fluid that passed before `step` is `run.stop_pore_volumes` or more."""
    if case.run.stop_pore_volumes is None:
        return False
    last, pores = _last_before(folder, step), scales.porosity * math.prod(case.size_m)
    return last is not None and last["filtrate_m3"] >= case.run.stop_pore_volumes * pores


def _last_before(folder: Path, step: int) -> Mapping[str, float] | None:
    """The last update before `step`, if there is one."""
    rows = [row for row in read_updates(folder) if row["step"] < step]
    return rows[-1] if rows else None


# ------------------------------------------------------------------------------------------------
# Records of checkpoints: digests of what LIGGGHTS had written when a checkpoint was whole.
#
# A later session continues from a checkpoint only when its files still match its record.


FOLLOWED = (
    f"{SECTION_ARCHIE} between nodes, fines placed, sections a third apart, solved at a fifth, "
    "drag at the new rate, field to 0.15, fluid on the way ahead, "
    "standing by the velocity given, each fine of its own density, edges of the box resolved"
)
"""How the fluid's forces are computed where the flow follows the deposit. Change these words when
that changes: then a run that an earlier version left unfinished starts over."""
DOUBTS = "doubts.txt"
"""Warnings of the sessions that went on from an earlier checkpoint than they could."""


def overlap_digest(rows: Sequence[Deepest]) -> str:
    """SHA-256 of measured overlaps, in hexadecimal digits."""
    text = "".join(f"{row.step},{row.fraction!r}\n" for row in rows)
    return hashlib.sha256(text.encode()).hexdigest()


def case_digest(case: InvasionCase) -> str:
    """What checkpoints of a case depend on: its digest, and how a flow that follows is made."""
    digest = case.digest("invade")
    return f"{digest} {FOLLOWED}" if case.drag.field == "network" else digest


def write_record(
    folder: Path, row: Checkpoint, case: InvasionCase, *, ranks: int, overlaps: Sequence[Deepest]
) -> None:
    """Record a checkpoint whose files are whole; `overlaps` are those since the one before."""
    post = folder / "post"
    record = CheckpointRecord(
        case=case_digest(case),
        ranks=ranks,
        row=csv_row(row),
        overlap=overlap_digest(overlaps),
        dump=file_digest(post / f"invade_{row.step}.dump"),
        restart=file_digest(post / f"invade_{row.step}.restart"),
        updates=updates_digest(folder, row.step),
    )
    store_record(folder, row.step, record)


def recorded_rows(folder: Path, case: InvasionCase) -> list[tuple[Checkpoint, CheckpointRecord]]:
    """The checkpoints from the first on whose rows and watched overlaps match their records.

    Raises LiggghtsError where history.csv lacks a row, or holds another one, than was recorded.
    """
    try:
        rows = read_history(folder)
    except LiggghtsError:
        return []
    _refuse_missing_rows(folder, rows, case)
    digest, result = case_digest(case), []
    for row, overlaps in zip(rows, _parts(read_watch(folder), rows), strict=False):
        record = read_record(folder, row.step)
        if record is None or record.case != digest or record.overlap != overlap_digest(overlaps):
            break
        result.append((row, record))
    return result


def _parts(seen: Iterable[Deepest], rows: Sequence[Checkpoint]) -> list[list[Deepest]]:
    """What was measured up to each checkpoint since the one before, and after the last one."""
    steps = [row.step for row in rows]
    parts: list[list[Deepest]] = [[] for _ in range(len(steps) + 1)]
    for item in seen:
        parts[bisect_left(steps, item.step)].append(item)
    return parts


def _refuse_missing_rows(folder: Path, rows: Sequence[Checkpoint], case: InvasionCase) -> None:
    lines = {row.step: csv_row(row) for row in rows}
    for step, path in checkpoint_files(folder):
        record = read_record(folder, step) if path.suffix == ".record" else None
        if record is None or step > rows[-1].step or record.case != case_digest(case):
            continue
        if lines.get(step) != record.row:
            raise LiggghtsError(
                f"{folder / HISTORY}: the row of step {step} is {lines.get(step, 'missing')!r}, "
                f"expected {record.row!r} as {path.name} has it; put the file back, or start "
                "over with --force"
            )


def last_checkpoint(folder: Path, case: InvasionCase) -> Checkpoint | None:
    """The newest checkpoint that is as it was recorded; None without one.

    Raises LiggghtsError as `recorded_rows` does.
    """
    for row, record in reversed(recorded_rows(folder, case)):
        if not _changed(folder, row, record):
            return row
    return None


def _changed(folder: Path, row: Checkpoint, record: CheckpointRecord) -> list[str]:
    """Names of the files of a checkpoint that are missing or not what was recorded."""
    names = {f"invade_{row.step}.dump": record.dump, f"invade_{row.step}.restart": record.restart}
    changed = [
        name for name, digest in names.items() if not _matches(folder / "post" / name, digest)
    ]
    same = record.updates == updates_digest(folder, row.step)
    return changed if same else [*changed, UPDATES]


def _matches(path: Path, digest: str) -> bool:
    try:
        return file_digest(path) == digest
    except OSError:
        return False


def passed_over(folder: Path, case: InvasionCase, last: Checkpoint | None) -> list[str]:
    """A warning for a cut invasion that goes on from an earlier checkpoint than it could.

    A checkpoint that has no record was cut itself, which needs no warning.
    """
    records = [
        step
        for step, path in checkpoint_files(folder)
        if path.suffix == ".record" and (last is None or step > last.step)
    ]
    if last is None and (records or _has_rows(folder)):
        return [
            Doubt(
                "started-over",
                "no checkpoint of the cut invasion could be used, it was started over",
            )
        ]
    if records:
        newest = max(records)
        return [
            Doubt(
                "earlier-checkpoint",
                f"files of the cut invasion were not those that were recorded (checkpoint at step "
                f"{newest}): it went on from the checkpoint at step {last.step if last else 0}",
            )
        ]
    return []


def keep_doubts(folder: Path, doubts: Sequence[str]) -> None:
    """Keep warnings on the invasion in `folder` until it is finished, in whichever session."""
    if doubts:
        text = "".join(
            f"{line}\n" for line in dict.fromkeys([*kept_doubts(folder), *map(explained, doubts)])
        )
        write_text(folder / DOUBTS, text)


def kept_doubts(folder: Path) -> list[str]:
    """The warnings that this and earlier sessions kept."""
    path = folder / DOUBTS
    text = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
    return text.splitlines()


def _has_rows(folder: Path) -> bool:
    """Whether several checkpoints were counted, so that one of them should be there."""
    try:
        return len(read_history(folder)) > 1
    except LiggghtsError:
        return False


def refuse_other_ranks(folder: Path, case: InvasionCase, ranks: int) -> None:
    """Raises CaseError when the cut invasion in `folder` ran on another number of MPI ranks."""
    for step, path in checkpoint_files(folder):
        record = read_record(folder, step) if path.suffix == ".record" else None
        if record and record.case == case_digest(case) and record.ranks != ranks:
            raise CaseError(
                f"{folder}: this invasion was begun with --np {record.ranks}, and --np {ranks} "
                f"would give neither result; continue with --np {record.ranks}, or start over "
                "with --force"
            )


class WatchReader:
    """Reads what is new in overlap.csv, at each checkpoint of a run.

    It begins at the end of the file, which holds what earlier sessions measured.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / WATCH
        self.offset = self.path.stat().st_size if self.path.exists() else 0
        self.waiting: list[Deepest] = []

    def upto(self, step: int) -> list[Deepest]:
        """The new rows up to `step`; later ones are kept for the next checkpoint."""
        if self.path.exists():
            with self.path.open("rb") as file:
                file.seek(self.offset)
                text = file.read()
            whole = text[: text.rfind(b"\n") + 1]
            self.offset += len(whole)
            self.waiting += watch_rows(whole.decode(errors="replace"))
        rows = [row for row in self.waiting if row.step <= step]
        self.waiting = [row for row in self.waiting if row.step > step]
        return rows
