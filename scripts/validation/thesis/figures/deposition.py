"""Figures 33 to 35, 56 and 57: where fines lie in throats, and the tetrahedra that they add."""

from typing import Any

import numpy as np

from validation.engine.palette import BLUE, GREY, ORANGE
from validation.thesis.figures.canvas import titled
from validation.thesis.figures.sources import Sources
from validation.thesis.figures.tables import POROSITY_CLASSES
from validation.thesis.numbers.values import percent

FARTHEST, STEP = 2.0, 0.1


def distances(figure: Any, sources: Sources, *, porosity: str) -> None:
    """Shares of the fines in throats of one class of porosity, by distance from the axis."""
    values = np.asarray(sources.tables.distances[porosity], float)
    edges = np.linspace(0.0, FARTHEST, round(FARTHEST / STEP) + 1)
    count = max(len(values), 1)
    share = np.histogram(values, edges)[0] / count
    axes = figure.add_subplot()
    middle, wall = edges[:-1] < 0.5 - 1e-9, edges[:-1] > 1.0 - 1e-9
    for mask, colour, words in (
        (middle, ORANGE, f"nearer the axis: {percent(np.mean(values < 0.5))}"),
        (
            ~middle & ~wall,
            BLUE,
            f"nearer the wall: {percent(np.mean((values >= 0.5) & (values <= 1.0)))}",
        ),
        (wall, GREY, f"centred outside the throat: {percent(np.mean(values > 1.0))}"),
    ):
        axes.bar(
            edges[:-1][mask],
            share[mask],
            STEP,
            align="edge",
            color=colour,
            alpha=0.75,
            label=words,
        )
    beyond = float(np.mean(values > FARTHEST))
    head = f"throat porosity {porosity}: {len(values)} fines in throats"
    claim = sources.numbers("specimen5").deposition_in(POROSITY_CLASSES[porosity])
    lines = [f"{head}, {percent(beyond)} farther out" if beyond else head]
    lines += [] if claim is None else [f"thesis: {claim.words}"]
    axes.set_title("\n".join(lines), fontsize=9.5, loc="left")
    axes.axvline(1.0, color="black", linewidth=1.2, linestyle="--")
    axes.annotate(
        "wall",
        (1.0, 0.97),
        (4, 0),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        va="top",
    )
    axes.set(
        xlabel="distance of the fine's centre from the axis / throat radius (–)",
        xlim=(0, FARTHEST),
    )
    axes.set_ylabel(f"share of the fines per {STEP} (–)")
    axes.margins(y=0.15)
    figure.legend(loc="outside lower center", ncols=3, fontsize=9.5)


def tetrahedra(figure: Any, sources: Sources) -> None:
    """Tetrahedra of the first millimetre, of all spheres and of the grains alone."""
    axes = figure.add_subplot()
    names = sorted(sources.tables.tetrahedra)
    places = np.arange(len(names), dtype=float)
    for shift, which, colour, words in (
        (-0.2, 0, ORANGE, "all spheres"),
        (0.2, 1, BLUE, "grains alone"),
    ):
        heights = [sources.tables.tetrahedra[name][which] for name in names]
        drawn = axes.bar(places + shift, heights, 0.38, color=colour, alpha=0.75, label=words)
        axes.bar_label(drawn, fontsize=9.5, padding=2)
    axes.set_xticks(places, [titled(name) for name in names])
    axes.set(ylabel="tetrahedra in the first 1 mm (–)", xlim=(-0.6, len(names) - 0.4))
    axes.margins(y=0.2)
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper left", ncols=2, fontsize=9.5)
