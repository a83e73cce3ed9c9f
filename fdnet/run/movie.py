"""Movies and pictures of the flow of a finished run.

The flow through a finished run, state by state: fluxes of its throats, or streamlines.
"""

import shlex
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.files import refuse_present
from fdnet.names import SECTION_ARCHIE
from fdnet.network.field.field import streamlines, velocity_field
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS, damage_law
from fdnet.network.specimen import cake_of
from fdnet.run.finished import FinishedRun
from fdnet.run.folder import ANALYSE_AGAIN, check_finished, check_one, frames_in, frames_of
from fdnet.run.open_run import open_run
from fdnet.spheres.geometry import wrapped
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.report.movie import MovieFrame

LINES = 200
"""About so many streamlines, evenly spaced in the mud: each carries the same flow."""
CELLS = 14.0
"""Cells across a grain: fewer lose more lines among the fines, more take minutes."""
STEP, AHEAD = 0.02, 0.3
"""Step along a streamline, and how far before the deposit it begins, in diameters of a grain."""
BRIGHTEST, DECADES = 99.5, 2.0
"""Percentile of the first values at which the colours end, and how many decades they show."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FlowState:
    """The flow at one state, ready to be drawn.

    Attributes:
        values: what is coloured, one array.
        k_over_k0: permeability over that of the clean specimen; None where it is not measured.
        write: writes the lines with their values to a path.
    """

    values: Array
    k_over_k0: float | None
    write: Callable[[Path], Any]


FlowOf = Callable[[Snapshot, float | None], FlowState]
"""From the fines (none: the clean specimen) and the rate over the first (None: not known)."""


def flux_of(run: FinishedRun) -> FlowOf:
    """The flux of each throat in percent of the first flow through the specimen.

    The laws are those of the run; where it measured the damage in two ways, that of the throats.
    Where no rate is known it is the one at the first pressure drop. Fines that still move count
    as deposit.
    """
    from fdnet.report.vtk import write_flux_vtp

    network, choices = run.network(), run.case.analysis
    clean = LAWS[choices.law](network)
    first = solve_flow(network, clean)

    def flow_of(fines: Snapshot, rate: float | None) -> FlowState:
        flow = solve_flow(network, _damaged(fines)) if len(fines) else first
        k = flow.inflow / first.inflow if first.inflow > 0 else 0.0
        values = 100.0 * _share(flow) * (k if rate is None else rate)
        return FlowState(
            values=values,
            k_over_k0=k,
            write=lambda path: write_flux_vtp(path, network, values),
        )

    def _damaged(fines: Snapshot) -> Array:
        names = (str(run.summary.get(f"damage_law_{which}")) for which in ("other", "used"))
        law = damage_law(
            next((name for name in names if name in DAMAGE_LAWS), SECTION_ARCHIE),
            clogging_threshold=choices.clogging_threshold,
            middle_band=choices.middle_band,
        )
        occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
        return law(network, occupancy, clean).conductance

    return flow_of


def _share(flow: Flow) -> Array:
    """Flux (T,) over that through the specimen; 0 where nothing flows."""
    return np.abs(flow.throat_flux) / flow.inflow if flow.inflow > 0 else 0.0 * flow.throat_flux


def streamlines_of(run: FinishedRun, *, cells: float = CELLS) -> FlowOf:
    """Streamlines of the resolved flow around grains and deposit, with the speed of the fluid.

    The speed is over the first superficial velocity; where no rate is known, over the present
    one. The deposit is all fines in the specimen, and the cake.
    """
    from fdnet.report.vtk import write_lines_vtp

    grains, sides = run.spheres("initial").grains(), run.case.periodic

    def flow_of(fines: Snapshot, rate: float | None) -> FlowState:
        deposit = _deposit(grains, fines, sides)
        field = velocity_field(grains, periodic=sides, fines=deposit, cells=cells)
        diameter = 2.0 * float(grains.radius.mean())
        front = float(np.min(deposit.position[:, 0] - deposit.radius, initial=grains.box[0, 0]))
        start = _starts(grains.box, front - AHEAD * diameter)
        ways = streamlines(field, start, step=STEP * diameter, until=float(grains.box[0, 1]))
        pieces = [piece for way in ways for piece in _pieces(way, grains.box, sides)]
        present = 1.0 if rate is None else rate
        lines = [(piece, present * np.linalg.norm(field.at(piece), axis=1)) for piece in pieces]
        return FlowState(
            values=np.concatenate([values for _, values in lines]),
            k_over_k0=None,
            write=lambda path: write_lines_vtp(path, lines),
        )

    return flow_of


def _deposit(grains: Snapshot, fines: Snapshot, sides: tuple[bool, bool, bool]) -> Snapshot:
    if not len(fines):
        return fines
    within = fines.where(fines.position[:, 0] >= grains.box[0, 0])
    cake = cake_of(grains.joined(fines), sides)
    return within.joined(cake) if len(cake) else within


def _starts(box: Array, depth: float) -> Array:
    """Points (N, 3) m, evenly over the cross-section at x = `depth`."""
    (y0, y1), (z0, z1) = box[1:]
    apart = np.sqrt((y1 - y0) * (z1 - z0) / LINES)
    across, up = max(1, round((y1 - y0) / apart)), max(1, round((z1 - z0) / apart))
    y = y0 + (np.arange(across) + 0.5) * (y1 - y0) / across
    z = z0 + (np.arange(up) + 0.5) * (z1 - z0) / up
    at_y, at_z = np.meshgrid(y, z)
    return np.column_stack([np.full(at_y.size, depth), at_y.ravel(), at_z.ravel()])


def _pieces(way: Array, box: Array, sides: tuple[bool, bool, bool]) -> list[Array]:
    """A line (M, 3) m cut where it passes a periodic side, each piece inside the box."""
    inside = wrapped(way, box, sides)
    jump = np.any(np.abs(np.diff(inside - way, axis=0)) > 0.5 * np.ptp(box, axis=1), axis=1)
    return [piece for piece in np.split(inside, np.flatnonzero(jump) + 1) if len(piece) > 1]


def colour_limits(values: Array) -> tuple[float, float]:
    """Two decades below the largest values (N,), rounded to one digit; of values above 0."""
    most = float(np.percentile(values[values > 0], BRIGHTEST)) if np.any(values > 0) else 1.0
    digit = 10.0 ** np.floor(np.log10(most))
    high = float(np.ceil(most / digit) * digit)
    return high / 10.0**DECADES, high


# ------------------------------------------------------------------------------------------------
# The movie of a finished run, or a picture of it before and after, from the states it kept.


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
