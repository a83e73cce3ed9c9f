"""The built-in engine: some processes at a time on this machine, nothing else needed."""

import contextlib
import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from fdnet.campaign.engine.tasks import Task, environment
from fdnet.errors import CaseError
from fdnet.files import disk_is_full

PAUSE = 0.05
"""Seconds between two looks at the running processes."""
PATIENCE = 20.0
"""Seconds that a run may take to stop in good order."""
_PR_SET_PDEATHSIG = 1
_SIGNALS = {signal.SIGINT, signal.SIGTERM}


def run_local(
    path: Path, tasks: Sequence[Task], *, jobs: int, ended: Callable[[str, int], None]
) -> None:
    """Run the tasks, `jobs` at a time; `ended` gets name and exit code of each as it ends.

    One that fails stops nothing but those that need what it makes. When this is left by an
    exception, the running ones are stopped in good order; they continue at the next call.

    Raises CaseError, after the running tasks have ended, when the disk is full.
    """
    waiting, ended_names = list(tasks), set()
    all_names = {task.name for task in tasks}
    running: dict[str, subprocess.Popen] = {}
    full = False
    try:
        while running or (waiting and not full):
            full = full or disk_is_full(path)
            for task in [] if full else list(waiting):
                ready = task.after not in all_names or task.after in ended_names
                if ready and len(running) < jobs:
                    waiting.remove(task)
                    running[task.name] = _start(path, task)
            for name in [name for name, process in running.items() if process.poll() is not None]:
                code = running.pop(name).returncode
                _note_signal(path, name, code)
                ended_names.add(name)
                ended(name, code)
            time.sleep(PAUSE)
    finally:
        _stop(running.values())
    if full and waiting:
        raise CaseError(
            f"{path}: the disk is full; {len(waiting)} jobs were not started: free space, then "
            "repeat the command, which runs only what is missing"
        )


def _start(path: Path, task: Task) -> subprocess.Popen:
    with (path / task.log).open("wb") as log:
        return subprocess.Popen(
            task.words,
            cwd=path,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=environment(),
            start_new_session=True,
            preexec_fn=_end_with_parent,
        )


def _end_with_parent() -> None:
    """Ask the kernel to stop the run when this process dies, however it dies."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)


def _note_signal(path: Path, name: str, code: int) -> None:
    """A process that was killed could not write its reason itself."""
    if code < 0:
        with (path / "logs" / f"{name}.txt").open("a", encoding="utf-8") as log:
            log.write(
                f"\nfdnet: ended by signal {-code} ({signal.Signals(-code).name}), perhaps for "
                "want of memory; repeat the command to go on\n"
            )


def _stop(processes: Iterable[subprocess.Popen]) -> None:
    """End these processes: first in good order, after PATIENCE by SIGKILL."""
    running = list(processes)
    for process in running:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
    deadline = time.monotonic() + PATIENCE
    for process in running:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.1, deadline - time.monotonic()))
        if process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
