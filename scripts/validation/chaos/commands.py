"""Commands that are given on attacked runs: started, waited for, ended when they hang."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from validation.chaos.nursery import PROGRAM, Nursery, set_limits

LIMIT_S = 120.0
"""Seconds after which a command counts as hanging."""
PAUSE_S = 0.01
"""Seconds between two looks at a command."""


class FaultError(Exception):
    """What fdnet must not do: hang, differ silently, show a traceback, lose a file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """A command that has ended.

    Attributes:
        code: exit code; negative: the signal that ended it.
        error: what it wrote to standard error.
    """

    code: int
    error: str


@dataclass(slots=True)
class Child:
    """A started command.

    Attributes:
        pid: its process, which leads a session of its own.
        poll: gives its exit code, None while it runs.
        error: descriptor from which its standard error is read.
        said: what was read from there.
    """

    pid: int
    poll: Callable[[], int | None]
    error: int
    said: bytes = b""

    def send(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        with contextlib.suppress(ProcessLookupError):
            if self.poll() is None:
                os.kill(self.pid, number)

    def let_run(self, seconds: float) -> None:
        """Wait for that time, or until it has ended."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and self.poll() is None:
            time.sleep(max(0.0, min(PAUSE_S, deadline - time.monotonic())))

    def let_write(self, folder: Path, files: int) -> None:
        """Wait until that many files are in and below the folder, or until it has ended."""
        while self.poll() is None and count_files(folder) < files:
            time.sleep(PAUSE_S)

    def listen(self) -> None:
        """Read what it has said meanwhile."""
        with contextlib.suppress(BlockingIOError):
            while part := os.read(self.error, 1 << 16):
                self.said += part


def count_files(folder: Path) -> int:
    """Number of files in and below a folder; 0 where there is none."""
    return sum(len(files) for _, _, files in os.walk(folder))


def started(
    words: Sequence[str],
    *,
    nursery: Nursery | None = None,
    limits: Mapping[int, int] | None = None,
) -> Child:
    """`fdnet WORD ...` in a session of its own, with limits of the system (RLIMIT_...: value).

    It is forked from the nursery; without one it is a Python of its own.
    """
    reader, writer = os.pipe()
    os.set_blocking(reader, False)
    try:
        if nursery is not None:
            process = nursery.start(words, writer, limits or {})
            return Child(process, _once(lambda: nursery.poll(process)), reader)
        own = subprocess.Popen(
            [sys.executable, "-m", PROGRAM, *words],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=writer,
            start_new_session=True,
            preexec_fn=lambda: set_limits(limits or {}),
        )
        return Child(own.pid, own.poll, reader)
    except BaseException:
        os.close(reader)
        raise
    finally:
        os.close(writer)


def _once(poll: Callable[[], int | None]) -> Callable[[], int | None]:
    """The same, but asked no more after the end, for a process is waited for only once."""
    code: list[int] = []

    def ask() -> int | None:
        if not code:
            answer = poll()
            code.extend([] if answer is None else [answer])
        return code[0] if code else None

    return ask


def wait_for(child: Child) -> Ended:
    """Wait for a started command. Raises FaultError when it hangs; it is ended then."""
    deadline = time.monotonic() + LIMIT_S
    try:
        while (code := child.poll()) is None:
            child.listen()
            if time.monotonic() > deadline:
                os.killpg(child.pid, signal.SIGKILL)
                while child.poll() is None:
                    time.sleep(PAUSE_S)
                raise FaultError(f"hang: not done within {LIMIT_S:g} s")
            time.sleep(PAUSE_S)
        child.listen()
    finally:
        os.close(child.error)
    return Ended(code=code, error=child.said.decode(errors="replace"))
