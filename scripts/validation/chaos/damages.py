"""Attacks on the files of a run: cut, zeroed, garbled, removed, swapped."""

from collections.abc import Callable
from pathlib import Path
from random import Random

from validation.chaos.commands import FaultError
from validation.chaos.judge import check_kept, judge
from validation.chaos.runs import TABLES, Prepared, contents

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
UNREAD = (".lock", "screen.txt", "log.liggghts")
"""Files that nobody reads again."""


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


def damage_and_go_on(
    change: Callable[[Random, Path, Path], None], rng: Random, place: Path, prepared: Prepared
) -> str:
    """Damage a file of a run; then the run is repeated, analysed anew, or continued."""
    which = rng.choice(("finished", "unfinished"))
    out = prepared.copy(which, place)
    path, other = _target(rng, out), _target(rng, out)
    change(rng, path, other)
    again = rng.choice(([], ["--force", "--stages", "analyse"]))
    options = ["--resume"] if which == "unfinished" else again
    before = contents(out)
    try:
        result = judge(prepared, out, prepared.call(out, *options, fresh=rng.random() < 0.1))
        check_kept(out, before, everything=result == "refused" and not options)
        if result == "refused" and rng.random() < 0.2:
            _check_force(prepared, out)
    except FaultError as fault:
        names = f"{path.relative_to(out)}" + (
            f" with {other.relative_to(out)}" if change is swap else ""
        )
        raise FaultError(f"{fault} ({which} {' '.join(options)}, {names})") from fault
    return result


def _check_force(prepared: Prepared, out: Path) -> None:
    """Raises FaultError when the refused run cannot be started over with --force."""
    if judge(prepared, out, prepared.call(out, "--force")) != "ok":
        raise FaultError("stuck: --force is refused too")
