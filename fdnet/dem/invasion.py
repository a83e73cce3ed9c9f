"""A stage that LIGGGHTS runs in chunks of steps; the invasion, which drives fines into the pack.

A checkpoint after every chunk lets a cut run go on. Where the stage is coupled, what the fluid
does to each fine is computed anew while LIGGGHTS waits: fdnet feeds it the deck, then for each
chunk the batch of fines that comes, for each update the files `ask.in` and `fluid.in` with a `run`
after them, and `checkpoint.in`. Every chunk begins with an update and a `run` that sets everything
up, as in a stage that is not coupled; so a cut one goes on bit for bit.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.dem import checkpoint, invade_deck
from fdnet.dem.checkpoint import WATCHED, Checkpoint, Checkpoints, Deepest, Updates
from fdnet.dem.deck import Deck, LeftOut, snapshot_of
from fdnet.dem.invade_deck import GIVEN, SCRATCH, SUPPLY, DrivingFluid, InvadeInputs, Moment
from fdnet.dem.liggghts import SCREEN, Execution, Feed, Launch, run_deck
from fdnet.dem.supply import batches_of, later_batch
from fdnet.errors import CaseError, Doubt, LiggghtsError
from fdnet.files import disk_is_full, write_text
from fdnet.scales.clock import ARRIVALS, rises
from fdnet.scales.scales import InvasionScales, stiffened
from fdnet.spheres.dump import Frame
from fdnet.spheres.geometry import groups_apart
from fdnet.spheres.snapshot import Snapshot

_START_OF_SCREEN = 1 << 20


@dataclass(frozen=True, eq=False, kw_only=True)
class ChunkedStage(ABC):
    """A stage that is run in chunks of steps."""

    case: InvasionCase
    scales: InvasionScales
    grains: Snapshot  # of the pack
    points: Checkpoints
    launch: Launch  # how LIGGGHTS is started
    # answers for the fines of a coupled case; None where the deck holds the forces
    fluid: DrivingFluid | None = None
    first_step: int = 0  # at which it begins

    deck = "in.invade"
    """Name of the deck; that of a continued stage ends in .resume."""
    mark = "FDNET checkpoint"
    """What LIGGGHTS prints at a checkpoint, before the chunk and its last step."""

    @property
    def folder(self) -> Path:
        """Where it runs."""
        return self.points.folder

    @abstractmethod
    def write(self, last: Any | None) -> Deck:
        """Write the inputs of a start, or of a restart from `last`."""

    @abstractmethod
    def over(self, last: Any) -> bool:
        """Whether the checkpoint `last` is the end."""

    def begin_chunk(self, feed: Feed, updates: Updates, last: Any | None) -> None:  # noqa: B027
        """Feed what a coupled stage takes in before the chunk after `last`."""

    def pace(self, last: Any | None) -> InvasionScales:
        """The scales of the chunk after `last`: its steps, and the springs that these bear."""
        return self.scales

    def time_at(self, last: Any | None, steps: float = 0) -> float:
        """Time of the simulation, s, `steps` of the first length after the checkpoint `last`."""
        steps += self.first_step + (last.chunk if last else 0) * self.scales.checkpoint_steps
        return steps * self.scales.time_step

    def drive(self) -> tuple[Deck, tuple[Execution, ...]]:
        """Run to the end, from the last whole checkpoint; nothing is run where that is the end.

        A restart that LIGGGHTS cannot read, since a full disk cut it silently, is set aside; then
        the checkpoint before it is tried. Raises LiggghtsError when a run fails, CaseError when
        the stage was begun on another number of MPI ranks.
        """
        if self.case.drag.coupled != (self.fluid is not None):
            needs, some = ("needs", "a") if self.case.drag.coupled else ("takes", "no")
            raise CaseError(
                f"drag.field: {self.case.drag.field!r} {needs} {some} fluid that fdnet computes; "
                "run the case with fdnet run or fdnet.run_case"
            )
        (self.folder / "post").mkdir(parents=True, exist_ok=True)
        self.points.refuse_another_way(self.launch.ranks)
        runs: tuple[Execution, ...] = ()
        while True:
            last = self.points.last()
            self.points.cut(last)
            deck, name = self.write(last), self.deck if last is None else f"{self.deck}.resume"
            if last is not None and self.over(last):
                return deck, runs
            launch = replace(self.launch, follow=self.follow)
            screen = self.folder / SCREEN
            screen.unlink(missing_ok=True)
            try:
                play = None if self.fluid is None else partial(self._play, name, last)
                runs += (run_deck(self.folder, name, launch, play),)
                if self.fluid is None:
                    return deck, runs
            except LiggghtsError:
                if last is None or not screen.exists():
                    raise
                with screen.open("rb") as file:
                    said = file.read(_START_OF_SCREEN)
                if b"FDNET restoring" not in said or b"FDNET restored" in said:
                    raise
                restart = self.points.path(last.step, "restart")
                restart.rename(restart.with_suffix(".unreadable"))
            finally:
                (self.folder / SCRATCH).unlink(missing_ok=True)

    def follow(self, line: str) -> None:
        """Follow the screen and pass every line on.

        At each checkpoint it records what is whole now, keeps the two newest restarts, and stops a
        run that writes to a full disk. LIGGGHTS itself goes on
        after a failed write and ends with exit code 0. Older restarts are removed only while there
        is room on the disk.
        """
        if line.startswith(self.mark):
            self._keep(int(line.split()[3]))
        if self.launch.follow:
            self.launch.follow(line)

    def _keep(self, step: int) -> None:
        if disk_is_full(self.folder):
            advice = "make room and continue with --resume"
            raise LiggghtsError(f"{self.folder}: the disk is full, LIGGGHTS was stopped; {advice}")
        every = checkpoint.read_rows(self.folder, self.points.kind)
        rows = [row for row in every if row.step == step][-1:]
        since = max((row.step for row in every if row.step < step), default=-1)
        overlaps = [one for one in checkpoint.read_watch(self.folder) if since < one.step <= step]
        for row in rows:
            self.points.keep(row, ranks=self.launch.ranks, overlaps=overlaps)
        self.points.remove_restarts(step)

    def _play(self, name: str, last: Any | None, feed: Feed) -> None:
        """Feed LIGGGHTS a coupled stage, from the deck `name`, until its springs must be others.

        Raises DumpError when LIGGGHTS did not show its spheres, and what the fluid raises.
        """
        assert self.fluid is not None
        updates = Updates(self.folder, self.fluid.measured, upto=last.step if last else 0)
        step, pace = last.step if last else self.first_step, self.pace(last)
        self.fluid.recall(self.points.path(step, "npz") if last else None)
        feed(f"include {name}")
        while last is None or not self.over(last):
            if self.pace(last) != pace:
                return
            self.begin_chunk(feed, updates, last)
            end, fresh = step + pace.checkpoint_steps, True
            while step < end:
                steps = self._update(feed, updates, last, pace, end - step)
                feed(f"run {steps}" + ("" if fresh else " pre no post no"))
                step, fresh = step + steps, False
            self.fluid.keep(self.points.path(step, "npz"))
            feed("include checkpoint.in")
            last = checkpoint.read_history(self.folder, self.points.kind)[-1]

    def _update(
        self, feed: Feed, updates: Updates, last: Any | None, pace: InvasionScales, left: int
    ) -> int:
        """Compute the fluid's forces in the chunk after `last`, of which `left` steps remain.

        Returns the steps they hold for, at most these.
        """
        done = pace.checkpoint_steps - left
        step = (last.step if last else self.first_step) + done
        time = self.time_at(last, done * self.scales.checkpoint_steps / pace.checkpoint_steps)
        frame = self.shown(feed)
        spheres = self.spheres(frame, time)
        moment = Moment(
            step=step,
            time=time,
            before=updates.last,
            fresh=done == 0,
            left=left * pace.time_step,
            given=np.linalg.norm([frame.column(one) for one in GIVEN], axis=0),
            density=invade_deck.fine_density(frame),
        )
        assert self.fluid is not None
        forces = self.fluid.forces(spheres, moment)
        invade_deck.write_forces(self.folder, spheres, forces)
        updates.add(step, time, forces.measures)
        feed("include fluid.in")
        return min(steps_between(self.case, pace, forces.pace), left)

    def shown(self, feed: Feed) -> Frame:
        """The state that LIGGGHTS shows when it is asked."""
        feed("include ask.in")
        return invade_deck.read_state(self.folder)

    def spheres(self, frame: Frame, time: float) -> Snapshot:
        """All spheres of a state at a `time` s, fixed grains too."""
        moved = snapshot_of(frame, self.case, time_s=time)
        return moved if self.case.grains.motion == "mobile" else self.grains.joined(moved)


def steps_between(case: InvasionCase, scales: InvasionScales, pace: float) -> int:
    """Steps in which a fine at `pace` m/s covers `drag.update_travel` smallest diameters.

    They are at least one, and at most those of a chunk.
    """
    travel = case.drag.travel_diameters * 2 * case.fines.radius_range_m[0]
    steps = travel / (pace * scales.time_step) if pace > 0 else math.inf
    return max(1, math.floor(min(steps, scales.checkpoint_steps)))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EndedStage:
    """A finished stage."""

    state: Snapshot  # grains and remaining fines at the end
    history: tuple[Any, ...]  # one row a checkpoint
    # "duration" (what the case asks for has gone by), "cap", or that of the stage
    stop_reason: str
    warnings: tuple[str, ...]  # doubts about how it ended, one sentence each
    left_out: tuple[LeftOut, ...]  # what the deck does without
    # executions of LIGGGHTS; empty when an earlier session had come to the end
    runs: tuple[Execution, ...]
    ranks: int  # MPI ranks of them
    step_s: float  # s, time step


# ---- The invasion: fines are driven into the pack until it is plugged.
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Invasion(EndedStage):
    """A finished invasion; `stop_reason` is also "plugged", "supply_exhausted", "mud_cut_off",
    or "unfinished" of one that was cut.
    """

    supplied: int  # number of fines that took part: all, or those of the batches that had come
    last: InvasionScales  # the scales of the last chunk: its step and its springs
    overlap: Deepest  # largest overlap of a fine with any sphere
    # the record of a coupled invasion, one row an update; empty when it is not coupled
    updates: tuple[Mapping[str, float], ...]


class InvadeStage(ChunkedStage):
    """An invasion as it is run."""

    @cached_property
    def inputs(self) -> InvadeInputs:
        """The files that its deck reads."""
        return InvadeInputs(self.case, self.scales, self.grains, self.folder)

    @cached_property
    def _overlaps(self) -> dict[int, float]:
        """By the step of a checkpoint the overlap that lasted in its chunk."""
        return {}

    @cached_property
    def _turns(self) -> int:
        """In so many chunks fines are watched with all grains once; dumps show all at once."""
        watched = checkpoint.is_watched(self.case)
        return int(groups_apart(self.grains, self.case.periodic).max()) if watched else 1

    def write(self, last: Checkpoint | None) -> Deck:
        """Write the inputs of a start, or of a restart from `last`."""
        ranks = self.launch.ranks
        if last is None:
            return self.inputs.write(ranks=ranks)
        if self.case.fines.supply == "batches":
            self.inputs.write_batches()
        pace = self.pace(last)
        invade_deck.write_parts(self.case, pace, self.grains, self.folder)
        deck = invade_deck.render_invade(self.case, pace, self.grains, ranks=ranks, resume=last)
        write_text(self.folder / f"{self.deck}.resume", deck.text)
        return deck

    def over(self, last: Checkpoint) -> bool:
        """Whether the checkpoint `last` is the end."""
        case, scales = self.case, self.scales
        said = checkpoint.flow_says(self.folder, case, scales, last.step)
        if said or last.chunk >= checkpoint.chunks_of(case, scales):
            return True
        timed = case.run.duration_s is not None
        return not timed and checkpoint.quiet_enough(self.folder, case, scales, last)

    def pace(self, last: Checkpoint | None) -> InvasionScales:
        """The scales of the chunk after `last`, with springs that bear what the chunk before saw.

        They follow from what the checkpoints up to it record: the steps, and the watched overlaps,
        or dumps where none are watched.
        """
        case, scales = self.case, self.scales
        if last is None or not rises(case):
            return scales
        rows = [row for row in checkpoint.read_rows(self.folder) if row.chunk <= last.chunk]
        ends = [0, *(row.step for row in rows)]
        steps = [end - begin for begin, end in pairwise(ends)]
        chunks = checkpoint.reference_chunks(steps, self._turns)
        known = [self._lasted(ends[chunk], rows[chunk]) for chunk in chunks]
        seen = self._lasted(ends[-2], rows[-1])
        return stiffened(case, scales, checkpoint.steps_after(case, steps[-1], seen, known))

    def _lasted(self, since: int, row: Checkpoint) -> float:
        """The overlap that lasted from the step `since` to a checkpoint."""
        if row.step not in self._overlaps:
            watched = checkpoint.read_watch(self.folder)
            seen = [one.fraction for one in watched if since < one.step <= row.step]
            if not seen and not self.points.holds(row.step, "dump"):
                raise LiggghtsError(
                    f"{self.points.path(row.step, 'dump')}: is missing, or not as it was "
                    "recorded, and the springs of the next chunk follow from it; put it back, "
                    "or start over with --force"
                )
            if not seen:
                state = checkpoint.state_at(self.folder, row, self.case, self.scales, self.grains)
                seen.append(checkpoint.overlap_in(self.case, state).fraction)
            self._overlaps[row.step] = checkpoint.lasting_overlap(seen)
        return self._overlaps[row.step]

    def begin_chunk(self, feed: Feed, updates: Updates, last: Checkpoint | None) -> None:
        """Feed the batches that are due, and the grains that are watched next."""
        case, scales = self.case, self.scales
        batches, chunk = batches_of(case, scales), last.chunk + 1 if last else 1
        entered = checkpoint.entered_by(case, batches, last) if last else batches.entered_at(1)
        if not case.drag.slowed:
            for which in range(entered, batches.entered_at(chunk)):
                feed(f"include {SUPPLY}/batch_{which}.in")
        else:
            time = self.time_at(last)
            moved, velocity = 0.0, scales.upstream_velocity  # of the mud, m and m/s
            if updates.last is not None:
                area, since = case.size_m[1] * case.size_m[2], time - updates.last["time_s"]
                velocity = float(updates.last["velocity_m_s"])
                moved = float(updates.last["filtrate_m3"]) / area + velocity * since
            ahead = velocity * scales.checkpoint_steps * scales.time_step
            for which in range(entered, batches.entered_after(moved + ahead)):
                spheres = self.spheres(self.shown(feed), time)
                fines = later_batch(case, scales, spheres, which, moved)
                feed(f"include {self.inputs.write_batch(which, fines, velocity)}")
        if checkpoint.is_watched(case):
            feed(f"include {WATCHED}")

    def ending(self, history: Sequence[Checkpoint]) -> tuple[str, list[str]]:
        """The stop reason, and warnings.

        An empty slab decides nothing about plugging, so it is a reason of its own: fewer than
        `ARRIVALS` fines wait upstream. Mud without an end was cut off then.
        """
        case, scales, last = self.case, self.scales, history[-1]
        waiting, warnings = last.waiting, list[str]()
        reason = checkpoint.flow_says(self.folder, case, scales, last.step)
        if reason is None and case.run.duration_s is not None:
            reason = "duration"
        elif reason is None and checkpoint.quiet_enough(self.folder, case, scales, last):
            reason = "mud_cut_off" if case.fines.endless else "supply_exhausted"
            reason = "plugged" if waiting >= ARRIVALS else reason
        elif reason is None:
            reason, cap = "cap", f"{1e3 * scales.cap_time * scales.force_factor:.3g} ms"
            rule = "before the stop rule held: raise run.cap_ms"
            text = f"invasion stopped at its cap of {cap} {rule}"
            warnings.append(Doubt("stopped-at-the-cap", text))
        if case.fines.endless and (waiting == 0 or reason == "mud_cut_off"):
            text = (
                f"the mud was cut off after {scales.supplied_count} fines "
                f"({1e3 * scales.slab_length:.3g} mm of mud): give fines.slab_mm for more"
            )
            warnings.append(Doubt("mud-cut-off", text))
        elif waiting == 0 or reason == "supply_exhausted":
            left = "no fine is left upstream: the end was decided by an empty slab"
            if waiting:
                left = f"only {waiting} fines are left upstream, too few to call the face plugged"
            warnings.append(Doubt("empty-slab", f"{left}: raise fines.count or fines.slab_mm"))
        fled = (
            last.passed - history[-min(len(history), checkpoint.quiet_chunks(scales) + 1)].passed
        )
        if reason == "plugged" and fled > checkpoint.plug_allowance(case, scales):
            text = (
                f"the face was plugged, but {fled} fines still left through the outlet meanwhile: "
                "raise run.plug_time_ms to follow them"
            )
            warnings.append(Doubt("still-leaving", text))
        if last.removed_upstream:
            text = f"{last.removed_upstream} fines bounced out upstream and were removed"
            warnings.append(Doubt("bounced-out", text))
        return reason, warnings


def invade(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    folder: Path,
    launch: Launch,
    *,
    fluid: DrivingFluid | None = None,
) -> Invasion:
    """Drive the fines in; continues from the last complete checkpoint when `folder` holds one.

    A coupled case (`case.drag.coupled`) needs the `fluid` that answers for its fines.

    Raises LiggghtsError when a run fails or fines are lost, CaseError when the fines cannot be
    placed or the invasion was begun on another number of MPI ranks.
    """
    points = Checkpoints(folder=folder, digest=case.digest("invade"))
    stage = InvadeStage(
        case=case, scales=scales, grains=grains, points=points, launch=launch, fluid=fluid
    )
    deck, runs = stage.drive()
    history = checkpoint.read_history(folder)
    reason, warnings = stage.ending(history)
    ended = {"stop_reason": reason, "left_out": deck.left_out, "runs": runs}
    return _read(case, scales, grains, points, history, warnings, **ended, ranks=launch.ranks)


def invasion_so_far(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot, folder: Path
) -> Invasion | None:
    """The cut invasion in `folder` at its last whole checkpoint; None without one.

    Nothing is written. Its stop reason is "unfinished".
    """
    points = Checkpoints(folder=folder, digest=case.digest("invade"))
    last = points.last()
    record = None if last is None else points.record(last.step)
    if last is None or record is None:
        return None
    history = tuple(row for row in checkpoint.read_history(folder) if row.step <= last.step)
    ended = {"stop_reason": "unfinished", "left_out": (), "runs": ()}
    return _read(case, scales, grains, points, history, [], **ended, ranks=record.ranks)


def _read(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    points: Checkpoints,
    history: tuple[Checkpoint, ...],
    warnings: Sequence[str],
    **ended: Any,
) -> Invasion:
    """The invasion in the folder of its `points`, up to the last checkpoint of the `history`.

    `ended` are the fields of `EndedStage` that no file tells.
    """
    folder, step, overlaps, damaged = points.folder, history[-1].step, [], grains
    for _, damaged in checkpoint.readable_states(folder, history, case, scales, grains):
        overlaps.append(checkpoint.overlap_in(case, damaged))
    if len(overlaps) < len(history):
        text = (
            f"{len(history) - len(overlaps)} of {len(history)} checkpoint dumps cannot be read: "
            "they are missing from the largest overlap and from invasion.pvd"
        )
        warnings = [*warnings, Doubt("dumps-cannot-be-read", text)]
    begun = history[-2].step if len(history) > 1 else 0
    entered = checkpoint.entered_by(case, batches_of(case, scales), history[-1])
    return Invasion(
        **ended,
        state=damaged,
        history=history,
        warnings=tuple(warnings),
        last=stiffened(case, scales, step - begun),
        supplied=batches_of(case, scales).supplied(entered),
        overlap=checkpoint.deepest_of(
            [*overlaps, *(one for one in checkpoint.read_watch(folder) if one.step <= step)]
        ),
        step_s=scales.time_step,
        updates=tuple(row for row in checkpoint.read_updates(folder) if row["step"] < step),
    )
