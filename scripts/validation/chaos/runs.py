"""Small real runs that are attacked."""

import hashlib
import json
import math
import shutil
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fdnet.run.folder import CASE as CASE_FILE
from fdnet.run.folder import UNFINISHED
from validation.chaos.commands import Child, Ended, started, wait_for
from validation.chaos.nursery import Nursery

CASE = """name = "chaos"
seed = 1
box = { size_mm = [1.6, 1.0, 1.0], sides = "periodic" }
grains = { radius_mm = 0.25, count = 15 }
fines = { radius_mm = 0.05, count = 60, supply = "batches" }
run = { cap_ms = 0.2, checkpoint_ms = 0.02 }
analysis = { sections = 2, damage_law = "section-archie" }
"""
STAGES = ("--stages", "pack,invade,analyse")
TABLES = (
    "spheres_initial.csv",
    "spheres_damaged.csv",
    "sections.csv",
    "profile.csv",
    "pores.csv",
    "throats.csv",
)
NOT_COMPARED = ("seconds", "warnings", "left_out")
"""Keys of summary.json that may differ: what took how long, and what is said about it."""
NOTES = "notes.txt"
"""A file of the user that lies in every attacked folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """What the attacks start from.

    Attributes:
        root: folder of what follows.
        ranks: MPI ranks of the runs.
        nursery: that starts the commands.
        seconds: s, wall time that a command takes on a copy of each run, by its name: "finished",
            "packed" (nothing but the pack is made) and "unfinished" (killed in the invasion).
        summary: summary.json of the uncut run without NOT_COMPARED.
        tables: SHA-256 of each of TABLES of the uncut run.
    """

    root: Path
    ranks: int
    nursery: Nursery
    seconds: Mapping[str, float]
    summary: Mapping[str, Any]
    tables: Mapping[str, str]

    @property
    def case(self) -> Path:
        """The case file."""
        return self.root.parent / "case.toml"

    def copy(self, which: str, place: Path) -> Path:
        """A copy of the "finished", "packed" or "unfinished" run, with the user's notes in it."""
        out = place / "run"
        shutil.copytree(self.root / which, out)
        (out / NOTES).write_text("mine")
        return out

    def words(self, out: Path, *options: str) -> list[str]:
        """The command that runs the case in `out`."""
        words = ["run", str(self.case), "--out", str(out), "--quiet", *options]
        ranks = ["--np", str(self.ranks)] * (self.ranks > 1 and "--np" not in words)
        return [*words, *ranks, *(STAGES * ("--stages" not in words))]

    def start(
        self,
        out: Path,
        *options: str,
        fresh: bool = False,
        limits: Mapping[int, int] | None = None,
    ) -> Child:
        """Start the command; `fresh` begins with Python and its imports."""
        nursery = None if fresh else self.nursery
        return started(self.words(out, *options), nursery=nursery, limits=limits)

    def call(
        self,
        out: Path,
        *options: str,
        fresh: bool = False,
        limits: Mapping[int, int] | None = None,
    ) -> Ended:
        """The command from its start to its end. Raises FaultError when it hangs."""
        return wait_for(self.start(out, *options, fresh=fresh, limits=limits))


def to_go_on(out: Path) -> list[str]:
    """The option that continues what is in the folder, none where no run was begun.

    The mark of an unfinished run is written before its case.
    """
    return ["--resume"] * any((out / name).exists() for name in (CASE_FILE, UNFINISHED))


@contextmanager
def nursery_in(root: Path) -> Iterator[Nursery]:
    """A nursery that has run the case in `root` once."""
    root.mkdir(parents=True, exist_ok=True)
    (root / "case.toml").write_text(CASE)
    warm = ["run", str(root / "case.toml"), "--out", str(root / "warm"), "--quiet", *STAGES]
    nursery = Nursery(warm)
    try:
        yield nursery
    finally:
        nursery.close()


def prepare(root: Path, nursery: Nursery, *, ranks: int = 1) -> Prepared:
    """Run the case in `root` to its end, up to the pack, and until it is killed in the invasion.

    Raises RuntimeError when it cannot be run.
    """
    folder = root / f"ranks_{ranks}"
    folder.mkdir()
    empty = Prepared(root=folder, ranks=ranks, nursery=nursery, seconds={}, summary={}, tables={})
    seconds = {"": _timed(empty, folder / "finished")}
    seconds["finished"] = _timed(empty, folder / "finished", "--force", "--stages", "analyse")
    _timed(empty, folder / "packed", "--stages", "pack")
    seconds["packed"] = _timed(empty, empty.copy("packed", root / f"{ranks}_from_packed"))
    history = folder / "unfinished" / "invade" / "history.csv"
    shutil.copytree(folder / "packed", folder / "unfinished")
    child = empty.start(folder / "unfinished")
    while child.poll() is None and not _rows(history):
        time.sleep(0.001)
    child.send(signal.SIGKILL)
    wait_for(child)
    if (folder / "unfinished" / "invade" / "stage.json").exists():
        raise RuntimeError("the run that was to be killed in the invasion came to its end")
    seconds["unfinished"] = _timed(
        empty, empty.copy("unfinished", root / f"{ranks}_from_unfinished"), "--resume"
    )
    return replace(
        empty,
        seconds=seconds,
        summary=read_results(folder / "finished"),
        tables={name: digest(folder / "finished" / name) for name in TABLES},
    )


def _timed(prepared: Prepared, out: Path, *options: str) -> float:
    start = time.monotonic()
    ended = prepared.call(out, *options)
    if ended.code != 0:
        raise RuntimeError(f"the run to be attacked fails: {ended.error}")
    return time.monotonic() - start


def _rows(history: Path) -> bool:
    return history.exists() and history.read_bytes().count(b"\n") > 3


def read_results(out: Path) -> dict[str, Any]:
    """What summary.json says, without what may differ. Raises OSError or ValueError."""
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    if not isinstance(summary, dict):
        raise ValueError("not a mapping")
    return {key: _plain(value) for key, value in summary.items() if key not in NOT_COMPARED}


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below a folder, by its name."""
    return {
        str(path.relative_to(folder)): digest(path)
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
