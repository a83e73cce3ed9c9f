"""PNG figures of one specimen; depth is x, from the formation face.

The colours are those of Okabe and Ito (2008), which colour-blind readers can tell apart.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.files.atomic import replacing
from fdnet.report.deposit_figure import fill_deposit, has_sizes
from fdnet.report.depth_figure import DEPTH_LABEL, fill_depth, legend_above, plain_decades
from fdnet.report.history_figure import fill_history
from fdnet.report.network_figure import fill_network
from fdnet.report.side_view import fill_side_view
from fdnet.report.size_figure import Sizes, fill_size_curves
from fdnet.report.tables import between_grains
from fdnet.report.units import MILLIDARCY
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis
    from fdnet.network.flow.depth import Layers

BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#7F7F7F"
MM, MICRON = 1e3, 1e6
STYLE: Any = {
    "font.size": 11,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.edgecolor": "white",
    "legend.framealpha": 0.9,
    "lines.linewidth": 2,
}
CAPTIONS = {
    "spheres_3d": "The specimen from the front and upstream: the grains of the far half (grey) "
    "and the fines, coloured by radius, or by depth where they are of one size. The fluid enters "
    "at x = 0.",
    "side_view": "Section x-z through the middle of the specimen. Grains are drawn where the "
    "plane cuts them, so that a grain cut off its middle looks small; fines that the plane meets "
    "are drawn whole.",
    "porosity_reduction": "Porosity lost to the fines against depth: difference of the intact and "
    "the damaged porosity, in fine bins and per section.",
    "invaded_fraction": "Share of the invaded fines, by number, against depth.",
    "permeability_ratio": "Damaged over intact permeability of each section, cut out with its own "
    "network and in place from the pressures of the whole specimen.",
    "depth": "Permeability in place (sections, and thin layers of the first millimetre) and "
    "porosity against depth, intact and damaged. In place is under the pressures of the whole "
    "specimen; where the fines turn the flow aside, a layer can take less of the pressure than "
    "before and lie above its intact value, though no fine raises the permeability.",
    "network": "Throats of a slice through the middle of the network, with the fines: pressure, "
    "absolute flux over the largest, and share of the conductance lost; crosses mark the throats "
    "of the slice that are blocked: one fine covers the whole section.",
    "deposit_by_size": "Volume of the deposit against depth, in classes of the fines' diameter "
    "that hold equal volume.",
    "size_distributions": "Inscribed radii of throats and pores between the grains alone, by "
    "number, without those beside side walls and end faces; the band is the range of the fines' "
    "radii.",
    "size_curves": "Sizes by volume: the curve that the case asks for, with what is left out at "
    "its ends, the spheres that were placed, and the fines in the specimen at the end.",
    "layers": "The first millimetre in layers of a fine's diameter: permeability of each layer in "
    "place, without and with the fines, and its share of the specimen's pressure drop. From the "
    "network of all spheres.",
    "invasion_history": "Fines inside the specimen, passed through it and still upstream, against "
    "time; where the flow follows the deposit, also the rate of flow and the permeability.",
}


def draw_all(
    folder: str | Path,
    analysis: "Analysis",
    snapshot: Snapshot | None = None,
    history: Sequence[Mapping[str, float]] | None = None,
    sizes: Sequence[Sizes] = (),
) -> list[Path]:
    """Draw every figure that has data into `folder`; return the paths in the order of the report.

    The folder is made if it is missing. `snapshot` is what the side view shows, the damaged
    specimen or the grains alone; without one there is no side view. Figures of damage are left out
    for an intact pack. `history` rows are those of history.csv. `sizes` are those of grains and
    fines with measured curves. `CAPTIONS` explains each figure under the stem of its file.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    fines = None if snapshot is None else snapshot.fines()
    draws: dict[str, Callable[[Any], None]] = {"depth": partial(fill_depth, analysis=analysis)}
    if snapshot is not None:
        draws["side_view"] = partial(fill_side_view, snapshot=snapshot)
        if has_sizes(snapshot):
            draws["deposit_by_size"] = partial(fill_deposit, spheres=snapshot)
    if analysis.occupancy is not None:
        draws["porosity_reduction"] = partial(_porosity_reduction, analysis=analysis)
        draws["invaded_fraction"] = partial(_invaded_fraction, analysis=analysis)
        draws["permeability_ratio"] = partial(_permeability_ratio, analysis=analysis)
    if analysis.layers is not None:
        draws["layers"] = partial(_layers, layers=analysis.layers)
    draws["network"] = partial(fill_network, analysis=analysis)
    draws["size_distributions"] = partial(_size_distributions, analysis=analysis, fines=fines)
    if sizes:
        draws["size_curves"] = partial(fill_size_curves, sizes=sizes)
    if history:
        draws["invasion_history"] = partial(fill_history, history=history)
    return [draw(target / f"{name}.png", fill) for name, fill in draws.items()]


def draw(path: Path, fill: Callable[[Any], None]) -> Path:
    """Save a figure that `fill` draws into, whole or not at all."""
    with _figure(path) as figure:
        fill(figure)
    return path


@contextmanager
def _figure(path: Path) -> Iterator[Any]:
    """A figure without pyplot's global state, saved to `path` when filled."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(STYLE):
        figure = Figure(figsize=(7.2, 4.4), dpi=130, layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        with replacing(path) as part:
            figure.savefig(part)


def _stairs(axes: Any, edges: Array, values: Any, **style: Any) -> None:
    axes.stairs(
        np.asarray(values, float),
        np.asarray(edges, float) * MM,
        baseline=None,
        linewidth=2,
        **style,
    )


def _section_edges(analysis: "Analysis") -> Array:
    return np.array([s.x_lo for s in analysis.sections] + [analysis.sections[-1].x_hi])


def _depth_axes(figure: Any, analysis: "Analysis", label: str) -> Any:
    axes = figure.add_subplot()
    axes.set(xlabel=DEPTH_LABEL, ylabel=label, xlim=np.asarray(analysis.network.box[0]) * MM)
    return axes


def _porosity_reduction(figure: Any, *, analysis: "Analysis") -> None:
    axes = _depth_axes(figure, analysis, "porosity reduction, intact − damaged (–)")
    profile, edges = analysis.profile, _section_edges(analysis)
    lost = np.subtract(profile.porosity_initial, profile.porosity_damaged)
    axes.stairs(
        lost, np.asarray(profile.edges) * MM, fill=True, color=BLUE, alpha=0.3, label="bins"
    )
    _stairs(
        axes,
        edges,
        [s.porosity_initial - s.porosity_damaged for s in analysis.sections],
        color=BLUE,
        label="sections",
    )
    axes.axhline(0, color=GREY, linewidth=0.8)
    legend_above(axes)


def _invaded_fraction(figure: Any, *, analysis: "Analysis") -> None:
    edges = np.asarray(analysis.profile.edges)
    width = np.diff(edges).mean() * MM
    axes = _depth_axes(figure, analysis, f"share of invaded fines per {width:.3g} mm (–)")
    axes.stairs(
        analysis.profile.fines_fraction,
        edges * MM,
        fill=True,
        color=ORANGE,
        alpha=0.6,
        label=f"{analysis.invaded_count} invaded fines",
    )
    if analysis.invaded_count:
        axes.axvline(
            analysis.invasion_depth_p95 * MM,
            color="black",
            linestyle="--",
            linewidth=1.3,
            label=f"95 % shallower than {analysis.invasion_depth_p95 * MM:.2f} mm",
        )
        axes.axvline(
            analysis.invasion_depth * MM,
            color="black",
            linestyle=":",
            linewidth=1.3,
            label=f"deepest {analysis.invasion_depth * MM:.2f} mm",
        )
    axes.set_ylim(bottom=0)
    legend_above(axes)


def _ratios(damaged: Sequence[float], initial: Sequence[float]) -> Array:
    """Damaged over initial, NaN where there is no intact permeability to compare with."""
    below = np.asarray(initial, float)
    return np.divide(
        np.asarray(damaged, float), below, out=np.full(len(below), np.nan), where=below > 0
    )


def _permeability_ratio(figure: Any, *, analysis: "Analysis") -> None:
    axes = _depth_axes(figure, analysis, "permeability damaged / intact, k/k₀ (–)")
    edges, sections = _section_edges(analysis), analysis.sections
    cut_out = _ratios([s.k_damaged for s in sections], [s.k_initial for s in sections])
    in_place = _ratios(
        [s.k_damaged_inplace for s in sections], [s.k_initial_inplace for s in sections]
    )
    _stairs(axes, edges, cut_out, color=BLUE, label="section cut out")
    _stairs(axes, edges, in_place, color=ORANGE, linestyle="--", label="section in place")
    if analysis.k_initial > 0:
        whole = analysis.k_damaged / analysis.k_initial
        axes.axhline(
            whole, color=GREY, linewidth=1.2, linestyle=":", label=f"whole specimen {whole:.3f}"
        )
    highest = np.nanmax([1.0, *cut_out, *in_place])
    axes.set_ylim(0, 1.05 * highest)
    legend_above(axes)


def _layers(figure: Any, *, layers: "Layers") -> None:
    above, below = figure.subplots(2, 1, sharex=True)
    for axes, before, after, label in (
        (above, *_in_millidarcy(layers), "k of the layer (mD)"),
        (below, 100 * layers.drop_initial, 100 * layers.drop_damaged, "pressure drop (%)"),
    ):
        _stairs(axes, layers.edges, before, color=GREY, label="intact")
        _stairs(axes, layers.edges, after, color=BLUE, label="damaged")
        axes.set(ylabel=label, xlim=np.asarray(layers.edges[[0, -1]]) * MM)
    if np.any(layers.k_damaged > 0):
        above.set_yscale("log")
        plain_decades(above)
    below.set_ylim(bottom=0)
    below.set_xlabel(DEPTH_LABEL)
    legend_above(above)


def _in_millidarcy(layers: "Layers") -> tuple[Array, Array]:
    return np.asarray(layers.k_initial) / MILLIDARCY, np.asarray(layers.k_damaged) / MILLIDARCY


def _size_distributions(figure: Any, *, analysis: "Analysis", fines: Snapshot | None) -> None:
    network = analysis.network
    left, right = figure.subplots(1, 2)
    for axes, radius, corners, name, colour in (
        (left, network.throat_radius, network.throat_images, "throat", BLUE),
        (right, network.pore_radius, network.pore_images, "pore", GREEN),
    ):
        between = between_grains(network, corners)
        radius = np.asarray(radius)[between if between.any() else ...]
        open_ones = radius[radius > 0] * MICRON
        closed = len(radius) - len(open_ones)
        label = f"{len(radius)} {name}s" + (
            f",\n{closed} of them closed\n(not drawn)" if closed else ""
        )
        if len(open_ones):
            weights = np.full(len(open_ones), 1 / len(radius))
            axes.hist(open_ones, bins=30, weights=weights, color=colour, alpha=0.7, label=label)
        if fines is not None and len(fines):
            _mark_fines(axes, fines)
        axes.set(xlabel=f"{name} radius, inscribed (µm)", ylabel=f"share of {name}s per bin (–)")
        axes.set_xlim(left=0)
        legend_above(axes, columns=1)


def _mark_fines(axes: Any, fines: Snapshot) -> None:
    """The range of the fines' radii as a band, or one radius as a line."""
    low, high = np.quantile(fines.radius, [0, 1]) * MICRON
    if high - low > 0.02 * high:
        label = f"fines, {low:.3g} to {high:.3g} µm"
        axes.axvspan(low, high, color=ORANGE, alpha=0.25, linewidth=1, label=label)
    else:
        axes.axvline(high, color=ORANGE, linewidth=2.5, label=f"fines, {high:.3g} µm")
