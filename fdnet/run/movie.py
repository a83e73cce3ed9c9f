"""The movie of a finished run, or a picture of it before and after, from the states it kept."""

import shlex
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.files.new import refuse_present
from fdnet.run.finished import FinishedRun
from fdnet.run.made_files import ANALYSE_AGAIN, check_one, frames_in, frames_of
from fdnet.run.open_run import open_run
from fdnet.run.record_files import check_finished
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    from fdnet.report.movie import MovieFrame

LEAST, MOST = 0.5, 30.0
"""Frames a second that a movie may have."""
SHOWN = {
    "fines": "",
    "flux": "flux of a throat,\n% of the first flow",
    "streamlines": "speed over the first\nsuperficial velocity",
}
"""What can be shown, and the title of its colours."""


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """One state of a run: the file of its spheres, None before the first fine came in, and its row
    of the history."""

    spheres: Path | None
    row: Mapping[str, Any]

    @property
    def rate(self) -> float | None:
        """Over the first; None where the flow did not follow the deposit."""
        if self.spheres is None:
            return 1.0 if "rate_over_initial" in self.row else None
        return self.row.get("rate_over_initial")


def movie_of(
    folder: Path,
    target: Path | None = None,
    *,
    per_second: float = 4.0,
    show: str = "fines",
    force: bool = False,
) -> Path:
    """Write the invasion of the run in `folder` as a movie; returns its path.

    `target` ends in .gif or .mp4 and is invasion.gif in the run folder without it. With .png it is
    one picture of the specimen before and after. `show` is a key of `SHOWN`. Raises CaseError
    where the folder is no finished run with fines and frames, one of its files was changed, a
    file is there that `force` does not allow to replace, or nothing can be drawn.
    """
    from fdnet.report.movie import MovieFrame, Scene, refuse_suffix, write_movie

    if not LEAST <= per_second <= MOST:
        raise CaseError(f"--fps: {per_second:g}, expected {LEAST:g} to {MOST:g} frames a second")
    if show not in SHOWN:
        raise CaseError(f"--show: {show!r} is not known; choose one of {sorted(SHOWN)}")
    run = open_run(folder)
    path = target or run.path / "invasion.gif"
    refuse_suffix(path)
    refuse_present(path, force=force)
    check_finished(folder)
    states = _states(run)
    if path.suffix.lower() == ".png":
        states = [states[0], states[-1]]
    with tempfile.TemporaryDirectory() as work:
        still = _whole(run, "spheres_initial.vtp")
        box = np.array([(0.0, side) for side in run.case.size_m])
        if show == "fines":
            frames = [
                MovieFrame(
                    spheres=state.spheres or _no_fines(run, Path(work)), words=_words(state)
                )
                for state in states
            ]
            scene = Scene(grains=still, box=box)
        else:
            frames, limits = _flow_frames(run, states, show, Path(work))
            scene = Scene(grains=still, box=box, title=SHOWN[show], limits=limits)
        return write_movie(path, frames, scene, per_second=per_second)


def _flow_frames(
    run: FinishedRun, states: list[State], show: str, work: Path
) -> "tuple[list[MovieFrame], tuple[float, float]]":
    """The frames with the flow at each state, and the limits of the colours of all."""
    from fdnet.report.movie import MovieFrame
    from fdnet.run.flow_states import colour_limits, flux_of, streamlines_of

    flow_of = flux_of(run) if show == "flux" else streamlines_of(run)
    frames, limits = [], (0.0, 0.0)
    for number, state in enumerate(states):
        spheres = state.spheres or _no_fines(run, work)
        flow = flow_of(_fines(run, state.spheres), state.rate)
        if not number:
            limits = colour_limits(flow.values)
        lines = work / f"lines_{number:04d}.vtp"
        flow.write(lines)
        words = _words(state, measured=flow.k_over_k0)
        frames.append(MovieFrame(spheres=spheres, words=words, lines=lines))
    return frames, limits


def _fines(run: FinishedRun, path: Path | None) -> Snapshot:
    from fdnet.spheres.readers import read_spheres

    if path is None:
        return run.spheres("initial").fines()
    return read_spheres(path, box=[(0.0, side) for side in run.case.size_m]).fines()


def _no_fines(run: FinishedRun, work: Path) -> Path:
    """A file of spheres without a fine."""
    from fdnet.report.vtk import write_spheres_vtp

    return write_spheres_vtp(work / "none.vtp", run.spheres("initial").fines())


def _states(run: FinishedRun) -> list[State]:
    """The states in order of time; the first is the clean specimen."""
    if not isinstance(run.case, InvasionCase):
        raise CaseError(f"{run.path}: has no fines, so there is no invasion to show")
    kept = frames_of(run.manifest["files"])
    files = frames_in(run.path) | kept
    if not files:
        raise CaseError(
            f"{run.path / 'frames'}: holds no states to draw; write them with fdnet run CASE.toml "
            f"--out {shlex.quote(str(run.path))} --stages report --force"
        )
    names = [str(name) for name in run.history.columns]
    rows = {
        int(row[names.index("step")]): dict(zip(names, row, strict=True))
        for row in run.history.itertuples(index=False)
    }
    for step, name in files.items():
        if step not in rows or (kept and step not in kept):
            raise CaseError(
                f"{run.path / name}: is no state that this run wrote; move it out of this folder"
            )
    first = dict.fromkeys(names, 0.0)
    states = [
        State(spheres=_whole(run, name), row=rows[step]) for step, name in sorted(files.items())
    ]
    return [State(spheres=None, row=first), *states]


def _whole(run: FinishedRun, name: str) -> Path:
    """A mesh of the run that is there, uncut and, where its digest was kept, unchanged."""
    path = run.path / name
    check_one(run.path, run.manifest, name, ANALYSE_AGAIN)
    if not path.is_file() or not path.read_bytes().rstrip().endswith(b"</VTKFile>"):
        what = "is cut" if path.is_file() else "is missing"
        raise CaseError(f"{path}: {what}; {ANALYSE_AGAIN}")
    return path


def _words(state: State, *, measured: float | None = None) -> str:
    """What stands above a state: time, rate, permeability and fines, as far as they are known."""
    row = state.row
    if state.spheres is None:
        return "clean sand"
    words = [_time(float(row.get("physical_time_s", row["time_s"])))]
    if state.rate is not None:
        words.append(f"rate {state.rate:.2f}")
    k = row.get("k_over_k0", measured)
    if k is not None:
        words.append(f"k/k0 {k:.2f}")
    return ",   ".join([*words, f"{int(row['invaded'])} fines in the sand"])


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"
