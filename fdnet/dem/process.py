"""A process of LIGGGHTS: how it is started, watched over and stopped."""

import contextlib
import ctypes
import fcntl
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from fdnet.dem.environment import environment
from fdnet.dem.verdict import SCREEN
from fdnet.errors import LiggghtsError

LOCK_PATIENCE = 20.0
"""Seconds to wait for processes of an earlier run to end."""
MOST_BYTES = 1 << 29
"""Largest screen or log of a run; a checkpoint takes some 3 kB of either."""
_STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}


@contextlib.contextmanager
def started(
    folder: Path,
    command: list[str],
    *,
    ranks: int,
    lock: int,
    stdin: IO[bytes] | int,
    stdout: IO[bytes] | int,
) -> Iterator[subprocess.Popen]:
    """A process of LIGGGHTS in `folder` that inherits the `lock` of `only_writer`.

    It is stopped with its children when the `with` block is left by an exception. Raises
    LiggghtsError when it cannot be started.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOP_SIGNALS)
    try:
        process = subprocess.Popen(
            command,
            cwd=folder,
            stdin=stdin,
            stdout=stdout,
            stderr=subprocess.STDOUT,
            env=environment(ranks),
            start_new_session=True,
            pass_fds=(lock,),
            preexec_fn=_prepare_child(ranks, before),
        )
    except OSError as error:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        raise LiggghtsError(f"{command[0]}: cannot be started: {error}") from error
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        yield process
    except BaseException:
        _stop(process)
        raise


@contextlib.contextmanager
def only_writer(folder: Path) -> Iterator[int]:
    """A lock on the folder of a stage that LIGGGHTS inherits.

    It holds until the last process that inherited it has ended. One that MPI started may outlive
    LIGGGHTS by a moment, so this waits for a lock that is taken.
    """
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    deadline = time.monotonic() + LOCK_PATIENCE
    try:
        while not _locked(lock):
            if time.monotonic() > deadline:
                raise LiggghtsError(
                    f"{folder}: a LIGGGHTS of an earlier run is still writing here; "
                    "wait until it ends"
                )
            time.sleep(0.05)
        yield lock
    finally:
        os.close(lock)


def _locked(lock: int) -> bool:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _prepare_child(ranks: int, mask: set[int]) -> Callable[[], None]:
    """What the child does before it becomes LIGGGHTS.

    It asks the kernel to end it when fdnet dies, so that no orphan writes into a resumed run. Then
    it restores `mask`, the signals that were blocked before the start. While the child is being
    started SIGINT and SIGTERM wait: Python would swallow an exception that is raised inside the
    fork, and the run would go on.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    last = signal.SIGKILL if ranks == 1 else signal.SIGTERM

    def prepare() -> None:
        libc.prctl(1, last, 0, 0, 0)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    return prepare


def refuse_late(folder: Path, deadline: float | None) -> None:
    """Raises LiggghtsError after `deadline`, s of the monotonic clock."""
    if deadline is not None and time.monotonic() > deadline:
        raise LiggghtsError(
            f"{folder}: LIGGGHTS did not end within its time limit and was stopped; raise "
            "--timeout and continue with --resume"
        )


def refuse_flood(folder: Path) -> None:
    """Raises LiggghtsError when the screen or the log is larger than any sound run makes it."""
    for path in (folder / SCREEN, folder / "log.liggghts"):
        if path.exists() and path.stat().st_size > MOST_BYTES:
            raise LiggghtsError(
                f"{folder}: LIGGGHTS wrote more than {MOST_BYTES >> 20} MiB into {path.name} and "
                "was stopped: it repeats a message without end; read the beginning of the file, "
                "then mend the cause and continue with --resume"
            )


def _stop(process: subprocess.Popen) -> None:
    """End the process and its children, first gently."""
    for end, patience in ((signal.SIGTERM, 5.0), (signal.SIGKILL, 5.0)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, end)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return
