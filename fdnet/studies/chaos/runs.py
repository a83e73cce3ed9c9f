"""Small real runs that are attacked, and the commands that are given on them."""

import csv
import hashlib
import json
import math
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CASE = """name = "chaos"
seed = 1
box = { size_mm = [2.0, 1.2, 1.2] }
grains = { radius_mm = 0.25, count = 26 }
fines = { radius_mm = 0.05, count = 60 }
run = { cap_ms = 0.2 }
analysis = { sections = 2 }
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
LIMIT_S = 90.0
"""Seconds after which a command counts as hanging."""
MOST_BYTES = 200 << 20
"""Bytes that one file of an attacked run may have."""
NOTES = "notes.txt"
"""A file of the user that lies in every attacked folder."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """What the attacks start from.

    Attributes:
        root: folder of what follows.
        seconds: s, wall time of the uncut run.
        summary: summary.json of the uncut run without NOT_COMPARED.
        tables: SHA-256 of each of TABLES of the uncut run.
    """

    root: Path
    seconds: float
    summary: Mapping[str, Any]
    tables: Mapping[str, str] = field(default_factory=dict)

    @property
    def case(self) -> Path:
        """The case file."""
        return self.root / "case.toml"

    def copy(self, which: str, place: Path) -> Path:
        """A copy of the "finished" or "unfinished" run, with the user's notes in it."""
        out = place / "run"
        shutil.copytree(self.root / which, out)
        (out / NOTES).write_text("mine")
        return out

    def command(self, out: Path, *options: str) -> list[str]:
        """The command that runs the case in `out`."""
        words = ["run", str(self.case), "--out", str(out), "--quiet", *options]
        return [sys.executable, "-m", "fdnet.cli", *words, *(STAGES * ("--stages" not in words))]


def prepare(root: Path) -> Prepared:
    """Run the case to its end, and once more until it is killed in the invasion."""
    root.mkdir(parents=True, exist_ok=True)
    (root / "case.toml").write_text(CASE)
    empty = Prepared(root=root, seconds=0.0, summary={})
    start = time.monotonic()
    whole = call(empty.command(root / "finished"))
    if whole.code != 0:
        raise RuntimeError(f"the run to be attacked fails: {whole.error}")
    seconds = time.monotonic() - start
    history = root / "unfinished" / "invade" / "history.csv"
    with started(empty.command(root / "unfinished")) as process:
        while process.poll() is None and not _rows(history):
            time.sleep(0.002)
        process.kill()
    return Prepared(
        root=root,
        seconds=seconds,
        summary=_summary(root / "finished"),
        tables={name: digest(root / "finished" / name) for name in TABLES},
    )


def _rows(history: Path) -> bool:
    return history.exists() and history.read_bytes().count(b"\n") > 3


def started(
    command: list[str], limits: Mapping[int, int] | None = None
) -> "subprocess.Popen[bytes]":
    """The command in a session of its own, with limits of the system (RLIMIT_...: value)."""

    def prepare_child() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        for what, most in (limits or {}).items():
            resource.setrlimit(what, (most, most))

    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
        preexec_fn=prepare_child,
    )


def call(command: list[str], limits: Mapping[int, int] | None = None) -> Ended:
    """Run a command to its end. Raises FaultError when it hangs."""
    return wait_for(started(command, limits))


def wait_for(process: "subprocess.Popen[bytes]") -> Ended:
    """Wait for a started command. Raises FaultError when it hangs; it is ended then."""
    try:
        error = process.communicate(timeout=LIMIT_S)[1]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise FaultError(f"hang: not done within {LIMIT_S:g} s") from None
    return Ended(code=process.returncode, error=error.decode(errors="replace"))


def judge(prepared: Prepared, out: Path, ended: Ended, *, stopped: bool = False) -> str:
    """Returns "ok" or "refused".

    Args:
        prepared: the uncut run.
        out: the attacked folder.
        ended: the command on it.
        stopped: whether a signal was sent to the command, so that it may end by it.

    Raises:
        FaultError: the command did neither.
    """
    if "Traceback" in ended.error:
        raise FaultError(f"traceback: {ended.error.strip().splitlines()[-1]}")
    for path in out.rglob("*"):
        if path.is_file() and path.stat().st_size > MOST_BYTES:
            raise FaultError(f"size: {path.relative_to(out)} has {path.stat().st_size} bytes")
    if ended.code == 0:
        difference = differs(prepared, out)
        if difference:
            raise FaultError(f"silent: {difference}")
        return "ok"
    if stopped and (ended.code == 130 or ended.code < 0):
        return "refused"
    lines = ended.error.strip().splitlines()
    if ended.code not in (2, 3, 4) or len(lines) != 1 or not lines[0].startswith("fdnet: "):
        raise FaultError(f"words: exit code {ended.code} with {len(lines)} lines: {lines[-1:]}")
    return "refused"


def differs(prepared: Prepared, out: Path) -> str:
    """What differs from the uncut run in a finished folder, in words; "" when nothing does."""
    for name in TABLES:
        if not (out / name).exists():
            return f"{name} is missing"
        if digest(out / name) != prepared.tables[name]:
            return f"{name} {_column(prepared.root / 'finished' / name, out / name)}"
    try:
        summary = _summary(out)
    except (OSError, ValueError) as error:
        return f"summary.json cannot be read: {error}"
    keys = [key for key in prepared.summary if summary.get(key) != prepared.summary[key]]
    return f"summary.json: {', '.join(keys)}" if keys else ""


def _column(expected: Path, actual: Path) -> str:
    """The first column that differs."""
    with (
        expected.open(newline="") as one,
        actual.open(newline="", encoding="utf-8", errors="replace") as other,
    ):
        rows = zip(csv.DictReader(one), csv.DictReader(other), strict=False)
        for number, (first, second) in enumerate(rows, 1):
            for name, value in first.items():
                if second.get(name) != value:
                    return f"row {number} column {name}"
    return "has another number of rows"


def _summary(out: Path) -> dict[str, Any]:
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
