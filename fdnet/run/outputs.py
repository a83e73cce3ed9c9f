"""What a run writes next to its summary: tables, figures, ParaView files."""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Spheres
from fdnet.dem.checkpoint import readable_states
from fdnet.dem.supply import batches_of, drawn_fines
from fdnet.errors import Doubt
from fdnet.report import figures, tables, vtk
from fdnet.report.figures import Added, PageTable, PlacedSizes
from fdnet.report.picture import render_spheres_png
from fdnet.report.tables import millimetres
from fdnet.report.text import cake_words
from fdnet.run.bridging import CLOGGED, ratio_rows
from fdnet.run.cake import cake_rows, cake_summary, measure_cake
from fdnet.run.clean_up import Returned, clean_up_rows, clean_up_summary
from fdnet.run.fluid import history_rows
from fdnet.run.records import FinishedInvasion
from fdnet.scales.pack import SHARES, diameter_at
from fdnet.scales.scales import invasion_scales
from fdnet.sizes import volume_quantiles
from fdnet.spheres.readers import write_spheres
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

MOST_FRAMES = 24


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Results:
    """The results of a run and where they go."""

    path: Path  # run folder
    grains: Snapshot  # as packed
    invasion: FinishedInvasion | None  # None when the case has no fines
    analysis: "Analysis"  # permeability, porosity and fines of the specimen
    sizes: tuple[PlacedSizes, ...] = ()  # of grains and fines with measured curves
    cleaned: Returned | None = None  # what the clean-up gave; None without one
    added: tuple[Added, ...] = ()  # results that only some runs have
    # of the summary, that only size classes give
    numbers: Mapping[str, Any] = field(default_factory=dict)
    # fines of classes beside the spheres of LIGGGHTS; None without any
    finer: Snapshot | None = None

    @property
    def shown(self) -> Snapshot:
        """The specimen at the end: damaged, or the intact grains."""
        end = self.grains if self.invasion is None else self.invasion.damaged
        return end if self.finer is None else end.joined(self.finer)

    @property
    def history_rows(self) -> list[dict[str, float]]:
        """The rows of history.csv; none without an invasion."""
        one = self.invasion
        if one is None or one.rows:
            return [] if one is None else list(one.rows)
        return history_rows(one.case, one.scales, one.history, one.updates)


def write_tables(results: Results) -> None:
    """The CSV files of the output contract."""
    path, analysis = results.path, results.analysis
    write_spheres(path / "spheres_initial.csv", results.grains)
    write_spheres(path / "spheres_damaged.csv", results.shown)
    tables.write_sections(path / "sections.csv", analysis)
    tables.write_profile(path / "profile.csv", analysis)
    if analysis.layers is not None:
        tables.write_layers(path / "layers.csv", analysis.layers)
    tables.write_pores(path / "pores.csv", analysis)
    tables.write_throats(path / "throats.csv", analysis)
    if results.cleaned is not None:
        write_spheres(path / "spheres_cleaned.csv", results.cleaned.state)
    for one in results.added:
        if one.rows:
            tables.write_rows(path / f"{one.name}.csv", one.rows)
    if results.history_rows:
        tables.write_rows(path / "history.csv", results.history_rows)


def write_paraview(results: Results) -> list[str]:
    """network.vtp, the spheres before and after, and the invasion for ParaView's time slider.

    Of the invasion there are at most `MOST_FRAMES` evenly spaced states, the last among them.
    Without VTK nothing is written, and the list that is returned says why.
    """
    if why := vtk.view_missing():
        words = f"no 3-D picture and no ParaView files, because VTK cannot be loaded ({why})"
        return [Doubt("no-view", words)]
    path, shown, one = results.path, results.shown, results.invasion
    vtk.write_network_vtp(path / "network.vtp", results.analysis)
    vtk.write_spheres_vtp(path / "spheres_initial.vtp", results.grains)
    vtk.write_spheres_vtp(path / "spheres_damaged.vtp", shown)
    vtk.write_pvd(
        path / "spheres.pvd", [(0.0, "spheres_initial.vtp"), (shown.time_s, "spheres_damaged.vtp")]
    )
    if one is not None:
        (path / "frames").mkdir(exist_ok=True)
        stride, entries = -(-len(one.history) // MOST_FRAMES), []
        chosen = one.history[::-1][::stride][::-1]
        states = readable_states(path / "invade", chosen, one.case, one.scales, results.grains)
        for row, state in one.states or states:
            name = f"frames/spheres_{row.step}.vtp"
            moving = state if one.case.grains.motion == "mobile" else state.fines()
            vtk.write_spheres_vtp(path / name, moving)
            entries.append((state.time_s, name))
        vtk.write_pvd(path / "invasion.pvd", entries)
    vtk.write_macro(path / "paraview_view.py")
    return []


def draw_figures(
    results: Results, *, solid: bool = True
) -> tuple[list[tuple[Path, str]], list[str]]:
    """All figures with their captions, and why the 3-D picture is missing if it is.

    The 3-D picture is drawn from a ParaView file by a process of its own at the same time as the
    others, where `solid` asks for it.
    """
    folder, spheres = results.path / "figures", results.path / "spheres_damaged.vtp"
    rows, picture = results.history_rows or None, folder / "spheres_3d.png"
    folder.mkdir(exist_ok=True)
    with ThreadPoolExecutor(1) as aside:
        box = results.shown.box
        waiting = aside.submit(render_spheres_png, picture, spheres, box) if solid else None
        drawn = figures.draw_all(folder, results.analysis, results.shown, rows, results.sizes)
        reason = waiting.result() if waiting else ""
    first = [picture] if solid and not reason else []
    captioned = [(file, figures.CAPTIONS[file.stem]) for file in first + drawn]
    for one in results.added:
        if one.fill is not None:
            captioned.append((figures.draw(folder / f"{one.name}.svg", one.fill), one.caption))
    return captioned, [reason] if reason else []


# ---- Sizes of the spheres that a run placed, next to those that its case asks for.
def placed_sizes(
    case: Case, grains: Snapshot, damaged: Snapshot | None, supplied: int
) -> Iterator[PlacedSizes]:
    """Grains and fines, where their sizes are measured ones.

    `damaged` is the specimen at the end and `supplied` the number of fines that entered.
    """
    if case.grains.measured:
        yield _placed("grains", case.grains, 2 * grains.radius)
    if isinstance(case, InvasionCase) and case.fines.measured and damaged is not None:
        fines = damaged.fines()
        inside = (fines.position[:, 0] >= 0) & (fines.position[:, 0] < case.size_m[0])
        counts = batches_of(case, invasion_scales(case)).counts
        entered = sum(total <= supplied for total in accumulate(counts))
        batches = drawn_fines(case, counts)[:entered]
        placed = np.concatenate([2 * batch.radius for batch in batches])
        yield _placed("fines", case.fines, placed, 2 * fines.radius[inside])


def _placed(
    name: str, spheres: Spheres, placed: Array, invaded: Array | None = None
) -> PlacedSizes:
    sizes, law, asked = spheres.sizes, "mixture", {}
    if sizes is not None:
        law = "measured" if sizes.fit is None else sizes.fit.name
        asked = sizes.asked or dict(sizes.points)
    return PlacedSizes(
        name=name, law=law, asked=asked, curve=spheres.curve, placed=placed, invaded=invaded
    )


def size_numbers(one: PlacedSizes) -> dict[str, Any]:
    """A row of the key `sizes` of summary.json: D10, D50 and D90 asked for, of the curve, placed.

    All in m; the shares are of the whole solids, with those left out, and a diameter that is left
    out is null.
    """
    names = {share: f"D{100 * share:.0f}" for share in SHARES}
    placed: dict[str, float | None] = {}
    for share, name in names.items():
        inside = (share - one.curve.below) / one.curve.kept
        here = 0 <= inside <= 1
        placed[name] = volume_quantiles(one.placed, [inside])[0] if here else None
    result: dict[str, Any] = {
        "law": one.law,
        "asked_m": {name: one.asked[p] for p, name in names.items() if p in one.asked},
        "curve_m": {name: diameter_at(one.curve, p) for p, name in names.items()},
        "placed_m": placed,
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


# ---- Results that only some runs have: cake, filtrate, bridging, and what the clean-up returns.
_CLEAN_UP_COLUMNS = (
    ("section", "section", "", None),
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("k_initial_m2", "k intact", "m²", 1),
    ("k_damaged_m2", "k damaged", "m²", 1),
    ("k_returned_m2", "k after the clean-up", "m²", 1),
    ("damaged_k_over_k0", "k/k0 damaged", "%", 1e2),
    ("return_k_over_k0", "k/k0 after the clean-up", "%", 1e2),
    ("fines_before", "fines before", "", None),
    ("fines_left_it", "of these came out", "", None),
    ("fines_after", "fines after", "", None),
)
_CAKE_COLUMNS = (
    ("x_lo_m", "from", "mm", 1e3),
    ("x_hi_m", "to", "mm", 1e3),
    ("fines_count", "fines", "", None),
    ("porosity", "porosity", "–", 1),
    ("sauter_diameter_m", "Sauter diameter", "mm", 1e3),
    ("k_m2", "k", "mD", 1),
)


def with_added(results: Results, record: dict[str, Any] | None) -> Results:
    """The results with what only some runs have; `record` is that of the clean-up, if any."""
    one, added = results.invasion, []
    if one is not None and one.rows:
        added = [*_filtrate(one)]
    elif one is not None:
        added = [_cake(results, one), *_filtrate(one)]
    if one is not None and results.analysis.invaded_count and len(one.damaged.fines()):
        added.append(_bridging(results, one))
    if results.cleaned is not None and record is not None:
        added.append(_clean_up(results, results.cleaned, record))
    return replace(results, added=tuple(added))


def _cake(results: Results, one: FinishedInvasion) -> Added:
    """The external cake by depth, and its share of the resistance."""
    case, analysis = one.case, results.analysis
    cake = measure_cake(one.damaged, case.periodic)
    pack = case.size_m[0] / analysis.k_damaged if analysis.k_damaged > 0 else np.inf
    summary = cake_summary(cake, pack, results.numbers.get("cake_of_classes_1_m", 0.0))
    if cake is None:
        return Added(name="cake", summary=summary)
    rows = cake_rows(cake)
    return Added(
        name="cake",
        rows=rows,
        summary=summary,
        fill=partial(figures.fill_cake, rows=rows),
        caption="The external cake in slices of a fine's diameter: porosity, and permeability by "
        "the law of Beetstra and others for the drag on spheres in a bed.",
        page=PageTable(
            title="External cake",
            columns=_CAKE_COLUMNS,
            rows=rows,
            note=f"The cake is {millimetres(cake.thickness)} thick: {cake_words(summary)}. It is "
            "the fines that stand before the face, each held by two others or more.",
        ),
    )


def _filtrate(one: FinishedInvasion) -> Iterator[Added]:
    """Filtrate against the root of time, where the flow follows the deposit."""
    updates, pace = one.rows or one.updates, 1.0 if one.rows else one.scales.force_factor
    if not updates or "filtrate_m3" not in updates[-1]:
        return
    time = pace * np.array([row["time_s"] for row in updates])
    volume = np.array([row["filtrate_m3"] for row in updates])
    yield Added(
        name="filtrate",
        fill=partial(
            figures.fill_filtrate,
            time=time,
            volume=volume / (one.case.size_m[1] * one.case.size_m[2]),
        ),
        caption="Filtrate per area of the face against the root of time. A cake that grows at "
        "constant pressure and resists far more than the pack gives a straight line.",
    )


def _bridging(results: Results, one: FinishedInvasion) -> Added:
    """Which throats the fines close, by the ratio of diameters."""
    last = one.history[-1]
    rows = ratio_rows(
        results.analysis,
        entered=last.invaded + last.passed,
        fine_diameter=2.0 * float(np.mean(one.damaged.fines().radius)),
        concentration=one.case.fines.placed_fraction,
    )
    return Added(
        name="bridging",
        rows=rows,
        fill=partial(figures.fill_bridging, rows=rows) if rows else None,
        caption="Throats between grains, down to the depth above which 95 % of the fines lie: the "
        "share that is closed, by the ratio of the fines' diameter to that of the throat, with "
        "Wilson's 95 % band. Closed: one fine covers the whole section (blocked), or less than "
        f"{CLOGGED:g} of the conductance is left (clogged).",
    )


def _clean_up(results: Results, after: Returned, record: dict[str, Any]) -> Added:
    rows = clean_up_rows(results.analysis, after)
    summary = clean_up_summary(results.analysis, after, record)
    counts = summary["clean_up"]
    whole = counts["damaged_k_over_k0"], summary["return_k_over_k0"]
    said = " and ".join("no path" if share is None else f"{share:.3f}" for share in whole)
    return Added(
        name="clean_up",
        rows=rows,
        summary=summary,
        fill=partial(
            figures.fill_clean_up,
            rows=rows,
            depths=(after.before, after.before[after.stayed]),
            whole=whole,
        ),
        caption="The clean-up: permeability of each section over that of the intact pack, after "
        "the invasion and after the flow was turned back; depth of the fines that were inside "
        "before, and of those of them that stayed.",
        page=PageTable(
            title="Clean-up",
            columns=_CLEAN_UP_COLUMNS,
            rows=rows,
            note=f"The flow was turned back. Of {counts['inside_before']} fines inside, "
            f"{counts['came_out']} came out and {counts['stayed']} stayed. k/k0 of the whole "
            f"specimen before and after: {said}. The damage law is that of the invasion.",
        ),
    )
