"""Runs of LIGGGHTS: started, followed, stopped, and only accepted when they really finished."""

import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from fdnet.dem.binary import Binary
from fdnet.dem.process import only_writer, refuse_flood, refuse_late, started
from fdnet.dem.verdict import SCREEN, verify
from fdnet.errors import LiggghtsError

_PART, _LONGEST_LINE = 1 << 16, 1 << 20


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
        waited: s of them, in which LIGGGHTS waited for fdnet to compute something.
        ranks: MPI ranks.
    """

    directory: Path
    command: tuple[str, ...]
    version: str
    seconds: float
    ranks: int
    waited: float = 0.0


def run_deck(folder: Path, deck: str, launch: Launch) -> Run:
    """Run `folder/deck` to its end mark.

    Raises LiggghtsError with the evidence when the run did not really finish. On KeyboardInterrupt
    the run is stopped and what it wrote is kept.
    """
    if not (folder / deck).is_file():
        raise LiggghtsError(f"{folder / deck}: deck not found; render it first")
    command, start = launch.binary.command(deck, launch.ranks), time.monotonic()
    deadline = None if launch.timeout is None else start + launch.timeout
    with (
        only_writer(folder) as lock,
        (folder / SCREEN).open("wb") as screen,
        started(
            folder,
            command,
            ranks=launch.ranks,
            lock=lock,
            stdin=subprocess.DEVNULL,
            stdout=screen,
        ) as process,
    ):
        _wait(process, folder / SCREEN, launch.follow, deadline)
    verify(folder, deck, process.returncode)
    seconds = time.monotonic() - start
    return Run(
        directory=folder,
        command=tuple(command),
        version=launch.binary.version,
        seconds=seconds,
        ranks=launch.ranks,
    )


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
                refuse_late(screen.parent, deadline)
                if follow:
                    follow(line.rstrip(b"\r").decode(errors="replace"))
            refuse_late(screen.parent, deadline)
            refuse_flood(screen.parent)
            rest = rest[-_LONGEST_LINE:]
            if not part:
                if ended:
                    return
                time.sleep(0.05)
