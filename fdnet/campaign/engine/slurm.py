"""A script for Slurm without Snakemake: an array of jobs, shared packs first."""

import re
import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from fdnet.campaign.engine.tasks import HowToRun, Task
from fdnet.campaign.plan.job import safe
from fdnet.errors import CaseError
from fdnet.files import write_text
from fdnet.run.progress import ONE_CORE

PACKS, RUNS, SUBMIT = "packs.sbatch", "runs.sbatch", "submit.bash"


def write_slurm_scripts(
    path: Path, name: str, tasks: Sequence[Task], how: HowToRun, *, ranks: int
) -> list[Path]:
    """Write the scripts of the tasks that are missing; `bash submit.bash` submits them.

    Resources with a hyphen or none in front, as "time=60" and "partition=short", become options
    of sbatch. Raises CaseError for one that sbatch could read as something else.
    """
    packs = [task for task in tasks if task.name.startswith("pack-")]
    runs = [task for task in tasks if task not in packs]
    folder, depends = str(path.absolute()), ""
    written, lines = [], ["#!/bin/bash", "# Written by fdnet: submits what is missing.", "set -e"]
    lines.append(f"cd {shlex.quote(folder)}")
    for file, part in ((PACKS, packs), (RUNS, runs)):
        if part:
            text = _script(name, folder, part, how, ranks)
            written.append(write_text(path / file, text))
            lines.append(f"job=$(sbatch --parsable{depends} {file}); echo $job")
            depends = ' --dependency="afterany:$job"'
    return [*written, write_text(path / SUBMIT, "\n".join(lines) + "\n")]


def _script(name: str, folder: str, tasks: Sequence[Task], how: HowToRun, ranks: int) -> str:
    from jinja2 import Environment, StrictUndefined

    text = resources.files("fdnet.campaign.engine").joinpath("array.j2").read_text("utf-8")
    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters["quoted"] = shlex.quote
    return environment.from_string(text).render(
        name=safe(name),
        folder=folder,
        tasks=tasks,
        jobs=how.jobs,
        ranks=ranks,
        options=[_option(one) for one in how.resources],
        one_core=" ".join(f"{variable}={value}" for variable, value in ONE_CORE.items()),
    )


_OPTION = re.compile(r"-{0,2}([A-Za-z][A-Za-z0-9-]*)(?:=([^'\"\\]*))?")


def _option(given: str) -> str:
    """An option of sbatch with its value quoted."""
    match = _OPTION.fullmatch(given)
    if match is None or not given.isprintable():
        raise CaseError(
            f"--slurm-script: {given!r}, expected options of sbatch as partition=short,time=60; a "
            "value holds no quotes, backslashes or line breaks"
        )
    return match[1] if match[2] is None else f"{match[1]}={shlex.quote(match[2])}"
