"""One invasion by fdnet and by Yade's flow engine: the same grains, fines, pressure and end.

fdnet runs a case in which the flow follows the deposit, between walls. Yade gets its grains, its
fines where they start, its contacts, step, viscosity and drop of pressure, and meshes every
sphere. Each tool is a process of its own, measured by the system. Both deposits are then judged
twice, by fdnet's analysis and by Yade's flow engine.

What was finished in a folder is read, so the command can be repeated and cut.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.errors import CaseError, FdnetError
from fdnet.files.atomic import write_text
from fdnet.run.finished import FinishedRun
from fdnet.run.one_core import ONE_CORE
from fdnet.run.open_run import open_run
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Snapshot
from fdnet.studies.benchmark.yade_exchange import (
    Answer,
    Job,
    end_state,
    invasion_job,
    read_answer,
    still_job,
    write_job,
)

PEER = Path(__file__).resolve().parent / "yade_invasion_peer.py"
SETTINGS = (
    "box.sides=walls",
    "box.wall_friction=0",
    "fines.supply=slab",
    "drag.field=network",
    "drag.upstream=darcy",
    "drag.scheme=implicit",
    "drag.crowd=beetstra",
    "drag.pressure_gradient=true",
    "fluid.velocity_m_s=5.4",
    "run.duration_ms=2.0",
    "run.stiffness_N_m=1e4",
    "analysis.law=lubrication",
    "analysis.damage_law=side-kozeny",
)
"""What the invasion needs to be one that Yade can repeat: no periodic sides, a drop of pressure
over the specimen alone, all fines there from the start, and a time at which it ends."""
FEW, WIDTH = 2000, 1.6
"""Fines of the small specimen and its width, mm; the area grows with the number of fines."""
STILL_LIMIT = 600.0
"""CPU seconds for the flow through spheres that stand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a process took.

    Attributes:
        cpu_s: CPU seconds of it and its children.
        wall_s: seconds by the clock.
        peak_MB: memory of the largest of them.
    """

    cpu_s: float
    wall_s: float
    peak_MB: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """One invasion by both tools.

    Attributes:
        fines: number of fines.
        seed: of the case.
        run: fdnet's run.
        cost: of fdnet's packing and invasion.
        job: what Yade was given.
        answer: where it ended.
        flux: m3/s, by Yade's flow engine, through the spheres "intact", "fdnet" and "Yade", and
            "fdnet then" where Yade was cut.
        then: where Yade was cut, step and spheres of fdnet's last checkpoint before it.
    """

    fines: int
    seed: int
    run: FinishedRun
    cost: Cost
    job: Job
    answer: Answer
    flux: Mapping[str, float]
    then: tuple[int, Snapshot] | None

    @property
    def yade_end(self) -> Snapshot:
        """Grains and fines where Yade left them."""
        return end_state(self.job, self.answer, self.run.spheres("initial").box)


def require_yade(program: str = "yade") -> str:
    """The path of the program.

    Raises:
        FdnetError: it is not installed.
    """
    path = shutil.which(program)
    if path is None:
        raise FdnetError(
            f"{program}: not found on the path, and the comparison is with it; install it "
            "(Debian: apt install yade)"
        )
    return path


def measured(command: Sequence[str], log: Path, **settings: str) -> Cost:
    """Run a command with its output in `log`; `settings` are added to its environment.

    Raises:
        FdnetError: it ended with another code than 0; the message names its output.
    """
    start = time.monotonic()
    with log.open("w") as file:
        process = subprocess.Popen(
            command, stdout=file, stderr=file, env={**os.environ, **ONE_CORE, **settings}
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise FdnetError(f"{command[0]} ended with {process.returncode}; its output is in {log}")
    return Cost(
        cpu_s=used.ru_utime + used.ru_stime,
        wall_s=time.monotonic() - start,
        peak_MB=used.ru_maxrss / 1024,
    )


def settings_of(fines: int, seed: int) -> tuple[str, ...]:
    """The settings of a specimen of a number of fines, as wide as they need."""
    width = round(WIDTH * (fines / FEW) ** 0.5, 3)
    size = f"box.size_mm=[4.0, {width}, {width}]"
    return (*SETTINGS, size, f"fines.count={fines}", f"seed={seed}")


def run_fdnet(case: Path, fines: int, seed: int, folder: Path) -> tuple[FinishedRun, Cost]:
    """fdnet's run in `folder`/fdnet, and what its packing and invasion cost.

    Raises:
        CaseError: the folder has a run that was not measured.
        FdnetError: as `measured`.
    """
    out, record = folder / "fdnet", folder / "cost.json"
    if not record.exists():
        if out.exists():
            raise CaseError(f"{out}: its cost was not measured; delete {folder} to run it again")
        folder.mkdir(parents=True, exist_ok=True)
        sets = [part for one in settings_of(fines, seed) for part in ("--set", one)]
        command = [sys.executable, "-m", "fdnet.cli", "run", str(case), "--out", str(out), *sets]
        cost = measured([*command, "--stages", "pack,invade"], folder / "fdnet.log")
        values = {name: getattr(cost, name) for name in Cost.__dataclass_fields__}
        write_text(record, json.dumps(values))
    if not (out / "manifest.json").exists():
        again = [sys.executable, "-m", "fdnet.cli", "run", str(out / "case.toml"), "--out"]
        rest = [str(out), "--resume", "--stages", "pack,invade,analyse"]
        measured([*again, *rest], folder / "analyse.log")
    return open_run(out), Cost(**json.loads(record.read_text()))


def run_yade(job: Job, name: str, folder: Path, yade: str) -> Answer:
    """Yade's answer to a job, in `folder`/`name`.answer.npz, where it is kept.

    Raises:
        FdnetError: as `measured`.
        CaseError: as `read_answer`.
    """
    answer = folder / f"{name}.answer.npz"
    done = folder / f"{name}.done"
    if not done.exists():
        path = write_job(folder / f"{name}.job.npz", job)
        measured(
            [yade, "-j1", "-n", "-x", str(PEER)],
            folder / f"{name}.log",
            INVASION_JOB=str(path),
            INVASION_ANSWER=str(answer),
        )
        write_text(done, "")
    return read_answer(answer)


def make_pair(
    case: Path, fines: int, seed: int, out: Path, *, limit_s: float, travel: float = 0.5
) -> Pair:
    """One invasion by both tools, in a folder of its own below `out`.

    `limit_s` and `travel` are as in `invasion_job`.

    Raises:
        FdnetError: Yade is missing, or a process failed.
    """
    yade = require_yade()
    folder = out / f"{fines}-{seed}"
    run, cost = run_fdnet(case, fines, seed, folder)
    job = invasion_job(run, limit_s=limit_s, travel=travel)
    answer = run_yade(job, f"yade-{travel:g}", folder, yade)
    then = state_before(run, answer.steps) if answer.steps < job.steps else None
    spheres = {
        "intact": run.spheres("initial"),
        "fdnet": run.spheres(),
        "Yade": end_state(job, answer, run.spheres("initial").box),
    }
    if then:
        spheres["fdnet then"] = then[1]
    flux = {}
    for name, one in spheres.items():
        still = still_job(job, one, limit_s=STILL_LIMIT)
        label = f"still-{name.replace(' ', '-')}" + (f"-{travel:g}" if name == "Yade" else "")
        flux[name] = run_yade(still, label, folder, yade).outflow
    return Pair(
        fines=fines,
        seed=seed,
        run=run,
        cost=cost,
        job=job,
        answer=answer,
        flux=flux,
        then=then,
    )


def state_before(run: FinishedRun, step: int) -> tuple[int, Snapshot]:
    """Step and spheres of the last checkpoint of a run of fixed grains up to `step`.

    Raises:
        CaseError: there is none.
    """
    dumps = {int(path.stem.split("_")[1]): path for path in _dumps(run)}
    steps = [one for one in dumps if one <= step]
    if not steps:
        raise CaseError(
            f"{run.path}: no checkpoint up to step {step}, so nothing to compare Yade with; "
            "give it more CPU seconds with --limit"
        )
    last = max(steps)
    grains = run.spheres("initial")
    return last, grains.joined(read_spheres(dumps[last], box=grains.box).fines())


def _dumps(run: FinishedRun) -> Iterable[Path]:
    return (run.path / "invade" / "post").glob("invade_*.dump")
