"""Attacks on small real runs: the result stays that of the uncut run, or there is one refusal.

Anything else is a fault: a silent difference, a hang, a traceback, a lost file.
"""

import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from typing import Any

from fdnet.studies.chaos.attacks import ATTACKS
from fdnet.studies.chaos.runs import FaultError, Prepared, prepare


def one_attack(prepared: Prepared, seed: int, index: int, kinds: Sequence[str]) -> tuple[str, str]:
    """Kind and outcome of attack `index` of a seed; it is always the same.

    The outcome is "ok", "refused", or "fault: " with what fdnet did.
    """
    rng = Random(f"{seed}:{index}")
    kind = kinds[index % len(kinds)]
    with tempfile.TemporaryDirectory(prefix="fdnet-chaos-") as folder:
        try:
            return kind, ATTACKS[kind](rng, Path(folder), prepared)
        except FaultError as fault:
            return kind, f"fault: {fault}"


def chaos(
    folder: Path,
    *,
    seed: int,
    indices: Iterable[int],
    kinds: Sequence[str] = tuple(ATTACKS),
    jobs: int = 1,
    seconds: float = math.inf,
    report: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Attacks `indices` of a seed; returns the record.

    Args:
        folder: for the runs that are attacked.
        seed: of the attacks.
        indices: which attacks.
        kinds: names of the attacks, one after the other.
        jobs: number of attacks at the same time.
        seconds: s, no attack begins after this time; the record has the number of those done.
        report: takes a line for each fault.

    Returns:
        Counts by kind and outcome, and every fault with its index.
    """
    prepared = prepare(folder)
    counts: Counter[tuple[str, str]] = Counter()
    faults: list[dict[str, Any]] = []
    start = time.perf_counter()

    def attack(index: int) -> tuple[int, str, str]:
        if time.perf_counter() - start > seconds:
            return index, "", ""
        return index, *one_attack(prepared, seed, index, kinds)

    with ThreadPoolExecutor(jobs) as pool:
        for index, kind, outcome in pool.map(attack, indices):
            if not kind:
                continue
            counts[kind, outcome.partition(":")[0]] += 1
            if outcome.startswith("fault"):
                what = " ".join(outcome.split())[:400].removeprefix("fault: ")
                faults.append({"index": index, "kind": kind, "what": what})
                report(f"{index} {kind}: {what}")
    by_kind: dict[str, dict[str, int]] = {}
    for (kind, outcome), count in sorted(counts.items()):
        by_kind.setdefault(kind, {})[outcome] = count
    return {
        "attacks": sum(counts.values()),
        "seed": seed,
        "seconds": round(time.perf_counter() - start, 1),
        "kinds": by_kind,
        "faults": faults,
    }
