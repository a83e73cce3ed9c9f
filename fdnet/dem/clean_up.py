"""The checkpoints of a clean-up: counts after each chunk of steps, and their states on disk."""

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import HISTORY, UPDATES, Updates, file_digest
from fdnet.dem.deck import (
    BELOW_ZERO,
    Deck,
    LeftOut,
    drag_variables,
    forces_left_out,
    gravity_variables,
    header_variables,
    number,
    render_text,
    snapshot_of,
)
from fdnet.dem.invade_deck import Fluid, coupled_parts, dumped_group, moving_variables
from fdnet.dem.invasion import Coupling
from fdnet.dem.liggghts import Feed, Launch, Run, run_deck, run_fed
from fdnet.errors import CaseError, LiggghtsError
from fdnet.files import disk_is_full, write_text
from fdnet.scales.scales import BackFlow, InvasionScales
from fdnet.spheres.dump import COLUMNS, FORMAT, read_frame
from fdnet.spheres.snapshot import Snapshot

_NAMES = ("chunk", "step", "inside", "out", "passed", "quiet")
CLEANED_HEADER = ",".join(_NAMES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cleaned:
    """Numbers of fines after one chunk of a clean-up.

    Attributes:
        chunk: number of the chunk, from 1.
        step: last step of the chunk; it counts on from those of the invasion.
        inside: fines inside the specimen.
        out: fines that have come out since the clean-up began.
        passed: fines that have left through the other end.
        quiet: chunks since a fine came out.
    """

    chunk: int
    step: int
    inside: int
    out: int
    passed: int
    quiet: int

    def line(self) -> str:
        """The checkpoint as a line of history.csv."""
        return ",".join(str(getattr(self, name)) for name in _NAMES)


def read_cleaned(folder: Path) -> tuple[Cleaned, ...]:
    """All whole rows of the history of a clean-up; none without the file."""
    try:
        text = (folder / HISTORY).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    lines = [line.split(",") for line in text[: text.rfind("\n") + 1].splitlines()[1:]]
    return tuple(
        Cleaned(**{name: int(count) for name, count in zip(_NAMES, line, strict=True)})
        for line in lines
        if len(line) == len(_NAMES) and all(count.isdecimal() for count in line)
    )


def dump_name(step: int) -> str:
    """The dump of a checkpoint, below the folder of the stage."""
    return f"post/clean_{step}.dump"


def restart_name(step: int) -> str:
    """The restart of a checkpoint, below the folder of the stage."""
    return f"post/clean_{step}.restart"


def cleaned_state(folder: Path, row: Cleaned, flow: BackFlow, grains: Snapshot) -> Snapshot:
    """Grains and remaining fines at a checkpoint. Raises DumpError without its dump."""
    case = flow.case
    frame = read_frame(folder / dump_name(row.step))
    moved = snapshot_of(frame, case, time_s=row.step * flow.step)
    return moved if case.grains.motion == "mobile" else grains.joined(moved)


def keep_record(folder: Path, row: Cleaned, digest: str, *, ranks: int) -> None:
    """Record a checkpoint whose files are whole, and keep its restart and the one before.

    LIGGGHTS may have written later checkpoints meanwhile, which are recorded in their turn.
    """
    record = _record(folder, row, digest) | {"ranks": ranks}
    write_text(_record_path(folder, row), json.dumps(record, indent=1) + "\n")
    before = [one for one in read_cleaned(folder) if one.step < row.step]
    for old in before[:-1]:
        (folder / restart_name(old.step)).unlink(missing_ok=True)


def newest_whole(folder: Path, digest: str, *, ranks: int) -> Cleaned | None:
    """The newest checkpoint whose files are what was recorded of this case; None without one.

    Raises CaseError when it was made on another number of MPI ranks.
    """
    for row in reversed(read_cleaned(folder)):
        record = _read(_record_path(folder, row))
        if not record or not _matches(folder, row, digest, record):
            continue
        if record["ranks"] != ranks:
            raise CaseError(
                f"{folder}: this clean-up was begun with --np {record['ranks']}, and --np {ranks} "
                f"would give neither result; continue with --np {record['ranks']}, or start over "
                "with --force"
            )
        return row
    return None


def _record_path(folder: Path, row: Cleaned) -> Path:
    return folder / f"post/clean_{row.step}.record"


def _record(folder: Path, row: Cleaned, digest: str) -> dict[str, Any]:
    rows = [one.line() for one in read_cleaned(folder) if one.step <= row.step]
    return {
        "case": digest,
        "history": hashlib.sha256("\n".join(rows).encode()).hexdigest(),
        "dump": file_digest(folder / dump_name(row.step)),
        "restart": file_digest(folder / restart_name(row.step)),
    }


def _matches(folder: Path, row: Cleaned, digest: str, record: dict[str, Any]) -> bool:
    try:
        return {**record, **_record(folder, row, digest)} == record
    except OSError:
        return False


def _read(path: Path) -> dict[str, Any]:
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) and isinstance(record.get("ranks"), int) else {}


def invasion_restart(folder: Path, step: int, case: InvasionCase) -> Path:
    """The restart at the end of the invasion in `folder`, checked against its record.

    Raises CaseError where it is missing or changed.
    """
    from fdnet.dem.checkpoint import read_record

    path, record = folder / "post" / f"invade_{step}.restart", read_record(folder, step)
    try:
        same = record is not None and file_digest(path) == record.restart
    except OSError:
        same = False
    if not same:
        raise CaseError(
            f"{path}: the clean-up begins with this file, and it is missing or is not the one "
            "that the invasion wrote; put it back, or run the invasion again with --stages "
            "invade,clean_up,analyse,report --force"
        )
    return path


# ------------------------------------------------------------------------------------------------
# The deck of a clean-up: the end of an invasion, with the flow turned back.


@dataclass(frozen=True, slots=True, kw_only=True)
class Beginning:
    """Where LIGGGHTS begins.

    Attributes:
        restart: path of the restart file, from the folder of the deck.
        row: the checkpoint of the clean-up that it holds; None at the end of the invasion.
    """

    restart: str
    row: Cleaned | None


def render_clean_up(flow: BackFlow, digest: str, begin: Beginning, *, ranks: int = 1) -> Deck:
    """The deck of a clean-up, at the end of the invasion or continued from a checkpoint."""
    case, scales = flow.case, flow.scales
    gravity, left_out = gravity_variables(case, scales)
    left_out += forces_left_out(case)
    header = header_variables(case, "invade", left_out, ranks)
    text = render_text(
        "clean_up.in.j2",
        header
        | moving_variables(case, scales)
        | {
            "stage": "clean_up",
            "digest": digest,
            "going_on": begin.row is not None,
            "restart": begin.restart,
            "gravity": gravity,
            "drag": turned_drag(flow),
            "resume": False,
            "regions": _regions(flow),
            "start": _start(begin.row),
            "chunks": flow.chunks,
            "chunk_steps": scales.checkpoint_steps,
            "quiet_chunks": flow.quiet_chunks,
            **_dump(flow),
        },
    )
    return Deck(text=text, stage="clean_up", digest=digest, left_out=tuple(left_out))


def clean_up_parts(flow: BackFlow) -> dict[str, str]:
    """Name and text of each file that a coupled clean-up includes; empty when it is not."""
    parts = coupled_parts(flow.case, flow.scales)
    if parts:
        parts["checkpoint.in"] = render_text("cleaned.in.j2", _dump(flow))
    return parts


def turned_drag(flow: BackFlow) -> dict[str, Any]:
    """The variables of `_drag.in.j2` with the velocities and the gradient below 0.

    What depends on the size of a slip alone is that of the flow ahead.
    """
    ahead = drag_variables(flow.case, flow.scales)
    back = drag_variables(flow.case, _turned(flow.scales))
    return back | {"inertia": ahead["inertia"]} if "inertia" in ahead else back


def _turned(scales: InvasionScales) -> InvasionScales:
    push = scales.push
    return replace(
        scales,
        drive_velocity=-scales.drive_velocity,
        upstream_velocity=-scales.upstream_velocity,
        push=replace(push, velocity=-push.velocity, gradient=-push.gradient, reynolds_slope=0.0),
    )


def _dump(flow: BackFlow) -> dict[str, str]:
    return {
        "dump_group": dumped_group(flow.case),
        "dump_columns": COLUMNS,
        "dump_format": FORMAT,
    }


def _start(row: Cleaned | None) -> dict[str, int]:
    if row is None:
        return {"chunk": 1, "out": 0, "passed": 0, "quiet": 0}
    return {"chunk": row.chunk + 1, "out": row.out, "passed": row.passed, "quiet": row.quiet}


def _regions(flow: BackFlow) -> dict[str, str]:
    length, sides = flow.case.size_m[0], "INF INF INF INF"
    return {
        "specimen": f"0.0 {number(np.nextafter(length, 0))} {sides}",
        "out": f"INF {number(BELOW_ZERO)} {sides}",
        "beyond": f"{number(length)} INF {sides}",
    }


# ------------------------------------------------------------------------------------------------
# The clean-up: after the invasion the flow is turned back, and what is loose comes out.
#
# It begins with the restart of the invasion's last checkpoint: the same spheres, contacts and
# velocities. A checkpoint after every chunk of steps lets a cut run go on.


DECK = "in.clean_up"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Start:
    """What a clean-up begins with.

    Attributes:
        grains: of the pack.
        invaded: grains and all fines at the end of the invasion.
        invasion: folder of the invasion.
        digest: of the case's clean-up.
    """

    grains: Snapshot
    invaded: Snapshot
    invasion: Path
    digest: str


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CleanedUp:
    """A finished clean-up.

    Attributes:
        state: grains and remaining fines at the end.
        history: one row a checkpoint.
        stop_reason: "quiet" (nothing came out any more), "duration", "empty" or "cap".
        warnings: doubts about how it ended, one sentence each.
        left_out: what the deck does without.
        runs: executions of LIGGGHTS; empty when an earlier session had come to the end.
        ranks: MPI ranks.
    """

    state: Snapshot
    history: tuple[Cleaned, ...]
    stop_reason: str
    warnings: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    runs: tuple[Run, ...]
    ranks: int


def clean_up(
    flow: BackFlow, start: Start, folder: Path, launch: Launch, *, fluid: Fluid | None = None
) -> CleanedUp:
    """Turn the flow back; continues from the last whole checkpoint when `folder` holds one.

    A coupled case needs the `fluid` that answers for its fines. Raises LiggghtsError when a run
    fails or fines are lost, CaseError when the restart of the invasion is not there.
    """
    (folder / "post").mkdir(parents=True, exist_ok=True)
    last = newest_whole(folder, mark_of(flow, start), ranks=launch.ranks)
    deck, begin = _prepare(flow, start, folder, last, ranks=launch.ranks)
    runs: tuple[Run, ...] = ()
    if not is_over(flow, last):
        keeper = _Keeper(folder, mark_of(flow, start), launch)
        runs = (_run(flow, begin, start, folder, replace(launch, follow=keeper), fluid),)
    history = read_cleaned(folder)
    state = cleaned_state(folder, history[-1], flow, start.grains)
    _check_balance(flow, start, history[-1], state, folder)
    reason, warnings = _ending(flow, history[-1])
    return CleanedUp(
        state=state,
        history=history,
        stop_reason=reason,
        warnings=warnings,
        left_out=deck.left_out,
        runs=runs,
        ranks=launch.ranks,
    )


def mark_of(flow: BackFlow, start: Start) -> str:
    """What checkpoints depend on.

    One that an earlier version made otherwise starts over: a crowd in the uniform field had the
    upstream velocity at the wrong end.
    """
    drag = flow.case.drag
    crowd = drag.coupled and drag.field == "uniform" and drag.upstream == "darcy"
    return f"{start.digest} mud side upstream" if crowd else start.digest


def fines_to_clean(flow: BackFlow, start: Start) -> Snapshot:
    """The fines that take part: those inside."""
    fines = start.invaded.fines()
    x, length = fines.position[:, 0], flow.case.size_m[0]
    return fines.where((x >= 0) & (x < length))


def _prepare(
    flow: BackFlow, start: Start, folder: Path, last: Cleaned | None, *, ranks: int
) -> tuple[Deck, Beginning]:
    """Write the deck of a start, or of a restart from `last` with later rows removed."""
    if last is None:
        old = sorted((folder / "post").glob("clean_*"))
        for stale in [folder / HISTORY, folder / UPDATES, *old]:
            stale.unlink(missing_ok=True)
        step = start.invaded.step
        path = invasion_restart(start.invasion, step, flow.case)
        restart = f"../{start.invasion.name}/post/{path.name}"
    else:
        restart = restart_name(last.step)
    begin = Beginning(restart=restart, row=last)
    rows = [row.line() for row in read_cleaned(folder) if last and row.step <= last.step]
    write_text(folder / HISTORY, "\n".join([CLEANED_HEADER, *rows]) + "\n")
    deck = render_clean_up(flow, start.digest, begin, ranks=ranks)
    write_text(folder / (DECK if last is None else f"{DECK}.resume"), deck.text)
    for name, text in clean_up_parts(flow).items():
        write_text(folder / name, text)
    return deck, begin


def _run(
    flow: BackFlow,
    begin: Beginning,
    start: Start,
    folder: Path,
    launch: Launch,
    fluid: Fluid | None,
) -> Run:
    deck = DECK if begin.row is None else f"{DECK}.resume"
    if fluid is None:
        return run_deck(folder, deck, launch)
    coupling = Coupling(
        case=flow.case,
        scales=flow.scales,
        grains=start.grains,
        folder=folder,
        fluid=fluid,
        last=None,
        over=lambda _: False,
    )

    def play(feed: Feed) -> None:
        step = start.invaded.step if begin.row is None else begin.row.step
        upto = 0 if begin.row is None else step
        updates = Updates(folder, coupling.fluid.measured, upto=upto)
        feed(f"include {deck}")
        while not is_over(flow, (read_cleaned(folder) or (None,))[-1]):
            step = coupling.chunk(feed, updates, step)
            feed("include checkpoint.in")

    return run_fed(folder, deck, launch, play)


def is_over(flow: BackFlow, last: Cleaned | None) -> bool:
    """Whether the last checkpoint is the end of the clean-up."""
    if last is None:
        return False
    quiet = flow.quiet_chunks and last.quiet >= flow.quiet_chunks
    return last.chunk >= flow.chunks or bool(quiet) or last.inside == 0


def _ending(flow: BackFlow, last: Cleaned) -> tuple[str, tuple[str, ...]]:
    """The stop reason, and warnings."""
    if last.inside == 0:
        return "empty", ()
    if not flow.quiet_chunks:
        return "duration", ()
    if last.quiet >= flow.quiet_chunks:
        return "quiet", ()
    return "cap", (
        "the clean-up stopped at its cap while fines still came out: raise clean_up.cap_ms",
    )


def _check_balance(
    flow: BackFlow, start: Start, last: Cleaned, state: Snapshot, folder: Path
) -> None:
    """Raises LiggghtsError unless what came out and what stays is what was there before."""
    before, fines = len(fines_to_clean(flow, start)), state.fines()
    x, length = fines.position[:, 0], flow.case.size_m[0]
    inside = int(np.count_nonzero((x >= 0) & (x < length)))
    if inside != last.inside or len(fines) != last.inside:
        raise LiggghtsError(
            f"{folder}: the last dump holds {len(fines)} fines, {inside} of them inside; "
            f"expected {last.inside} as in {HISTORY}; start over with --force"
        )
    if before != last.inside + last.out + last.passed:
        raise LiggghtsError(
            f"{folder}: {last.inside} fines inside, {last.out} come out and "
            f" {last.passed} at the other end are not the {before} before: fines were lost; "
            "lower run.time_step_factor"
        )


class _Keeper:
    """Follows the screen of a clean-up, records each checkpoint and passes every line on."""

    def __init__(self, folder: Path, digest: str, launch: Launch) -> None:
        self.folder, self.digest, self.launch = folder, digest, launch

    def __call__(self, line: str) -> None:
        if line.startswith("FDNET cleaned"):
            self._keep(int(line.split()[3]))
        if self.launch.follow:
            self.launch.follow(line)

    def _keep(self, step: int) -> None:
        if disk_is_full(self.folder):
            raise LiggghtsError(
                f"{self.folder}: the disk is full, LIGGGHTS was stopped; make room and "
                "continue with --resume"
            )
        for row in read_cleaned(self.folder)[-3:]:
            if row.step == step:
                keep_record(self.folder, row, self.digest, ranks=self.launch.ranks)
