"""Records of checkpoints: digests of what LIGGGHTS had written when a checkpoint was whole.

A later session continues from a checkpoint only when its files still match its record.
"""

import hashlib
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.case.names import SECTION_ARCHIE
from fdnet.dem.checkpoint import HISTORY, Checkpoint, csv_row, read_history
from fdnet.dem.digests import (
    CheckpointRecord,
    checkpoint_files,
    file_digest,
    read_record,
    store_record,
)
from fdnet.dem.overlap import WATCH, Deepest, read_watch, watch_rows
from fdnet.dem.updates import UPDATES, updates_digest
from fdnet.errors import CaseError, LiggghtsError
from fdnet.files.atomic import write_text

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
        return ["no checkpoint of the cut invasion could be used, it was started over"]
    if records:
        newest = max(records)
        return [
            f"files of the cut invasion were not those that were recorded (checkpoint at step "
            f"{newest}): it went on from the checkpoint at step {last.step if last else 0}"
        ]
    return []


def keep_doubts(folder: Path, doubts: Sequence[str]) -> None:
    """Keep warnings on the invasion in `folder` until it is finished, in whichever session."""
    if doubts:
        text = "".join(f"{line}\n" for line in dict.fromkeys([*kept_doubts(folder), *doubts]))
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
