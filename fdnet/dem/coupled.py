"""A coupled invasion: what the fluid does to each fine is computed anew while LIGGGHTS waits.

fdnet feeds LIGGGHTS the commands of an invasion: the deck, then for each chunk the batch of fines
that comes, for each update the files `ask.in` and `fluid.in` with a `run` after them, and
`checkpoint.in`. Every chunk begins with an update and a `run` that sets everything up, as in an
invasion that is not coupled; so a cut one goes on bit for bit.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.dem.batch_files import SUPPLY
from fdnet.dem.batches import Batches, batches_of
from fdnet.dem.checkpoint import Checkpoint, chunks_of, entered_by, read_history
from fdnet.dem.feed import Feed
from fdnet.dem.fluid import (
    Fluid,
    FluidForces,
    Moment,
    fine_density,
    given_speed,
    largest_share,
    read_state,
    write_forces,
)
from fdnet.dem.invade_deck import batch_files
from fdnet.dem.overlap import WATCHED, is_watched
from fdnet.dem.scene import snapshot_of
from fdnet.dem.supply import later_batch
from fdnet.dem.updates import Updates
from fdnet.errors import LiggghtsError
from fdnet.scales.scales import InvasionScales
from fdnet.scales.time_step import DRAG_LIMIT
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
