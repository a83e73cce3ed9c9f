"""Figures of what happens at the formation face: clean-up, cake, filtrate, bridging."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fdnet.report.depth_figure import legend_above
from fdnet.report.figures import BLUE, DEPTH_LABEL, GREY, MM, ORANGE
from fdnet.spheres.snapshot import Array


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
