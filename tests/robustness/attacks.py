"""The attacks. Each is drawn from a generator, and returns "ok" or "refused" or raises FaultError.

An attack that this machine does not allow calls `pytest.skip`.
"""

import os
import resource
import signal
import subprocess
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from random import Random

import pytest

from robustness.runs import (
    NOTES,
    TABLES,
    FaultError,
    Prepared,
    check_kept,
    contents,
    finish,
    judge,
    to_go_on,
)

Attack = Callable[[Random, Path, Prepared], str]
KILLS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
FILES = (*TABLES, "summary.json", "manifest.json", "case.toml", ".unfinished")
AT_STAKE = (*FILES, "pack/*", "pack/post/*", "invade/*", "invade/post/*")
"""Files that are damaged: results, records, and what LIGGGHTS wrote."""
UNREAD = (".lock", "screen.txt", "log.liggghts")
FOREIGN = (".lock", "summary.json", "manifest.json", "report.html", "case.toml")
FOREIGN += ("pack/stage.json", "pack/pack.data", "figures/figure.png")
"""Names that fdnet uses too, in a folder of somebody else."""


def kill(rng: Random, place: Path, prepared: Prepared) -> str:
    """A run is killed up to three times and continued."""
    which = rng.choice(("", "packed", "unfinished", "unfinished"))
    out = prepared.copy(which, place)
    for _ in range(rng.randrange(1, 4)):
        child = prepared.start(out, *to_go_on(out), fresh=rng.random() < 0.15)
        child.let_run(rng.uniform(0.0, prepared.seconds[which]))
        child.send(rng.choice(KILLS))
        ended = child.wait()
        if ended.code:
            judge(prepared, out, ended, stopped=True)
    return finish(prepared, out)


def _target(rng: Random, out: Path) -> Path:
    """A file of the run that is not empty; each pattern of AT_STAKE has the same chance."""

    def whole(path: Path) -> bool:
        return path.is_file() and path.stat().st_size > 0 and path.name not in UNREAD

    groups = [[*filter(whole, sorted(out.glob(pattern)))] for pattern in AT_STAKE]
    return rng.choice(rng.choice([*filter(None, groups)]))


def damage(how: str, rng: Random, place: Path, prepared: Prepared) -> str:
    """A file is damaged; then the run is repeated, analysed anew, or continued."""
    which = rng.choice(("finished", "unfinished"))
    out = prepared.copy(which, place)
    path, other = _target(rng, out), _target(rng, out)
    data = bytearray(path.read_bytes())
    if how == "cut":
        path.write_bytes(data[: rng.randrange(len(data))])
    elif how == "zero":
        path.write_bytes(bytes(len(data)))
    elif how == "garble":
        start = rng.randrange(len(data))
        for at in range(start, min(len(data), start + rng.choice((1, 8, 400)))):
            data[at] = rng.randrange(256)
        path.write_bytes(data)
    elif how == "swap":
        path.write_bytes(other.read_bytes())
        other.write_bytes(data)
    else:
        path.unlink()
    options = rng.choice(([], ["--force", "--stages", "analyse"]))
    options = ["--resume"] if which == "unfinished" else options
    before = contents(out)
    try:
        result = judge(prepared, out, prepared.call(out, *options))
        check_kept(out, before, everything=result == "refused" and not options)
        if result == "refused" and rng.random() < 0.2:
            anew = judge(prepared, out, prepared.call(out, "--force"))
            assert anew == "ok", "--force is refused too"
    except FaultError as fault:
        names = f"{path.relative_to(out)}, {other.relative_to(out)}"
        raise FaultError(f"{fault} ({which} {' '.join(options)}: {how} {names})") from fault
    return result


def limit(what: int, values: tuple[int, ...], rng: Random, place: Path, prepared: Prepared) -> str:
    """A run lacks something the system limits; then the limit is lifted and it is continued."""
    out, most = prepared.copy("unfinished", place), rng.choice(values)
    fresh = what != resource.RLIMIT_FSIZE
    ended = prepared.call(out, "--resume", fresh=fresh, limits={what: most})
    return finish(prepared, out) if judge(prepared, out, ended) == "refused" else "ok"


def race(rng: Random, place: Path, prepared: Prepared) -> str:
    """Two commands on one folder at the same time: one runs, the other is refused or waits."""
    which = rng.choice(("", "packed", "unfinished", "unfinished"))
    out = prepared.copy(which, place)
    first = prepared.start(out, "--resume")
    first.let_run(rng.choice((0.0, rng.uniform(0.0, prepared.seconds[which]))))
    second = prepared.start(out, "--resume")
    results = [judge(prepared, out, ended) for ended in (first.wait(), second.wait())]
    if "ok" not in results:
        raise FaultError("race: both commands were refused")
    return "ok"


def foreign(rng: Random, place: Path, prepared: Prepared) -> str:
    """A folder of somebody else is refused, also with --resume and --force."""
    out = place / "run"
    names = {NOTES, *rng.sample(FOREIGN, rng.randrange(4))}
    for name in sorted(names):
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(rng.choice(("", "{}", "mine")))
    before, options = contents(out), rng.choice(([], ["--resume"], ["--force"]))
    ended = prepared.call(out, *options)
    check_kept(out, before, everything=True)
    if ended.code == 0:
        raise FaultError(f"lost: a run in a folder of somebody else, with {options} {names}")
    return judge(prepared, out, ended)


def full_disk(rng: Random, place: Path, prepared: Prepared) -> str:
    """Bytes or inodes of the disk run out; then there is room and the run is continued."""
    disk, wide = place / "disk", "size=256m,nr_inodes=100000"
    disk.mkdir()

    def mount(options: str) -> None:
        words = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(disk)]
        if refusal := subprocess.run(words, capture_output=True, text=True, check=False).stderr:
            pytest.skip(f"no such disk can be mounted here: {refusal}")

    mount(wide)
    try:
        out = prepared.copy(rng.choice(("packed", "unfinished")), disk)
        used = os.statvfs(disk)
        files, size = used.f_files - used.f_ffree, (used.f_blocks - used.f_bfree) * used.f_frsize
        more = rng.choice((0, 4, 16, 32, 64, 128, 192, 256, 384)) << 10
        few = f"nr_inodes={files + rng.choice((0, 1, 2, 4, 8, 16, 32))}", f"size={size + more}"
        mount(f"remount,{rng.choice(few)}")
        ended = prepared.call(out, *["--resume"] * (out / ".unfinished").exists())
        result = judge(prepared, out, ended)
        mount(f"remount,{wide}")
        return result if result == "ok" else finish(prepared, out)
    finally:
        while subprocess.run(["umount", "-l", disk], capture_output=True, check=False).returncode:
            time.sleep(0.1)


ATTACKS: Mapping[str, Attack] = {
    "kill": kill,
    "foreign": foreign,
    "garble": partial(damage, "garble"),
    "file size": partial(limit, resource.RLIMIT_FSIZE, (1000, 8_000, 30_000, 100_000)),
    "race": race,
    **{how: partial(damage, how) for how in ("cut", "zero", "remove", "swap")},
    # with 4 handles Python does not start; below 200 MB the import of numpy ends the process
    "handles": partial(limit, resource.RLIMIT_NOFILE, (5, 6, 8, 12, 16, 24, 48)),
    "memory": partial(limit, resource.RLIMIT_AS, (300 << 20, 600 << 20, 1 << 30)),
    "full disk": full_disk,
}
