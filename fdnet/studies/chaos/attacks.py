"""The attacks. Each is drawn from a generator, and returns what became of the attacked run."""

import os
import resource
import signal
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random

from fdnet.studies.chaos.runs import (
    NOTES,
    TABLES,
    FaultError,
    Prepared,
    call,
    contents,
    judge,
    started,
    wait_for,
)

Attack = Callable[[Random, Path, Prepared], str]
"""Takes the generator, an empty folder and the prepared runs.

Returns "ok" or "refused", or raises FaultError.
"""

AT_STAKE = (
    *TABLES,
    "summary.json",
    "manifest.json",
    "case.toml",
    ".unfinished",
    "pack/*",
    "pack/post/*",
    "invade/*",
    "invade/post/*",
)
"""Files that are damaged: results, records, and what LIGGGHTS wrote."""
MEMORY_BYTES = (300 << 20, 600 << 20, 1 << 30)
"""Limits of memory. Below some 200 MB the import of numpy itself ends the process (OpenBLAS)."""
UNREAD = (".lock", "screen.txt", "log.liggghts")
"""Files that nobody reads again."""
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


def _target(rng: Random, out: Path) -> Path:
    """A file of the run that is not empty; each pattern of AT_STAKE has the same chance."""
    groups = [
        [
            path
            for path in sorted(out.glob(pattern))
            if path.is_file() and path.stat().st_size and path.name not in UNREAD
        ]
        for pattern in AT_STAKE
    ]
    return rng.choice(rng.choice([group for group in groups if group]))


def cut(rng: Random, path: Path, _: Path) -> None:
    """The file ends early."""
    data = path.read_bytes()
    path.write_bytes(data[: rng.randrange(len(data))])


def zero(_: Random, path: Path, __: Path) -> None:
    """The file has its size and holds zeros, as after a loss of power."""
    path.write_bytes(bytes(path.stat().st_size))


def garble(rng: Random, path: Path, _: Path) -> None:
    """Some bytes in the file are others."""
    data = bytearray(path.read_bytes())
    start = rng.randrange(max(1, len(data)))
    for place in range(start, min(len(data), start + rng.choice((1, 8, 400)))):
        data[place] = rng.randrange(256)
    path.write_bytes(bytes(data))


def remove(_: Random, path: Path, __: Path) -> None:
    """The file is not there."""
    path.unlink()


def swap(_: Random, path: Path, other: Path) -> None:
    """Two files have each other's content."""
    one, two = path.read_bytes(), other.read_bytes()
    path.write_bytes(two)
    other.write_bytes(one)


def damage(change: Callable[[Random, Path, Path], None]) -> Attack:
    """Damage a file of a run; then the run is repeated, analysed anew, or continued."""

    def attack(rng: Random, place: Path, prepared: Prepared) -> str:
        which = rng.choice(("finished", "unfinished"))
        out = prepared.copy(which, place)
        path, other = _target(rng, out), _target(rng, out)
        change(rng, path, other)
        again = rng.choice(([], ["--force", "--stages", "analyse"]))
        options = ["--resume"] if which == "unfinished" else again
        before = contents(out)
        try:
            result = judge(prepared, out, call(prepared.command(out, *options)))
            _check_kept(out, before, everything=result == "refused" and not options)
            if result == "refused" and rng.random() < 0.3:
                _check_force(prepared, out)
        except FaultError as fault:
            names = f"{path.relative_to(out)}" + (
                f" with {other.relative_to(out)}" if change is swap else ""
            )
            raise FaultError(f"{fault} ({which} {' '.join(options)}, {names})") from fault
        return result

    return attack


def _check_kept(out: Path, before: Mapping[str, str], *, everything: bool) -> None:
    """Raises FaultError when the user's file, or a file of a run only read, has changed."""
    after = contents(out)
    names = [name for name in before if everything or name == NOTES]
    lost = [name for name in names if after.get(name) != before[name] and name != ".lock"]
    if lost:
        raise FaultError(f"lost: {', '.join(lost)}")


def _check_force(prepared: Prepared, out: Path) -> None:
    """Raises FaultError when the refused run cannot be started over with --force."""
    result = judge(prepared, out, call(prepared.command(out, "--force")))
    if result != "ok":
        raise FaultError("stuck: --force is refused too")


def kill(rng: Random, place: Path, prepared: Prepared) -> str:
    """A run is killed up to three times and continued."""
    out = place / "run" if rng.random() < 0.5 else prepared.copy("unfinished", place)
    for _ in range(rng.randrange(1, 4)):
        resume = ["--resume"] * (out / "case.toml").exists()
        process = started(prepared.command(out, *resume))
        time.sleep(rng.uniform(0.0, prepared.seconds))
        process.send_signal(rng.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT)))
        ended = wait_for(process)
        if ended.code:
            judge(prepared, out, ended, stopped=True)
    return _finish(prepared, out)


def pause(rng: Random, place: Path, prepared: Prepared) -> str:
    """A run is stopped for a moment and goes on."""
    out = prepared.copy("unfinished", place)
    process = started(prepared.command(out, "--resume"))
    for _ in range(rng.randrange(1, 4)):
        time.sleep(rng.uniform(0.0, 0.5 * prepared.seconds))
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(rng.uniform(0.0, 0.5))
        os.kill(process.pid, signal.SIGCONT)
    return judge(prepared, out, wait_for(process))


def limit(what: int, values: tuple[int, ...]) -> Attack:
    """A run lacks something the system limits; then the limit is lifted and it is continued."""

    def attack(rng: Random, place: Path, prepared: Prepared) -> str:
        out = prepared.copy("unfinished", place)
        most = rng.choice(values)
        try:
            ended = call(prepared.command(out, "--resume"), {what: most})
            result = judge(prepared, out, ended)
            return result if result == "ok" else _finish(prepared, out)
        except FaultError as fault:
            raise FaultError(f"{fault} (limit {most})") from fault

    return attack


def race(rng: Random, place: Path, prepared: Prepared) -> str:
    """Two commands on one folder at the same time: one runs, the other is refused or waits."""
    out = place / "run" if rng.random() < 0.3 else prepared.copy("unfinished", place)
    command = prepared.command(out, "--resume")
    first = started(command)
    time.sleep(rng.uniform(0.0, prepared.seconds))
    second = started(command)
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
    for name in names:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(FOREIGN.get(name, "mine"))
    before = contents(out)
    options = rng.choice(([], ["--resume"], ["--force"]))
    ended = call(prepared.command(out, *options))
    try:
        _check_kept(out, before, everything=True)
        if ended.code == 0:
            raise FaultError("lost: the run was made in a folder of somebody else")
        return judge(prepared, out, ended)
    except FaultError as fault:
        raise FaultError(f"{fault} ({' '.join(options)} {', '.join(sorted(names))})") from fault


def _finish(prepared: Prepared, out: Path) -> str:
    """Continue a run without any hindrance: it must end as the uncut one."""
    resume = ["--resume"] * (out / "case.toml").exists()
    ended = call(prepared.command(out, *resume))
    result = judge(prepared, out, ended)
    if result != "ok":
        raise FaultError(f"stuck: {' '.join(ended.error.split())[:200]}")
    return result


ATTACKS: Mapping[str, Attack] = {
    "kill": kill,
    "pause": pause,
    "cut": damage(cut),
    "zero": damage(zero),
    "garble": damage(garble),
    "remove": damage(remove),
    "swap": damage(swap),
    "file size": limit(resource.RLIMIT_FSIZE, (0, 1000, 8_000, 30_000, 100_000)),
    "handles": limit(resource.RLIMIT_NOFILE, (4, 6, 8, 12, 16, 24, 48)),
    "memory": limit(resource.RLIMIT_AS, MEMORY_BYTES),
    "race": race,
    "foreign": foreign,
}
