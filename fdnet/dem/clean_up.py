"""The clean-up: after the invasion the flow is turned back, and what is loose comes out.

It begins with the restart of the invasion's last checkpoint: the same spheres, contacts and
velocities. A checkpoint after every chunk of steps lets a cut run go on.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fdnet.dem.checkpoint import HISTORY
from fdnet.dem.clean_up_deck import Beginning, clean_up_parts, render_clean_up
from fdnet.dem.clean_up_states import (
    CLEANED_HEADER,
    Cleaned,
    cleaned_state,
    invasion_restart,
    keep_record,
    newest_whole,
    read_cleaned,
    restart_name,
)
from fdnet.dem.coupled import Coupling
from fdnet.dem.deck import Deck, LeftOut
from fdnet.dem.feed import Feed, run_fed
from fdnet.dem.fluid import Fluid
from fdnet.dem.liggghts import Launch, Run, run_deck
from fdnet.dem.updates import UPDATES, Updates
from fdnet.errors import LiggghtsError
from fdnet.files.atomic import disk_is_full, write_text
from fdnet.scales.clean_up import BackFlow
from fdnet.spheres.snapshot import Snapshot

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
