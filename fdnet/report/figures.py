"""The figures of a run.

Permeability and porosity against depth, the intact sand next to the damaged one.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from fdnet.files import replacing
from fdnet.report.tables import MILLIDARCY, between_grains, blocked_throats, write_rows
from fdnet.sizes import SizeCurve
from fdnet.spheres.snapshot import Array, Snapshot

if TYPE_CHECKING:
    from fdnet.network.flow.sections import Layers
    from fdnet.network.permeability import Analysis

MM = 1e3
INTACT, DAMAGED = "#7F7F7F", "#0072B2"
DEPTH_LABEL = "depth from the formation face (mm)"


def legend_above(axes: Any, columns: int = 4) -> None:
    """A legend above the axes, where it can cover no line; none without entries."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns,
            frameon=False,
            borderaxespad=0.2,
            fontsize=9,
        )


def fill_depth(figure: Any, *, analysis: "Analysis") -> None:
    """Two axes: permeability of the sections (mD, in place, with the thin layers) and porosity."""
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.3, 1])
    _permeability(above, analysis)
    _porosity(below, analysis)
    below.set(xlabel=DEPTH_LABEL, xlim=np.asarray(analysis.network.box[0]) * MM)
    figure.set_size_inches(7.2, 6.0)


def _permeability(axes: Any, analysis: "Analysis") -> None:
    sections = analysis.sections
    edges = [s.x_lo for s in sections] + [sections[-1].x_hi]
    pairs = [("intact", "k_initial_inplace", INTACT)]
    if analysis.occupancy is not None:
        pairs.append(("damaged", "k_damaged_inplace", DAMAGED))
    for label, name, colour in pairs:
        values = np.array([getattr(s, name) for s in sections]) / MILLIDARCY
        _depth_steps(axes, edges, values, color=colour, label=f"{label}, sections")
    layers = analysis.layers
    if layers is not None:
        thin = {"linewidth": 1.0, "alpha": 0.8}
        for label, k, colour in (
            ("intact", layers.k_initial, INTACT),
            ("damaged", layers.k_damaged, DAMAGED),
        ):
            values = np.asarray(k) / MILLIDARCY
            _depth_steps(
                axes, layers.edges, values, color=colour, label=f"{label}, layers", **thin
            )
        if np.all(np.asarray(layers.k_damaged) > 0):
            axes.set_yscale("log")
            plain_decades(axes)
    if axes.get_yscale() == "linear":
        axes.set_ylim(bottom=0)
        axes.yaxis.set_major_formatter("{x:,.10g}")
    axes.set_ylabel("permeability in place (mD)")
    legend_above(axes)


def plain_decades(axes: Any) -> None:
    """Ticks as 1,000 and not 10^3, with those between where there are few decades."""
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = axes.get_ylim()
    steps = (1, 2, 5) if high < 300 * low else (1,)
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter("{x:,.10g}")
    axes.yaxis.set_minor_formatter(NullFormatter())


def _porosity(axes: Any, analysis: "Analysis") -> None:
    profile = analysis.profile
    mean = f"intact, mean {analysis.porosity_initial:.4f}"
    _depth_steps(axes, profile.edges, profile.porosity_initial, color=INTACT, label=mean)
    if analysis.occupancy is not None:
        mean = f"damaged, mean {analysis.porosity_damaged:.4f}"
        _depth_steps(axes, profile.edges, profile.porosity_damaged, color=DAMAGED, label=mean)
    axes.set(ylabel="porosity (–)", ylim=(0, None))
    legend_above(axes)


def _depth_steps(axes: Any, edges: Any, values: Array, **style: Any) -> None:
    drawn = {"linewidth": 2.0, "baseline": None} | style
    axes.stairs(np.asarray(values, float), np.asarray(edges, float) * MM, **drawn)


# ------------------------------------------------------------------------------------------------
# Where fines of each size lie: their volume against depth, in classes of size.


MM, MICRON = 1e3, 1e6
CLASSES, BINS = 3, 24
COLOURS = ("#56B4E9", "#E69F00", "#D55E00")
ONE_SIZE = 0.02
"""Spread of radii over the largest, below which fines count as of one size."""


def has_sizes(spheres: Snapshot) -> bool:
    """Whether fines of clearly different sizes lie in the specimen."""
    radius = _inside(spheres).radius
    return len(radius) > 1 and float(np.ptp(radius)) > ONE_SIZE * float(radius.max())


def fill_deposit(figure: Any, *, spheres: Snapshot) -> None:
    """Volume of the fines inside by depth, stacked in classes of size that hold equal volume."""
    axes, fines = figure.add_subplot(), _inside(spheres)
    volume = 4 / 3 * np.pi * fines.radius**3
    order = np.argsort(fines.radius)
    finer = np.empty(len(fines))
    finer[order] = np.cumsum(volume[order]) / volume.sum()
    number = np.minimum((finer * CLASSES * (1 - 1e-12)).astype(int), CLASSES - 1)
    low, high = spheres.box[0]
    edges = np.linspace(low, high, BINS + 1)
    base, width = np.zeros(BINS), float(np.diff(edges)[0])
    for index in range(CLASSES):
        own = number == index
        if not own.any():
            continue
        height = np.histogram(fines.position[own, 0], edges, weights=volume[own])[0]
        height = height / volume.sum() * 100
        sizes = 2 * fines.radius[own] * MICRON
        label = f"{sizes.min():.3g} to {sizes.max():.3g} µm ({own.sum()} fines)"
        axes.bar(
            edges[:-1] * MM,
            height,
            width * MM,
            base,
            align="edge",
            color=COLOURS[index],
            label=label,
        )
        base += height
    axes.set(
        xlabel=DEPTH_LABEL,
        ylabel=f"share of the deposit by volume\nper {width * MM:.3g} mm (%)",
        xlim=(low * MM, high * MM),
    )
    legend_above(axes, columns=2)


def _inside(spheres: Snapshot) -> Snapshot:
    fines = spheres.fines()
    low, high = spheres.box[0]
    return fines.where((fines.position[:, 0] >= low) & (fines.position[:, 0] < high))


# ------------------------------------------------------------------------------------------------
# The invasion against time: counts of fines, and rate and permeability where they are known.


BLUE, ORANGE, GREEN, GREY = "#0072B2", "#D55E00", "#009E73", "#7F7F7F"
FLOW_CURVES = (
    ("rate_over_initial", "rate of flow", BLUE, "-"),
    ("k_over_k0", "permeability of the specimen", ORANGE, "--"),
)
"""Columns of history.csv of a flow that follows the deposit, with label, colour and line."""


def fill_history(figure: Any, *, history: Sequence[Mapping[str, float]]) -> None:
    """Counts of fines against time, and under them rate and permeability where they are known."""
    flow = [name for name, *_ in FLOW_CURVES if all(name in row for row in history)]
    rows = figure.subplots(1 + bool(flow), 1, sharex=True, squeeze=False)[:, 0]
    time = np.array([row["physical_time_s"] for row in history])
    scale, unit = (1.0, "s") if time.max() >= 1 else (1e3, "ms")
    for name, label, colour, line in (
        ("invaded_count", "inside the specimen", BLUE, "-"),
        ("passed_count", "passed the outlet", GREEN, "--"),
        ("upstream_count", "upstream of the face", ORANGE, ":"),
    ):
        rows[0].plot(time * scale, [row[name] for row in history], line, color=colour, label=label)
    rows[0].set(ylabel="number of fines (–)", ylim=(0, None))
    for name, label, colour, line in FLOW_CURVES:
        if name in flow:
            values = [row[name] for row in history]
            rows[-1].plot(time * scale, values, line, color=colour, label=label)
            rows[-1].set(ylabel="over the first (–)", ylim=(0, None))
    rows[-1].set_xlabel(f"time since the fines were released ({unit})")
    for axes in rows:
        legend_above(axes)


# ------------------------------------------------------------------------------------------------
# The pore network from the side: pressure, flux, and what each throat lost of its conductance.


SLICE = 1.0
"""Thickness of the slice that is drawn, in mean grain spacings."""
LEAST_FLUX = 1e-3
"""Smallest flux of the scale of colours, over the largest one drawn."""


def fill_network(figure: Any, *, analysis: "Analysis") -> None:
    """Throats of a slice through the middle as lines in the x-z plane, by three quantities.

    The pressure is over that of the whole specimen, the flux absolute and over the largest one.
    Blocked throats are marked in the last axes.
    """
    network = analysis.network
    index = _slice(analysis)
    segments = np.asarray(network.throat_ends)[index][:, :, ::2] * MM
    flux = np.abs(np.asarray(analysis.flow_damaged.throat_flux))[index]
    clean = np.asarray(analysis.conductance_initial)[index]
    damaged = np.asarray(analysis.conductance_damaged)[index]
    lost = 1.0 - np.divide(damaged, clean, out=np.ones(len(index)), where=clean > 0)
    most = flux.max(initial=0.0) or 1.0
    rows = figure.subplots(3, 1, sharex=True, sharey=True)
    _lines(
        figure, rows[0], segments, _pressure(analysis, index), "pressure (–)", (0, 1), "viridis"
    )
    share = np.clip(flux / most, LEAST_FLUX, None)
    _lines(figure, rows[1], segments, share, "flux / largest (–)", (LEAST_FLUX, 1), "magma_r")
    _lines(figure, rows[2], segments, 100 * lost, "conductance lost (%)", (0, 100), _losses())
    _blocked(rows[2], segments, blocked_throats(analysis)[index])
    _frame(figure, rows, analysis)


def _slice(analysis: "Analysis") -> Array:
    """Indices of the throats whose middle lies in the slice and that conduct when clean."""
    ends = np.asarray(analysis.network.throat_ends)
    (low, high), box = analysis.network.box[1], np.asarray(analysis.network.box)
    grains = max(len(np.unique(analysis.network.throat_grains)), 1)
    spacing = float(np.cbrt(np.prod(np.ptp(box, axis=1)) / grains))
    away = np.abs(ends[:, :, 1].mean(axis=1) - 0.5 * (low + high))
    inside = away <= 0.5 * max(SLICE * spacing, 0.0)
    return np.flatnonzero(inside & (np.asarray(analysis.conductance_initial) > 0))


def _pressure(analysis: "Analysis", index: Array) -> Array:
    """Mean pressure of the two ends of each throat; 1 and 0 beyond the faces."""
    pores = np.asarray(analysis.network.throat_pores)[index]
    pressure = np.asarray(analysis.flow_damaged.pore_pressure)
    ends = np.where(pores == -1, 1.0, 0.0)
    ends[pores >= 0] = pressure[pores[pores >= 0]]
    return ends.mean(axis=1)


def _lines(
    figure: Any, axes: Any, segments: Array, value: Array, label: str, limits: Any, colours: Any
) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm, Normalize

    scale = LogNorm(*limits) if "flux" in label else Normalize(*limits)
    order = np.argsort(np.nan_to_num(value, nan=-1.0))
    lines = LineCollection(list(segments[order]), cmap=colours, norm=scale, linewidths=1.6)
    lines.set_array(np.ma.masked_invalid(value[order]))
    axes.add_collection(lines)
    figure.colorbar(lines, ax=axes, label=label, shrink=0.9, pad=0.01)


def _losses() -> Any:
    """Colours from light grey, where nothing is lost, to dark red."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(
        "losses", ["#D5D5D5", "#E69F00", "#D55E00", "#5A0A00"]
    )


def _blocked(axes: Any, segments: Array, blocked: Array) -> None:
    middle = segments[blocked].mean(axis=1)
    if len(middle):
        axes.plot(*middle.T, "kx", markersize=6, markeredgewidth=1.6)
    axes.set_title(f"x: {len(middle)} blocked throats of the slice", loc="right", fontsize=9)


def _frame(figure: Any, rows: Any, analysis: "Analysis") -> None:
    box = np.asarray(analysis.network.box) * MM
    for axes in rows:
        axes.set(
            xlim=box[0] + np.array([-0.02, 0.02]) * np.ptp(box[0]),
            ylim=box[2] + np.array([-0.04, 0.04]) * np.ptp(box[2]),
            aspect="equal",
            ylabel="z (mm)",
        )
        axes.grid(False)
        axes.axvline(box[0, 0], color="#0072B2", linestyle="--", linewidth=1.2)
    rows[2].set_xlabel("depth from the formation face (mm)")
    height = 3 * 6.6 * float(np.ptp(box[2]) / np.ptp(box[0])) + 1.6
    figure.set_size_inches(9.0, min(14.0, max(5.0, height)))


# ------------------------------------------------------------------------------------------------
# The true cut through the specimen in the x-z plane of its middle.


GRAIN_FACE, GRAIN_EDGE, FINE_FACE = "#D9D9D9", "#8C8C8C", "#D55E00"


def cut_circles(spheres: Snapshot, plane: float) -> tuple[Array, Array, Array]:
    """The circles in which the plane y = `plane` m cuts the spheres.

    Returns the index of the sphere (M,), the centre (M, 2) along x and z, m, and the radius (M,),
    m. A sphere of radius r at distance d < r from the plane is cut in a circle of radius
    sqrt(r^2 - d^2).
    """
    squared = spheres.radius**2 - (spheres.position[:, 1] - plane) ** 2
    index = np.flatnonzero(squared > 0)
    return index, spheres.position[index][:, ::2], np.sqrt(squared[index])


def fill_side_view(figure: Any, *, snapshot: Snapshot) -> None:
    """Draw grains (grey) cut at mid-width, and the fines (by radius) that the plane meets whole.

    All is to scale, and the formation face is marked.
    """
    axes = figure.add_subplot()
    plane = float(snapshot.box[1].mean())
    grains, fines = snapshot.grains(), snapshot.fines()
    _circles(axes, grains, plane, facecolor=GRAIN_FACE, edgecolor=GRAIN_EDGE, linewidth=0.5)
    _fines(figure, axes, fines, plane)
    _side_frame(figure, axes, snapshot)
    title = f"section at y = {plane * MM:.3g} mm: {_grain_words(grains)}"
    axes.set_title(title, fontsize=10, loc="left", pad=22)


def _grain_words(grains: Snapshot) -> str:
    """The radius of the grains, so that those that are cut off their middle mislead nobody."""
    if not len(grains):
        return "no grains"
    low, high = grains.radius.min() * MICRON, grains.radius.max() * MICRON
    if high - low < 0.02 * high:
        return f"all grains have a radius of {high:.3g} µm, some are cut off their middle"
    return f"grains of {low:.3g} to {high:.3g} µm radius, cut by the plane"


def _circles(axes: Any, spheres: Snapshot, plane: float, **style: Any) -> Any:
    from matplotlib.collections import EllipseCollection

    index, centre, radius = cut_circles(spheres, plane)
    if style.pop("whole", False):
        radius = spheres.radius[index]
    values = style.pop("values", None)
    circles = EllipseCollection(
        2 * radius * MM,
        2 * radius * MM,
        np.zeros(len(index)),
        units="xy",
        offsets=centre * MM,
        offset_transform=axes.transData,
        **style,
    )
    if values is not None:
        circles.set_array(values[index])
    axes.add_collection(circles)
    return circles


def _fines(figure: Any, axes: Any, fines: Snapshot, plane: float) -> None:
    """Fines coloured by their radius; in one colour when they are (nearly) of one size."""
    if not len(fines):
        return
    low, high = fines.radius.min() * MICRON, fines.radius.max() * MICRON
    if high - low < 0.02 * high:
        style = {"facecolor": FINE_FACE, "edgecolor": "black", "linewidth": 0.3}
        _circles(axes, fines, plane, whole=True, **style)
        axes.plot([], [], "o", color=FINE_FACE, label=f"fines, radius {high:.3g} µm")
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), fontsize=9, frameon=False)
        return
    circles = _circles(
        axes,
        fines,
        plane,
        whole=True,
        values=fines.radius * MICRON,
        cmap="plasma",
        edgecolor="black",
        linewidth=0.3,
    )
    circles.set_clim(low, high)
    figure.colorbar(circles, ax=axes, label="radius of the fine (µm)", shrink=0.8)


def _side_frame(figure: Any, axes: Any, snapshot: Snapshot) -> None:
    box = np.asarray(snapshot.box) * MM
    (x_lo, x_hi), (z_lo, z_hi) = box[0], box[2]
    margin = 0.02 * (x_hi - x_lo)
    reach = (snapshot.position - snapshot.radius[:, None]).min(axis=0, initial=np.inf) * MM
    overhang = snapshot.grains().radius.max(initial=0.0) * MM
    start = max(min(x_lo, float(reach[0])), x_lo - 0.35 * (x_hi - x_lo)) - margin
    axes.plot([x_lo, x_hi, x_hi, x_lo], [z_lo, z_lo, z_hi, z_hi], color="black", linewidth=1)
    axes.axvline(x_lo, color="#0072B2", linestyle="--", linewidth=1.6)
    axes.annotate(
        "formation face",
        (x_lo, z_hi),
        (3, 3),
        textcoords="offset points",
        color="#0072B2",
        fontsize=9,
    )
    axes.set(
        xlim=(start, x_hi + overhang),
        ylim=(z_lo - overhang, z_hi + overhang),
        aspect="equal",
        xlabel="x, depth from the formation face (mm)",
        ylabel="z (mm)",
    )
    axes.grid(False)
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    figure.set_size_inches(9.0, min(9.0, max(3.0, 7.2 * height / width + 1.6)))


# ------------------------------------------------------------------------------------------------
# The curves of sizes: asked for, placed, and of the fines that invaded.


KIND_COLOURS = {"grains": "#7F7F7F", "fines": "#D55E00"}
INVADED = "#0072B2"


class Sizes(Protocol):
    """What is drawn of one kind of spheres; see `fdnet.run.outputs`."""

    @property
    def name(self) -> str:
        """Grains or fines."""

    @property
    def asked(self) -> Mapping[float, float]:
        """Diameters, m, by the share that is finer."""

    @property
    def curve(self) -> SizeCurve:
        """The curve of the case."""

    @property
    def placed(self) -> Array:
        """(N,) m, diameters."""

    @property
    def invaded(self) -> Array | None:
        """(M,) m, diameters."""


def fill_size_curves(figure: Any, *, sizes: Sequence[Sizes]) -> None:
    """Share finer by volume, in percent, over the diameter on a logarithmic axis."""
    from matplotlib.ticker import LogLocator, NullLocator

    axes = figure.add_subplot()
    for one in sizes:
        colour, curve = KIND_COLOURS[one.name], one.curve
        whole = 100 * (curve.below + curve.kept * curve.finer())
        axes.plot(MICRON * curve.edges, whole, color=colour, alpha=0.5, label=f"{one.name}, asked")
        if one.asked:
            shares, diameters = np.array([*one.asked]), np.array([*one.asked.values()])
            axes.plot(MICRON * diameters, 100 * shares, "o", color=colour, label="given points")
        _size_steps(
            axes, one.placed, curve, color=colour, label=f"{len(one.placed)} {one.name} placed"
        )
        if one.invaded is not None and len(one.invaded):
            label = f"{len(one.invaded)} of them invaded"
            _size_steps(axes, one.invaded, curve, color=INVADED, linestyle="--", label=label)
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
    axes.step(MICRON * rising, 100 * finer, where="post", linewidth=1.3, **style)


# ------------------------------------------------------------------------------------------------
# PNG figures of one specimen; depth is x, from the formation face.
#
# The colours are those of Okabe and Ito (2008), which colour-blind readers can tell apart.


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


# ------------------------------------------------------------------------------------------------
# A result that only some runs have: its table, its figure, its part of the summary and page.


@dataclass(frozen=True, slots=True, kw_only=True)
class PageTable:
    """A table of the page report.html.

    Attributes:
        title: heading of its part of the page.
        columns: key, heading, unit, and factor to that unit (None: as it is).
        rows: with these keys, SI.
        note: what the reader must know.
    """

    title: str
    columns: Sequence[tuple[str, str, str, float | None]]
    rows: Sequence[Mapping[str, Any]]
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Added:
    """One added result.

    Attributes:
        name: stem of its CSV file and of its figure.
        rows: of the CSV file, SI; without any there is no file.
        summary: its keys in summary.json.
        fill: draws its figure; None without one.
        caption: of the figure.
        page: its table in the page; None without one.
    """

    name: str
    rows: Sequence[Mapping[str, Any]] = ()
    summary: Mapping[str, Any] = field(default_factory=dict)
    fill: Callable[[Any], None] | None = None
    caption: str = ""
    page: PageTable | None = None


def write_added(folder: Path, added: Sequence[Added]) -> None:
    """The CSV files, NAME.csv in `folder`."""
    for one in added:
        if one.rows:
            write_rows(folder / f"{one.name}.csv", one.rows)


def draw_added(folder: Path, added: Sequence[Added]) -> list[tuple[Path, str]]:
    """The figures, NAME.png in `folder`, with their captions."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        (draw(folder / f"{one.name}.png", one.fill), one.caption)
        for one in added
        if one.fill is not None
    ]


# ------------------------------------------------------------------------------------------------
# Figures of what happens at the formation face: clean-up, cake, filtrate, bridging.


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
    edges = MM * np.array([row["x_lo_m"] for row in rows] + [rows[-1]["x_hi_m"]])
    for key, share, colour, line, name in (
        ("damaged_k_over_k0", whole[0], ORANGE, "--", "after the invasion"),
        ("return_k_over_k0", whole[1], BLUE, "-", "after the clean-up"),
    ):
        values = np.array([np.nan if row[key] is None else row[key] for row in rows], float)
        label = name if share is None else f"{name}, whole {share:.3f}"
        above.stairs(
            values, edges, baseline=None, color=colour, linestyle=line, linewidth=2, label=label
        )
    above.axhline(1.0, color=GREY, linewidth=0.8)
    above.set(ylabel="k / intact k (–)", ylim=(0, None))
    bins = np.linspace(edges[0], edges[-1], 41)
    for depth, colour, name in (
        (depths[0], ORANGE, "before"),
        (depths[1], BLUE, "stayed"),
    ):
        label = f"{name}: {len(depth)}"
        below.hist(MM * depth, bins=bins, color=colour, alpha=0.6, label=label)
    below.set(xlabel=DEPTH_LABEL, ylabel="fines (–)", xlim=edges[[0, -1]])
    legend_above(above)
    legend_above(below)


def fill_cake(figure: Any, *, rows: Sequence[Mapping[str, Any]]) -> None:
    """Porosity and permeability of the slices of the cake, against the distance from the face."""
    left, right = figure.subplots(1, 2)
    edges = MM * np.array([-row["x_hi_m"] for row in rows] + [-rows[-1]["x_lo_m"]])
    left.stairs([row["porosity"] for row in rows], edges, baseline=None, color=BLUE, linewidth=2)
    left.set(ylabel="porosity (–)", ylim=(0, 1))
    for key, colour, line, name in (
        ("k_network_m2", BLUE, "-", "network"),
        ("k_kozeny_m2", ORANGE, "--", "Carman-Kozeny"),
    ):
        values = np.array([np.nan if row[key] is None else row[key] for row in rows], float)
        if np.any(np.isfinite(values)):
            right.stairs(
                values, edges, baseline=None, color=colour, linestyle=line, linewidth=2, label=name
            )
    if right.get_legend_handles_labels()[0]:
        right.set(ylabel="permeability (m²)", yscale="log")
        legend_above(right)
    else:
        right.set_axis_off()
    for axes in (left, right):
        axes.set(xlabel="distance from the face (mm)", xlim=(0, edges[-1]))


def fill_filtrate(
    figure: Any, *, time: Array, volume: Array, fitted: Array | None, said: str
) -> None:
    """Filtrate per area, m, against the root of time, s, and the fit at the same times."""
    axes = figure.add_subplot()
    root = np.sqrt(time)
    axes.plot(root, MM * volume, color=BLUE, label="simulated")
    if fitted is not None:
        axes.plot(root, MM * fitted, "--", color=ORANGE, label="t = a V² + b V + c")
    axes.set(
        xlabel="root of the time of the fluid (s$^{1/2}$)",
        ylabel="filtrate per area (mm)",
        xlim=(0, None),
        ylim=(0, None),
    )
    axes.set_title(said, fontsize=10)
    axes.legend(loc="lower right")


def fill_bridging(figure: Any, *, rows: Sequence[Mapping[str, Any]]) -> None:
    """Share of closed throats by the ratio of diameters, with its band."""
    axes = figure.add_subplot()
    place = np.arange(len(rows))
    share = np.array([row["share_closed"] for row in rows])
    low, high = (np.array([row[key] for row in rows]) for key in ("share_low", "share_high"))
    axes.bar(place, share, color=BLUE, alpha=0.7)
    axes.errorbar(place, share, [share - low, high - share], fmt="none", color="black", capsize=3)
    names = [
        f"{row['ratio_lo']:g} to {row['ratio_hi']:g}"
        if row["ratio_hi"]
        else f"> {row['ratio_lo']:g}"
        for row in rows
    ]
    labels = [f"{name}\n({row['throats']})" for name, row in zip(names, rows, strict=True)]
    axes.set_xticks(place, labels, fontsize=9)
    axes.set(
        xlabel="diameter of the fines over that of the throat (number of throats)",
        ylabel="share of the throats that is closed (–)",
        ylim=(0, 1),
    )


# ------------------------------------------------------------------------------------------------
# The stress-strain curve of a triaxial test, as a figure.


class Row(Protocol):
    """One load step; see `fdnet.mechanics.triaxial`."""

    @property
    def axial_strain(self) -> float:
        """Compression above 0."""

    @property
    def volume_strain(self) -> float:
        """Compression above 0."""

    @property
    def deviatoric(self) -> float:
        """Pa."""

    @property
    def tension(self) -> int:
        """Bonds broken in tension."""

    @property
    def shear(self) -> int:
        """Bonds broken in shear."""


def draw_stress_strain(rows: Sequence[Row], path: Path, *, bonds: int) -> None:
    """Deviatoric stress and volume strain over axial strain; broken bonds where there are any."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    strain = [100 * row.axial_strain for row in rows]
    panels = 3 if bonds else 2
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 2.6 * panels), layout="constrained", dpi=130)
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
        with replacing(path) as temporary:
            figure.savefig(temporary, format="png")
