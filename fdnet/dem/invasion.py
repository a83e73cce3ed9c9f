"""A coupled invasion: what the fluid does to each fine is computed anew while LIGGGHTS waits.

fdnet feeds LIGGGHTS the commands of an invasion: the deck, then for each chunk the batch of fines
that comes, for each update the files `ask.in` and `fluid.in` with a `run` after them, and
`checkpoint.in`. Every chunk begins with an update and a `run` that sets everything up, as in an
invasion that is not coupled; so a cut one goes on bit for bit.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import (
    HISTORY,
    HISTORY_HEADER,
    UPDATES,
    WATCH,
    WATCHED,
    Checkpoint,
    Deepest,
    Updates,
    WatchReader,
    checkpoint_files,
    chunks_of,
    csv_row,
    cut_watch,
    deepest_of,
    entered_by,
    is_watched,
    keep_doubts,
    kept_doubts,
    last_checkpoint,
    overlap_in,
    passed_over,
    quiet_chunks,
    quiet_enough,
    rate_is_low,
    read_history,
    read_updates,
    read_watch,
    readable_states,
    refuse_other_ranks,
    refuse_overlap,
    volume_has_passed,
    write_record,
)
from fdnet.dem.deck import Deck, LeftOut, snapshot_of
from fdnet.dem.invade_deck import (
    SCRATCH,
    SUPPLY,
    Fluid,
    FluidForces,
    Moment,
    batch_files,
    fine_density,
    given_speed,
    largest_share,
    read_state,
    render_invade,
    write_batches,
    write_forces,
    write_invade_inputs,
    write_parts,
)
from fdnet.dem.liggghts import SCREEN, Feed, Launch, Run, run_deck, run_fed
from fdnet.dem.supply import Batches, batches_of, later_batch
from fdnet.errors import CaseError, Doubt, LiggghtsError
from fdnet.files import disk_is_full, write_text
from fdnet.scales.clock import DRAG_LIMIT
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.dump import Frame
from fdnet.spheres.snapshot import Array, Snapshot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Coupling:
    """A coupled invasion.

    Attributes:
        case: what is run.
        scales: of the case.
        grains: of the pack.
        folder: of the invasion.
        fluid: answers for the fines.
        last: checkpoint from which it goes on; None from the start.
        over: whether a checkpoint is the end.
    """

    case: InvasionCase
    scales: InvasionScales
    grains: Snapshot
    folder: Path
    fluid: Fluid
    last: Checkpoint | None
    over: Callable[[Checkpoint], bool]

    @property
    def deck(self) -> str:
        """Name of the deck that LIGGGHTS begins with."""
        return "in.invade" if self.last is None else "in.invade.resume"

    def play(self, feed: Feed) -> None:
        """Feed LIGGGHTS the whole invasion.

        Raises LiggghtsError when explicit drag would overshoot, DumpError when LIGGGHTS did not
        show its spheres, and what the fluid raises.
        """
        step, chunk = (self.last.step, self.last.chunk) if self.last else (0, 0)
        updates = Updates(self.folder, self.fluid.measured, upto=step)
        batches = batches_of(self.case, self.scales)
        entered = entered_by(self.case, batches, self.last) if self.last else batches.entered_at(1)
        feed(f"include {self.deck}")
        while chunk < chunks_of(self.case, self.scales):
            chunk += 1
            entered = self._supply(feed, updates, (chunk, step), (batches, entered))
            if is_watched(self.case):
                feed(f"include {WATCHED}")
            step = self.chunk(feed, updates, step)
            feed("include checkpoint.in")
            if self.over(read_history(self.folder)[-1]):
                return

    def _supply(
        self, feed: Feed, updates: Updates, at: tuple[int, int], supply: tuple[Batches, int]
    ) -> int:
        """Feed the batches that are due `at` a chunk and its first step.

        `supply` are the batches, and the number of those that have entered; returns the new one.
        """
        (chunk, step), (batches, entered) = at, supply
        if not self.case.drag.slowed:
            due = batches.entered_at(chunk)
            for number in range(entered, due):
                feed(f"include {SUPPLY}/batch_{number}.in")
            return due
        time = step * self.scales.time_step
        moved, velocity = self._mud(updates, time)
        ahead = velocity * self.scales.checkpoint_steps * self.scales.time_step
        due = max(entered, batches.entered_after(moved + ahead))
        files = batch_files(self.case, self.scales, self.grains, self.folder)
        for number in range(entered, due):
            spheres = self._spheres(self._shown(feed), time)
            fines = later_batch(self.case, self.scales, spheres, number, moved)
            feed(f"include {files.write(number, fines, velocity)}")
        return due

    def _mud(self, updates: Updates, time: float) -> tuple[float, float]:
        """By how much the mud has moved at the `time` s, m, and its velocity upstream, m/s."""
        last = updates.last
        if last is None:
            return 0.0, self.scales.upstream_velocity
        since = time - last["time_s"]
        area = self.case.size_m[1] * self.case.size_m[2]
        velocity = float(last["velocity_m_s"])
        return float(last["filtrate_m3"]) / area + velocity * since, velocity

    def chunk(self, feed: Feed, updates: Updates, step: int) -> int:
        """A chunk of steps from `step`; returns its last one."""
        end, fresh = step + self.scales.checkpoint_steps, True
        while step < end:
            steps = min(self._update(feed, updates, (step, end), fresh), end - step)
            if fresh and self.case.drag.scheme == "held" and self.scales.hold_steps > 1:
                feed("include held.in")
            feed(f"run {steps}" + ("" if fresh else " pre no post no"))
            step, fresh = step + steps, False
        return step

    def _update(self, feed: Feed, updates: Updates, at: tuple[int, int], fresh: bool) -> int:
        """Compute the fluid's forces for the state `at` a step of a chunk with its last one.

        Returns the steps they hold for.
        """
        step, end = at
        time, frame = step * self.scales.time_step, self._shown(feed)
        spheres, density = self._spheres(frame, time), fine_density(frame)
        moment = Moment(
            step=step,
            time=time,
            before=updates.last,
            first=updates.first,
            fresh=fresh,
            left=(end - step) * self.scales.time_step,
            given=given_speed(frame),
            density=density,
        )
        forces = self.fluid.forces(spheres, moment)
        self._refuse_overshoot(spheres, forces, density)
        write_forces(self.folder, spheres, forces)
        updates.add(step, time, forces.measures)
        feed("include fluid.in")
        return steps_between(self.case, self.scales, forces.pace)

    def _shown(self, feed: Feed) -> Frame:
        """The state that LIGGGHTS shows when it is asked."""
        feed("include ask.in")
        return read_state(self.folder, self.case)

    def _spheres(self, frame: Frame, time: float) -> Snapshot:
        moved = snapshot_of(frame, self.case, time_s=time)
        return moved if self.case.grains.motion == "mobile" else self.grains.joined(moved)

    def _refuse_overshoot(self, spheres: Snapshot, forces: FluidForces, density: Array) -> None:
        held = self.scales.time_step * self.scales.hold_steps
        share = largest_share(spheres, forces, density, held)
        if self.case.drag.scheme != "implicit" and share > DRAG_LIMIT:
            raise LiggghtsError(
                f"{self.folder}: at step {spheres.step} drag is constant for {share:.3g} "
                f"relaxation times of a fine in the crowd (limit {DRAG_LIMIT:g}), explicit drag "
                "would overshoot; take drag.scheme = 'implicit', or lower run.time_step_factor, "
                "and start over with --force"
            )


def steps_between(case: InvasionCase, scales: InvasionScales, pace: float) -> int:
    """Steps in which a fine at `pace` m/s covers `drag.update_travel` smallest diameters.

    They are whole refreshes of the drag, at least one.
    """
    travel = case.drag.travel_diameters * 2 * case.fines.radius_range_m[0]
    refresh = scales.time_step * scales.hold_steps
    most = scales.checkpoint_steps // scales.hold_steps
    refreshes = travel / (pace * refresh) if pace > 0 else math.inf
    return max(1, math.floor(min(refreshes, most))) * scales.hold_steps


# ------------------------------------------------------------------------------------------------
# What fdnet does at each checkpoint while LIGGGHTS runs.


class CheckpointKeeper:
    """Follows the screen of a run and passes every line on.

    At each checkpoint it records what is whole now, keeps the two newest restarts, and stops a run
    that writes to a full disk or whose fines overlap too much. LIGGGHTS itself goes on after a
    failed write and ends with exit code 0. Older restarts are removed only while there is room on
    the disk.
    """

    def __init__(
        self,
        folder: Path,
        case: InvasionCase,
        scales: InvasionScales,
        grains: Snapshot,
        *,
        launch: Launch,
    ) -> None:
        self.folder, self.case, self.scales, self.grains = folder, case, scales, grains
        self.ranks, self.follow, self.watch = launch.ranks, launch.follow, WatchReader(folder)

    def __call__(self, line: str) -> None:
        if line.startswith("FDNET checkpoint"):
            self._keep(int(line.split()[3]))
        if self.follow:
            self.follow(line)

    def _keep(self, step: int) -> None:
        if disk_is_full(self.folder):
            raise LiggghtsError(
                f"{self.folder}: the disk is full, LIGGGHTS was stopped; make room and "
                "continue with --resume"
            )
        rows = [row for row in read_history(self.folder) if row.step == step]
        overlaps = self.watch.upto(step)
        if rows:
            write_record(self.folder, rows[-1], self.case, ranks=self.ranks, overlaps=overlaps)
        elif self.case.run.on_overlap == "stop":
            raise LiggghtsError(
                f"{self.folder / HISTORY}: no row for the checkpoint at step {step}; continue "
                "with --resume"
            )
        restarts = [
            (at, path)
            for at, path in checkpoint_files(self.folder)
            if path.suffix == ".restart" and at <= step
        ]
        for _, old in sorted(restarts)[:-2]:
            old.unlink(missing_ok=True)
        for row in rows[-1:]:
            refuse_overlap(
                self.case, self.scales, self.grains, self.folder, history=[row], last=row
            )


# ------------------------------------------------------------------------------------------------
# The invasion: fines are driven into the pack until it is plugged.
#
# A checkpoint after every chunk of steps lets a cut run go on.


_START_OF_SCREEN = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Invasion:
    """A finished invasion.

    Attributes:
        damaged: grains and remaining fines at the end, those upstream too.
        history: one row a checkpoint.
        stop_reason: "plugged", "supply_exhausted", "duration" (the time or volume that the
            case asks for) or "cap".
        supplied: number of fines that took part: all, or those of the batches that had come.
        overlap: largest overlap of a fine with any sphere.
        step_s: s, time step.
        left_out: what the deck does without.
        warnings: doubts about how it ended, one sentence each.
        ranks: MPI ranks of all executions of LIGGGHTS.
        runs: executions of LIGGGHTS; empty when an earlier session had come to the end.
        updates: the record of a coupled invasion, one row an update; empty when it is not coupled.
    """

    damaged: Snapshot
    history: tuple[Checkpoint, ...]
    stop_reason: str
    supplied: int
    overlap: Deepest
    step_s: float
    left_out: tuple[LeftOut, ...]
    warnings: tuple[str, ...]
    ranks: int
    runs: tuple[Run, ...]
    updates: tuple[Mapping[str, float], ...]

    @property
    def max_overlap(self) -> float:
        """Largest overlap of a fine with any sphere, over the smaller diameter."""
        return self.overlap.fraction


def invade(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    folder: Path,
    launch: Launch,
    *,
    fluid: Fluid | None = None,
) -> Invasion:
    """Drive the fines in; continues from the last complete checkpoint when `folder` holds one.

    A coupled case (`case.drag.coupled`) needs the `fluid` that answers for its fines.

    Raises LiggghtsError when a run fails or fines are lost, CaseError when the fines cannot be
    placed or the invasion was begun on another number of MPI ranks.
    """
    _refuse_uncoupled(case, fluid)
    (folder / "post").mkdir(parents=True, exist_ok=True)
    refuse_other_ranks(folder, case, launch.ranks)
    deck, run = _drive(case, scales, grains, folder, launch, fluid)
    history, batches = read_history(folder), batches_of(case, scales)
    overlaps, damaged = [], grains
    for _, damaged in readable_states(folder, history, case, scales, grains):
        overlaps.append(overlap_in(case, damaged))
    reason, warnings = _ending(case, scales, folder, history)
    warnings += kept_doubts(folder)
    if len(overlaps) < len(history):
        lost = len(history) - len(overlaps)
        warnings.append(
            Doubt(
                "dumps-cannot-be-read",
                f"{lost} of {len(history)} checkpoint dumps cannot be read: they are missing from "
                "the largest overlap and from invasion.pvd",
            )
        )
    return Invasion(
        damaged=damaged,
        history=history,
        stop_reason=reason,
        supplied=batches.supplied(entered_by(case, batches, history[-1])),
        overlap=deepest_of([*overlaps, *read_watch(folder)]),
        step_s=scales.time_step,
        left_out=deck.left_out,
        warnings=tuple(warnings),
        ranks=launch.ranks,
        runs=(run,) if run else (),
        updates=tuple(read_updates(folder)),
    )


def _refuse_uncoupled(case: InvasionCase, fluid: Fluid | None) -> None:
    """Raise CaseError unless a coupled case, and no other, has a fluid."""
    if case.drag.coupled != (fluid is not None):
        raise CaseError(
            f"drag.crowd: {case.drag.crowd!r} with drag.field {case.drag.field!r} "
            f"{'needs' if case.drag.coupled else 'takes'} "
            f"{'a' if case.drag.coupled else 'no'} fluid that fdnet computes; run the case with "
            "fdnet run or fdnet.run_case"
        )


def _drive(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    folder: Path,
    launch: Launch,
    fluid: Fluid | None,
) -> tuple[Deck, Run | None]:
    """Run to the end of the invasion; no run when the last checkpoint was the end already."""
    while True:
        last = last_checkpoint(folder, case)
        keep_doubts(folder, passed_over(folder, case, last))
        deck = _prepare(case, scales, grains, folder, ranks=launch.ranks, last=last)
        if last is not None:
            refuse_overlap(case, scales, grains, folder, history=read_history(folder), last=last)
        if _over(case, scales, folder, last):
            return deck, None
        keeper = CheckpointKeeper(folder, case, scales, grains, launch=launch)
        follower, coupling = replace(launch, follow=keeper), None
        if fluid is not None:
            coupling = Coupling(
                case=case,
                scales=scales,
                grains=grains,
                folder=folder,
                fluid=fluid,
                last=last,
                over=partial(_over, case, scales, folder),
            )
        run = _run(folder, last, follower, coupling)
        if run is not None:
            return deck, run


def _run(
    folder: Path, last: Checkpoint | None, launch: Launch, coupling: Coupling | None
) -> Run | None:
    """The run, or None when LIGGGHTS could not read the restart (a full disk cuts it silently).

    The restart is then set aside, so that the checkpoint before it is tried next.
    """
    deck = "in.invade" if last is None else "in.invade.resume"
    try:
        if coupling is not None:
            return run_fed(folder, deck, launch, coupling.play)
        return run_deck(folder, deck, launch)
    except LiggghtsError:
        with (folder / SCREEN).open("rb") as file:
            screen = file.read(_START_OF_SCREEN)
        if last is None or b"FDNET restoring" not in screen or b"FDNET restored" in screen:
            raise
        restart = folder / "post" / f"invade_{last.step}.restart"
        restart.rename(restart.with_suffix(".unreadable"))
        return None
    finally:
        (folder / SCRATCH).unlink(missing_ok=True)


def _over(
    case: InvasionCase, scales: InvasionScales, folder: Path, last: Checkpoint | None
) -> bool:
    """Whether the last checkpoint is the end of the invasion."""
    if last is None:
        return False
    if last.chunk >= chunks_of(case, scales) or rate_is_low(folder, case, last.step):
        return True
    if volume_has_passed(folder, case, scales, last.step):
        return True
    return case.run.duration_s is None and quiet_enough(case, scales, last)


def _prepare(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    folder: Path,
    *,
    ranks: int,
    last: Checkpoint | None,
) -> Deck:
    """Write the inputs of a start, or of a restart from `last` with later files removed."""
    if last is None:
        old = (path for _, path in checkpoint_files(folder))
        for stale in [folder / HISTORY, folder / WATCH, folder / UPDATES, *old]:
            stale.unlink(missing_ok=True)
        deck = write_invade_inputs(case, scales, grains, folder, ranks=ranks)
        write_text(folder / HISTORY, HISTORY_HEADER + "\n")
        return deck
    rows = [row for row in read_history(folder) if row.step <= last.step]
    write_text(
        folder / HISTORY, "\n".join([HISTORY_HEADER, *(csv_row(row) for row in rows)]) + "\n"
    )
    cut_watch(folder, last.step)
    for step, path in checkpoint_files(folder):
        if step > last.step:
            path.unlink()
    if case.fines.supply == "batches":
        write_batches(case, scales, grains, folder)
    write_parts(case, scales, grains, folder)
    deck = render_invade(case, scales, grains, ranks=ranks, resume=last)
    write_text(folder / "in.invade.resume", deck.text)
    return deck


def _ending(
    case: InvasionCase, scales: InvasionScales, folder: Path, history: tuple[Checkpoint, ...]
) -> tuple[str, list[str]]:
    """The stop reason, and warnings.

    An empty slab decides nothing about plugging, so it is a reason of its own.
    """
    last = history[-1]
    waiting = last.upstream - last.removed_upstream
    warnings: list[str] = []
    if rate_is_low(folder, case, last.step):
        reason = "plugged"
    elif case.run.duration_s is not None or volume_has_passed(folder, case, scales, last.step):
        reason = "duration"
    elif quiet_enough(case, scales, last):
        reason = "plugged" if waiting > 0 else "supply_exhausted"
    else:
        reason, cap = "cap", scales.cap_time * scales.force_factor
        warnings.append(
            Doubt(
                "stopped-at-the-cap",
                f"invasion stopped at its cap of {1e3 * cap:.3g} ms before the stop rule "
                "held: raise run.cap_ms",
            )
        )
    if waiting == 0:
        warnings.append(
            Doubt(
                "empty-slab",
                "no fine is left upstream: the end was decided by an empty slab, raise "
                "fines.count or fines.slab_mm",
            )
        )
    before = history[-min(len(history), quiet_chunks(scales) + 1)]
    if reason == "plugged" and last.passed > before.passed:
        warnings.append(
            Doubt(
                "still-leaving",
                f"the face was plugged, but {last.passed - before.passed} fines still left "
                "through the outlet meanwhile: raise run.plug_time_ms to follow them",
            )
        )
    if last.removed_upstream:
        warnings.append(
            Doubt(
                "bounced-out",
                f"{last.removed_upstream} fines bounced out upstream and were removed",
            )
        )
    return reason, warnings
