"""Checkpoints of a stage that LIGGGHTS runs in chunks of steps: an invasion, or a clean-up.

After each chunk the deck counts the fines in a row of history.csv and writes a dump and a restart.
fdnet then records what these files are. A later session goes on from the newest checkpoint whose
files still are what was recorded.
"""

import hashlib
import json
import math
import re
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.dem.deck import number, render_text, snapshot_of
from fdnet.dem.supply import Batches, batches_of
from fdnet.errors import CaseError, DumpError, LiggghtsError
from fdnet.files import write_text
from fdnet.scales.clock import ARRIVALS, PRESSED, REST, arrival_time, rises
from fdnet.scales.contacts import two_digits_up
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.dump import read_frame
from fdnet.spheres.geometry import groups_apart, max_overlap
from fdnet.spheres.snapshot import Snapshot

HISTORY, UPDATES, WATCH = "history.csv", "updates.csv", "overlap.csv"
_SUFFIXES = "dump|restart|npz|unreadable|record"


class Checkpoint(NamedTuple):
    """Numbers of fines after one chunk of an invasion: a row of its history.csv."""

    chunk: int  # from 1
    step: int  # the last one of the chunk
    upstream: int  # of the face, with those that were removed there
    invaded: int  # inside the specimen
    passed: int  # have left through the outlet
    removed_upstream: int  # bounced out upstream and were removed
    most_crossed: int  # crossings when the clock of the stop rule last started
    quiet: int  # chunks since then

    @property
    def waiting(self) -> int:
        """Fines that are upstream."""
        return self.upstream - self.removed_upstream


class Cleaned(NamedTuple):
    """Numbers of fines after one chunk of a clean-up: a row of its history.csv."""

    chunk: int  # from 1
    step: int  # the last one of the chunk; it counts on from those of the invasion
    inside: int  # the specimen
    out: int  # have come out since the clean-up began
    passed: int  # have left through the other end
    quiet: int  # chunks since a fine came out


class Record(NamedTuple):
    """What a checkpoint was when its files were whole; digests are SHA-256."""

    case: str  # what the stage depends on
    ranks: int  # MPI ranks of LIGGGHTS
    row: str  # line of history.csv
    overlap: str  # what was watched since the checkpoint before
    dump: str
    restart: str
    updates: str  # of a coupled stage, before the checkpoint
    fluid: str = ""  # what the fluid of a coupled stage remembers, if there is any
    fdnet: str = ""  # version, whose forces these are


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoints:
    """The checkpoints of a stage in its folder."""

    folder: Path
    digest: str  # of what the stage depends on
    stage: str = "invade"  # or "clean": what the names of its files begin with
    kind: type = Checkpoint  # of the rows of its history.csv

    def path(self, step: int, suffix: str) -> Path:
        """The "dump", "restart" or "record" of a checkpoint."""
        return self.folder / "post" / f"{self.stage}_{step}.{suffix}"

    def files(self, suffix: str = _SUFFIXES) -> list[tuple[int, Path]]:
        """Step and path of the files of checkpoints, by step; other files are passed over."""
        name = re.compile(rf"{self.stage}_(\d{{1,18}})\.({suffix})")
        paths = (self.folder / "post").glob(f"{self.stage}_*")
        return sorted((int(hit[1]), path) for path in paths if (hit := name.fullmatch(path.name)))

    def record(self, step: int) -> Record | None:
        """The record of a checkpoint; None where there is none, or none that can be understood."""
        try:
            record = Record(**json.loads(self.path(step, "record").read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError, RecursionError):
            return None
        sound = tuple(map(type, record)) == tuple(Record.__annotations__.values())
        return record if sound and record.row.split(",")[1:2] == [str(step)] else None

    def store(self, step: int, record: Record) -> None:
        """Write the record of a checkpoint, whole or not at all."""
        write_text(self.path(step, "record"), json.dumps(record._asdict(), indent=1) + "\n")

    def keep(self, row: Any, *, ranks: int, overlaps: Sequence["Deepest"] = ()) -> None:
        """Record a checkpoint whose files are whole; `overlaps` are those since the one before.

        LIGGGHTS may have written later checkpoints meanwhile, which are recorded in their turn.
        """
        seen, own = rows_digest(overlaps), self._digests(row.step)
        record = Record(self.digest, ranks, csv_row(row), seen, **own, fdnet=version("fdnet"))
        self.store(row.step, record)

    def remove_restarts(self, step: int) -> None:
        """Remove the restarts before `step`, but for the two newest, and what goes with them."""
        for suffix in ("restart", "npz"):
            for _, old in [one for one in self.files(suffix) if one[0] <= step][:-2]:
                old.unlink(missing_ok=True)

    def _digests(self, step: int) -> dict[str, str]:
        """Digests of the files of a checkpoint. Raises OSError where one cannot be read."""
        try:
            updates = [row for row in read_updates(self.folder) if row["step"] < step]
        except (LiggghtsError, KeyError):
            updates = [{"unreadable": 0.0}]
        files = {name: file_digest(self.path(step, name)) for name in ("dump", "restart")}
        memory = self.path(step, "npz")
        files["fluid"] = file_digest(memory) if memory.exists() else ""
        return files | {"updates": rows_digest([sorted(row.items()) for row in updates])}

    def last(self) -> Any | None:
        """The newest checkpoint that is as it was recorded; None without one.

        The rows and the watched overlaps of all before it match their records too. Raises
        LiggghtsError where history.csv lacks a row, or holds another one, than was recorded.
        """
        rows = read_rows(self.folder, self.kind)
        steps, lines = [row.step for row in rows], {row.step: csv_row(row) for row in rows}
        records = {step: self.record(step) for step, _ in self.files("record")}
        for step, record in records.items():
            if record is None or record.case != self.digest or not rows or step > steps[-1]:
                continue
            if lines.get(step) != record.row:
                raise LiggghtsError(
                    f"{self.folder / HISTORY}: the row of step {step} is "
                    f"{lines.get(step, 'missing')!r}, expected {record.row!r} as "
                    f"{self.path(step, 'record').name} has it; put the file back, or start over "
                    "with --force"
                )
        parts: list[list[Deepest]] = [[] for _ in range(len(rows) + 1)]
        for one in read_watch(self.folder):
            parts[bisect_left(steps, one.step)].append(one)
        usable = []
        for row, overlaps in zip(rows, parts, strict=False):
            record = records.get(row.step)
            if not record or (record.case, record.overlap) != (self.digest, rows_digest(overlaps)):
                break
            usable.append((row, record))
        return next((row for row, record in reversed(usable) if self._is_whole(row, record)), None)

    def holds(self, step: int, suffix: str) -> bool:
        """Whether the "dump" or "restart" of a checkpoint is as it was recorded."""
        with suppress(OSError):
            return file_digest(self.path(step, suffix)) == getattr(self.record(step), suffix, None)
        return False

    def _is_whole(self, row: Any, record: Record) -> bool:
        with suppress(OSError):
            return self._digests(row.step).items() <= record._asdict().items()
        return False

    def cut(self, last: Any | None) -> None:
        """Remove what came after the checkpoint `last`; everything where there is none."""
        for step, path in self.files():
            if last is None or step > last.step:
                path.unlink()
        if last is None:
            for name in (WATCH, UPDATES):
                (self.folder / name).unlink(missing_ok=True)
        else:
            cut_watch(self.folder, last.step)
        rows = [row for row in read_rows(self.folder, self.kind) if last and row.step <= last.step]
        lines = [",".join(self.kind._fields), *map(csv_row, rows)]  # type: ignore[attr-defined]
        write_text(self.folder / HISTORY, "\n".join(lines) + "\n")

    def refuse_another_way(self, ranks: int) -> None:
        """Raises CaseError when the cut stage was begun in a way that would give another result.

        That is on another number of MPI ranks, or by another version of fdnet.
        """
        stage = "invasion" if self.stage == "invade" else "clean-up"
        begun = f"{self.folder}: this {stage} was begun with"
        for step, _ in self.files("record"):
            record = self.record(step)
            if record is None or record.case != self.digest:
                continue
            if record.ranks != ranks:
                raise CaseError(
                    f"{begun} --np {record.ranks}, and --np {ranks} would give neither result; "
                    f"continue with --np {record.ranks}, or start over with --force"
                )
            if record.fdnet != version("fdnet"):
                raise CaseError(
                    f"{begun} fdnet {record.fdnet or 'of an earlier version'}, and fdnet "
                    f"{version('fdnet')} may make other forces; run it anew with --force, or "
                    "continue with the fdnet that began it"
                )


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits. Raises OSError when it cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def rows_digest(rows: Sequence[Any]) -> str:
    """SHA-256 of some rows of numbers."""
    return hashlib.sha256("".join(f"{row!r}\n" for row in rows).encode()).hexdigest()


def _whole_lines(path: Path) -> list[str]:
    """The lines of a file without an unfinished last one; none without the file."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return []
    return text[: text.rfind("\n") + 1].splitlines()


def csv_row(row: Any) -> str:
    """A checkpoint as a line of history.csv."""
    return ",".join(map(str, row))


def read_rows(folder: Path, kind: type = Checkpoint) -> tuple[Any, ...]:
    """All rows of history.csv that are whole; none without the file."""
    rows = []
    for line in _whole_lines(folder / HISTORY)[1:]:
        with suppress(ValueError, OverflowError, TypeError):
            counts = [float(count) for count in line.split(",")]
            row = kind(*map(int, counts))
            rows += [row] if row == tuple(counts) else []
    return tuple(rows)


def read_history(folder: Path, kind: type = Checkpoint) -> tuple[Any, ...]:
    """All checkpoints of history.csv, without an unfinished last line.

    Raises LiggghtsError when it holds none.
    """
    rows = read_rows(folder, kind)
    if not rows:
        seen = f"see {folder}/screen.txt, run again"
        raise LiggghtsError(f"{folder / HISTORY}: no checkpoint recorded; {seen}")
    return rows


# ---- When an invasion ends, in chunks.
def chunks_of(case: InvasionCase, scales: InvasionScales) -> int:
    """Number of chunks of the whole run: nearest to its duration, or enough to reach the cap."""
    chunks = scales.cap_time / (scales.checkpoint_steps * scales.time_step)
    return max(1, round(chunks) if case.run.duration_s is not None else math.ceil(chunks - 1e-9))


def quiet_chunks(scales: InvasionScales) -> int:
    """Chunks without a crossing that make the plug time."""
    chunk = scales.checkpoint_steps * scales.time_step
    return max(1, math.ceil(scales.plug_time / chunk - 1e-9))


def plug_allowance(case: InvasionCase, scales: InvasionScales) -> int:
    """Fines that may cross face (and outlet) within the plug time of a face that is plugged.

    They are `run.plug_rate` of those that the undisturbed suspension would bring.
    """
    arrival = arrival_time(case, scales.upstream_velocity)
    return math.floor(case.run.plug_rate * scales.plug_time / arrival)


def empty_chunks(case: InvasionCase, scales: InvasionScales) -> int:
    """Chunks without a fine that leaves which end an invasion once the slab is empty.

    They take twice the passage of the fluid through the specimen, at least the plug time.
    """
    passage, chunk = 2 * case.size_m[0] / scales.drive_velocity, scales.checkpoint_steps
    return max(quiet_chunks(scales), math.ceil(passage / (chunk * scales.time_step)))


def quiet_enough(
    folder: Path, case: InvasionCase, scales: InvasionScales, row: Checkpoint
) -> bool:
    """Whether the stop rule holds at this checkpoint.

    In the uniform field it is the thesis's: no more fines cross the face in the plug time than
    the allowance, or once no fine is left upstream, none leaves in the time of `empty_chunks`.

    Where the flow follows the deposit no more than the allowance cross the face and the outlet
    together, and those inside move at `run.plug_rate` of the fluid's first velocity at the most.
    It takes the plug time while mud is at the face, and else that of `empty_chunks`. Fewer than
    `ARRIVALS` fines are no mud: they say nothing of the face.
    """
    follows = case.drag.coupled
    mud = row.waiting >= (ARRIVALS if follows else 1)
    if row.quiet < (quiet_chunks(scales) if mud else empty_chunks(case, scales)):
        return False
    if not follows:
        return True
    frame = read_frame(folder / "post" / f"invade_{row.step}.dump")
    fines = snapshot_of(frame, case, time_s=0.0).fines()
    inside = (fines.position[:, 0] >= 0) & (fines.position[:, 0] < case.size_m[0])
    speed = float(np.mean(fines.velocity[inside, 0])) if inside.any() else 0.0
    return speed <= max(REST, case.run.plug_rate) * scales.drive_velocity


def flow_says(folder: Path, case: InvasionCase, scales: InvasionScales, step: int) -> str | None:
    """Why the flow before `step` ends an invasion that follows it; None where it does not.

    "plugged" when its rate is below `run.stop_rate` of the first one, "duration" when
    `run.stop_pore_volumes` or more have passed. Beside finer classes `run.plug_rate` of the first
    rate ends it too: no more than that of spheres and classes can come.
    """
    rate, volumes = case.run.stop_rate, case.run.stop_pore_volumes
    if case.with_classes and case.run.duration_s is None:
        rate = rate or case.run.plug_rate
    if rate is None and volumes is None:
        return None
    rows = [row for row in read_updates(folder) if row["step"] < step]
    if not rows:
        return None
    if rate is not None and rows[-1]["rate_over_initial"] < rate:
        return "plugged"
    pores = scales.porosity * math.prod(case.size_m)
    most = (case.run.stop_pore_volumes or math.inf) * pores
    return "duration" if rows[-1]["filtrate_m3"] >= most else None


def time_of(row: Checkpoint, scales: InvasionScales) -> float:
    """Time of the simulation, s, at a checkpoint; chunks take one time, in more or fewer steps."""
    return row.chunk * scales.checkpoint_steps * scales.time_step


# ------------------------------------------------------------------------------------------------
# Springs that grow with the load, where `run.stiffness_N_m` is "auto" and the flow follows the
# deposit: steps of a chunk go with the root of the stiffness, so history.csv records it.


RAISE_ABOVE, RAISE_TO, GROWN, MOST_RAISE = 0.67, 0.6, 1.1, 2.0
"""Springs are stiffened at a checkpoint when the overlap that lasted in the chunk before was above
the first share of `PRESSED`, so that it would have been the second. At most so many times the
steps at once. A fine that is wedged between grains keeps its overlap with stiffer springs too: so
the overlap must be `GROWN` times that in each of the `reference_chunks`."""


def lasting_overlap(seen: Sequence[float]) -> float:
    """The overlap that one in ten of those `seen` exceeds at the most: an impact is no load."""
    return sorted(seen)[math.ceil(9 * (len(seen) - 1) / 10)]


def reference_chunks(steps: Sequence[int], groups: int) -> range:
    """The chunks, from 0, with which the last of some of so many `steps` is compared.

    They are the first ones with the present springs, until all `groups` of grains were watched,
    one in a chunk. Until then the chunk that the springs were stiffened for is one of them.
    """
    others = [chunk for chunk, one in enumerate(steps) if one != steps[-1]]
    first = others[-1] + 1 if others else 0  # with the present springs
    whole = first + groups
    begin = first - 1 if first > 0 and len(steps) <= whole else first
    return range(begin, min(whole, len(steps) - 1))


def steps_after(case: InvasionCase, steps: int, overlap: float, known: Iterable[float]) -> int:
    """Steps of the chunk after one of `steps` steps in which an `overlap` lasted.

    In the `reference_chunks` the `known` ones lasted. An overlap goes with the stiffness k to the
    power -1 (Hertz -2/3), the step with k to -1/2.
    """
    least = max(GROWN * max(known, default=0.0), RAISE_ABOVE * PRESSED)
    if not rises(case) or overlap <= least:
        return steps
    power = 0.75 if case.contact.model == "hertz" else 0.5
    return math.ceil(steps * min(MOST_RAISE, (overlap / (RAISE_TO * PRESSED)) ** power))


# ---- The states of checkpoints, from their dumps.
def entered_by(case: InvasionCase, batches: Batches, row: Checkpoint) -> int:
    """Batches of fines that had entered by a checkpoint.

    In mud that the deposit slows down, their number follows from that of the fines.
    """
    if case.drag.slowed:
        return batches.entered_with(row.upstream + row.invaded + row.passed)
    return batches.entered_at(row.chunk)


def state_at(
    folder: Path, row: Any, case: InvasionCase, scales: InvasionScales, grains: Snapshot
) -> Snapshot:
    """Grains and remaining fines at a checkpoint of an invasion or a clean-up.

    Raises DumpError when its dump is missing or cut.
    """
    stage = "invade" if isinstance(row, Checkpoint) else "clean"
    frame = read_frame(folder / "post" / f"{stage}_{row.step}.dump")
    time = time_of(row, scales) if isinstance(row, Checkpoint) else row.step * scales.time_step
    moved = snapshot_of(frame, case, time_s=time)
    return moved if case.grains.motion == "mobile" else grains.joined(moved)


def check_counts(folder: Path, row: Checkpoint, damaged: Snapshot, supplied: int) -> None:
    """Raises LiggghtsError when a state does not hold the fines that its checkpoint counts."""
    x = damaged.fines().position[:, 0]
    inside, upstream = int(np.sum((x >= 0) & (x < damaged.box[0, 1]))), int(np.sum(x < 0))
    if inside != row.invaded or upstream != row.waiting:
        raise LiggghtsError(
            f"{folder}/post/invade_{row.step}.dump: {inside} fines inside and {upstream} "
            f"upstream, expected {row.invaded} and {row.waiting} as in {HISTORY}"
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
    """The states of the checkpoints in `history`; LiggghtsError where its counts disagree.

    Dumps that are missing, cut or changed are passed over, except the last one, which raises
    DumpError.
    """
    batches, points = batches_of(case, scales), Checkpoints(folder=folder, digest="")
    for row in history:
        try:
            state = state_at(folder, row, case, scales, grains)
            if points.record(row.step) and not points.holds(row.step, "dump"):
                raise DumpError(
                    f"{points.path(row.step, 'dump')}: is not the dump that the run wrote; put it "
                    "back, or start over with --force"
                )
        except DumpError:
            if row == history[-1]:
                raise
            continue
        check_counts(folder, row, state, batches.supplied(entered_by(case, batches, row)))
        yield row, state


# ------------------------------------------------------------------------------------------------
# The overlap of fines, watched while an invasion runs.
#
# The deck measures it every few steps, and the dumps of the checkpoints give it as well.


GRAINS_APART = "grains_apart.txt"
"""File with the group of each grain; no two grains of a group touch."""
WATCHED = "watched.in"  # File by which a coupled deck changes the grains that are watched
EVERY, MOST_ROWS = 50, 200
"""Steps between two measurements by the deck, and most measurements in a chunk. Each costs about a
fifth of a step with contacts."""


class Deepest(NamedTuple):
    """The largest overlap of a fine with another sphere, over the smaller diameter, at a step."""

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


def write_watch_parts(case: InvasionCase, grains: Snapshot, folder: Path) -> None:
    """Write the files by which a deck watches the overlap; nothing where it does not."""
    if not is_watched(case):
        return
    groups = groups_apart(grains, case.periodic)
    rows = [f"{grain} {group}" for grain, group in zip(grains.id, groups, strict=True)]
    write_text(folder / GRAINS_APART, "\n".join([str(len(rows)), *rows, ""]))
    if case.drag.coupled:
        write_text(folder / WATCHED, render_text("watched.in.j2", {}))


def read_watch(folder: Path) -> list[Deepest]:
    """What the deck measured; nothing where it did not watch. Titles are passed over."""
    seen = []
    for line in _whole_lines(folder / WATCH):
        step, _, fraction = line.partition(",")
        with suppress(ValueError):
            seen.append(Deepest(int(step), max(0.0, float(fraction))))
    return seen


def cut_watch(folder: Path, last_step: int) -> None:
    """Remove what was measured after `last_step`, from which the run goes on."""
    if (folder / WATCH).exists():
        rows = [row for row in read_watch(folder) if row.step <= last_step]
        write_text(folder / WATCH, "".join(f"{row.step},{row.fraction!r}\n" for row in rows))


def overlap_in(case: Case, state: Snapshot) -> Deepest:
    """The largest overlap of a fine in a state."""
    return Deepest(state.step, max_overlap(state, case.periodic, only_fines=True))


def deepest_of(seen: Iterable[Deepest]) -> Deepest:
    """The largest of several, the first one among equals; step 0 and 0.0 if there is none."""
    return max(seen, key=lambda row: row.fraction, default=Deepest(0, 0.0))


def overlap_text(case: Case, deepest: Deepest, stiffness: float) -> str:
    """The overlap, its limit and what to do, in words; springs ended at a `stiffness` of N/m."""
    stiffer = "raise run.stiffness_N_m"
    if isinstance(case.run.stiffness_N_m, str):
        power = 1.5 if case.contact.model == "hertz" else 1.0
        enough = two_digits_up((deepest.fraction / PRESSED) ** power * stiffness)
        stiffer = f"set run.stiffness_N_m = {enough:.2g}"
    return (
        f"a fine overlapped by {100 * deepest.fraction:.3g} % of the smaller diameter at step "
        f"{deepest.step} (limit run.max_overlap, {100 * case.run.max_overlap:.3g} %): {stiffer}"
    )


# ---- The record of updates of a coupled stage, updates.csv: one row for each.
class Updates:
    """The rows of updates.csv; new ones are appended to the file at once.

    Every number is written so that it is read back exactly.
    """

    def __init__(self, folder: Path, names: Sequence[str], *, upto: int) -> None:
        """Keep the rows before step `upto` of an earlier session, or begin a file of `names`."""
        self.path, self.names = folder / UPDATES, ("step", "time_s", *names)
        rows = [row for row in read_updates(folder) if row["step"] < upto] if upto > 0 else []
        self.last: Mapping[str, float] | None = rows[-1] if rows else None
        lines = [",".join(self.names), *(self._line(row) for row in rows)]
        write_text(self.path, "\n".join(lines) + "\n")

    def add(self, step: int, time: float, measures: Mapping[str, float]) -> None:
        """Append the row of the update at `step` and `time` s."""
        row = {"step": float(step), "time_s": time, **measures}
        with self.path.open("a", encoding="utf-8") as file:
            file.write(self._line(row) + "\n")
        self.last = row

    def _line(self, row: Mapping[str, float]) -> str:
        return ",".join(repr(float(row[name])) for name in self.names)


def read_updates(folder: Path) -> list[dict[str, float]]:
    """The whole rows of updates.csv; none without the file.

    Raises LiggghtsError where a row is not one number for each column.
    """
    title, *lines = _whole_lines(folder / UPDATES) or [""]
    try:
        return [
            dict(zip(title.split(","), map(float, line.split(",")), strict=True)) for line in lines
        ]
    except ValueError as error:
        raise LiggghtsError(
            f"{folder / UPDATES}: {error}; the file was changed, start over with --force"
        ) from error
