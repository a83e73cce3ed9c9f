"""Permeability and porosity against depth, the intact sand next to the damaged one."""

from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.report.units import MILLIDARCY
from fdnet.spheres.snapshot import Array

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

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
        _stairs(axes, edges, values, color=colour, label=f"{label}, sections")
    layers = analysis.layers
    if layers is not None:
        thin = {"linewidth": 1.0, "alpha": 0.8}
        for label, k, colour in (
            ("intact", layers.k_initial, INTACT),
            ("damaged", layers.k_damaged, DAMAGED),
        ):
            values = np.asarray(k) / MILLIDARCY
            _stairs(axes, layers.edges, values, color=colour, label=f"{label}, layers", **thin)
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
    _stairs(axes, profile.edges, profile.porosity_initial, color=INTACT, label=mean)
    if analysis.occupancy is not None:
        mean = f"damaged, mean {analysis.porosity_damaged:.4f}"
        _stairs(axes, profile.edges, profile.porosity_damaged, color=DAMAGED, label=mean)
    axes.set(ylabel="porosity (–)", ylim=(0, None))
    legend_above(axes)


def _stairs(axes: Any, edges: Any, values: Array, **style: Any) -> None:
    drawn = {"linewidth": 2.0, "baseline": None} | style
    axes.stairs(np.asarray(values, float), np.asarray(edges, float) * MM, **drawn)
