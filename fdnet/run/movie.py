"""Movies and pictures of a finished run: its fines, or with them the flux of its throats."""

import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.errors import CaseError
from fdnet.files import refuse_present
from fdnet.names import SECTION_ARCHIE
from fdnet.network.fines.occupancy import measure_occupancy
from fdnet.network.flow.flow import solve_flow
from fdnet.network.laws.named import DAMAGE_LAWS, LAWS, damage_law
from fdnet.network.network import Network
from fdnet.report.picture import MovieFrame, Scene, refuse_suffix, write_movie
from fdnet.report.vtk import refuse_without_view, write_flux_vtp, write_spheres_vtp
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import ANALYSE_AGAIN, check_finished, check_one, frames_in, frames_of
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Array, Snapshot

BRIGHTEST, DECADES = 99.5, 2.0
"""Percentile of the first values at which the colours end, and how many decades they show."""
FluxOf = Callable[[Snapshot, float | None], tuple[Array, float]]
"""From the fines (none: the clean specimen) and the rate over the first (None: not known) to the
flux (T,) of the throats in percent of the first flow, and k over that of the clean specimen."""


def flux_of(run: FinishedRun, network: Network) -> FluxOf:
    """How the flux of each throat in the network of a run follows from the fines.

    The laws are those of the run; where it measured the damage in two ways, that of the throats.
    Where no rate is known it is the one at the first pressure drop. Fines that still move count
    as deposit.
    """
    choices = run.case.analysis
    clean = LAWS[choices.law](network)
    first = solve_flow(network, clean)
    names = (str(run.summary.get(f"damage_law_{which}")) for which in ("other", "used"))
    damaged = damage_law(
        next((name for name in names if name in DAMAGE_LAWS), SECTION_ARCHIE),
        clogging_threshold=choices.clogging_threshold,
        middle_band=choices.middle_band,
    )

    def flux(fines: Snapshot, rate: float | None) -> tuple[Array, float]:
        flow = first
        if len(fines):
            occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
            flow = solve_flow(network, damaged(network, occupancy, clean).conductance)
        k = flow.inflow / first.inflow if first.inflow > 0 else 0.0
        flux = np.abs(flow.throat_flux)
        share = flux / flow.inflow if flow.inflow > 0 else 0.0 * flux
        return 100.0 * share * (k if rate is None else rate), k

    return flux


def colour_limits(values: Array) -> tuple[float, float]:
    """Two decades below the largest values (N,), rounded to one digit; of values above 0."""
    most = float(np.percentile(values[values > 0], BRIGHTEST)) if np.any(values > 0) else 1.0
    digit = 10.0 ** np.floor(np.log10(most))
    high = float(np.ceil(most / digit) * digit)
    return high / 10.0**DECADES, high


# ---- The movie of a finished run, or a picture of it before and after, from the states it kept.
LEAST, MOST = 0.5, 30.0  # Frames a second that a movie may have
TITLE = "flux of a throat,\n% of the first flow"  # Of the colours


class DrawnState(NamedTuple):
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

    def words(self, measured: float | None = None) -> str:
        """Time, rate, permeability (else the `measured` one) and fines, as far as known."""
        if self.spheres is None:
            return "clean sand"
        seconds = float(self.row.get("physical_time_s", self.row["time_s"]))
        words = [f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"]
        if self.rate is not None:
            words.append(f"rate {self.rate:.2f}")
        k = self.row.get("k_over_k0", measured)
        if k is not None:
            words.append(f"k/k0 {k:.2f}")
        return ",   ".join([*words, f"{int(self.row['invaded'])} fines in the sand"])


def movie_of(
    folder: Path,
    target: Path | None = None,
    *,
    per_second: float = 4.0,
    flux: bool = False,
    force: bool = False,
    progress: bool = False,
) -> Path:
    """Write the invasion of the run in `folder` as a movie; returns its path.

    `target` ends in .gif or .mp4 and is invasion.gif in the run folder without it. With .png it is
    one picture of the specimen before and after. With `flux` the throats are drawn too. With
    `progress`, standard error says how far the drawing is.

    Raises CaseError where the folder is no finished run with fines and frames, one of its files
    was changed, a file is there that `force` does not allow to replace, VTK is missing, or nothing
    can be drawn.
    """
    if not LEAST <= per_second <= MOST:
        raise CaseError(f"--fps: {per_second:g}, expected {LEAST:g} to {MOST:g} frames a second")
    run = open_run(folder)
    path = target or run.path / "invasion.gif"
    refuse_suffix(path)
    if run.summary.get("method") == "network" and path.suffix.lower() != ".png":
        raise CaseError(
            f"{run.path}: the fast model keeps the end of an invasion alone, so there is no "
            "movie; give --out FILE.png for a picture of before and after, or run the case "
            "without --fast"
        )
    refuse_present(path, force=force)
    refuse_without_view(str(path))
    check_finished(folder)
    moments = list(moments_of(run))
    if path.suffix.lower() == ".png":
        moments = [moments[0], moments[-1]]
    still = _whole(run, "spheres_initial.vtp")
    box = np.array([(0.0, side) for side in run.case.size_m])
    frames, limits = [], (0.0, 0.0)
    with tempfile.TemporaryDirectory() as work:
        none, network = run.spheres("initial").fines(), run.network() if flux else None
        empty = write_spheres_vtp(Path(work, "none.vtp"), none)
        fluxes = None if network is None else flux_of(run, network)
        for number, one in enumerate(moments):
            spheres = one.spheres or empty
            if fluxes is None:
                frames.append(MovieFrame(spheres, one.words()))
                continue
            if progress:
                print(f"movie: flow of state {number + 1} of {len(moments)}", file=sys.stderr)
            fines = read_spheres(spheres, box=box).fines() if one.spheres else none
            values, k_over_k0 = fluxes(fines, one.rate)
            limits = limits if number else colour_limits(values)
            lines = write_flux_vtp(Path(work, f"lines_{number:04d}.vtp"), network, values)
            frames.append(MovieFrame(spheres, one.words(k_over_k0), lines))
        title = TITLE if flux else ""
        scene = Scene(grains=still, box=box, title=title, limits=limits, told=progress)
        return write_movie(path, frames, scene, per_second=per_second)


def moments_of(run: FinishedRun) -> Iterator[DrawnState]:
    """The states that the run kept, in order of time; the first is the clean specimen."""
    if not isinstance(run.case, InvasionCase):
        raise CaseError(f"{run.path}: has no fines, so there is no invasion to show")
    kept = frames_of(run.manifest["files"])
    files = frames_in(run.path) | kept
    if not files:
        raise CaseError(
            f"{run.path / 'frames'}: holds no states to draw; write them with fdnet run CASE.toml "
            f"--out {shlex.quote(str(run.path))} --stages report --force"
        )
    rows: dict[int, Any] = {int(row["step"]): row for row in run.history.to_dict("records")}
    for step, name in files.items():
        if step not in rows or (kept and step not in kept):
            raise CaseError(
                f"{run.path / name}: is no state that this run wrote; move it out of this folder"
            )
    yield DrawnState(None, dict.fromkeys(map(str, run.history.columns), 0.0))
    for step, name in sorted(files.items()):
        yield DrawnState(_whole(run, name), rows[step])


def _whole(run: FinishedRun, name: str) -> Path:
    """A mesh of the run that is there, uncut and, where its digest was kept, unchanged."""
    path = run.path / name
    check_one(run.path, run.manifest, name, ANALYSE_AGAIN)
    if not path.is_file() or not path.read_bytes().rstrip().endswith(b"</VTKFile>"):
        what = "is cut" if path.is_file() else "is missing"
        raise CaseError(f"{path}: {what}; {ANALYSE_AGAIN}")
    return path
