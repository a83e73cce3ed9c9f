"""Where fines of each size lie: their volume against depth, in classes of size."""

from typing import Any

import numpy as np

from fdnet.report.depth_figure import DEPTH_LABEL, legend_above
from fdnet.spheres.snapshot import Snapshot

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
