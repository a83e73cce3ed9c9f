"""Tables and figures of a finished invasion.

Sizes of the spheres that a run placed, next to those that its case asks for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.dem.checkpoint import Checkpoint, readable_states
from fdnet.dem.supply import batches_of, drawn_fines
from fdnet.errors import Doubt
from fdnet.report.figures import Added, draw_added, write_added
from fdnet.run.fluid import history_rows
from fdnet.scales.pack import SHARES, diameter_at
from fdnet.scales.scales import InvasionScales, invasion_scales
from fdnet.sizes import SizeCurve, volume_quantiles
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedSizes:
    """One kind of spheres of measured sizes.

    Attributes:
        name: "grains" or "fines".
        law: "log-normal", "rosin-rammler", "measured" or "mixture".
        asked: diameters, m, by the share that is finer, as the case gives them.
        curve: of the case.
        placed: (N,) m, diameters of the spheres that were placed.
        invaded: (M,) m, diameters of the fines that lie in the specimen at the end; None for
            grains.
    """

    name: str
    law: str
    asked: Mapping[float, float]
    curve: SizeCurve
    placed: Array
    invaded: Array | None = None


def placed_sizes(
    case: Case, grains: Snapshot, damaged: Snapshot | None, supplied: int
) -> list[PlacedSizes]:
    """Grains and fines, where their sizes are measured ones.

    `damaged` is the specimen at the end and `supplied` the number of fines that entered.
    """
    result = []
    if case.grains.measured:
        result.append(_sizes("grains", case.grains, 2 * grains.radius))
    if isinstance(case, InvasionCase) and case.fines.measured and damaged is not None:
        fines = damaged.fines()
        inside = (fines.position[:, 0] >= 0) & (fines.position[:, 0] < case.size_m[0])
        placed = _supplied_fines(case, invasion_scales(case), supplied)
        result.append(_sizes("fines", case.fines, placed, 2 * fines.radius[inside]))
    return result


def _supplied_fines(case: InvasionCase, scales: InvasionScales, supplied: int) -> Array:
    """Diameters (N,) m of the fines of the batches that entered."""
    counts = batches_of(case, scales).counts
    entered = sum(total <= supplied for total in accumulate(counts))
    drawn = drawn_fines(case, counts)[:entered]
    return np.concatenate([2 * batch.radius for batch in drawn])


def _sizes(
    name: str, spheres: Spheres, placed: Array, invaded: Array | None = None
) -> PlacedSizes:
    sizes = spheres.sizes
    law = "mixture" if sizes is None else ("measured" if sizes.fit is None else sizes.fit.name)
    asked: dict[float, float] = {}
    if sizes is not None:
        asked = sizes.asked or dict(sizes.points)
    return PlacedSizes(
        name=name, law=law, asked=asked, curve=spheres.curve, placed=placed, invaded=invaded
    )


def size_summary(sizes: Sequence[PlacedSizes]) -> dict[str, Any]:
    """The key `sizes` of summary.json: D10, D50 and D90 asked for, of the curve and placed, m.

    All shares are of the whole solids, with those left out; a diameter that is left out is null.
    """
    return {one.name: _numbers(one) for one in sizes}


def _numbers(one: PlacedSizes) -> dict[str, Any]:
    names = {share: f"D{100 * share:.0f}" for share in SHARES}
    result: dict[str, Any] = {
        "law": one.law,
        "asked_m": {name: one.asked[p] for p, name in names.items() if p in one.asked},
        "curve_m": {name: diameter_at(one.curve, p) for p, name in names.items()},
        "placed_m": {name: _placed_at(one, one.placed, p) for p, name in names.items()},
        "placed_count": len(one.placed),
        "smallest_m": float(one.placed.min()),
        "largest_m": float(one.placed.max()),
        "finer_left_out": one.curve.below,
        "coarser_left_out": one.curve.above,
    }
    if one.invaded is not None and len(one.invaded):
        values = volume_quantiles(one.invaded, SHARES)
        result["invaded_m"] = dict(zip(names.values(), values, strict=True))
    return result


def _placed_at(one: PlacedSizes, diameter: Array, share: float) -> float | None:
    inside = (share - one.curve.below) / one.curve.kept
    return volume_quantiles(diameter, [inside])[0] if 0 <= inside <= 1 else None


# ------------------------------------------------------------------------------------------------
# What a run writes next to its summary: tables, figures, ParaView files.


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
    from fdnet.spheres import readers as spheres

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
        return [(file, figures.CAPTIONS[file.stem]) for file in drawn] + more, [
            Doubt("no-picture", reason)
        ]
    return [(file, figures.CAPTIONS[file.stem]) for file in (picture, *drawn)] + more, []
