"""What carries out the runs of a plan: Snakemake with its executors, or a pool of processes.

Each run is `fdnet run --resume` in a process of its own, which goes on where it was cut.
"""

import contextlib
import ctypes
import itertools
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
from functools import partial
from importlib import resources
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from fdnet.campaign.plan import CASES, LOGS, PACKS, RUNS, Plan, last_words, state_of
from fdnet.errors import CaseError
from fdnet.files import disk_is_full, write_text
from fdnet.run.folder import MANIFEST, RECORDS
from fdnet.run.progress import ONE_CORE

PAUSE, PATIENCE = 0.05, 120.0
"""Seconds between two looks at the runs, and seconds that they may take to stop in good order."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HowToRun:
    """How runs are carried out: `jobs` at the same time, each stopped after `timeout` seconds.

    The engine is "local", "snakemake" or "slurm" (Snakemake with its executor for Slurm, which
    gets `resources`, as "slurm_partition=short"). LIGGGHTS is looked for where None is given.
    """

    jobs: int
    liggghts: str | None = None
    launcher: str | None = None
    timeout: float | None = None
    engine: str = "local"
    resources: tuple[str, ...] = ()
    quiet: bool = False

    def __post_init__(self) -> None:
        engines = ("local", "snakemake", "slurm")
        if self.jobs < 1:
            raise CaseError(f"jobs: {self.jobs} runs at the same time, expected at least 1")
        if self.engine not in engines:
            raise CaseError(f"engine: {self.engine!r}, expected one of {', '.join(engines)}")

    @property
    def options(self) -> list[str]:
        """Options of `fdnet run` that are not those of the plan."""
        path = self.liggghts and str(Path(self.liggghts).expanduser().absolute())
        given = {"--liggghts": path, "--launcher": self.launcher, "--timeout": self.timeout}
        return [str(word) for name, value in given.items() if value for word in (name, value)]

    def refuse(self) -> None:
        """Raise CaseError where Snakemake is asked for and missing, or a resource has no value."""
        plugin = "snakemake_executor_plugin_slurm" if self.engine == "slurm" else "snakemake"
        if self.engine != "local" and not (has_snakemake() and find_spec(plugin)):
            advice = "pip install 'fdnet[sweep]', or take --engine local"
            raise CaseError(f"--engine {self.engine}: {plugin} is not installed; {advice}")
        for resource in self.resources:
            _quoted(resource)

    def say(self, text: str) -> None:
        """Show how far it is."""
        if not self.quiet:
            print(f"fdnet: {text}", file=sys.stderr, flush=True)


class Task(NamedTuple):
    """One process: what it calls, the file that it makes, and the task that must end before."""

    name: str
    words: Sequence[str]
    makes: str
    after: str = ""


def run_missing(path: Path, plan: Plan, how: HowToRun, lock: int) -> None:
    """Carry out what is missing of the plan; `lock` is the descriptor of the folder's lock.

    A run that fails stops no other. Raises CaseError for a full disk.
    """
    tasks = _tasks_of(path, plan, how)
    if not tasks:
        return
    missing = sum(task.makes.endswith(MANIFEST) for task in tasks)
    how.say(f"{len(plan.jobs)} runs: {missing} to do, after {len(tasks) - missing} packs")
    for task in tasks:
        _log(path, task.name).unlink(missing_ok=True)
    numbers = itertools.count(1)

    def ended(name: str, code: int) -> None:
        word = f"FAILED (exit code {code})" if code else "done"
        how.say(f"{next(numbers)} of {len(tasks)}: {name} {word}")

    if how.engine == "local":
        _run_pool(path, tasks, how.jobs, ended)
    else:
        _run_snakemake(path, plan, tasks, how, lock, ended)


def _tasks_of(path: Path, plan: Plan, how: HowToRun) -> list[Task]:
    """Packs that several runs share, and runs that are not done; changed ones are only named."""
    shared, packs, runs = plan.packs, dict[str, Task](), []
    for job in plan.jobs:
        status, reason = state_of(path, plan, job)
        changed = status == "failed" and (path / RUNS / job.name / MANIFEST).exists()
        if changed:
            how.say(f"{job.name} is left as it is: {reason}")
        if changed or status == "done":
            continue
        start = [sys.executable, "-m", "fdnet.cli", "run", f"{CASES}/{job.name}.toml"]
        start += ["--resume", "--quiet", "--np", str(plan.ranks), *how.options]
        words = [*start, "--out", f"{RUNS}/{job.name}", "--stages", ",".join(plan.stages)]
        digest, after = shared.get(job.name), ""
        if digest:
            folder = f"{PACKS}/{digest}"
            words += ["--pack-from", folder]
            made = f"{folder}/{RECORDS['pack']}"
            if not (path / made).is_file():
                after = f"pack-{digest}"
                pack = [*start, "--out", folder, "--stages", "pack"]
                packs.setdefault(after, Task(after, pack, made))
        runs.append(Task(job.name, words, f"{RUNS}/{job.name}/{MANIFEST}", after))
    return [*packs.values(), *runs]


def _log(path: Path, name: str) -> Path:
    return path / LOGS / f"{name}.txt"


def _start(words: Sequence[str], path: Path, log: Path, **more: Any) -> subprocess.Popen:
    """A process of one thread in a session of its own, which works in `path`."""
    streams: Any = {"stdin": subprocess.DEVNULL, "stderr": subprocess.STDOUT}
    own: Any = {"cwd": path, "env": os.environ | ONE_CORE, "start_new_session": True}
    with log.open("wb") as file:
        return subprocess.Popen(words, stdout=file, **streams, **own, **more)


def _stop(running: Iterable[subprocess.Popen], kill: Callable[..., None], number: int) -> None:
    """End these processes by a signal in good order, after PATIENCE by SIGKILL."""
    deadline = time.monotonic() + PATIENCE
    open_still = [process for process in running if process.poll() is None]
    for process in open_still:
        with contextlib.suppress(ProcessLookupError):
            kill(process.pid, number)
    for process in open_still:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.1, deadline - time.monotonic()))
        if process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


# ---- The pool: some processes at a time on this machine, nothing else needed.
def _run_pool(path: Path, tasks: Sequence[Task], jobs: int, ended: Callable[..., None]) -> None:
    """Run the tasks, `jobs` at a time; one that fails stops only those that need what it makes."""
    waiting, running, full, failed = list(tasks), dict[str, subprocess.Popen](), False, set[str]()
    # The kernel sends SIGTERM when the parent dies, however it dies (PR_SET_PDEATHSIG).
    dies_with_parent = partial(ctypes.CDLL(None).prctl, 1, signal.SIGTERM, 0, 0, 0)
    try:
        while running or (waiting and not full):
            full = full or disk_is_full(path)
            for task in [task for task in waiting if task.after in failed]:
                waiting.remove(task)
                ended(task.name, 1)
            not_ended = {task.name for task in waiting} | running.keys()
            ready = [task for task in waiting if task.after not in not_ended]
            for task in [] if full else ready[: jobs - len(running)]:
                waiting.remove(task)
                log = _log(path, task.name)
                running[task.name] = _start(task.words, path, log, preexec_fn=dies_with_parent)
            for name in [name for name, process in running.items() if process.poll() is not None]:
                code = running.pop(name).returncode
                if code < 0:  # it could not write its reason itself
                    why = f"ended by signal {-code} ({signal.Signals(-code).name}), perhaps for "
                    with _log(path, name).open("a", encoding="utf-8") as file:
                        file.write(f"\nfdnet: {why}want of memory; repeat the command to go on\n")
                failed |= {name} if code else set()
                ended(name, code)
            time.sleep(PAUSE)
    finally:
        _stop(running.values(), os.kill, signal.SIGTERM)
    if full and waiting:
        advice = "free space, then repeat the command, which runs only what is missing"
        problem = f"the disk is full; {len(waiting)} jobs were not started"
        raise CaseError(f"{path}: {problem}: {advice}")


# ---- Snakemake, with the static Snakefile that comes with fdnet.
SNAKEFILE = str(resources.files("fdnet.campaign").joinpath("Snakefile"))
_CONFIG = f"{LOGS}/snakemake.json"
_REASON = re.compile(
    r"(?m)^(?!.*(?:check log file|Error in rule|Look above)).*(?:rror|Exception|failed|locked).*"
)


def has_snakemake() -> bool:
    """Whether Snakemake is installed."""
    return find_spec("snakemake") is not None


def _run_snakemake(
    path: Path, plan: Plan, tasks: Sequence[Task], how: HowToRun, lock: int, ended: Any
) -> None:
    """Run what is missing as jobs of Snakemake, which cancels them when it is stopped by SIGINT.

    It inherits the folder's lock, in which it is named: no other call works while either lives.
    """
    words, log = _snakemake_words(how, plan), _log(path, "snakemake")
    config = {"options": how.options, "slurm_conf": os.environ.get("SLURM_CONF")}
    write_text(path / _CONFIG, json.dumps(config))
    if os.pread(lock, 1, 0) and any(path.glob(".snakemake/locks/*")):
        how.say("an earlier Snakemake was killed here; its lock is removed")
        _start([*words, "--unlock"], path, log).wait()
    open_tasks = {task.name: path / task.makes for task in tasks}
    process = _start(words, path, log, pass_fds=(lock,))
    holder = f"Snakemake (process {process.pid} on {socket.gethostname()}) still runs the jobs of "
    holder += f"this folder; wait for its end, or stop it with kill -INT -{process.pid}"
    os.truncate(lock, 0)
    os.pwrite(lock, holder.encode(), 0)
    try:
        over = False
        while not over:
            over = process.poll() is not None
            for name in [name for name, made in open_tasks.items() if made.exists()]:
                del open_tasks[name]
                ended(name, 0)
            time.sleep(PAUSE)
    finally:
        _stop([process], os.killpg, signal.SIGINT)
        os.truncate(lock, 0)
    if process.returncode and not any(last_words(_log(path, task.name)) for task in tasks):
        said = log.read_text("utf-8", "replace")
        for job in re.findall(r"SLURM jobid \S+ \(log: (.+)\)", said)[-1:]:  # what it says itself
            said = Path(job).read_text("utf-8", "replace") + said if Path(job).exists() else said
        reasons = " | ".join(dict.fromkeys(map(str.strip, _REASON.findall(said))))[:1000]
        problem = f"Snakemake ended with exit code {process.returncode} before any run"
        raise CaseError(f"{log}: {problem}: {reasons or last_words(log)}")


def _snakemake_words(how: HowToRun, plan: Plan) -> list[str]:
    words = [sys.executable, "-m", "snakemake", "--snakefile", SNAKEFILE, "--configfile", _CONFIG]
    words += ["--until", "run", "--keep-going", "--rerun-incomplete"]
    if how.engine == "snakemake":
        return [*words, "--cores", str(how.jobs * plan.ranks)]
    words = ["env", "-u", "SLURM_JOB_ID", *words]  # in a job the executor drops SLURM_CONF
    words += ["--executor", "slurm", "--jobs", str(how.jobs), "--latency-wait", "30"]
    with contextlib.suppress(OSError):  # without accounting sacct would see no job end
        if subprocess.run(["sacct", "-X"], capture_output=True, check=False).returncode:
            words += ["--slurm-status-command", "squeue"]
    quoted = [_quoted(one) for one in how.resources]
    return words + (["--default-resources", *quoted] if quoted else [])


def _quoted(resource: str) -> str:
    """A resource for Snakemake, which reads it as Python: `all` shall be no function."""
    name, _, value = resource.partition("=")
    if not name.isidentifier() or not value.isprintable() or not value:
        raise CaseError(f"--slurm: {resource!r}, expected e.g. slurm_partition=short,runtime=60")
    return resource if value.isdecimal() else f"{name}={value.strip(chr(39) + chr(34))!r}"
