"""The pore network from the side: pressure, flux, and what each throat lost of its conductance."""

from typing import TYPE_CHECKING, Any

import numpy as np

from fdnet.report.tables import blocked_throats
from fdnet.spheres.snapshot import Array

if TYPE_CHECKING:
    from fdnet.network.analysis import Analysis

MM = 1e3
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
