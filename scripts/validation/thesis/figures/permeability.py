"""Figures 49, 58, 65, 69 and 72: damaged over intact permeability of sections of 1 mm."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.network.permeability import Analysis
from fdnet.spheres.snapshot import Array
from validation.engine.palette import BLUE, GREEN
from validation.thesis.figures.canvas import (
    DEPTH_LABEL,
    MM,
    SPECIMEN_COLOURS,
    SPECIMEN_MARKERS,
    THESIS,
    seeds,
    sized,
    steps,
)
from validation.thesis.figures.sources import Sources
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR

LAWS = ((THESIS_PAIR, "the thesis's laws", BLUE), (DEFAULT_PAIR, "fdnet's default laws", GREEN))
RATIO_LABEL = "permeability damaged / intact, k/k₀ (–)"


def section_edges(analysis: Analysis) -> Array:
    """Edges (S+1,) mm of the sections."""
    return np.array([s.x_lo for s in analysis.sections] + [analysis.sections[-1].x_hi]) * MM


def ratios(analysis: Analysis, *, inplace: bool) -> Array:
    """k/k0 (S,) of the sections; nan where k0 is 0.

    In place they have the pressures of the whole specimen; otherwise they are cut out of it.
    """
    pairs = [
        (s.k_damaged_inplace, s.k_initial_inplace) if inplace else (s.k_damaged, s.k_initial)
        for s in analysis.sections
    ]
    return np.array([after / before if before > 0 else np.nan for after, before in pairs])


def permeability(figure: Any, sources: Sources, *, specimen: str) -> None:
    """One specimen's sections, cut out and in place, by both pairs of laws and in the thesis."""
    runs, thesis = sources.examined[specimen], sources.numbers(specimen)
    axes = figure.add_subplot()
    edges = section_edges(runs[0].thesis)
    for pair, name, colour in LAWS:
        for inplace, line, place in ((False, "-", "cut out"), (True, (0, (2, 1.5)), "in place")):
            rows = [ratios(run.analyses[pair], inplace=inplace) for run in runs]
            steps(axes, edges, rows, colour=colour, line=line, label=f"{name}, section {place}")
    if thesis.reductions:
        given = 1.0 - np.array(thesis.reductions)
        axes.plot(
            np.arange(len(given)) + 0.5,
            given,
            linestyle="",
            label="thesis, 1 mm sections",
            **THESIS,
        )
    axes.set(xlabel=DEPTH_LABEL, ylabel=RATIO_LABEL, xlim=edges[[0, -1]], ylim=(0, 1.05))
    axes.set_title(f"{sized(runs[0], specimen)}{seeds(runs)}", fontsize=11, loc="left")
    axes.legend(loc="lower right", fontsize=9.5)


def compared_permeability(figure: Any, sources: Sources, *, specimens: Sequence[str]) -> None:
    """Several specimens, by the thesis's laws (left) and fdnet's own (right)."""
    figure.set_size_inches(9.6, 4.6)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (pair, name, _) in zip(panels, LAWS, strict=True):
        _compare(axes, sources, specimens, pair)
        axes.set_title(f"by {name}", fontsize=11, loc="left")
        axes.set(xlabel=DEPTH_LABEL, ylim=(0, 1.05))
    _mark(panels[0], sources, specimens)
    panels[0].set_ylabel(RATIO_LABEL)
    panels[1].plot([], [], "-", color="black", label="section cut out")
    panels[1].plot([], [], ":", color="black", label="section in place")
    panels[0].plot([], [], linestyle="", label="thesis (its specimen's colour)", **THESIS)
    handles = [axes.get_legend_handles_labels() for axes in panels]
    once = dict(
        zip([*handles[0][1], *handles[1][1]], [*handles[0][0], *handles[1][0]], strict=True)
    )
    figure.legend([*once.values()], [*once], loc="outside lower center", ncols=3, fontsize=9.5)


def _compare(axes: Any, sources: Sources, specimens: Sequence[str], pair: tuple[str, str]) -> None:
    for name in specimens:
        runs, colour = sources.examined[name], SPECIMEN_COLOURS[name]
        edges = section_edges(runs[0].thesis)
        label = f"{sized(runs[0], name)}, porosity {runs[0].thesis.porosity_initial:.2f}"
        for inplace, line in ((False, "-"), (True, ":")):
            rows = np.array([ratios(run.analyses[pair], inplace=inplace) for run in runs])
            style: Any = {"color": colour, "marker": SPECIMEN_MARKERS[name], "markersize": 4}
            middle = (edges[1:] + edges[:-1]) / 2
            axes.plot(
                middle, rows.mean(axis=0), linestyle=line, label="" if inplace else label, **style
            )
            if len(runs) > 1 and not inplace:
                axes.fill_between(
                    middle,
                    rows.min(axis=0),
                    rows.max(axis=0),
                    color=colour,
                    alpha=0.2,
                    linewidth=0,
                )
        axes.set_xlim(edges[[0, -1]])


def _mark(axes: Any, sources: Sources, specimens: Sequence[str]) -> None:
    for name in specimens:
        given = 1.0 - np.array(sources.numbers(name).reductions)
        style = {**THESIS, "color": SPECIMEN_COLOURS[name]}
        axes.plot(np.arange(len(given)) + 0.5, given, linestyle="", zorder=5, **style)
