"""Runs of LIGGGHTS: started, followed, stopped, and only accepted when they really finished."""

import contextlib
import ctypes
import fcntl
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from fdnet.dem.binary import Binary
from fdnet.dem.verdict import SCREEN, verify
from fdnet.errors import LiggghtsError

LOCK_PATIENCE = 20.0
"""Seconds to wait for processes of an earlier run to end."""
MOST_BYTES = 1 << 29
"""Largest screen or log of a run; a checkpoint takes some 3 kB of either."""
_PART, _LONGEST_LINE = 1 << 16, 1 << 20
_STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}


@dataclass(frozen=True, slots=True, kw_only=True)
class Launch:
    """How to run decks.

    Attributes:
        binary: LIGGGHTS.
        ranks: MPI ranks.
        timeout: s, time limit of one deck; None: no limit.
        follow: is called with each new line that LIGGGHTS prints.
    """

    binary: Binary
    ranks: int = 1
    timeout: float | None = None
    follow: Callable[[str], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run that really finished; there is none of a run that did not.

    Attributes:
        directory: folder that it ran in.
        command: command line.
        version: of LIGGGHTS.
        seconds: s, from start to end.
        ranks: MPI ranks.
    """

    directory: Path
    command: tuple[str, ...]
    version: str
    seconds: float
    ranks: int


def run_deck(folder: Path, deck: str, launch: Launch) -> Run:
    """Run `folder/deck` to its end mark.

    Raises LiggghtsError with the evidence when the run did not really finish. On KeyboardInterrupt
    the run is stopped and what it wrote is kept.
    """
    if not (folder / deck).is_file():
        raise LiggghtsError(f"{folder / deck}: deck not found; render it first")
    command, start = launch.binary.command(deck, launch.ranks), time.monotonic()
    deadline = None if launch.timeout is None else start + launch.timeout
    with _only_writer(folder) as lock, (folder / SCREEN).open("wb") as screen:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _STOP_SIGNALS)
        try:
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=screen,
                stderr=subprocess.STDOUT,
                env=_environment(),
                start_new_session=True,
                pass_fds=(lock,),
                preexec_fn=_prepare_child(launch.ranks, before),
            )
        except OSError as error:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            raise LiggghtsError(f"{command[0]}: cannot be started: {error}") from error
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            _wait(process, folder / SCREEN, launch.follow, deadline)
        except BaseException:
            _stop(process)
            raise
    verify(folder, deck, process.returncode)
    seconds = time.monotonic() - start
    return Run(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=seconds,
        ranks=launch.ranks,
    )


@contextlib.contextmanager
def _only_writer(folder: Path) -> Iterator[int]:
    """A lock on the folder of a stage that LIGGGHTS inherits.

    It holds until the last process that inherited it has ended. Open MPI's daemon of a serial run
    outlives it by a moment, so this waits for a lock that is taken.
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


def _environment() -> dict[str, str]:
    return os.environ | {
        "OMP_NUM_THREADS": "1",
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    }


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


def _wait(
    process: subprocess.Popen,
    screen: Path,
    follow: Callable[[str], None] | None,
    deadline: float | None,
) -> None:
    """Wait until the process has ended, with each line of its screen given to `follow`.

    Raises LiggghtsError after `deadline`, s, and when the screen or the log is flooded.
    """
    with screen.open("rb") as file:
        rest = b""
        while True:
            ended = process.poll() is not None
            part = file.read(_PART)
            *lines, rest = (rest + part).split(b"\n")
            if ended and not part and rest:
                lines, rest = [*lines, rest], b""
            for line in lines:
                _refuse_late(screen.parent, deadline)
                if follow:
                    follow(line.rstrip(b"\r").decode(errors="replace"))
            _refuse_late(screen.parent, deadline)
            _refuse_flood(screen.parent)
            rest = rest[-_LONGEST_LINE:]
            if not part:
                if ended:
                    return
                time.sleep(0.05)


def _refuse_late(folder: Path, deadline: float | None) -> None:
    if deadline is not None and time.monotonic() > deadline:
        raise LiggghtsError(
            f"{folder}: LIGGGHTS did not end within its time limit and was stopped; raise "
            "--timeout and continue with --resume"
        )


def _refuse_flood(folder: Path) -> None:
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
