"""The figures of a run: SVG files; depth is x, from the formation face."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.files import replacing
from fdnet.names import FLOW_LAW
from fdnet.report.tables import MILLIDARCY, between_grains, blocked_throats
from fdnet.sizes import SizeCurve
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.mechanics.triaxial import LoadStep
    from fdnet.network.flow.sections import Layers
    from fdnet.network.permeability import Analysis

MM, MICRON = 1e3, 1e6
BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#7F7F7F"
PALETTE = (BLUE, ORANGE, GREEN, "#CC79A7", "#56B4E9", "#E69F00", "#5A5A5A", "#8C564B")
"""Colours of Okabe and Ito (2008), which colour-blind readers can tell apart."""
DEPTH_LABEL = "depth from the formation face (mm)"
MOST_SHAPES = 3000
"""Lines or circles of a figure, above which they are drawn as dots to keep the file small."""
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
    "font.sans-serif": ["DejaVu Sans", "Verdana"],
    "svg.fonttype": "none",
    "svg.hashsalt": "fdnet",
}


def draw(path: Path, fill: Callable[[Any], None]) -> Path:
    """Save a figure that `fill` draws into, whole or not at all: .svg, the same bytes each time,
    or .png. It has no state of pyplot's."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    dated: dict[str, Any] = {"metadata": {"Date": None}} if path.suffix == ".svg" else {}
    with rc_context(STYLE), replacing(path) as part:
        figure = Figure(figsize=(7.2, 4.4), dpi=130, layout="constrained")
        fill(figure)
        figure.savefig(part, **dated)
    return path


def shown(fill: Callable[[Any], Any]) -> Any:
    """A figure of pyplot that `fill` draws into, for notebooks and `plt.show()`; its axes (N,)."""
    from matplotlib import pyplot, rc_context

    with rc_context(STYLE):
        figure = pyplot.figure(layout="constrained")
        fill(figure)
    return np.array(figure.axes)


def stairs(axes: Any, edges: Any, values: Any, **style: Any) -> None:
    """Steps of `values` (N,) between `edges` (N+1,) m, drawn over mm; None and NaN are gaps."""
    drawn = {"linewidth": 2.0, "baseline": None} | style
    axes.stairs(np.asarray(values, float), np.asarray(edges, float) * MM, **drawn)


def legend_above(axes: Any, columns: int = 4) -> None:
    """A legend above the axes, where it can cover no line; none without entries."""
    place: Any = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
    if axes.get_legend_handles_labels()[0]:
        axes.legend(ncols=columns, frameon=False, fontsize=9, **place)


def fill_depth(figure: Any, *, analysis: "Analysis") -> None:
    """Two axes: permeability of the sections (mD, in place, with the thin layers) and porosity."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.3, 1])
    layers, profile, slabs = analysis.layers, analysis.profile, analysis.sections
    edges = [*(slab.x_lo for slab in slabs), slabs[-1].x_hi]
    states = [("intact", "initial", GREY), ("damaged", "damaged", BLUE)]
    states = states if analysis.occupancy is not None else states[:1]
    for label, state, colour in states:
        k = np.array([getattr(slab, f"k_{state}_inplace") for slab in slabs]) / MILLIDARCY
        stairs(above, edges, k, color=colour, label=f"{label}, sections")
        porosity = getattr(profile, f"porosity_{state}")
        mean = f"{label}, mean {getattr(analysis, f'porosity_{state}'):.4f}"
        stairs(below, profile.edges, porosity, color=colour, label=mean)
    if layers is not None:
        for label, state, colour in (("intact", "initial", GREY), ("damaged", "damaged", BLUE)):
            thin = {"color": colour, "label": f"{label}, layers", "linewidth": 1.0, "alpha": 0.8}
            stairs(above, layers.edges, getattr(layers, f"k_{state}") / MILLIDARCY, **thin)
        if np.all(np.asarray(layers.k_damaged) > 0):
            plain_decades(above)
    if above.get_yscale() == "linear":
        above.set_ylim(bottom=0)
        above.yaxis.set_major_formatter("{x:,.10g}")
    above.set_ylabel("permeability in place (mD)")
    below.set(ylabel="porosity (–)", ylim=(0, None))
    for axes in (above, below):
        legend_above(axes, columns=2)
    below.set(xlabel=DEPTH_LABEL, xlim=np.asarray(analysis.network.box[0]) * MM)
    figure.set_size_inches(7.2, 6.0)


def plain_decades(axes: Any) -> None:
    """A logarithmic axis with ticks as 1,000 and not 10^3, more where there are few decades."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set_yscale("log")
    low, high = axes.get_ylim()
    steps = (1, 2, 5) if high < 300 * low else (1,)
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter("{x:,.10g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


# ---- Where fines of each size lie: their volume against depth, in classes of size.
CLASSES, BINS = 3, 24
COLOURS = ("#56B4E9", "#E69F00", "#D55E00")
ONE_SIZE = 0.02  # Spread of radii over the largest, below which fines count as of one size


def fill_deposit(figure: Any, *, fines: Snapshot) -> None:
    """Volume of the fines inside by depth, stacked in classes of size that hold equal volume."""
    axes = figure.add_subplot()
    volume, order = 4 / 3 * np.pi * fines.radius**3, np.argsort(fines.radius)
    finer = np.empty(len(fines))
    finer[order] = np.cumsum(volume[order]) / volume.sum()
    number = np.minimum((finer * CLASSES * (1 - 1e-12)).astype(int), CLASSES - 1)
    edges = np.linspace(fines.box[0, 0], fines.box[0, 1], BINS + 1)
    base, width = np.zeros(BINS), float(np.diff(edges)[0])
    for index in np.unique(number):
        own = number == index
        height = np.histogram(fines.position[own, 0], edges, weights=volume[own])[0]
        height = height / volume.sum() * 100
        sizes = 2 * fines.radius[own] * MICRON
        label = f"{sizes.min():.3g} to {sizes.max():.3g} µm ({own.sum()} fines)"
        style = {"align": "edge", "color": COLOURS[index], "label": label}
        axes.bar(edges[:-1] * MM, height, width * MM, base, **style)
        base += height
    axes.set_ylabel(f"share of the deposit by volume\nper {width * MM:.3g} mm (%)")
    axes.set(xlabel=DEPTH_LABEL, xlim=edges[[0, -1]] * MM)
    legend_above(axes, columns=2)


# ---- The invasion against time: counts of fines, and rate and permeability where they are known.
def fill_history(figure: Any, *, history: Sequence[Mapping[str, float]]) -> None:
    counts = (
        ("invaded_count", "inside the specimen", BLUE, "-"),
        ("passed_count", "passed the outlet", GREEN, "--"),
        ("upstream_count", "upstream of the face", ORANGE, ":"),
    )
    flow = (
        ("rate_over_initial", "rate of flow", BLUE, "-"),
        ("k_over_k0", f"permeability {FLOW_LAW}", ORANGE, "--"),
    )
    known = [curve for curve in flow if all(curve[0] in row for row in history)]
    panels = [(counts, "number of fines (–)"), *([(known, "over the first (–)")] if known else [])]
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    time = np.array([row["physical_time_s"] for row in history])
    scale, unit = (1.0, "s") if time.max() >= 1 else (1e3, "ms")
    for axes, (curves, title) in zip(rows, panels, strict=True):
        for name, label, colour, line in curves:
            values = [row[name] for row in history]
            axes.plot(time * scale, values, line, color=colour, label=label)
        axes.set(ylabel=title, ylim=(0, None))
        legend_above(axes)
    rows[-1].set_xlabel(f"time since the fines were released ({unit})")


# ------------------------------------------------------------------------------------------------
# The pore network from the side: pressure, flux, and what each throat lost of its conductance.


SLICE = 1.0  # Thickness of the slice that is drawn, in mean grain spacings
LEAST_FLUX = 1e-3  # Smallest flux of the scale of colours, over the largest one drawn


def fill_network(figure: Any, *, analysis: "Analysis") -> None:
    """Throats of a slice through the middle as lines in the x-z plane, by three quantities.

    The pressure is over that of the whole specimen, the flux absolute and over the largest one.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize

    network, box = analysis.network, np.asarray(analysis.network.box)
    all_ends = np.asarray(network.throat_ends)
    grains = max(len(np.unique(network.throat_grains)), 1)
    spacing = float(np.cbrt(np.prod(np.ptp(box, axis=1)) / grains))
    away = np.abs(all_ends[:, :, 1].mean(axis=1) - box[1].mean())
    clean, left = np.asarray([analysis.conductance_initial, analysis.conductance_damaged])
    index = np.flatnonzero((away <= 0.5 * SLICE * spacing) & (clean > 0))
    segments = all_ends[index][:, :, ::2] * MM
    pores = np.asarray(network.throat_pores)[index]
    ends = np.where(pores == -1, 1.0, 0.0)  # beyond the faces
    ends[pores >= 0] = np.asarray(analysis.flow_damaged.pore_pressure)[pores[pores >= 0]]
    flux = np.abs(np.asarray(analysis.flow_damaged.throat_flux))[index]
    share = np.clip(flux / (flux.max(initial=0.0) or 1.0), LEAST_FLUX, None)
    lost = 100 * (1.0 - left[index] / clean[index])
    losses = ["#D5D5D5", "#E69F00", "#D55E00", "#5A0A00"]
    dark = LinearSegmentedColormap.from_list("losses", losses)
    rows = figure.subplots(3, 1, sharex=True, sharey=True)
    for axes, value, label, scale, colours in (
        (rows[0], ends.mean(axis=1), "pressure (–)", Normalize(0, 1), "viridis"),
        (rows[1], share, "flux / largest (–)", LogNorm(LEAST_FLUX, 1), "magma_r"),
        (rows[2], lost, "conductance lost (%)", Normalize(0, 100), dark),
    ):
        order = np.argsort(np.nan_to_num(value, nan=-1.0))
        lines = LineCollection(list(segments[order]), cmap=colours, norm=scale, linewidths=1.6)
        lines.set_rasterized(len(index) > MOST_SHAPES)
        lines.set_array(np.ma.masked_invalid(value[order]))
        axes.add_collection(lines)
        figure.colorbar(lines, ax=axes, label=label, shrink=0.9, pad=0.01)
        axes.set_xlim(box[0] * MM + np.array([-0.02, 0.02]) * np.ptp(box[0] * MM))
        axes.set_ylim(box[2] * MM + np.array([-0.04, 0.04]) * np.ptp(box[2] * MM))
        axes.set(aspect="equal", ylabel="z (mm)")
        axes.grid(False)
        axes.axvline(box[0, 0] * MM, color=BLUE, linestyle="--", linewidth=1.2)
    middle = segments[blocked_throats(analysis)[index]].mean(axis=1)
    if len(middle):
        rows[2].plot(*middle.T, "kx", markersize=6, markeredgewidth=1.6)
    rows[2].set_title(f"x: {len(middle)} blocked throats of the slice", loc="right", fontsize=9)
    rows[2].set_xlabel(DEPTH_LABEL)
    height = 3 * 6.6 * float(np.ptp(box[2]) / np.ptp(box[0])) + 1.6
    figure.set_size_inches(9.0, min(14.0, max(5.0, height)))


# ---- The true cut through the specimen in the x-z plane of its middle.
GRAIN_FACE, GRAIN_EDGE = "#D9D9D9", "#8C8C8C"


def cut_circles(spheres: Snapshot, plane: float) -> tuple[Array, Array, Array]:
    """Index of the spheres (M,) that the plane y = `plane` m cuts, and the circles of the cuts:
    centre (M, 2) along x and z, m, and radius sqrt(r^2 - d^2) (M,), m, at distance d."""
    squared = spheres.radius**2 - (spheres.position[:, 1] - plane) ** 2
    index = np.flatnonzero(squared > 0)
    return index, spheres.position[index][:, ::2], np.sqrt(squared[index])


def fill_side_view(figure: Any, *, snapshot: Snapshot) -> None:
    """Grains (grey) cut at mid-width, and the fines (by radius) that the plane meets, whole."""
    axes, plane = figure.add_subplot(), float(snapshot.box[1].mean())
    grains, fines = snapshot.grains(), snapshot.fines()
    index, centre, radius = cut_circles(grains, plane)
    _circles(axes, centre, radius, facecolor=GRAIN_FACE, edgecolor=GRAIN_EDGE, linewidth=0.5)
    index, centre, _ = cut_circles(fines, plane)
    edge = {"edgecolor": "black", "linewidth": 0.3}
    if len(fines) and _one_size(fines.radius):
        _circles(axes, centre, fines.radius[index], facecolor=ORANGE, **edge)
        label = f"fines, radius {fines.radius.max() * MICRON:.3g} µm"
        axes.plot([], [], "o", color=ORANGE, label=label)
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), fontsize=9, frameon=False)
    elif len(fines):
        circles = _circles(axes, centre, fines.radius[index], cmap="plasma", **edge)
        circles.set_array(fines.radius[index] * MICRON)
        circles.set_clim(fines.radius.min() * MICRON, fines.radius.max() * MICRON)
        figure.colorbar(circles, ax=axes, label="radius of the fine (µm)", shrink=0.8)
    _side_frame(figure, axes, snapshot)
    said = "no grains"
    if len(grains):  # so that those that are cut off their middle mislead nobody
        low, high = grains.radius.min() * MICRON, grains.radius.max() * MICRON
        said = f"grains of {low:.3g} to {high:.3g} µm radius, cut by the plane"
        if _one_size(grains.radius):
            said = f"all grains have a radius of {high:.3g} µm, some are cut off their middle"
    title = f"section at y = {plane * MM:.3g} mm: {said}"
    axes.set_title(title, fontsize=10, loc="left", pad=22)


def _one_size(radius: Array) -> bool:
    return float(np.ptp(radius)) < ONE_SIZE * float(radius.max())


def _circles(axes: Any, centre: Array, radius: Array, **style: Any) -> Any:
    from matplotlib.collections import EllipseCollection

    width = 2 * radius * MM
    place = {"offsets": centre * MM, "offset_transform": axes.transData}
    circles = EllipseCollection(width, width, np.zeros(len(radius)), units="xy", **place, **style)
    circles.set_rasterized(len(radius) > MOST_SHAPES)
    axes.add_collection(circles)
    return circles


def _side_frame(figure: Any, axes: Any, snapshot: Snapshot) -> None:
    (x_lo, x_hi), _, (z_lo, z_hi) = np.asarray(snapshot.box) * MM
    margin = 0.02 * (x_hi - x_lo)
    reach = (snapshot.position - snapshot.radius[:, None]).min(axis=0, initial=np.inf) * MM
    overhang = snapshot.grains().radius.max(initial=0.0) * MM
    start = max(min(x_lo, float(reach[0])), x_lo - 0.35 * (x_hi - x_lo)) - margin
    axes.plot([x_lo, x_hi, x_hi, x_lo], [z_lo, z_lo, z_hi, z_hi], color="black", linewidth=1)
    axes.axvline(x_lo, color=BLUE, linestyle="--", linewidth=1.6)
    above = axes.get_xaxis_transform()
    axes.text(x_lo, 1.01, "formation face", transform=above, color=BLUE, fontsize=9)
    axes.set(xlim=(start, x_hi + overhang), ylim=(z_lo - overhang, z_hi + overhang))
    axes.set(aspect="equal", xlabel=f"x, {DEPTH_LABEL}", ylabel="z (mm)")
    axes.grid(False)
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    figure.set_size_inches(9.0, min(9.0, max(3.0, 7.2 * height / width + 1.9)))


# ---- The curves of sizes: asked for, placed, and of the fines that invaded.
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedSizes:
    """Grains or fines of measured sizes: the law and the curve of the case, and diameters, m.

    Those `asked` are by the share that is finer; then come those that were `placed` (N,) and, of
    fines, those that lie in the specimen at the end (M,).
    """

    name: str
    law: str
    asked: Mapping[float, float]
    curve: SizeCurve
    placed: Array
    invaded: Array | None = None


def fill_size_curves(figure: Any, *, sizes: Sequence[PlacedSizes]) -> None:
    """Share finer by volume, in percent, over the diameter on a logarithmic axis."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes = figure.add_subplot()
    for one in sizes:
        colour, curve = (GREY if one.name == "grains" else ORANGE), one.curve
        whole = 100 * (curve.below + curve.kept * curve.finer())
        axes.plot(MICRON * curve.edges, whole, color=colour, alpha=0.5, label=f"{one.name}, asked")
        if one.asked:
            shares, diameters = np.array([*one.asked]), np.array([*one.asked.values()])
            axes.plot(MICRON * diameters, 100 * shares, "o", color=colour, label="given points")
        label = f"{len(one.placed)} {one.name} placed"
        _size_steps(axes, one.placed, curve, color=colour, label=label)
        if one.invaded is not None and len(one.invaded):
            label = f"{len(one.invaded)} of them invaded"
            _size_steps(axes, one.invaded, curve, color=BLUE, linestyle="--", label=label)
    axes.set_xscale("log")
    axes.set(xlabel="diameter (µm)", ylabel="finer by volume (%)", ylim=(0, 100))
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_locator(NullLocator())
    legend_above(axes, columns=3)


def _size_steps(axes: Any, diameter: Array, curve: SizeCurve, **style: Any) -> None:
    """Steps of some spheres, from the share that is left out below to that above."""
    rising = np.sort(diameter)
    finer = curve.below + curve.kept * np.cumsum(rising**3) / np.sum(rising**3)
    seen = np.linspace(0, len(rising) - 1, min(len(rising), 300)).astype(int)
    axes.step(MICRON * rising[seen], 100 * finer[seen], where="post", linewidth=1.3, **style)


# ---- All figures of one specimen, and those against depth.
CAPTIONS = {
    "spheres_3d": "The specimen from the front and upstream: the grains of the far half (grey) "
    "and the fines, coloured by radius, or by depth where they are of one size. The fluid enters "
    "at x = 0.",
    "side_view": "Section x-z through the middle of the specimen. Grains are drawn where the "
    "plane cuts them, so that a grain cut off its middle looks small; fines that the plane meets "
    "are drawn whole.",
    "invaded_fraction": "Share of the invaded fines, by number, against depth.",
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
    sizes: Sequence[PlacedSizes] = (),
) -> list[Path]:
    """Draw every figure that has data into `folder`; return the paths in the order of the report.

    `snapshot` is what the side view shows, the damaged specimen or the grains alone. `history`
    rows are those of history.csv. `CAPTIONS` explains each figure under the stem of its file.
    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    fines = None if snapshot is None else snapshot.fines()
    draws: dict[str, Callable[[Any], None]] = {"depth": partial(fill_depth, analysis=analysis)}
    if snapshot is not None:
        draws["side_view"] = partial(fill_side_view, snapshot=snapshot)
    if snapshot is not None and fines is not None:
        x, (low, high) = fines.position[:, 0], snapshot.box[0]
        inside = fines.where((x >= low) & (x < high))
        if len(inside) and not _one_size(inside.radius):
            draws["deposit_by_size"] = partial(fill_deposit, fines=inside)
    if analysis.occupancy is not None:
        draws["invaded_fraction"] = partial(_invaded_fraction, analysis=analysis)
    if analysis.layers is not None:
        draws["layers"] = partial(_layers, layers=analysis.layers)
    draws["network"] = partial(fill_network, analysis=analysis)
    draws["size_distributions"] = partial(_size_distributions, analysis=analysis, fines=fines)
    if sizes:
        draws["size_curves"] = partial(fill_size_curves, sizes=sizes)
    if history:
        draws["invasion_history"] = partial(fill_history, history=history)
    return [draw(target / f"{name}.svg", fill) for name, fill in draws.items()]


def _invaded_fraction(figure: Any, *, analysis: "Analysis") -> None:
    axes, edges = figure.add_subplot(), np.asarray(analysis.profile.edges)
    label = f"{analysis.invaded_count} invaded fines"
    filled = {"fill": True, "alpha": 0.6, "linewidth": None, "baseline": 0}
    stairs(axes, edges, analysis.profile.fines_fraction, color=ORANGE, label=label, **filled)
    if analysis.invaded_count:
        p95, deepest = analysis.invasion_depth_p95 * MM, analysis.invasion_depth * MM
        for depth, line, said in (
            (p95, "--", f"95 % shallower than {p95:.2f} mm"),
            (deepest, ":", f"deepest {deepest:.2f} mm"),
        ):
            axes.axvline(depth, color="black", linestyle=line, linewidth=1.3, label=said)
    width = np.diff(edges).mean() * MM
    axes.set(ylabel=f"share of invaded fines per {width:.3g} mm (–)", ylim=(0, None))
    axes.set(xlabel=DEPTH_LABEL, xlim=np.asarray(analysis.network.box[0]) * MM)
    legend_above(axes)


def _layers(figure: Any, *, layers: "Layers") -> None:
    above, below = figure.subplots(2, 1, sharex=True)
    k = layers.k_initial / MILLIDARCY, layers.k_damaged / MILLIDARCY
    for axes, before, after, label in (
        (above, *k, "k of the layer (mD)"),
        (below, 100 * layers.drop_initial, 100 * layers.drop_damaged, "pressure drop (%)"),
    ):
        stairs(axes, layers.edges, before, color=GREY, label="intact")
        stairs(axes, layers.edges, after, color=BLUE, label="damaged")
        axes.set(ylabel=label, xlim=np.asarray(layers.edges[[0, -1]]) * MM)
    if np.any(layers.k_damaged > 0):
        plain_decades(above)
    below.set(ylim=(0, None), xlabel=DEPTH_LABEL)
    legend_above(above)


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
        if fines is not None and len(fines):  # their range as a band, or one radius as a line
            low, high = np.quantile(fines.radius, [0, 1]) * MICRON
            if _one_size(fines.radius):
                axes.axvline(high, color=ORANGE, linewidth=2.5, label=f"fines, {high:.3g} µm")
            else:
                band = {"color": ORANGE, "alpha": 0.25, "linewidth": 1}
                axes.axvspan(low, high, label=f"fines, {low:.3g} to {high:.3g} µm", **band)
        axes.set(xlabel=f"{name} radius, inscribed (µm)", ylabel=f"share of {name}s per bin (–)")
        axes.set_xlim(left=0)
        legend_above(axes, columns=1)


# ---- A result that only some runs have: its table, its figure, its part of the summary and page.
@dataclass(frozen=True, slots=True, kw_only=True)
class PageTable:
    """A table of the page report.html: heading, columns, rows (SI) and what a reader must know.

    A column has key, heading, unit, and factor to that unit (None: as it is).
    """

    title: str
    columns: Sequence[tuple[str, str, str, float | None]]
    rows: Sequence[Mapping[str, Any]]
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Added:
    """One added result: the stem of its files, its rows (SI, of a CSV file where there are any),
    its keys in summary.json, what draws its figure, and its table in the page."""

    name: str
    rows: Sequence[Mapping[str, Any]] = ()
    summary: Mapping[str, Any] = field(default_factory=dict)
    fill: Callable[[Any], None] | None = None
    caption: str = ""
    page: PageTable | None = None


# ---- Figures of what happens at the formation face: clean-up, cake, filtrate, bridging.
def fill_clean_up(
    figure: Any,
    *,
    rows: Sequence[Mapping[str, Any]],
    depths: tuple[Array, Array],
    whole: tuple[float | None, float | None],
) -> None:
    """Permeability of each section after the invasion and after the clean-up; fines by depth.

    `depths` are those of all fines before and of those that stayed, m; `whole` is k/k0 of the
    specimen after the invasion and after the clean-up.
    """
    above, below = figure.subplots(2, 1, sharex=True)
    edges = np.array([row["x_lo_m"] for row in rows] + [rows[-1]["x_hi_m"]])
    for key, share, colour, line, name in (
        ("damaged_k_over_k0", whole[0], ORANGE, "--", "after the invasion"),
        ("return_k_over_k0", whole[1], BLUE, "-", "after the clean-up"),
    ):
        label = name if share is None else f"{name}, whole {share:.3f}"
        stairs(above, edges, [row[key] for row in rows], color=colour, linestyle=line, label=label)
    above.axhline(1.0, color=GREY, linewidth=0.8)
    above.set(ylabel="k / intact k (–)", ylim=(0, None))
    bins = np.linspace(MM * edges[0], MM * edges[-1], 41)
    for depth, colour, name in zip(depths, (ORANGE, BLUE), ("before", "stayed"), strict=True):
        label = f"{name}: {len(depth)}"
        below.hist(MM * depth, bins=bins, color=colour, alpha=0.6, label=label)
    below.set(xlabel=DEPTH_LABEL, ylabel="fines (–)", xlim=MM * edges[[0, -1]])
    legend_above(above)
    legend_above(below)


def fill_cake(figure: Any, *, rows: Sequence[Mapping[str, Any]]) -> None:
    """Porosity and permeability of the slices of the cake, against the distance from the face."""
    above, below = figure.subplots(2, 1, sharex=True)
    edges = np.array([-row["x_hi_m"] for row in rows] + [-rows[-1]["x_lo_m"]])
    stairs(above, edges, [row["porosity"] for row in rows], color=BLUE)
    above.set(ylabel="porosity (–)", ylim=(0, 1))
    k = np.array([row["k_m2"] for row in rows], float) / MILLIDARCY
    stairs(below, edges, k, color=BLUE)
    plain_decades(below)
    below.set(
        ylabel="permeability (mD)", xlabel="distance from the face (mm)", xlim=(0, MM * edges[-1])
    )


def fill_filtrate(figure: Any, *, time: Array, volume: Array) -> None:
    """Filtrate per area, m, against the root of time, s."""
    axes = figure.add_subplot()
    axes.plot(np.sqrt(time), MM * volume, color=BLUE)
    axes.set(xlabel="root of the time of the fluid (s$^{1/2}$)", ylabel="filtrate per area (mm)")
    axes.set(xlim=(0, None), ylim=(0, None))


def fill_bridging(figure: Any, *, rows: Sequence[Mapping[str, Any]]) -> None:
    """Share of closed throats by the ratio of diameters, with its band."""
    axes, place = figure.add_subplot(), np.arange(len(rows))
    keys = ("share_closed", "share_low", "share_high")
    share, low, high = (np.array([row[key] for row in rows]) for key in keys)
    axes.bar(place, share, color=BLUE, alpha=0.7)
    axes.errorbar(place, share, [share - low, high - share], fmt="none", color="black", capsize=3)
    labels = []
    for row in rows:
        low, high = row["ratio_lo"], row["ratio_hi"]
        labels.append(f"{low:g} to {high:g}" if high else f"> {low:g}")
        labels[-1] += f"\n({row['throats']})"
    axes.set_xticks(place, labels, fontsize=9)
    axes.set_xlabel("diameter of the fines over that of the throat (number of throats)")
    axes.set(ylabel="share of the throats that is closed (–)", ylim=(0, 1))


# ---- The stress-strain curve of a triaxial test, as a figure.
def draw_stress_strain(rows: Sequence["LoadStep"], path: Path, *, bonds: int) -> None:
    """Deviatoric stress and volume strain over axial strain; broken bonds where there are any."""
    draw(path, partial(_stress_strain, rows=rows, bonds=bonds))


def _stress_strain(figure: Any, *, rows: Sequence["LoadStep"], bonds: int) -> None:
    panels = 3 if bonds else 2
    figure.set_size_inches(6.4, 2.6 * panels)
    strain = [100 * row.axial_strain for row in rows]
    axes = figure.subplots(panels, 1, sharex=True)
    axes[0].plot(strain, [1e-6 * row.deviatoric for row in rows], color=BLUE, marker=".")
    axes[0].set_ylabel("deviatoric stress (MPa)")
    axes[1].plot(strain, [100 * row.volume_strain for row in rows], color=GREEN, marker=".")
    axes[1].set_ylabel("volume strain (%),\ncompression above 0")
    if bonds:
        axes[2].plot(strain, [row.tension for row in rows], color=ORANGE, label="in tension")
        axes[2].plot(strain, [row.shear for row in rows], color=BLUE, label="in shear")
        axes[2].set_ylabel(f"bonds broken, of {bonds}")
        axes[2].legend()
    axes[-1].set_xlabel("axial strain (%)")
