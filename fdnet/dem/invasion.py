"""The invasion: fines are driven into the pack until it is plugged.

A checkpoint after every chunk of steps lets a cut run go on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.dem.batches import batches_of
from fdnet.dem.checkpoint import (
    HISTORY,
    HISTORY_HEADER,
    Checkpoint,
    chunks_of,
    csv_row,
    entered_by,
    quiet_chunks,
    quiet_enough,
    read_history,
    readable_states,
)
from fdnet.dem.checkpoint_record import (
    keep_doubts,
    kept_doubts,
    last_checkpoint,
    passed_over,
    refuse_other_ranks,
)
from fdnet.dem.coupled import Coupling
from fdnet.dem.deck import Deck, LeftOut
from fdnet.dem.digests import checkpoint_files
from fdnet.dem.feed import run_fed
from fdnet.dem.fluid import Fluid
from fdnet.dem.invade_deck import (
    SCRATCH,
    render_invade,
    write_batches,
    write_invade_inputs,
    write_parts,
)
from fdnet.dem.keeper import CheckpointKeeper
from fdnet.dem.liggghts import Launch, Run, run_deck
from fdnet.dem.overlap import (
    WATCH,
    Deepest,
    cut_watch,
    deepest_of,
    overlap_in,
    read_watch,
    refuse_overlap,
)
from fdnet.dem.updates import UPDATES, rate_is_low, read_updates, volume_has_passed
from fdnet.dem.verdict import SCREEN
from fdnet.errors import CaseError, LiggghtsError
from fdnet.files.atomic import write_text
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot

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
            f"{lost} of {len(history)} checkpoint dumps cannot be read: they are missing from the "
            "largest overlap and from invasion.pvd"
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
    warnings = []
    if rate_is_low(folder, case, last.step):
        reason = "plugged"
    elif case.run.duration_s is not None or volume_has_passed(folder, case, scales, last.step):
        reason = "duration"
    elif quiet_enough(case, scales, last):
        reason = "plugged" if waiting > 0 else "supply_exhausted"
    else:
        reason, cap = "cap", scales.cap_time * scales.force_factor
        warnings.append(
            f"invasion stopped at its cap of {1e3 * cap:.3g} ms before the stop rule "
            "held: raise run.cap_ms"
        )
    if waiting == 0:
        warnings.append(
            "no fine is left upstream: the end was decided by an empty slab, raise fines.count or "
            "fines.slab_mm"
        )
    before = history[-min(len(history), quiet_chunks(scales) + 1)]
    if reason == "plugged" and last.passed > before.passed:
        warnings.append(
            f"the face was plugged, but {last.passed - before.passed} fines still left through "
            "the outlet meanwhile: raise run.plug_time_ms to follow them"
        )
    if last.removed_upstream:
        warnings.append(f"{last.removed_upstream} fines bounced out upstream and were removed")
    return reason, warnings
