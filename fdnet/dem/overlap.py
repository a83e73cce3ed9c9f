"""The overlap of fines, watched while an invasion runs: by the deck every some steps, from the dump at checkpoints."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fdnet.atomic import write_text
from fdnet.case.case import Case, InvasionCase
from fdnet.dem.checkpoint import Checkpoint, readable_states
from fdnet.dem.deck import number
from fdnet.errors import LiggghtsError
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.contacts import max_overlap
from fdnet.spheres.snapshot import Snapshot

WATCH = "overlap.csv"
EVERY, MOST_ROWS = 50, 200
"""Steps between two looks (each costs about a fifth of a step with contacts), and most of them in a chunk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Deepest:
    """The largest overlap of a fine with any sphere over the smaller diameter, and the step at which it was seen."""

    step: int
    fraction: float


def is_watched(case: InvasionCase) -> bool:
    """Whether the deck can watch: LIGGGHTS reduces overlaps in metres over all pairs, of grains too."""
    return case.grains.motion == "fixed" and case.fines.one_size


def watch_variables(case: InvasionCase, scales: InvasionScales) -> dict[str, Any] | None:
    """Variables of `_overlap.in.j2`; None where the dumps alone must do."""
    if not is_watched(case):
        return None
    every = max(EVERY, scales.checkpoint_steps // MOST_ROWS)
    return {"every": every, "diameter": number(2 * case.fines.radius_range_m[1]), "file": WATCH}


def read_watch(folder: Path) -> Iterator[Deepest]:
    """What the deck saw; nothing where it did not watch. A half-written last line and titles are no rows."""
    try:
        text = (folder / WATCH).read_text(errors="replace")
    except OSError:
        return
    for line in text[: text.rfind("\n") + 1].splitlines():
        step, comma, fraction = line.partition(",")
        if comma and step.isdecimal():
            yield Deepest(step=int(step), fraction=max(0.0, _number(fraction)))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return 0.0


def cut_watch(folder: Path, last_step: int) -> None:
    """Forget what was seen after `last_step`, from which the run goes on."""
    if (folder / WATCH).exists():
        rows = [
            f"{row.step},{row.fraction!r}\n" for row in read_watch(folder) if row.step <= last_step
        ]
        write_text(folder / WATCH, "".join(rows))


def overlap_in(case: Case, state: Snapshot) -> Deepest:
    """The same from a state on disk."""
    return Deepest(step=state.step, fraction=max_overlap(state, case.periodic, only_fines=True))


def deepest_of(seen: Iterable[Deepest]) -> Deepest:
    """The largest, the first of them if several; step 0 and 0.0 where nothing was seen."""
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
    """Raises LiggghtsError when `run.on_overlap` is "stop" and a fine overlapped too much up to checkpoint `last`.

    Looks at what the deck saw and at the dumps of `history`. Everything up to the checkpoint stays on disk.
    """
    if case.run.on_overlap != "stop":
        return
    seen = [found for found in read_watch(folder) if found.step <= last.step]
    for _, state in readable_states(folder, history, case, scales, grains):
        seen.append(overlap_in(case, state))
    deepest = deepest_of(seen)
    if deepest.fraction > case.run.max_overlap:
        raise LiggghtsError(
            f"{folder}: {overlap_text(case, deepest)}; stopped at checkpoint {last.chunk} (step {last.step}) as "
            "run.on_overlap = 'stop' asks; raise run.stiffness_N_m and start over with --force, or go on from here "
            "with --resume --set run.on_overlap=warn (or a larger run.max_overlap)"
        )


def overlap_text(case: Case, deepest: Deepest) -> str:
    """The finding in words."""
    return (
        f"a fine overlapped by {100 * deepest.fraction:.3g} % of the smaller diameter at step {deepest.step} "
        f"(limit run.max_overlap, {100 * case.run.max_overlap:.3g} %)"
    )
