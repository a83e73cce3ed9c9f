"""What each job of a plan calls: `fdnet run` in a process of its own, which resumes itself."""

import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.campaign.plan.folder import CASES, LOGS, PACKS, RUNS
from fdnet.campaign.plan.job import Job, Plan, shared_packs
from fdnet.campaign.plan.state import pack_is_done, state_of
from fdnet.run.progress import ONE_CORE


@dataclass(frozen=True, slots=True, kw_only=True)
class HowToRun:
    """How jobs are carried out, as opposed to what they are.

    Attributes:
        jobs: how many at the same time.
        liggghts: path of the binary; None: looked for.
        launcher: template that starts several ranks; None: mpirun.
        timeout: s, after which LIGGGHTS of one job is stopped; None: never.
        engine: "local", "snakemake", or "slurm" (Snakemake on a cluster).
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One process of a campaign.

    Attributes:
        name: of its log.
        words: its command line, run in the folder of the campaign.
        after: name of the task that must have ended before; "" for none.
        makes: file below the folder that is there when it has succeeded.
    """

    name: str
    words: tuple[str, ...]
    makes: str
    after: str = ""

    @property
    def log(self) -> str:
        """Where its output goes, below the folder."""
        return f"{LOGS}/{self.name}.txt"

    @property
    def line(self) -> str:
        """Its command line for a shell."""
        return shlex.join(self.words)


def tasks_of(path: Path, plan: Plan, how: HowToRun) -> list[Task]:
    """What is missing: packs that several runs share, and the runs that are not done.

    A run whose files were changed is asked again, and `fdnet run` says so in its log.
    """
    missing = [job for job in plan.jobs if state_of(path, plan, job).status != "done"]
    digests = {job.name: job.case.digest("pack") for job in missing}
    packs = {
        digest: job
        for digest, job in shared_packs(plan.jobs).items()
        if digest in digests.values()
    }
    made = {digest: pack_is_done(path / PACKS / digest) for digest in packs}
    tasks = [_pack(digest, job, plan, how) for digest, job in packs.items() if not made[digest]]
    for job in missing:
        digest = digests[job.name]
        after = f"pack-{digest}" if digest in packs and not made[digest] else ""
        own_pack = (path / RUNS / job.name / "pack" / "stage.json").exists()
        source = digest if digest in packs and not own_pack else ""
        tasks.append(_run(job, plan, how, source=source, after=after))
    return tasks


def environment() -> Mapping[str, str]:
    """The environment of a job: one thread of its own for each process."""
    return os.environ | ONE_CORE


def _pack(digest: str, job: Job, plan: Plan, how: HowToRun) -> Task:
    out = f"{PACKS}/{digest}"
    words = [*_common(job, out, plan, how), "--stages", "pack"]
    return Task(name=f"pack-{digest}", words=tuple(words), makes=f"{out}/pack/stage.json")


def _run(job: Job, plan: Plan, how: HowToRun, *, source: str, after: str) -> Task:
    words = [*_common(job, f"{RUNS}/{job.name}", plan, how), "--stages", ",".join(plan.stages)]
    if source:
        words += ["--pack-from", f"{PACKS}/{source}"]
    makes = f"{RUNS}/{job.name}/manifest.json"
    return Task(name=job.name, words=tuple(words), makes=makes, after=after)


def _common(job: Job, out: str, plan: Plan, how: HowToRun) -> Sequence[str]:
    words = [sys.executable, "-m", "fdnet.cli", "run", f"{CASES}/{job.name}.toml", "--out", out]
    words += ["--resume", "--quiet", "--np", str(plan.ranks)]
    if how.liggghts:
        words += ["--liggghts", str(Path(how.liggghts).expanduser().absolute())]
    if how.launcher:
        words += ["--launcher", how.launcher]
    if how.timeout is not None:
        words += ["--timeout", repr(how.timeout)]
    return words
