"""The attacks. Each is drawn from a generator, and returns what became of the attacked run."""

import resource
import signal
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from random import Random

from validation.chaos.commands import FaultError, wait_for
from validation.chaos.damages import cut, damage_and_go_on, garble, remove, swap, zero
from validation.chaos.judge import check_kept, finish, judge
from validation.chaos.runs import NOTES, Prepared, contents, to_go_on
from validation.chaos.surroundings import full_disk, report, two_ranks

Attack = Callable[[Random, Path, Prepared], str]
"""Takes the generator, an empty folder and the prepared runs.

Returns "ok" or "refused", or raises FaultError, or SkipError where it cannot be made.
"""

MEMORY_BYTES = (300 << 20, 600 << 20, 1 << 30)
"""Limits of memory. Below some 200 MB the import of numpy itself ends the process (OpenBLAS)."""
HANDLES = (5, 6, 8, 12, 16, 24, 48)
"""Limits of open files. With 4 Python itself does not start where a .pth file imports anything."""
FRESH = 0.15
"""Share of the commands that are killed which begin with the start of Python."""
FOREIGN = {
    ".lock": "",
    "summary.json": "{}",
    "manifest.json": '{"name": "an extension", "version": 3}',
    "report.html": "<p>mine</p>",
    "case.toml": "mine = 1\n",
    "pack/stage.json": "{}",
    "pack/pack.data": "mine",
    "figures/figure.png": "mine",
    "spheres_initial.csv": "a,b\n1,2\n",
}
"""Names that fdnet uses too, in a folder of somebody else."""


def kill(rng: Random, place: Path, prepared: Prepared) -> str:
    """A run is killed up to three times and continued."""
    which = rng.choice(("", "packed", "unfinished", "unfinished"))
    out = prepared.copy(which, place) if which else place / "run"
    for _ in range(rng.randrange(1, 4)):
        resume = to_go_on(out)
        child = prepared.start(out, *resume, fresh=rng.random() < FRESH)
        child.let_run(rng.uniform(0.0, prepared.seconds[which]))
        child.send(rng.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT)))
        ended = wait_for(child)
        if ended.code:
            judge(prepared, out, ended, stopped=True)
    return finish(prepared, out)


def pause(rng: Random, place: Path, prepared: Prepared) -> str:
    """A run is stopped for a moment and goes on."""
    out = prepared.copy("unfinished", place)
    child = prepared.start(out, "--resume", fresh=rng.random() < FRESH)
    for _ in range(rng.randrange(1, 4)):
        child.let_run(rng.uniform(0.0, 0.5 * prepared.seconds["unfinished"]))
        child.send(signal.SIGSTOP)
        child.let_run(rng.uniform(0.0, 0.5))
        child.send(signal.SIGCONT)
    return judge(prepared, out, wait_for(child))


def limit(what: int, values: tuple[int, ...], rng: Random, place: Path, prepared: Prepared) -> str:
    """A run lacks something the system limits; then the limit is lifted and it is continued."""
    out = prepared.copy("unfinished", place)
    most = rng.choice(values)
    fresh = what != resource.RLIMIT_FSIZE or rng.random() < FRESH
    try:
        ended = prepared.call(out, "--resume", fresh=fresh, limits={what: most})
        result = judge(prepared, out, ended)
        return result if result == "ok" else finish(prepared, out)
    except FaultError as fault:
        raise FaultError(f"{fault} (limit {most})") from fault


def race(rng: Random, place: Path, prepared: Prepared) -> str:
    """Two commands on one folder at the same time: one runs, the other is refused or waits."""
    which = rng.choice(("", "packed", "unfinished", "unfinished"))
    out = prepared.copy(which, place) if which else place / "run"
    first = prepared.start(out, "--resume")
    first.let_run(rng.choice((0.0, rng.uniform(0.0, prepared.seconds[which]))))
    second = prepared.start(out, "--resume")
    ends = [wait_for(first), wait_for(second)]
    for ended in ends:
        if ended.code:
            judge(prepared, out, ended)
    if all(ended.code for ended in ends):
        raise FaultError("race: both commands were refused")
    return judge(prepared, out, next(ended for ended in ends if not ended.code))


def foreign(rng: Random, place: Path, prepared: Prepared) -> str:
    """A folder of somebody else is refused, also with --resume and --force."""
    out = place / "run"
    names = {NOTES, *rng.sample(sorted(FOREIGN), rng.randrange(4))}
    for name in sorted(names):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(FOREIGN.get(name, "mine"))
    before = contents(out)
    options = rng.choice(([], ["--resume"], ["--force"]))
    ended = prepared.call(out, *options, fresh=rng.random() < FRESH)
    try:
        check_kept(out, before, everything=True)
        if ended.code == 0:
            raise FaultError("lost: the run was made in a folder of somebody else")
        return judge(prepared, out, ended)
    except FaultError as fault:
        raise FaultError(f"{fault} ({' '.join(options)} {', '.join(sorted(names))})") from fault


ATTACKS: Mapping[str, Attack] = {
    "kill": kill,
    "pause": pause,
    "cut": partial(damage_and_go_on, cut),
    "zero": partial(damage_and_go_on, zero),
    "garble": partial(damage_and_go_on, garble),
    "remove": partial(damage_and_go_on, remove),
    "swap": partial(damage_and_go_on, swap),
    "file size": partial(limit, resource.RLIMIT_FSIZE, (0, 1000, 8_000, 30_000, 100_000)),
    "handles": partial(limit, resource.RLIMIT_NOFILE, HANDLES),
    "memory": partial(limit, resource.RLIMIT_AS, MEMORY_BYTES),
    "race": race,
    "foreign": foreign,
    "full disk": full_disk,
    "two ranks": two_ranks,
    "report": report,
}
TWO_RANKS = ("two ranks",)
"""Attacks on the runs on two MPI ranks."""
SELDOM = ("two ranks", "report")
"""Attacks that take the longest, of which there are a third of the others."""
ORDER = (*ATTACKS, *(2 * [kind for kind in ATTACKS if kind not in SELDOM]))
"""The kind of attack INDEX is the one at INDEX modulo the length of this."""
