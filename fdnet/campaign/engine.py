"""What carries out the runs of a plan: Snakemake with its executors, or a pool of processes.

Each run is `fdnet run --resume` in a process of its own, which goes on where it was cut.
"""

import contextlib
import ctypes
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fdnet.campaign.plan import CASES, LOGS, PACKS, RUNS, Plan, last_words, state_of
from fdnet.errors import CaseError
from fdnet.files import disk_is_full, write_text
from fdnet.run.folder import MANIFEST, RECORDS
from fdnet.run.progress import ONE_CORE

PAUSE = 0.05
"""Seconds between two looks at the running processes."""
PATIENCE = 60.0
"""Seconds that runs may take to stop in good order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HowToRun:
    """How runs are carried out, as opposed to what they are.

    Attributes:
        jobs: how many at the same time.
        liggghts: path of the binary; None: looked for.
        launcher: template that starts several ranks; None: mpirun.
        timeout: s, after which LIGGGHTS of one run is stopped; None: never.
        engine: "local", "snakemake", or "slurm" (Snakemake with its executor for Slurm).
        resources: of Snakemake for Slurm, as ("slurm_partition=short", "runtime=60").
        quiet: whether to show no progress.
    """

    jobs: int
    liggghts: str | None = None
    launcher: str | None = None
    timeout: float | None = None
    engine: str = "local"
    resources: tuple[str, ...] = ()
    quiet: bool = False

    @property
    def options(self) -> list[str]:
        """Options of `fdnet run`, beside those of the plan."""
        words = []
        if self.liggghts:
            words += ["--liggghts", str(Path(self.liggghts).expanduser().absolute())]
        if self.launcher:
            words += ["--launcher", self.launcher]
        return words if self.timeout is None else [*words, "--timeout", repr(self.timeout)]

    def say(self, text: str) -> None:
        """Show how far it is."""
        if not self.quiet:
            print(f"fdnet: {text}", file=sys.stderr, flush=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One process of a campaign.

    Attributes:
        name: of its log.
        words: what it calls, run in the folder of the campaign.
        makes: file below the folder that is there when it has succeeded.
        after: name of the task that must have ended before; "" for none.
    """

    name: str
    words: tuple[str, ...]
    makes: str
    after: str = ""


def tasks_of(path: Path, plan: Plan, how: HowToRun) -> list[Task]:
    """What is missing in the folder: packs that several runs share, and runs that are not done.

    A run whose files were changed is asked again, and `fdnet run` says so in its log.
    """
    common = ["--resume", "--quiet", "--np", str(plan.ranks), *how.options]
    packs: dict[str, Task] = {}
    runs = []
    for job in plan.jobs:
        if state_of(path, plan, job).status == "done":
            continue
        start = (sys.executable, "-m", "fdnet.cli", "run", f"{CASES}/{job.name}.toml", *common)
        words = [*start, "--out", f"{RUNS}/{job.name}", "--stages", ",".join(plan.stages)]
        digest, after = plan.packs.get(job.name, ""), ""
        if digest:
            words += ["--pack-from", f"{PACKS}/{digest}"]
            makes = f"{PACKS}/{digest}/{RECORDS['pack']}"
            if not (path / makes).is_file():
                after = f"pack-{digest}"
                pack = (*start, "--out", f"{PACKS}/{digest}", "--stages", "pack")
                packs.setdefault(digest, Task(name=after, words=pack, makes=makes))
        makes = f"{RUNS}/{job.name}/{MANIFEST}"
        runs.append(Task(name=job.name, words=tuple(words), makes=makes, after=after))
    return [*packs.values(), *runs]


def run_missing(path: Path, plan: Plan, how: HowToRun, lock: int) -> None:
    """Carry out what is missing of the plan; `lock` is the descriptor of the folder's lock.

    A run that fails stops no other. Raises CaseError when the disk is full, when Snakemake is not
    installed, and when it did not begin.
    """
    tasks = tasks_of(path, plan, how)
    if not tasks:
        return
    if how.engine == "slurm" and find_spec("snakemake_executor_plugin_slurm") is None:
        raise CaseError(
            "--slurm: Snakemake's executor for Slurm is not installed; pip install 'fdnet[sweep]'"
        )
    if how.engine != "local" and not has_snakemake():
        raise CaseError(
            f"--engine {how.engine}: Snakemake is not installed; pip install 'fdnet[sweep]', or "
            "take --engine local"
        )
    missing = sum(task.makes.endswith(MANIFEST) for task in tasks)
    how.say(f"{len(plan.jobs)} runs, {missing} of them to do")
    for task in tasks:
        _log(path, task.name).unlink(missing_ok=True)
    count = 0

    def ended(name: str, code: int) -> None:
        nonlocal count
        count += 1
        word = "done" if code == 0 else f"FAILED (exit code {code})"
        how.say(f"{count} of {len(tasks)}: {name} {word}")

    if how.engine == "local":
        _run_pool(path, tasks, how.jobs, ended)
    else:
        _run_snakemake(path, plan, tasks, how, lock, ended)


def _log(path: Path, name: str) -> Path:
    return path / LOGS / f"{name}.txt"


# ------------------------------------------------------------------------------------------------
# The pool: some processes at a time on this machine, nothing else needed.


def _run_pool(path: Path, tasks: list[Task], jobs: int, ended: Callable[[str, int], None]) -> None:
    """Run the tasks, `jobs` at a time. One that fails stops only those that need what it makes.

    When this is left by an exception, the running ones are stopped in good order.
    """
    waiting, running = list(tasks), dict[str, subprocess.Popen]()
    full = False
    try:
        while running or (waiting and not full):
            full = full or disk_is_full(path)
            open_names = {task.name for task in waiting} | running.keys()
            for task in [] if full else list(waiting):
                if task.after not in open_names and len(running) < jobs:
                    waiting.remove(task)
                    with _log(path, task.name).open("wb") as log:
                        running[task.name] = _start(task.words, path, log, _end_with_parent)
            for name in [name for name, process in running.items() if process.poll() is not None]:
                code = running.pop(name).returncode
                if code < 0:  # it could not write its reason itself
                    with _log(path, name).open("a", encoding="utf-8") as log:
                        log.write(
                            f"\nfdnet: ended by signal {-code} ({signal.Signals(-code).name}), "
                            "perhaps for want of memory; repeat the command to go on\n"
                        )
                ended(name, code)
            time.sleep(PAUSE)
    finally:
        _stop(running.values(), signal.SIGTERM, whole_group=False)
    if full and waiting:
        raise CaseError(
            f"{path}: the disk is full; {len(waiting)} jobs were not started: free space, then "
            "repeat the command, which runs only what is missing"
        )


def _start(
    words: Sequence[str], path: Path, log: Any, before: Any = None, **more: Any
) -> subprocess.Popen:
    return subprocess.Popen(
        words,
        cwd=path,
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=subprocess.STDOUT,
        env=os.environ | ONE_CORE,
        start_new_session=True,
        preexec_fn=before,
        **more,
    )


def _end_with_parent() -> None:
    """Ask the kernel for a SIGTERM when the parent dies, however it dies (PR_SET_PDEATHSIG)."""
    ctypes.CDLL(None).prctl(1, signal.SIGTERM, 0, 0, 0)


def _stop(processes: Iterable[subprocess.Popen], number: int, *, whole_group: bool) -> None:
    """End these processes: first in good order, after PATIENCE by SIGKILL."""
    running = [process for process in processes if process.poll() is None]
    for process in running:
        with contextlib.suppress(ProcessLookupError):
            if whole_group:
                os.killpg(process.pid, number)
            else:
                process.send_signal(number)
    deadline = time.monotonic() + PATIENCE
    for process in running:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.1, deadline - time.monotonic()))
        if process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


# ------------------------------------------------------------------------------------------------
# Snakemake, with the static Snakefile that comes with fdnet.


SNAKEFILE = str(resources.files("fdnet.campaign").joinpath("Snakefile"))
_SNAKEMAKE_LOG, _CONFIG = "logs/snakemake.txt", "logs/snakemake.json"
_REASON = re.compile(
    r"^(?!.*(?:check log file|Error in rule|Look above)).*(?:[Ee]rror|Exception|failed|locked).*$",
    re.MULTILINE,
)


def has_snakemake() -> bool:
    """Whether Snakemake is installed."""
    return find_spec("snakemake") is not None


def _run_snakemake(
    path: Path,
    plan: Plan,
    tasks: list[Task],
    how: HowToRun,
    lock: int,
    ended: Callable[[str, int], None],
) -> None:
    """Run what is missing as jobs of Snakemake, which gets its stop as one of the terminal.

    Snakemake inherits the lock of the folder, so that no other call works there while it lives,
    also when this process is killed.
    """
    write_text(path / _CONFIG, json.dumps({"options": how.options}))
    if os.pread(lock, 1, 0):  # Snakemake was killed before: its lock is nobody's
        how.say("an earlier Snakemake was killed here; its lock is removed")
        with (path / _SNAKEMAKE_LOG).open("wb") as log:
            _start([*_command(how, plan), "--unlock"], path, log).wait()
    open_tasks = {task.name: path / task.makes for task in tasks}
    with (path / _SNAKEMAKE_LOG).open("wb") as log:
        process = _start([*_command(how, plan)], path, log, pass_fds=(lock,))
    holder = f"Snakemake (process {process.pid} on {socket.gethostname()}) still runs the jobs of "
    holder += f"this folder; wait for its end, or stop it with kill -INT -{process.pid}"
    os.pwrite(lock, holder.encode(), 0)
    try:
        while open_tasks:
            over = process.poll() is not None
            for name in [name for name, made in open_tasks.items() if made.exists()]:
                del open_tasks[name]
                ended(name, 0)
            if over:
                break
            time.sleep(PAUSE)
        process.wait()
    finally:
        _stop([process], signal.SIGINT, whole_group=True)
        os.ftruncate(lock, 0)
    begun = any(last_words(_log(path, task.name)) for task in tasks)
    if process.returncode and not begun and open_tasks:
        text = (path / _SNAKEMAKE_LOG).read_text("utf-8", "replace")
        reasons = dict.fromkeys(line.strip() for line in _REASON.findall(text))
        raise CaseError(
            f"{path / _SNAKEMAKE_LOG}: Snakemake ended with exit code {process.returncode} before "
            f"any run: {' | '.join(reasons)[:1000] or last_words(path / _SNAKEMAKE_LOG)}"
        )


def _command(how: HowToRun, plan: Plan) -> list[str]:
    words = [sys.executable, "-m", "snakemake", "--snakefile", SNAKEFILE, "--configfile", _CONFIG]
    words += ["--until", "run", "--keep-going", "--rerun-incomplete"]
    if how.engine == "snakemake":
        return [*words, "--cores", str(how.jobs * plan.ranks)]
    words += ["--executor", "slurm", "--jobs", str(how.jobs), "--latency-wait", "30"]
    if not _has_accounting():
        words += ["--slurm-status-command", "squeue"]
    resources = [_quoted(one) for one in how.resources if "=" in one]
    return words + (["--default-resources", *resources] if resources else [])


def _has_accounting() -> bool:
    """Whether sacct answers: without accounting it does not, and no job would be seen to end."""
    with contextlib.suppress(OSError):
        return subprocess.run(["sacct", "-X"], capture_output=True, check=False).returncode == 0
    return False


def _quoted(resource: str) -> str:
    """A resource for Snakemake, which reads it as Python: texts are quoted, `all` is no function.

    Raises CaseError for one that is no name with a printable value.
    """
    name, _, value = resource.partition("=")
    if not name.isidentifier() or not value.isprintable() or not value:
        raise CaseError(
            f"--slurm: {resource!r}, expected resources of Snakemake as slurm_partition=short,"
            "runtime=60"
        )
    return resource if value.isdecimal() else f"{name}={value.strip(chr(39) + chr(34))!r}"
