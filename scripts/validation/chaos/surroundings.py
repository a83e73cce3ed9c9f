"""Attacks by what is around a run: a small disk, another number of ranks, a report cut short."""

import os
import resource
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

from validation.chaos.commands import Ended, FaultError, wait_for
from validation.chaos.judge import check_report, finish, judge
from validation.chaos.runs import Prepared

_WIDE = "size=256m,nr_inodes=100000"
_REPORT = ("--stages", "report")
_KILLS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
_REPORT_S = 10.0
"""Seconds within which a report is killed; a whole one takes less than that."""


class SkipError(Exception):
    """An attack that cannot be made on this machine."""


@contextmanager
def small_disk(place: Path) -> Iterator[Callable[[str], str]]:
    """A disk of its own at `place`; raises SkipError where none may be mounted.

    Gives a function that sets its limits: "size=BYTES,nr_inodes=NUMBER".
    """
    place.mkdir()

    def mount(options: str) -> str:
        command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        return done.stderr.strip()

    refusal = mount(_WIDE)
    if refusal:
        raise SkipError(f"no disk can be mounted here: {refusal}")
    try:
        yield lambda options: mount(f"remount,{options}")
    finally:
        while subprocess.run(
            ["umount", "-l", str(place)], capture_output=True, check=False
        ).returncode:
            time.sleep(0.1)


def full_disk(rng: Random, place: Path, prepared: Prepared) -> str:
    """Bytes or inodes of the disk run out; then there is room and the run is continued."""
    with small_disk(place / "disk") as limit:
        return _full(rng, place / "disk", prepared, limit)


def _full(rng: Random, disk: Path, prepared: Prepared, limit: Callable[[str], str]) -> str:
    out = prepared.copy(rng.choice(("packed", "unfinished")), disk)
    used = os.statvfs(disk)
    files, size = used.f_files - used.f_ffree, (used.f_blocks - used.f_bfree) * used.f_frsize
    few = {
        "nr_inodes": (files, rng.choice((0, 1, 2, 4, 8, 16, 32))),
        "size": (size, rng.choice((0, 4, 16, 32, 64, 128, 192, 256, 384)) << 10),
    }
    name = rng.choice(sorted(few))
    have, more = few[name]
    options = ["--resume"] * (out / ".unfinished").exists()
    what = limit(f"{name}={max(1, have + more)}")
    if what:
        raise SkipError(f"the disk cannot be made smaller: {what}")
    try:
        result = judge(prepared, out, prepared.call(out, *options))
        limit(_WIDE)
        return result if result == "ok" else finish(prepared, out)
    except FaultError as fault:
        raise FaultError(f"{fault} ({more} more of {name})") from fault


def two_ranks(rng: Random, place: Path, prepared: Prepared) -> str:
    """A run on two MPI ranks is killed and continued; one rank is refused meanwhile.

    `prepared` must be of two ranks.
    """
    which = rng.choice(("packed", "unfinished"))
    out = prepared.copy(which, place)
    if rng.random() < 0.5:
        other = prepared.call(out, "--resume", "--np", "1")
        if judge(prepared, out, other) != "refused" or "--np 2" not in other.error:
            raise FaultError("silent: a run on two ranks is continued on one")
    child = prepared.start(out, "--resume")
    child.let_run(rng.uniform(0.0, prepared.seconds[which]))
    child.send(rng.choice(_KILLS))
    ended = wait_for(child)
    if ended.code:
        judge(prepared, out, ended, stopped=True)
    return finish(prepared, out)


def report(rng: Random, place: Path, prepared: Prepared) -> str:
    """The report of a finished run is killed, or lacks room for a file; then it is repeated."""
    out = prepared.copy("finished", place)
    for ended, stopped in _hindered_reports(rng, out, prepared):
        if ended.code:
            judge(prepared, out, ended, stopped=stopped)
        elif not _lost_picture(ended):
            check_report(out)
    result = finish(prepared, out, *_REPORT)
    check_report(out)
    return result


def _hindered_reports(rng: Random, out: Path, prepared: Prepared) -> Iterator[tuple[Ended, bool]]:
    """The ends of commands that write the report, and whether a signal was sent to them."""
    if rng.random() < 0.3:
        most = rng.choice((1_000, 8_000, 30_000, 100_000))
        limits = {resource.RLIMIT_FSIZE: most}
        yield prepared.call(out, "--resume", *_REPORT, limits=limits), False
        return
    for _ in range(rng.randrange(1, 3)):
        child = prepared.start(out, "--resume", *_REPORT)
        child.let_run(rng.uniform(0.0, _REPORT_S))
        child.send(rng.choice(_KILLS))
        yield wait_for(child), True


def _lost_picture(ended: Ended) -> bool:
    """Whether it said that it left out the 3-D picture."""
    return "3-D picture" in ended.error or "the drawing process" in ended.error
