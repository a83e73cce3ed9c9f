"""A script for Slurm without Snakemake: an array of jobs, shared packs first."""

import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from fdnet.campaign.engine.tasks import HowToRun, Task
from fdnet.files.atomic import write_text
from fdnet.run.one_core import ONE_CORE

PACKS, RUNS, SUBMIT = "packs.sbatch", "runs.sbatch", "submit.bash"


def write_slurm_scripts(
    path: Path, name: str, tasks: Sequence[Task], how: HowToRun, *, ranks: int
) -> list[Path]:
    """Write the scripts of the tasks that are missing; `bash submit.bash` submits them.

    Resources with a hyphen or none in front, as "time=60" and "partition=short", become options
    of sbatch.
    """
    packs = [task for task in tasks if task.name.startswith("pack-")]
    runs = [task for task in tasks if task not in packs]
    written, lines = [], ["#!/bin/bash", "# Written by fdnet: submits what is missing.", "set -e"]
    folder = str(path.absolute())
    depends = ""
    for file, part in ((PACKS, packs), (RUNS, runs)):
        if part:
            text = _script(name, folder, part, how, ranks)
            written.append(write_text(path / file, text))
            script = shlex.quote(str(path.absolute() / file))
            lines.append(f"job=$(sbatch --parsable{depends} {script}); echo $job")
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
        name=name,
        folder=folder,
        tasks=tasks,
        jobs=how.jobs,
        ranks=ranks,
        options=[one.lstrip("-") for one in how.resources],
        one_core=" ".join(f"{variable}={value}" for variable, value in ONE_CORE.items()),
    )
