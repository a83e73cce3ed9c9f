"""The engine Snakemake: a Snakefile of what is missing, on this machine or on a cluster."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

from fdnet.campaign.engine.tasks import HowToRun, Task, environment
from fdnet.errors import CaseError
from fdnet.files import write_text

SNAKEFILE, TASKS, LOG = "Snakefile", "tasks.json", "logs/snakemake.log"
PAUSE, PATIENCE = 0.2, 60.0
"""Seconds between two looks, and seconds that Snakemake may take to stop."""


def has_snakemake(*, slurm: bool = False) -> bool:
    """Whether Snakemake is installed, with its executor for Slurm if asked for."""
    plugin = "snakemake_executor_plugin_slurm"
    return find_spec("snakemake") is not None and (not slurm or find_spec(plugin) is not None)


def write_snakefile(path: Path, tasks: Sequence[Task], how: HowToRun, *, ranks: int) -> None:
    """Write `Snakefile` and `tasks.json` of the tasks that are missing."""
    from jinja2 import Environment, StrictUndefined

    text = resources.files("fdnet.campaign.engine").joinpath("snakefile.j2").read_text("utf-8")
    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    snakefile = environment.from_string(text).render(ranks=ranks, cluster=how.engine == "slurm")
    rows = [asdict(task) | {"line": task.line} for task in tasks]
    write_text(path / TASKS, json.dumps(rows, indent=1) + "\n")
    write_text(path / SNAKEFILE, snakefile)


def run_snakemake(
    path: Path,
    tasks: Sequence[Task],
    how: HowToRun,
    *,
    ranks: int,
    ended: Callable[[str, int], None],
) -> None:
    """Run the tasks as jobs of Snakemake; `ended` gets each that succeeds, with exit code 0.

    Raises CaseError when Snakemake is not installed, or when it did not even begin.
    """
    if not has_snakemake(slurm=how.engine == "slurm"):
        raise CaseError(
            f"--engine {how.engine}: Snakemake is not installed; pip install 'fdnet[sweep]', or "
            "take --engine local"
        )
    write_snakefile(path, tasks, how, ranks=ranks)
    for task in tasks:
        for name in (f"logs/{task.name}.done", task.log):
            (path / name).unlink(missing_ok=True)
    with (path / LOG).open("wb") as log:
        process = subprocess.Popen(
            [*_command(how, ranks)],
            cwd=path,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=environment(),
            start_new_session=True,
        )
    try:
        _watch(path, tasks, process, ended)
    finally:
        _stop(process)
    begun = any((path / task.log).exists() or (path / task.makes).exists() for task in tasks)
    if process.returncode and not begun:
        raise CaseError(
            f"{path / LOG}: Snakemake ended with exit code {process.returncode} before any job; "
            "read the end of that file, or take --engine local"
        )


def _command(how: HowToRun, ranks: int) -> list[str]:
    words = [sys.executable, "-m", "snakemake", "--snakefile", SNAKEFILE, "--keep-going"]
    words += ["--rerun-triggers", "mtime", "--rerun-incomplete", "--nolock"]
    if how.engine == "slurm":
        words += ["--executor", "slurm", "--jobs", str(how.jobs), "--latency-wait", "30"]
        defaults = [one for one in how.resources if "=" in one]
        return words + (["--default-resources", *defaults] if defaults else [])
    return [*words, "--cores", str(how.jobs * ranks)]


def _watch(
    path: Path,
    tasks: Sequence[Task],
    process: subprocess.Popen,
    ended: Callable[[str, int], None],
) -> None:
    open_tasks = {task.name: path / "logs" / f"{task.name}.done" for task in tasks}
    while True:
        over = process.poll() is not None
        for name in [name for name, mark in open_tasks.items() if mark.exists()]:
            del open_tasks[name]
            ended(name, 0)
        if over:
            return
        time.sleep(PAUSE)


def _stop(process: subprocess.Popen) -> None:
    """Snakemake passes a stop on to its jobs, which stop in good order."""
    if process.poll() is not None:
        return
    for number, patience in ((signal.SIGTERM, PATIENCE), (signal.SIGKILL, 5.0)):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(patience)
            return
