"""Attacks on small real runs: the result stays that of the uncut run, or there is one refusal.

Anything else is a fault: a silent difference, a hang, a traceback, a lost file.
"""

import json
import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from random import Random
from typing import Any

from validation.chaos.attacks import ATTACKS, ORDER, TWO_RANKS
from validation.chaos.commands import FaultError
from validation.chaos.runs import Prepared, nursery_in, prepare
from validation.chaos.surroundings import SkipError


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of one attack.

    Attributes:
        index: of the attack.
        kind: name of the attack.
        what: "ok", "refused", "skipped" or "fault".
        words: what fdnet did, or why the attack was skipped; "" otherwise.
        seconds: s, wall time.
    """

    index: int
    kind: str
    what: str
    words: str
    seconds: float


def one_attack(
    prepared: Mapping[int, Prepared], seed: int, index: int, kinds: Sequence[str] = ORDER
) -> Outcome:
    """Attack `index` of a seed; it is always the same. `prepared` is by number of MPI ranks."""
    rng = Random(f"{seed}:{index}")
    kind, start, words = kinds[index % len(kinds)], time.perf_counter(), ""
    with tempfile.TemporaryDirectory(prefix="fdnet-chaos-", ignore_cleanup_errors=True) as folder:
        try:
            what = ATTACKS[kind](rng, Path(folder), prepared[1 + (kind in TWO_RANKS)])
        except FaultError as fault:
            what, words = "fault", str(fault)
        except SkipError as skip:
            what, words = "skipped", str(skip)
    seconds = round(time.perf_counter() - start, 2)
    words = " ".join(words.split())[:400]
    return Outcome(index=index, kind=kind, what=what, words=words, seconds=seconds)


@contextmanager
def prepared_runs(folder: Path, *, ranks: Iterable[int] = (1, 2)) -> Iterator[dict[int, Prepared]]:
    """The runs that are attacked, by number of MPI ranks, made in an empty folder."""
    with nursery_in(folder) as nursery:
        yield {number: prepare(folder, nursery, ranks=number) for number in ranks}


def chaos(
    prepared: Mapping[int, Prepared],
    *,
    seed: int,
    indices: Iterable[int],
    kinds: Sequence[str] = ORDER,
    jobs: int = 1,
    seconds: float = math.inf,
    progress: Path | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Attacks `indices` of a seed; returns the record.

    Args:
        prepared: the runs that are attacked, by number of MPI ranks.
        seed: of the attacks.
        indices: which attacks.
        kinds: names of the attacks, one after the other.
        jobs: number of attacks at the same time.
        seconds: s, no attack begins after this time; the record has the number of those done.
        progress: a file that keeps each outcome; attacks that are in it already are not repeated.
        report: takes a line for each fault.

    Returns:
        Counts by kind and outcome, and every fault with its index.
    """
    done = {} if progress is None else _read(progress)
    start = time.perf_counter()

    def attack(index: int) -> Outcome | None:
        if time.perf_counter() - start > seconds:
            return None
        return one_attack(prepared, seed, index, kinds)

    with ThreadPoolExecutor(jobs) as pool:
        waiting = [index for index in indices if index not in done]
        for outcome in filter(None, pool.map(attack, waiting)):
            done[outcome.index] = outcome
            if progress is not None:
                with progress.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(outcome)) + "\n")
            if outcome.what == "fault":
                report(f"{outcome.index} {outcome.kind}: {outcome.words}")
    return record_of(done.values(), seed)


def record_of(outcomes: Iterable[Outcome], seed: int) -> dict[str, Any]:
    """Counts by kind and outcome, every fault, and the reasons of what was skipped."""
    ordered = sorted(outcomes, key=lambda outcome: outcome.index)
    counts = Counter((outcome.kind, outcome.what) for outcome in ordered)
    by_kind: dict[str, dict[str, int]] = {}
    for (kind, what), count in sorted(counts.items()):
        by_kind.setdefault(kind, {})[what] = count
    return {
        "attacks": len(ordered),
        "seed": seed,
        "seconds": round(sum(outcome.seconds for outcome in ordered), 1),
        "kinds": by_kind,
        "skipped": sorted({one.words for one in ordered if one.what == "skipped"}),
        "faults": [
            {"index": one.index, "kind": one.kind, "what": one.words}
            for one in ordered
            if one.what == "fault"
        ],
    }


def _read(progress: Path) -> dict[int, Outcome]:
    """The outcomes in the file, without an unfinished last line; the last of each attack."""
    if not progress.exists():
        return {}
    text = progress.read_text(encoding="utf-8")
    lines = text[: text.rfind("\n") + 1].splitlines()
    return {one.index: one for one in (Outcome(**json.loads(line)) for line in lines)}
