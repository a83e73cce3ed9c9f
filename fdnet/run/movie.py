"""Movies and pictures of a finished run: its fines, or with them the flux of its throats."""

import shlex
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from itertools import repeat
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
from fdnet.run.by_classes import STATE
from fdnet.run.finished import FinishedRun, open_run
from fdnet.run.folder import ANALYSE_AGAIN, check_finished, frames_of
from fdnet.spheres.readers import read_spheres
from fdnet.spheres.snapshot import Array


# ---- The states of a finished run.
class DrawnState(NamedTuple):
    """One state of a run: the file of its spheres, None before the first fine came in, and its row
    of the history, with `rate_over_initial` where the flow followed the deposit."""

    spheres: Path | None
    row: Mapping[str, Any]

    def words(self, what: str, measured: float | None = None) -> str:
        """Time, rate, permeability (else the `measured` one) and number of `what` is drawn."""
        if self.spheres is None:
            return "clean sand"
        seconds = float(self.row.get("physical_time_s", self.row["time_s"]))
        time = f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"
        rate, k = self.row.get("rate_over_initial"), self.row.get("k_over_k0", measured)
        shares = [
            f"{name} {one:.2f}" for name, one in (("rate", rate), ("k/k0", k)) if one is not None
        ]
        return ",   ".join([time, *shares, f"{int(self.row['invaded'])} {what}"])


def states_of(run: FinishedRun) -> Iterator[DrawnState]:
    """The states that the run kept, in order of time; the first is the clean specimen."""
    if not isinstance(run.case, InvasionCase):
        raise CaseError(f"{run.path}: has no fines, so there is no invasion to show")
    files = frames_of(run.manifest["files"])
    if not files:
        raise CaseError(
            f"{run.path / 'frames'}: holds no states that this run wrote; write them with fdnet "
            f"run CASE.toml --out {shlex.quote(str(run.path))} --stages report --force"
        )
    rows: dict[int, Any] = {int(row["step"]): row for row in run.history.to_dict("records")}
    follows = "rate_over_initial" in run.history
    yield DrawnState(None, {"step": 0} | ({"rate_over_initial": 1.0} if follows else {}))
    for step, name in sorted(files.items()):
        yield DrawnState(_there(run, name), rows[step])


def _there(run: FinishedRun, name: str) -> Path:
    if not (path := run.path / name).is_file():
        raise CaseError(f"{path}: is missing; {ANALYSE_AGAIN}")
    return path


def drawn_as(run: FinishedRun) -> str:
    """What the spheres in the sand of a run are."""
    if run.summary.get("method") == "both":
        return "spheres in the sand; finer solids are not drawn"
    several = any(row["fines_per_row"] > 1 for row in run.summary.get("classes", ()))
    return "spheres stand for the solids in the sand" if several else "fines in the sand"


def fluxes_of(
    run: FinishedRun, network: Network, states: Iterable[DrawnState]
) -> Iterator[tuple[Array, float | None]]:
    """The flux (T,) of the throats of a run in percent of the first flow at each of its `states`.

    With it k over that of the clean specimen, where it is measured for it. The fast model kept the
    flow. Else the laws are those of the run; where it measured the damage in two ways, that of the
    throats. Fines that still move count as deposit. Where no rate is known it is the one at the
    first pressure drop.
    """
    if run.summary.get("method") == "network":
        with np.load(run.path / "invade" / STATE) as data:
            if "state_flux" not in data.files:
                raise CaseError(f"{run.path}: kept no flow; run the case anew for --show flux")
            kept = dict(zip(data["state_step"].tolist(), data["state_flux"], strict=True))
        for one in states:
            yield 100.0 * one.row["rate_over_initial"] * kept[one.row["step"]], None
        return
    choices = run.case.analysis
    clean = LAWS[choices.law](network)
    first = flow = solve_flow(network, clean)
    other = run.summary.get("damage_law_other") or run.summary["damage_law_used"]
    damaged = damage_law(
        other if other in DAMAGE_LAWS else SECTION_ARCHIE,
        clogging_threshold=choices.clogging_threshold,
        middle_band=choices.middle_band,
    )
    for one in states:
        if one.spheres is not None:
            fines = read_spheres(one.spheres, box=network.box).fines()
            occupancy = measure_occupancy(network, fines, overlap=choices.throat_overlap)
            flow = solve_flow(network, damaged(network, occupancy, clean).conductance)
        k = flow.inflow / max(first.inflow, 1e-300)
        share = np.abs(flow.throat_flux) / max(flow.inflow, 1e-300)
        yield 100.0 * share * one.row.get("rate_over_initial", k), k


# ---- The movie, or a picture of before and after.
LEAST, MOST = 0.5, 30.0  # Frames a second that a movie may have


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
    refuse_present(path, force=force)
    refuse_without_view(str(path))
    check_finished(folder)
    states, what = list(states_of(run)), drawn_as(run)
    if path.suffix.lower() == ".png":
        states = [states[0], states[-1]]
    scene = Scene(
        grains=_there(run, "spheres_initial.vtp"),
        box=np.array([(0.0, side) for side in run.case.size_m]),
        told=progress,
    )
    frames, network = list[MovieFrame](), run.network() if flux else None
    fluxes = repeat((None, None)) if network is None else fluxes_of(run, network, states)
    with tempfile.TemporaryDirectory() as work:
        none = write_spheres_vtp(Path(work, "none.vtp"), run.spheres("initial").fines())
        for one, (values, k_over_k0) in zip(states, fluxes, strict=False):
            lines = None
            if values is not None:
                lines = Path(work, f"lines_{len(frames):04d}.vtp")
                write_flux_vtp(lines, network, values)
                if progress:
                    print(f"movie: flow of {len(frames) + 1} of {len(states)}", file=sys.stderr)
            frames.append(MovieFrame(one.spheres or none, one.words(what, k_over_k0), lines))
        return write_movie(path, frames, scene, per_second=per_second)
