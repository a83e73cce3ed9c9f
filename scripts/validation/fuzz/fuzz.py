"""Mutated inputs through fdnet's real entries: none may crash, hang or leave a half-written file.

All inputs run in this process. Beyond the faults that `targets` names, any exception but fdnet's
own, a warning of Python, and more than the limit of CPU time are faults.
"""

import contextlib
import faulthandler
import signal
import tempfile
import time
import tomllib
import warnings
from collections import Counter
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from random import Random
from typing import Any

from validation.fuzz.targets import Command, Target, fault, targets

LIMIT_S = 10.0
"""CPU seconds that one input may take."""


class TooLong(BaseException):
    """The time limit of one input has passed."""


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TooLong in the body after `seconds` of this process's CPU time."""

    def stop(*_: Any) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    # compiled code sees no signal before it returns: this ends the process and says where it was
    faulthandler.dump_traceback_later(30 * seconds, exit=True)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGPROF, before)


def one_input(known: dict[str, Target], seed: int, index: int) -> tuple[str, bytes, Random]:
    """Kind, bytes and the generator that chooses the options of input `index`."""
    rng = Random(f"{seed}:{index}")
    name = rng.choice(list(known))
    kind = rng.choice(list(known[name].changes))
    return f"{name} {kind}", known[name].changes[kind](rng, rng.choice(known[name].seeds)), rng


def outcome(target: Target, data: bytes, rng: Random, limit: float) -> str:
    """What became of one input."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        try:
            with limited(limit):
                result = target.judge(data, Path(folder), rng)
        except TooLong:
            return fault(f"not done within {limit:g} s")
        except Exception as error:
            return fault(f"{type(error).__name__}: {error}")
    return fault(f"{seen[0].category.__name__}: {seen[0].message}") if seen else result


def _refuse_bad_seeds(target: Target) -> None:
    """What all inputs are made from must be accepted.

    This also compiles what numba compiles, outside the time limit.
    """
    plain = Random()
    plain.choice = lambda options: options[-1]  # type: ignore[method-assign, assignment]
    for data in target.seeds:
        with tempfile.TemporaryDirectory() as folder:
            result = target.judge(data, Path(folder), plain)
        if not result.startswith("accepted"):
            raise RuntimeError(f"a good input is not accepted: {result}")


def fuzz(
    root: Path,
    command: Command,
    *,
    seed: int,
    indices: range,
    limit: float = LIMIT_S,
    keep: Path | None = None,
) -> dict[str, Any]:
    """Runs the inputs `indices` of `seed` and returns the record.

    Args:
        root: the project's folder, whose cases are among the good inputs.
        command: fdnet's command line.
        seed: of the mutations.
        indices: which inputs; input INDEX of a seed is always the same.
        limit: CPU seconds an input may take.
        keep: folder for the inputs that made faults.

    Returns:
        Counts by kind and outcome, and every fault with its index.
    """
    known = targets(root, command)
    counts: Counter[tuple[str, str]] = Counter()
    faults: list[dict[str, Any]] = []
    for target in known.values():
        _refuse_bad_seeds(target)
    start = time.perf_counter()
    for index in indices:
        kind, data, rng = one_input(known, seed, index)
        if keep:
            (keep / "last").write_text(f"{seed} {index} {kind}")
        result = outcome(known[kind.split()[0]], data, rng, limit)
        counts[kind, result.partition(":")[0]] += 1
        if result.startswith("fault"):
            faults.append({"index": index, "kind": kind, "what": " ".join(result.split())[:300]})
            if keep:
                (keep / f"{seed}_{index}").write_bytes(data)
    kinds: dict[str, dict[str, int]] = {}
    for (kind, result), count in sorted(counts.items()):
        kinds.setdefault(kind, {})[result] = count
    return {
        "inputs": len(indices),
        "seed": seed,
        "limit_s": limit,
        "seconds": round(time.perf_counter() - start, 1),
        "versions": _versions(root),
        "kinds": kinds,
        "faults": faults,
    }


def _versions(root: Path) -> dict[str, str]:
    versions = {name: metadata.version(name) for name in ("numpy", "pandas", "pydantic", "scipy")}
    versions["fdnet"] = tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    return versions
