"""Checkpoints of an invasion: the counts after each chunk of steps, and their states on disk."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.batches import Batches, batches_of
from fdnet.dem.digests import dump_is_changed
from fdnet.dem.scene import snapshot_of
from fdnet.errors import DumpError, LiggghtsError
from fdnet.scales.scales import InvasionScales
from fdnet.scales.slab import arrival_time
from fdnet.spheres.dump import read_frame
from fdnet.spheres.snapshot import Snapshot

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
