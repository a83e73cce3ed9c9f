"""Small real runs that are attacked, the commands on them, and what may become of them."""

import hashlib
import json
import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from fdnet.cli import main
from fdnet.run.folder import CASE, UNFINISHED

LIMIT_S = 120.0
"""Seconds after which a command counts as hanging."""
MOST_BYTES = 200 << 20
STAGES = ("--stages", "pack,invade,analyse")
TABLES = tuple(f"{name}.csv" for name in ("spheres_initial", "spheres_damaged", "sections"))
TABLES += ("profile.csv", "pores.csv", "throats.csv")
NOT_COMPARED = {"seconds", "warnings", "left_out", "cpu_seconds", "peak_memory_bytes"}
"""Keys of summary.json that may differ: what took how long, and what is said about it."""
NOTES = "notes.txt"
"""A file of the user that lies in every attacked folder."""
TOML = """name = "chaos"
seed = 1
box = { size_mm = [1.6, 1.0, 1.0], sides = "periodic" }
grains = { radius_mm = 0.25, count = 15 }
fines = { radius_mm = 0.05, count = 60, supply = "batches" }
run = { cap_ms = 0.2, checkpoint_ms = 0.02 }
analysis = { sections = 2, damage_law = "section-archie" }
"""


class FaultError(Exception):
    """What fdnet must not do: hang, differ silently, show a traceback, lose a file."""


class Ended(NamedTuple):
    """Exit code of a command, negative for the signal that ended it, and its standard error."""

    code: int
    error: str


class Child(NamedTuple):
    """A started command in a session of its own, and the file of its standard error."""

    pid: int
    poll: Callable[[], int | None]
    error: Path

    def send(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def let_run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> None:
        """Wait for that time, or until it has ended or something holds."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and self.poll() is None and not until():
            time.sleep(0.005)

    def wait(self) -> Ended:
        """Wait for its end. Raises FaultError when it hangs; it is ended then."""
        self.let_run(LIMIT_S)
        if (code := self.poll()) is None:
            os.kill(self.pid, signal.SIGKILL)
            raise FaultError(f"hang: not done within {LIMIT_S:g} s")
        return Ended(code, self.error.read_text(errors="replace"))


Limits = Mapping[int, int]


def _limit(limits: Limits) -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for what, most in limits.items():
        resource.setrlimit(what, (most, most))


def _command(words: list[str], error: str, limits: Limits) -> None:
    os.setsid()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(os.open(error, os.O_WRONLY | os.O_CREAT), 2)
    sys.stderr = os.fdopen(2, "w", buffering=1, closefd=False)
    _limit(limits)
    sys.exit(main(words))


def start(words: list[str], error: Path, *, fresh=False, limits: Limits | None = None) -> Child:
    """`fdnet WORD ...` with limits of the system (RLIMIT_...: value).

    It is forked from a process that has loaded fdnet; `fresh` is a Python of its own.
    """
    if fresh:
        streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL}
        streams |= {"stderr": error.open("wb"), "preexec_fn": lambda: _limit(limits or {})}
        command = [sys.executable, "-m", "fdnet.cli", *words]
        own = subprocess.Popen(command, start_new_session=True, **streams)
        return Child(own.pid, own.poll, error)
    folders = [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    os.environ["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(":".join(folders).split(":")))
    server = multiprocessing.get_context("forkserver")
    server.set_forkserver_preload(["robustness.warm"])
    error.touch()
    process = server.Process(target=_command, args=(words, str(error), dict(limits or {})))
    process.start()
    assert process.pid is not None
    return Child(process.pid, lambda: process.exitcode, error)


class Prepared(NamedTuple):
    """What the attacks start from: runs that are finished, packed alone, and unfinished."""

    root: Path
    seconds: dict[str, float]
    """Wall time that a command takes on each of them, and on none."""
    summary: dict[str, Any]
    tables: dict[str, str]
    """Summary of the uncut run, and the SHA-256 of each of its TABLES."""

    def copy(self, which: str, place: Path) -> Path:
        """A copy of one of the runs with the user's notes in it; an empty place for none."""
        out = place / "run"
        if which:
            shutil.copytree(self.root / which, out)
            (out / NOTES).write_text("mine")
        return out

    def start(self, out: Path, *options: str, **more: Any) -> Child:
        """Start the command that runs the case in `out`."""
        words = ["run", str(self.root / "case.toml"), "--out", str(out), "--quiet", *options]
        words += STAGES * ("--stages" not in words)
        return start(words, self.root / f"error-{time.monotonic_ns()}", **more)

    def call(self, out: Path, *options: str, **more: Any) -> Ended:
        """The command from its start to its end."""
        return self.start(out, *options, **more).wait()


def to_go_on(out: Path) -> list[str]:
    """The option that continues what is in the folder, none where no run was begun."""
    return ["--resume"] * any((out / name).exists() for name in (CASE, UNFINISHED))


def prepare(root: Path) -> Prepared:
    """Run the case to its end, up to the pack, and until it is killed in the invasion."""
    (root / "case.toml").write_text(TOML)
    runs, begin = Prepared(root, {}, {}, {}), time.monotonic()
    assert runs.call(root / "finished").code == 0, "the run to be attacked fails"
    runs.seconds.update(dict.fromkeys(("", "packed", "unfinished"), time.monotonic() - begin))
    runs.call(root / "packed", "--stages", "pack")
    shutil.copytree(root / "packed", root / "unfinished")
    history = root / "unfinished" / "invade" / "history.csv"
    child = runs.start(root / "unfinished")
    child.let_run(60.0, lambda: history.exists() and history.read_bytes().count(b"\n") > 3)
    child.send(signal.SIGKILL)
    child.wait()
    assert not (root / "unfinished" / "invade" / "stage.json").exists(), "it came to its end"
    runs.summary.update(results(root / "finished"))
    runs.tables.update({name: digest(root / "finished" / name) for name in TABLES})
    return runs


def results(out: Path) -> dict[str, Any]:
    """What summary.json says, without what may differ. Raises OSError or ValueError."""
    nothing = {"parse_constant": lambda name: None}
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"), **nothing)
    if not isinstance(summary, dict):
        raise ValueError("not a mapping")
    return {key: value for key, value in summary.items() if key not in NOT_COMPARED}


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def contents(folder: Path) -> dict[str, str]:
    """SHA-256 of every file below a folder, by its name."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): digest(path) for path in files}


def judge(prepared: Prepared, out: Path, ended: Ended, *, stopped: bool = False) -> str:
    """ "ok" or "refused", which a command may be; it may end by a signal where one was sent.

    Raises FaultError when it is neither.
    """
    if "Traceback" in ended.error:
        raise FaultError(f"traceback: {ended.error.strip().splitlines()[-1]}")
    for path in out.rglob("*"):
        if path.is_file() and path.stat().st_size > MOST_BYTES:
            raise FaultError(f"size: {path.relative_to(out)} has {path.stat().st_size} bytes")
    if ended.code == 0:
        if difference := differs(prepared, out):
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
    try:
        for name in TABLES:
            if digest(out / name) != prepared.tables[name]:
                return f"{name} differs"
        summary = results(out)
    except (OSError, ValueError) as error:
        return f"a result cannot be read: {error}"
    keys = [key for key in prepared.summary if summary.get(key) != prepared.summary[key]]
    return f"summary.json: {', '.join(keys)}" if keys else ""


def check_kept(out: Path, before: Mapping[str, str], *, everything: bool) -> None:
    """Raises FaultError when the user's file, or a file of a run only read, has changed."""
    after = contents(out)
    names = [name for name in before if everything or name == NOTES]
    if lost := [name for name in names if after.get(name) != before[name] and name != ".lock"]:
        raise FaultError(f"lost: {', '.join(lost)}")


def finish(prepared: Prepared, out: Path, *options: str) -> str:
    """Continue a run without any hindrance: it must end as the uncut one."""
    ended = prepared.call(out, *to_go_on(out), *options)
    if judge(prepared, out, ended) != "ok":
        raise FaultError(f"stuck: {' '.join(ended.error.split())[:200]}")
    return "ok"
