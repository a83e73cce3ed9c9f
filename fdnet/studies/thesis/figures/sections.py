"""Throats and pores of the first millimetre (the thesis's Figures 42, 44-48, 50-55, 59-64)."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array
from fdnet.studies.thesis.figures.canvas import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    Sources,
    bars,
    seeds,
    steps,
    titled,
)
from fdnet.studies.thesis.figures.marks import Told, percent
from fdnet.studies.thesis.numbers.section_sizes import SectionSizes, section_sizes, share_within

BINS = 40
TAIL = 0.995
"""Share of the values a figure's axis reaches to; the rest is told."""
DEPTH_BINS = 10
CONTENTS = (
    "throats without fines",
    "throats with fines",
    "throats blocked",
    "mean porosity of throats with fines",
)
"""What the thesis tells of the throats' contents."""


def sizes(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Probability density of the inscribed radii of throats and of pore bodies."""
    wanted = [("throat_radius", "throats", BLUE), ("pore_radius", "pore bodies", GREEN)]
    _densities(figure, sources, specimen, wanted)
    figure.axes[0].set(xlabel="inscribed radius (mm)", ylabel="probability density (1/mm)")


def lengths(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Probability density of the throats' lengths."""
    _densities(figure, sources, specimen, [("throat_length", "throats", BLUE)])
    figure.axes[0].set(
        xlabel="throat length, between the centres of its pores (mm)",
        ylabel="probability density (1/mm)",
    )


def volumes(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Probability density of the pores' void volume before and after the invasion."""
    wanted = [("pore_volume", "intact", BLUE), ("pore_volume_left", "with fines", ORANGE)]
    _densities(figure, sources, specimen, wanted)
    axes = figure.axes[0]
    axes.set(xlabel="void volume of a pore (mm³)", ylabel="probability density (1/mm³)")


def density(values: Array, edges: Array) -> Array:
    """Probability density (B,) of `values` (N,) between `edges` (B+1,); what lies outside counts in the whole."""
    return np.histogram(values, edges)[0] / max(len(values), 1) / np.diff(edges)


def _densities(
    figure: Any, sources: Sources, specimen: str, wanted: Sequence[tuple[str, str, str]]
) -> None:
    runs = sources.examined[specimen]
    cuts = [section_sizes(run) for run in runs]
    every = np.concatenate([getattr(cut, name) for cut in cuts for name, *_ in wanted])
    edges = np.linspace(0.0, float(np.quantile(every, TAIL)), BINS + 1)
    axes = figure.add_subplot()
    for (name, words, colour), line in zip(wanted, ("-", (0, (3, 1))), strict=False):
        values = [getattr(cut, name) for cut in cuts]
        closed = float(np.mean([np.mean(one <= 0.0) for one in values]))
        label = f"{np.mean([len(one) for one in values]):.0f} {words}, {percent(closed)} of them 0{seeds(runs)}"
        steps(
            axes,
            edges,
            [density(one, edges) for one in values],
            colour=colour,
            line=line,
            label=label,
        )
    _tell(
        axes,
        specimen,
        _shares(sources.marks(specimen).statistics, cuts, [name for name, *_ in wanted]),
    )
    axes.set(xlim=edges[[0, -1]], ylim=(0, 1.25 * axes.get_ylim()[1]))
    axes.legend(loc="upper right", fontsize=9.5)


def _shares(
    told: Sequence[Told], cuts: Sequence[SectionSizes], wanted: Sequence[str]
) -> list[str]:
    """What the thesis says of ranges of the `wanted` sizes, beside what we find there."""
    lines = []
    for one in told:
        name = one.quantity.replace(" ", "_")
        if one.between is not None and name in wanted:
            low, high = one.between
            ours = float(np.mean([share_within(getattr(cut, name), low, high) for cut in cuts]))
            lines.append(f"{one.what}: {percent(ours)} (thesis: {one.words})")
    return lines


def _tell(axes: Any, specimen: str, lines: Sequence[str]) -> None:
    head = f"{titled(specimen)}, first 1 mm"
    axes.set_title("\n".join([head, *lines]), fontsize=9.5, loc="left")


def throats_by_depth(figure: Any, sources: Sources, *, specimen: str) -> None:
    """All and blocked throats in bins of 0.1 mm."""
    runs, marks = sources.examined[specimen], sources.marks(specimen)
    cuts = [section_sizes(run) for run in runs]
    edges = np.linspace(0.0, 1.0, DEPTH_BINS + 1)
    every = [np.histogram(cut.throat_depth, edges)[0] for cut in cuts]
    blocked = np.mean(
        [np.histogram(cut.throat_depth[cut.blocked], edges)[0] for cut in cuts], axis=0
    )
    axes = figure.add_subplot()
    count = np.mean([one.sum() for one in every])
    bars(axes, edges, every, colour=BLUE, label=f"all throats, {count:.0f}{seeds(runs)}")
    axes.stairs(
        blocked, edges, fill=True, color=ORANGE, label=f"blocked throats, {blocked.sum():.0f}"
    )
    for middle, height in zip((edges[1:] + edges[:-1]) / 2, blocked, strict=True):
        offset: Any = {"xytext": (0, 3), "textcoords": "offset points"}
        axes.annotate(
            f"{height:.3g}", (middle, height), ha="center", fontsize=9, color="black", **offset
        )
    ours = percent(float(np.mean([cut.blocked.mean() for cut in cuts])))
    told = "".join(
        f" (thesis: {one.words})" for one in marks.statistics if one.quantity == "throats blocked"
    )
    _tell(axes, specimen, [f"blocked: {ours} of the throats{told}"])
    axes.set(
        xlabel="depth from the formation face (mm)", ylabel="throats per 0.1 mm (–)", xlim=(0, 1)
    )
    axes.margins(y=0.2)
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper left", ncols=2, fontsize=9.5)


def contents(cut: SectionSizes) -> dict[str, float]:
    """Shares of the throats by what is in them: closed by the grains, free of fines, with fines, blocked by one."""
    closed = cut.throat_radius <= 0.0
    fines = cut.throat_fines > 0
    found = {
        "closed by\nthe grains": closed,
        "without\nfines": ~closed & ~fines & ~cut.blocked,
        "with fines": ~closed & fines & ~cut.blocked,
        "blocked by\na fine": ~closed & cut.blocked,
    }
    return {name: float(np.mean(mask)) for name, mask in found.items()}


def throat_porosity(figure: Any, sources: Sources, *, specimen: str) -> None:
    """What the throats hold (left), and the density of porosity of those that hold fines and are not blocked."""
    runs = sources.examined[specimen]
    cuts = [section_sizes(run) for run in runs]
    figure.set_size_inches(9.6, 4.4)
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.6))
    found = [contents(cut) for cut in cuts]
    names = list(found[0])
    heights = [np.mean([one[name] for one in found]) for name in names]
    left.bar(names, heights, color=[GREY, BLUE, GREEN, ORANGE], alpha=0.7)
    for place, height in enumerate(heights):
        left.annotate(
            percent(height),
            (place, height),
            (0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=9.5,
        )
    left.set(ylabel="share of the throats (–)", ylim=(0, 1.1 * max(heights)))
    left.tick_params(axis="x", labelsize=9)
    left.grid(axis="x", visible=False)
    edges = np.linspace(0.0, 1.0, 21)
    held = [cut.throat_porosity[(cut.throat_fines > 0) & ~cut.blocked] for cut in cuts]
    mean = np.mean([one.mean() if len(one) else np.nan for one in held])
    label = f"throats with fines, their mean {mean:.2f}{seeds(runs)}"
    steps(right, edges, [density(one, edges) for one in held], colour=GREEN, label=label)
    right.set(xlabel="porosity of the throat (–)", ylabel="probability density (–)", xlim=(0, 1))
    right.margins(y=0.15)
    right.set_ylim(bottom=0)
    right.legend(loc="upper left", fontsize=9.5)
    told = [one for one in sources.marks(specimen).statistics if one.quantity in CONTENTS]
    _tell(left, specimen, [f"thesis: {one.quantity} {one.words}" for one in told] or [""])


def conductances(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Density per decade of the open throats' conductance before and after, by the thesis's laws."""
    runs = sources.examined[specimen]
    cuts = [section_sizes(run) for run in runs]
    first = np.concatenate([cut.conductance_initial for cut in cuts])
    low, high = np.log10(np.quantile(first[first > 0], [1 - TAIL, TAIL]))
    edges = np.linspace(np.floor(2 * low) / 2, np.ceil(2 * high) / 2, BINS + 1)
    axes = figure.add_subplot()
    for name, words, colour, line in (
        ("conductance_initial", "intact", BLUE, "-"),
        ("conductance_damaged", "with fines", ORANGE, (0, (3, 1))),
    ):
        values = [getattr(cut, name) for cut in cuts]
        # what is 0 counts in the whole, in no bin
        rows = [density(np.log10(np.where(one > 0, one, 1e-300)), edges) for one in values]
        closed = percent(float(np.mean([np.mean(one <= 0) for one in values])))
        steps(
            axes,
            10**edges,
            rows,
            colour=colour,
            line=line,
            label=f"{words}, {closed} of the throats 0{seeds(runs)}",
        )
    _tell(
        axes,
        specimen,
        [
            "by the thesis's laws; viscosity left out (flux = conductance × pressure drop / viscosity)"
        ],
    )
    axes.set(
        xscale="log",
        xlabel="conductance of the throat (mm³)",
        ylabel="probability density per decade (–)",
    )
    axes.set_xlim(10 ** edges[[0, -1]])
    axes.margins(y=0.25)
    axes.set_ylim(bottom=0)
    axes.legend(loc="upper left", fontsize=9.5)
