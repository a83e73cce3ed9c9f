"""LIGGGHTS fed on its standard input: it takes blocks of commands and waits in between.

fdnet computes something between two blocks and puts it into files, which the next block reads. The
process ends when its standard input does, so it cannot outlive fdnet.
"""

import contextlib
import os
import select
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO

from fdnet.dem.liggghts import Launch, Run
from fdnet.dem.process import only_writer, refuse_flood, refuse_late, started
from fdnet.dem.verdict import END_MARK, SCREEN, verify

_PART, _LONGEST_LINE = 1 << 16, 1 << 20
_PATIENCE = 0.1
"""Longest time, s, to wait for a line before the process and its time limit are looked at."""


class _EndedError(Exception):
    """LIGGGHTS has ended although more was to come."""


class Feed:
    """A LIGGGHTS that waits for commands; call it with some, and it returns when they are done.

    `busy` are the seconds that it has worked on them.
    """

    def __init__(
        self,
        process: subprocess.Popen,
        folder: Path,
        screen: IO[bytes],
        *,
        follow: Callable[[str], None] | None,
        deadline: float | None,
    ) -> None:
        self.process, self.folder, self.screen = process, folder, screen
        self.follow, self.deadline = follow, deadline
        self.busy, self._fed, self._rest = 0.0, 0, b""

    def __call__(self, *commands: str) -> None:
        """Carry out the commands, in order.

        Raises LiggghtsError after the time limit or when the screen is flooded, and what `follow`
        raises. `run_fed` reports a LIGGGHTS that ends before it has done them.
        """
        self._fed, began = self._fed + 1, time.monotonic()
        mark = f"FDNET fed {self._fed}"
        self._write("".join(f"{line}\n" for line in (*commands, f'print "{mark}"')))
        while mark not in self._lines():
            pass
        self.busy += time.monotonic() - began

    def finish(self) -> None:
        """Let LIGGGHTS print its end mark and end."""
        self._write(f'print "{END_MARK}"\n')
        assert self.process.stdin is not None
        try:
            self.process.stdin.close()
            while True:
                self._lines()
        except (_EndedError, BrokenPipeError):
            self.process.wait()

    def _write(self, text: str) -> None:
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(text.encode())
            self.process.stdin.flush()
        except BrokenPipeError:
            while True:
                self._lines()

    def _lines(self) -> list[str]:
        """What LIGGGHTS has printed next, line by line; each went to `follow` and to the screen.

        Raises _EndedError at the end of its output.
        """
        assert self.process.stdout is not None
        pipe = self.process.stdout.fileno()
        while not select.select([pipe], [], [], _PATIENCE)[0]:
            refuse_late(self.folder, self.deadline)
            if self.process.poll() is not None:  # a daemon of MPI may keep the pipe open
                raise _EndedError
        part = os.read(pipe, _PART)
        self.screen.write(part)
        *parts, self._rest = (self._rest + part).split(b"\n")
        if not part and self._rest:
            parts, self._rest = [*parts, self._rest], b""
        self._rest = self._rest[-_LONGEST_LINE:]
        refuse_late(self.folder, self.deadline)
        refuse_flood(self.folder)
        lines = [line.rstrip(b"\r").decode(errors="replace") for line in parts]
        for line in lines:
            if self.follow:
                self.follow(line)
        if not part and not lines:
            raise _EndedError
        return lines


def run_fed(folder: Path, deck: str, launch: Launch, play: Callable[[Feed], None]) -> Run:
    """Run LIGGGHTS in `folder` on the commands that `play` feeds it; `deck` is their main file.

    Raises LiggghtsError with the evidence when the run did not really finish, and what `play`
    raises. LIGGGHTS is stopped then, and what it wrote is kept.
    """
    command, start = launch.binary.command(None, launch.ranks), time.monotonic()
    deadline, waited = None if launch.timeout is None else start + launch.timeout, 0.0
    with (
        only_writer(folder) as lock,
        (folder / SCREEN).open("wb", buffering=0) as screen,
        started(
            folder,
            command,
            ranks=launch.ranks,
            lock=lock,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        ) as process,
    ):
        feed = Feed(process, folder, screen, follow=launch.follow, deadline=deadline)
        try:
            began = time.monotonic()
            play(feed)
            waited = time.monotonic() - began - feed.busy
            feed.finish()
        except _EndedError:
            process.wait()
        finally:
            _close(process)
    verify(folder, deck, process.returncode)  # no run that was cut short gets beyond this
    return Run(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=time.monotonic() - start,
        ranks=launch.ranks,
        waited=waited,
    )


def _close(process: subprocess.Popen) -> None:
    """Close both ends of the pipes; LIGGGHTS ends at the end of its input."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
