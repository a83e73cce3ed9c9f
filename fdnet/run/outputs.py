"""What a run writes beside its summary: tables, figures, ParaView files."""

from dataclasses import dataclass
from pathlib import Path

from fdnet.case.case import Case
from fdnet.dem.checkpoint import Checkpoint, readable_states
from fdnet.network.analysis import Analysis
from fdnet.scales.scales import Scales
from fdnet.spheres.snapshot import Snapshot

MOST_FRAMES = 24


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Results:
    """A run's results and where they go; `damaged` is None and `history` empty without fines."""

    path: Path
    case: Case
    scales: Scales
    grains: Snapshot
    damaged: Snapshot | None
    history: tuple[Checkpoint, ...]
    analysis: Analysis

    @property
    def shown(self) -> Snapshot:
        """The specimen at the end: damaged, or the intact grains."""
        return self.grains if self.damaged is None else self.damaged


def write_tables(results: Results) -> None:
    """The CSV files of the output contract."""
    from fdnet.report import tables
    from fdnet.spheres import csv_file as spheres

    path = results.path
    spheres.write_spheres(path / "spheres_initial.csv", results.grains)
    spheres.write_spheres(path / "spheres_damaged.csv", results.shown)
    tables.write_sections(path / "sections.csv", results.analysis)
    tables.write_profile(path / "profile.csv", results.analysis)
    tables.write_pores(path / "pores.csv", results.analysis)
    tables.write_throats(path / "throats.csv", results.analysis)


def write_paraview(results: Results) -> None:
    """network.vtp, the spheres before and after, and the invasion for ParaView's time slider."""
    from fdnet.report import vtk

    path, shown = results.path, results.shown
    vtk.write_network_vtp(path / "network.vtp", results.analysis)
    vtk.write_spheres_vtp(path / "spheres_initial.vtp", results.grains)
    vtk.write_spheres_vtp(path / "spheres_damaged.vtp", shown)
    vtk.write_pvd(
        path / "spheres.pvd", [(0.0, "spheres_initial.vtp"), (shown.time_s, "spheres_damaged.vtp")]
    )
    if results.history:
        _write_frames(results)


def _write_frames(results: Results) -> None:
    """At most 24 evenly spaced states, the last always among them."""
    from fdnet.report import vtk

    stride = -(-len(results.history) // MOST_FRAMES)
    (results.path / "frames").mkdir(exist_ok=True)
    entries = []
    chosen = results.history[::-1][::stride][::-1]
    for row, state in readable_states(
        results.path / "invade", chosen, results.case, results.scales, results.grains
    ):
        name = f"frames/spheres_{row.step}.vtp"
        vtk.write_spheres_vtp(
            results.path / name, state if results.case.grains.motion == "mobile" else state.fines()
        )
        entries.append((state.time_s, name))
    vtk.write_pvd(results.path / "invasion.pvd", entries)


def draw_figures(results: Results) -> tuple[list[tuple[Path, str]], list[str]]:
    """All figures with their captions, and why the 3-D picture is missing if it is."""
    from fdnet.report import figures, vtk

    rows = [
        {
            "time_s": row.step * results.scales.time_step,
            "upstream": row.upstream,
            "invaded": row.invaded,
            "passed": row.passed,
        }
        for row in results.history
    ]
    drawn = figures.draw_all(
        results.path / "figures", results.analysis, results.shown, rows or None
    )
    picture = results.path / "figures" / "spheres_3d.png"
    reason = vtk.render_spheres_png(
        picture, results.path / "spheres_damaged.vtp", results.shown.box
    )
    if reason:
        return [(file, figures.CAPTIONS[file.stem]) for file in drawn], [reason]
    return [(file, figures.CAPTIONS[file.stem]) for file in (picture, *drawn)], []
