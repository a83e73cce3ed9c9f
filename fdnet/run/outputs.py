"""What a run writes next to its summary: tables, figures, ParaView files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fdnet.case.case import InvasionCase
from fdnet.dem.checkpoint import Checkpoint, readable_states
from fdnet.report.added import Added, draw_added, write_added
from fdnet.run.history import history_rows
from fdnet.run.placed_sizes import PlacedSizes
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

MOST_FRAMES = 24


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Invaded:
    """A finished invasion.

    Attributes:
        case: what was run.
        scales: of the case.
        history: one row a checkpoint.
        damaged: grains and all remaining fines at the end.
        updates: the record of a coupled invasion, one row an update; empty of others.
    """

    case: InvasionCase
    scales: InvasionScales
    history: tuple[Checkpoint, ...]
    damaged: Snapshot
    updates: tuple[Mapping[str, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Results:
    """The results of a run and where they go.

    Attributes:
        path: run folder.
        grains: as packed.
        invasion: None when the case has no fines.
        analysis: permeability, porosity and fines of the specimen.
        sizes: of grains and fines with measured curves.
        cleaned: grains and fines after the clean-up; None without one.
        added: results that only some runs have.
    """

    path: Path
    grains: Snapshot
    invasion: Invaded | None
    analysis: "Analysis"
    sizes: tuple[PlacedSizes, ...] = ()
    cleaned: Snapshot | None = None
    added: tuple[Added, ...] = ()

    @property
    def shown(self) -> Snapshot:
        """The specimen at the end: damaged, or the intact grains."""
        return self.grains if self.invasion is None else self.invasion.damaged

    @property
    def history(self) -> tuple[Checkpoint, ...]:
        """The checkpoints of the invasion; empty without one."""
        return () if self.invasion is None else self.invasion.history

    @property
    def history_rows(self) -> list[dict[str, float]]:
        """The rows of history.csv; none without an invasion."""
        one = self.invasion
        return [] if one is None else history_rows(one.case, one.scales, one.history, one.updates)

    @property
    def physical_time_s(self) -> float | None:
        """How long the fluid drove the fines, s; None without an invasion."""
        rows = self.history_rows
        return rows[-1]["physical_time_s"] if rows else None


def write_tables(results: Results) -> None:
    """The CSV files of the output contract."""
    from fdnet.report import tables
    from fdnet.spheres import csv_file as spheres

    path = results.path
    spheres.write_spheres(path / "spheres_initial.csv", results.grains)
    spheres.write_spheres(path / "spheres_damaged.csv", results.shown)
    tables.write_sections(path / "sections.csv", results.analysis)
    tables.write_profile(path / "profile.csv", results.analysis)
    if results.analysis.layers is not None:
        tables.write_layers(path / "layers.csv", results.analysis.layers)
    tables.write_pores(path / "pores.csv", results.analysis)
    tables.write_throats(path / "throats.csv", results.analysis)
    if results.cleaned is not None:
        spheres.write_spheres(path / "spheres_cleaned.csv", results.cleaned)
    write_added(path, results.added)
    if results.history_rows:
        tables.write_history(path / "history.csv", results.history_rows)


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
    if results.invasion is not None:
        _write_frames(path, results.grains, results.invasion)
    vtk.write_macro(path / "paraview_view.py")


def _write_frames(path: Path, grains: Snapshot, invasion: Invaded) -> None:
    """At most `MOST_FRAMES` evenly spaced states; the last is always among them."""
    from fdnet.report import vtk

    case, history = invasion.case, invasion.history
    stride = -(-len(history) // MOST_FRAMES)
    (path / "frames").mkdir(exist_ok=True)
    entries = []
    chosen = history[::-1][::stride][::-1]
    for row, state in readable_states(path / "invade", chosen, case, invasion.scales, grains):
        name = f"frames/spheres_{row.step}.vtp"
        moving = state if case.grains.motion == "mobile" else state.fines()
        vtk.write_spheres_vtp(path / name, moving)
        entries.append((state.time_s, name))
    vtk.write_pvd(path / "invasion.pvd", entries)


def draw_figures(results: Results) -> tuple[list[tuple[Path, str]], list[str]]:
    """All figures with their captions, and why the 3-D picture is missing if it is."""
    from fdnet.report import child, figures

    drawn = figures.draw_all(
        results.path / "figures",
        results.analysis,
        results.shown,
        results.history_rows or None,
        results.sizes,
    )
    more = draw_added(results.path / "figures", results.added)
    picture = results.path / "figures" / "spheres_3d.png"
    reason = child.render_spheres_png(
        picture, results.path / "spheres_damaged.vtp", results.shown.box
    )
    if reason:
        return [(file, figures.CAPTIONS[file.stem]) for file in drawn] + more, [reason]
    return [(file, figures.CAPTIONS[file.stem]) for file in (picture, *drawn)] + more, []
