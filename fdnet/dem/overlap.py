"""The overlap of fines, watched while an invasion runs.

The deck measures it every few steps, and the dumps of the checkpoints give it as well.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.case.case import Case, InvasionCase
from fdnet.dem.checkpoint import Checkpoint, readable_states
from fdnet.dem.deck import LeftOut, number, render_text
from fdnet.errors import LiggghtsError
from fdnet.files.atomic import write_text
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.contacts import groups_apart, max_overlap
from fdnet.spheres.snapshot import Snapshot

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
