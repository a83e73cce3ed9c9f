"""The movie of a finished run, from the states that its report kept."""

import re
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.run.finished import FinishedRun
from fdnet.run.open_run import open_run

LEAST, MOST = 0.5, 30.0
"""Frames a second that a movie may have."""


def movie_of(folder: Path, target: Path | None = None, *, per_second: float = 4.0) -> Path:
    """Write the invasion of the run in `folder` as a movie; returns its path.

    `target` ends in .gif or .mp4 and is invasion.gif in the run folder without it. Raises
    CaseError where the folder is no finished run with fines and frames, or nothing can be drawn.
    """
    from fdnet.report.movie import MovieFrame, write_movie

    if not LEAST <= per_second <= MOST:
        raise CaseError(f"--fps: {per_second:g}, expected {LEAST:g} to {MOST:g} frames a second")
    run = open_run(folder)
    frames = [
        MovieFrame(spheres=path, words=words) for path, words in _states(run, run.path / "frames")
    ]
    box = np.array([(0.0, side) for side in run.case.size_m])
    return write_movie(
        target or run.path / "invasion.gif",
        run.path / "spheres_initial.vtp",
        frames,
        box=box,
        per_second=per_second,
    )


def _states(run: FinishedRun, folder: Path) -> list[tuple[Path, str]]:
    """The files of the states in order of time, and what is said above each."""
    if not isinstance(run.case, InvasionCase):
        raise CaseError(f"{run.path}: has no fines, so there is no invasion to show")
    files = {int(re.sub(r"\D", "", path.stem)): path for path in folder.glob("spheres_*.vtp")}
    if not files:
        raise CaseError(
            f"{folder}: holds no states to draw; write them with fdnet run CASE.toml "
            f"--out {run.path} --stages report --force"
        )
    rows = {int(row["step"]): row for row in run.history.to_dict("records")}
    result = []
    for step, path in sorted(files.items()):
        row = rows.get(step)
        words = ""
        if row is not None:
            time = float(row.get("physical_time_s", row["time_s"]))
            words = f"{_time(time)}: {int(row['invaded'])} fines in the sand"
        result.append((path, words))
    return result


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"
