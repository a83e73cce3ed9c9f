"""Many runs under random kills: afterwards nothing is left of them but their results.

The last session of each run is done in this process, whose handles and memory are watched.
"""

import contextlib
import io
import os
import shutil
import signal
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any

from validation.chaos.attacks import FRESH
from validation.chaos.commands import LIMIT_S, FaultError, count_files, wait_for
from validation.chaos.judge import differs
from validation.chaos.runs import Prepared, nursery_in, prepare, to_go_on

MARK = "FDNET_SOAK"
"""Name in the environment by which the processes of a soak are known."""
MOST_KILLS = 4
ALLOWED_GROWTH = 40 << 20
"""Bytes by which this process may grow after its second run (caches of libraries)."""

Command = Callable[[Sequence[str]], int]


def soak(folder: Path, command: Command, *, runs: int, seed: int) -> dict[str, Any]:
    """Do `runs` runs, each killed at random moments and continued until done.

    Args:
        folder: an empty folder for the runs and their temporary files.
        command: fdnet's command line.
        runs: number of runs.
        seed: of the moments.

    Returns:
        The record: counts, handles and memory after each run, and every fault.
    """
    rng, mark, temporary = Random(seed), uuid.uuid4().hex, folder / "tmp"
    temporary.mkdir()
    faults: list[dict[str, Any]] = []
    handles, memory, kills = [], [], 0
    start = time.perf_counter()
    with _environment({MARK: mark, "TMPDIR": str(temporary)}):
        with nursery_in(folder / "prepared") as nursery:
            prepared = prepare(folder / "prepared", nursery)
            for number in range(runs):
                out = folder / f"run_{number}"
                done, what = _one_run(prepared, out, rng, command)
                kills += done
                if what:
                    faults.append({"index": number, "kind": "soak", "what": what})
                else:
                    shutil.rmtree(out)
                handles.append(len(os.listdir("/proc/self/fd")))
                memory.append(_memory_bytes())
        faults += [
            {"index": -1, "kind": "soak", "what": what}
            for what in _left(folder, temporary, mark, handles, memory)
        ]
    return {
        "runs": runs,
        "kills": kills,
        "seed": seed,
        "seconds": round(time.perf_counter() - start, 1),
        "handles": [handles[0], handles[-1]],
        "memory_bytes": [memory[min(1, runs - 1)], memory[-1]],
        "faults": faults,
    }


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Any:
    before = dict(os.environ)
    os.environ.update(values)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _one_run(prepared: Prepared, out: Path, rng: Random, command: Command) -> tuple[int, str]:
    """Number of kills of a run, and what is wrong with it at its end, "" when nothing is."""
    kills = 0
    try:
        kills = _killed(prepared, out, rng)
        return kills, _finished(prepared, out, command)
    except FaultError as fault:
        return kills, str(fault)


def _killed(prepared: Prepared, out: Path, rng: Random) -> int:
    """Start the run and kill it up to MOST_KILLS times, when it has written some of its files.

    Returns the number of kills.
    """
    kills, files = 0, count_files(prepared.root / "finished")
    for _ in range(rng.randrange(1, MOST_KILLS + 1)):
        resume = to_go_on(out)
        child = prepared.start(out, *resume, fresh=rng.random() < FRESH)
        child.let_write(out, rng.randrange(files))
        child.send(rng.choice((signal.SIGKILL, signal.SIGTERM)))
        kills += wait_for(child).code != 0
    return kills


def _finished(prepared: Prepared, out: Path, command: Command) -> str:
    """End the run in this process; what is wrong with it, "" when nothing is."""
    resume = to_go_on(out)
    screen, handler = io.StringIO(), signal.getsignal(signal.SIGTERM)
    with (
        _alarm(),
        contextlib.redirect_stdout(screen),
        contextlib.redirect_stderr(screen),
    ):
        code = command(prepared.words(out, *resume))
    signal.signal(signal.SIGTERM, handler)
    if code:
        return f"exit code {code}: {' '.join(screen.getvalue().split())[-300:]}"
    return differs(prepared, out)


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    """Raise FaultError in the body when it takes longer than LIMIT_S."""

    def ring(_: int, frame: FrameType | None) -> None:
        place = "" if frame is None else f", in {frame.f_code.co_filename}:{frame.f_lineno}"
        raise FaultError(f"hang: not done within {LIMIT_S:g} s{place}")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _left(
    folder: Path, temporary: Path, mark: str, handles: Sequence[int], memory: Sequence[int]
) -> list[str]:
    """What the runs left behind, in words."""
    time.sleep(1.0)
    parts = [str(path.relative_to(folder)) for path in folder.rglob(".*.part*")]
    files = [str(path.relative_to(folder)) for path in temporary.rglob("*") if path.is_file()]
    growth = memory[-1] - memory[min(1, len(memory) - 1)]
    return [
        *(f"unfinished file {name}" for name in parts),
        *(f"temporary file {name}" for name in files),
        *(f"process {number}" for number in _processes(mark)),
        *([f"handles grew: {list(handles)}"] if handles[-1] > handles[0] else []),
        *([f"memory grew by {growth} bytes"] if growth > ALLOWED_GROWTH else []),
    ]


def _processes(mark: str) -> list[str]:
    """Ids of other running processes that inherited the mark."""
    ids = []
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            inherited = f"{MARK}={mark}".encode() in (place / "environ").read_bytes()
            if inherited and place.name != str(os.getpid()):
                ids.append(place.name)
    return ids


def _memory_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
