"""One session of a run: what is run, where, and how long each stage took."""

import math
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from fdnet.case.case import Case
from fdnet.case.stages import STAGES
from fdnet.dem.binary import Binary, find_binary
from fdnet.dem.liggghts import Launch
from fdnet.errors import CaseError
from fdnet.run.folder import RunFolder
from fdnet.run.progress import Progress
from fdnet.scales.scales import Scales


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How to run a case, as opposed to what it is.

    Attributes:
        out: run folder.
        ranks: MPI ranks of LIGGGHTS.
        resume: continue an unfinished run.
        force: replace what is there.
        stages: stages to run, of "pack", "invade", "analyse" and "report".
        liggghts: path of the binary; None: looked for.
        launcher: template that starts several ranks, as "srun -n {ranks}"; None: mpirun.
        pack_from: run folder whose finished pack is taken; None: the pack is made.
        timeout: s, after which LIGGGHTS is stopped; None: never.
        show_progress: whether to write progress to standard error.
        command: command line that started the run, for its records.
    """

    out: Path
    ranks: int = 1
    resume: bool = False
    force: bool = False
    stages: tuple[str, ...] = STAGES
    liggghts: str | None = None
    launcher: str | None = None
    pack_from: Path | None = None
    timeout: float | None = None
    show_progress: bool = True
    command: str = ""

    def __post_init__(self) -> None:
        """Raise CaseError on a time limit or a number of ranks that means nothing."""
        if self.timeout is not None and not 0 < self.timeout < math.inf:
            raise CaseError(
                f"timeout: {self.timeout}, expected a number of seconds above 0; leave it out for "
                "no limit"
            )
        if not 1 <= self.ranks <= most_ranks():
            raise CaseError(
                f"ranks: {self.ranks}, expected 1 to {most_ranks()} on the {cores()} cores of "
                "this machine"
            )


def cores() -> int:
    """Number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0))


def most_ranks() -> int:
    """Largest number of MPI ranks that is accepted: more would only exhaust the machine."""
    return max(256, 64 * cores())


@dataclass(slots=True)
class Session:
    """A run while it goes on.

    Attributes:
        case: what is run.
        scales: of the case.
        folder: where it is run; this process holds its lock.
        options: how it is run.
        seconds: s, that each stage took in this session.
    """

    case: Case
    scales: Scales
    folder: RunFolder
    options: RunOptions
    seconds: dict[str, float] = field(default_factory=dict)
    _binary: Binary | None = None

    @property
    def path(self) -> Path:
        """The run folder."""
        return self.folder.path

    def wants(self, stage: str) -> bool:
        """Whether the stage was asked for and belongs to the case."""
        return stage in self.options.stages and stage in self.case.stages

    def launch(self, progress: Progress) -> Launch:
        """How this run starts LIGGGHTS; the binary is looked for when a stage first needs it."""
        if self._binary is None:
            options = self.options
            self._binary = find_binary(options.liggghts, launcher=options.launcher)
        return Launch(
            binary=self._binary,
            ranks=self.options.ranks,
            timeout=self.options.timeout,
            follow=progress,
        )

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Add the time inside the `with` block to the seconds of the stage."""
        start = time.monotonic()
        yield
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.monotonic() - start
