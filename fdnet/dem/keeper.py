"""What fdnet does at each checkpoint while LIGGGHTS runs."""

from pathlib import Path

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import HISTORY, read_history
from fdnet.dem.checkpoint_record import WatchReader, write_record
from fdnet.dem.digests import checkpoint_files
from fdnet.dem.liggghts import Launch
from fdnet.dem.overlap import refuse_overlap
from fdnet.errors import LiggghtsError
from fdnet.files.atomic import disk_is_full
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot


class CheckpointKeeper:
    """Follows the screen of a run and passes every line on.

    At each checkpoint it records what is whole now, keeps the two newest restarts, and stops a run
    that writes to a full disk or whose fines overlap too much. LIGGGHTS itself goes on after a
    failed write and ends with exit code 0. Older restarts are removed only while there is room on
    the disk.
    """

    def __init__(
        self,
        folder: Path,
        case: InvasionCase,
        scales: InvasionScales,
        grains: Snapshot,
        *,
        launch: Launch,
    ) -> None:
        self.folder, self.case, self.scales, self.grains = folder, case, scales, grains
        self.ranks, self.follow, self.watch = launch.ranks, launch.follow, WatchReader(folder)

    def __call__(self, line: str) -> None:
        if line.startswith("FDNET checkpoint"):
            self._keep(int(line.split()[3]))
        if self.follow:
            self.follow(line)

    def _keep(self, step: int) -> None:
        if disk_is_full(self.folder):
            raise LiggghtsError(
                f"{self.folder}: the disk is full, LIGGGHTS was stopped; make room and "
                "continue with --resume"
            )
        rows = [row for row in read_history(self.folder) if row.step == step]
        overlaps = self.watch.upto(step)
        if rows:
            write_record(self.folder, rows[-1], self.case, ranks=self.ranks, overlaps=overlaps)
        elif self.case.run.on_overlap == "stop":
            raise LiggghtsError(
                f"{self.folder / HISTORY}: no row for the checkpoint at step {step}; continue "
                "with --resume"
            )
        restarts = [
            (at, path)
            for at, path in checkpoint_files(self.folder)
            if path.suffix == ".restart" and at <= step
        ]
        for _, old in sorted(restarts)[:-2]:
            old.unlink(missing_ok=True)
        for row in rows[-1:]:
            refuse_overlap(
                self.case, self.scales, self.grains, self.folder, history=[row], last=row
            )
