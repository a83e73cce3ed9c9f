"""The figure of an invasion by fdnet and by Yade: both deposits, porosity, k and rate."""

from pathlib import Path
from typing import Any

import numpy as np

from fdnet.files.atomic import replacing
from fdnet.network.analysis import Analysis
from fdnet.spheres.snapshot import Snapshot
from fdnet.studies.benchmark.yade_exchange import HISTORY
from fdnet.studies.benchmark.yade_invasion import Pair
from fdnet.studies.benchmark.yade_invasion_rows import judged
from fdnet.studies.engine.palette import BLACK, BLUE, GREY, ORANGE

TOOLS = {"fdnet (LIGGGHTS)": BLUE, "Yade": ORANGE}
"""Colour of each tool, in the order of the rows."""
PALE = "#DDDDDD"
"""Of the grains."""


def draw_pair(pair: Pair, path: Path) -> Path:
    """Both deposits from the side, and what they do, as PNG.

    Where Yade was cut, fdnet's deposit is that of its last checkpoint before.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    step, then = pair.then or (pair.job.steps, pair.run.spheres())
    ends = (then, pair.yade_end)
    times = [1e3 * one * pair.job.time_step for one in (step, pair.answer.steps)]
    analyses = [judged(pair, end)[0] for end in ends]
    figure = plt.figure(figsize=(12, 8.4), constrained_layout=True)
    grid = figure.add_gridspec(3, 3, height_ratios=(1.0, 1.0, 1.15))
    for row, (name, end, time) in enumerate(zip(TOOLS, ends, times, strict=True)):
        axes = figure.add_subplot(grid[row, :])
        _draw_side(axes, end, name, pair.job.length)
        axes.set_title(f"{name}: fines at {time:.2f} ms", loc="left", fontsize=10)
    below = [figure.add_subplot(grid[2, column]) for column in range(3)]
    _draw_porosity(below[0], analyses)
    _draw_sections(below[1], analyses)
    _draw_rate(below[2], pair)
    handles, labels = below[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=3, frameon=False)
    with replacing(path) as part:
        figure.savefig(part, dpi=110, format="png")
    plt.close(figure)
    return path


def _draw_side(axes: Any, end: Snapshot, name: str, length: float) -> None:
    """All fines from the side, over the grains that reach into the middle of the specimen."""
    from matplotlib.collections import EllipseCollection

    middle = 0.5 * float(end.box[1, 1])
    grains, fines = end.grains(), end.fines()
    cut = np.abs(grains.position[:, 1] - middle) < grains.radius
    depth = grains.position[cut, 1] - middle
    layers = (
        (grains.position[cut], np.sqrt(grains.radius[cut] ** 2 - depth**2), PALE, "none"),
        (fines.position, fines.radius, TOOLS[name], BLACK),
    )
    for position, radius, colour, edge in layers:
        size = 2e3 * radius
        places = 1e3 * position[:, (0, 2)]
        axes.add_collection(
            EllipseCollection(
                size,
                size,
                np.zeros(len(size)),
                units="xy",
                offsets=places,
                transOffset=axes.transData,
                facecolor=colour,
                edgecolor=edge,
                linewidth=0.2,
                alpha=0.75,
            )
        )
    axes.axvline(0, color=GREY, lw=0.8)
    width = 1e3 * float(end.box[2, 1])
    axes.set(xlim=(-0.75, 1e3 * length + 0.25), ylim=(0, width), aspect="equal", ylabel="z, mm")
    axes.set_xlabel("depth, mm")


def _draw_porosity(axes: Any, analyses: list[Analysis]) -> None:
    first = analyses[0].profile
    axes.stairs(first.porosity_initial, 1e3 * first.edges, color=GREY, label="without fines")
    for (name, colour), one in zip(TOOLS.items(), analyses, strict=True):
        axes.stairs(
            one.profile.porosity_damaged, 1e3 * one.profile.edges, color=colour, label=name
        )
    axes.set(xlabel="depth, mm", ylabel="porosity")


def _draw_sections(axes: Any, analyses: list[Analysis]) -> None:
    for colour, one in zip(TOOLS.values(), analyses, strict=True):
        edges = [1e3 * part.x_lo for part in one.sections] + [1e3 * one.sections[-1].x_hi]
        values = [part.k_damaged / part.k_initial for part in one.sections]
        axes.stairs(values, edges, color=colour)
    axes.set(xlabel="depth, mm", ylabel="k/k0 of each section by fdnet", ylim=(0, 1.05))


def _draw_rate(axes: Any, pair: Pair) -> None:
    own = pair.run.history
    axes.plot(1e3 * own["time_s"], own["rate_over_initial"], color=BLUE)
    history = dict(zip(HISTORY, pair.answer.history.T, strict=True))
    time = 1e3 * history["step"] * pair.job.time_step
    axes.plot(time, history["rate_m3_s"] / history["rate_m3_s"][0], color=ORANGE, lw=0.8)
    axes.set(xlabel="time, ms", ylabel="flow rate over the first")
    axes.set_ylim(bottom=0)
