"""Figures 42, 44 to 48, 50 to 55 and 59 to 64: pores and throats of the first millimetre."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array
from validation.engine.palette import BLUE, GREEN, GREY, ORANGE
from validation.thesis.figures.canvas import bars, seeds, steps, titled
from validation.thesis.figures.sources import Sources
from validation.thesis.numbers.values import Statistic, percent
from validation.thesis.numbers.whole_pores import WholePores, share_within, whole_pores

BINS = 40
TAIL = 0.995
"""Share of the values that lie within the axis of a figure."""
DEPTH_BINS = 10
LINES: Sequence[Any] = ("-", (0, (3, 1)))
Curve = tuple[str, str, str, str]
"""Field of `WholePores`, words on it, colour, and what a value of 0 means (empty: not counted)."""
CONTENTS = (
    "throats without fines",
    "throats with fines",
    "throats blocked",
    "mean porosity of throats with fines",
)
"""The thesis's quantities on the contents of throats."""


def sizes(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Probability density of the inscribed radii of throats and of pore bodies."""
    curves = [
        ("throat_radius", "throats", BLUE, "closed"),
        ("pore_radius", "pore bodies", GREEN, "closed"),
    ]
    _densities(figure, sources, specimen, curves)
    figure.axes[0].set(xlabel="inscribed radius (mm)", ylabel="probability density (1/mm)")


def lengths(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Probability density of the throats' lengths."""
    _densities(figure, sources, specimen, [("throat_length", "throats", BLUE, "")])
    figure.axes[0].set(
        xlabel="throat length, between the centres of its pores (mm)",
        ylabel="probability density (1/mm)",
    )


def volumes(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Probability density of the pores' void volume before and after the invasion."""
    curves = [
        ("pore_volume", "pores, intact", BLUE, "without void"),
        ("pore_volume_left", "pores, with fines", ORANGE, "without void"),
    ]
    _densities(figure, sources, specimen, curves)
    axes = figure.axes[0]
    axes.set(xlabel="void volume of a pore (mm³)", ylabel="probability density (1/mm³)")


def density(values: Array, edges: Array) -> Array:
    """Probability density (B,) of `values` (N,) in bins with `edges` (B+1,).

    Values outside of the bins count in the total.
    """
    return np.histogram(values, edges)[0] / max(len(values), 1) / np.diff(edges)


def _densities(figure: Any, sources: Sources, specimen: str, curves: Sequence[Curve]) -> None:
    runs = sources.examined[specimen]
    sections = [whole_pores(run) for run in runs]
    every = np.concatenate([getattr(section, name) for section in sections for name, *_ in curves])
    edges = np.linspace(0.0, float(np.quantile(every, TAIL)), BINS + 1)
    axes = figure.add_subplot()
    for (name, words, colour, without), line in zip(curves, LINES, strict=False):
        values = [getattr(section, name) for section in sections]
        label = f"{np.mean([len(one) for one in values]):.0f} {words}"
        if without:
            zero = float(np.mean([np.mean(one <= 0.0) for one in values]))
            label += f", {percent(zero)} of them {without}"
        steps(
            axes,
            edges,
            [density(one, edges) for one in values],
            colour=colour,
            line=line,
            label=label + seeds(runs),
        )
    _title(
        axes,
        specimen,
        _shares(sources.numbers(specimen).statistics, sections, [name for name, *_ in curves]),
    )
    axes.set(xlim=edges[[0, -1]], ylim=(0, 1.25 * axes.get_ylim()[1]))
    axes.legend(loc="upper right", fontsize=9.5)


def _shares(
    statistics: Sequence[Statistic], sections: Sequence[WholePores], wanted: Sequence[str]
) -> list[str]:
    """Our share and the thesis's share of the `wanted` sizes in the thesis's ranges."""
    lines = []
    for one in statistics:
        name = one.quantity.replace(" ", "_")
        if one.between is not None and name in wanted:
            low, high = one.between
            ours = float(
                np.mean([share_within(getattr(section, name), low, high) for section in sections])
            )
            lines.append(f"{one.subject}: {percent(ours)} (thesis: {one.words})")
    return lines


def _title(axes: Any, specimen: str, lines: Sequence[str]) -> None:
    head = f"{titled(specimen)}, first 1 mm"
    axes.set_title("\n".join([head, *lines]), fontsize=9.5, loc="left")


def throats_by_depth(figure: Any, sources: Sources, *, specimen: str) -> None:
    """All and blocked throats in bins of 0.1 mm."""
    runs, thesis = sources.examined[specimen], sources.numbers(specimen)
    sections = [whole_pores(run) for run in runs]
    edges = np.linspace(0.0, 1.0, DEPTH_BINS + 1)
    every = [np.histogram(section.throat_depth, edges)[0] for section in sections]
    blocked = np.mean(
        [np.histogram(section.throat_depth[section.blocked], edges)[0] for section in sections],
        axis=0,
    )
    axes = figure.add_subplot()
    count = np.mean([one.sum() for one in every])
    bars(axes, edges, every, colour=BLUE, label=f"all throats, {count:.0f}{seeds(runs)}")
    axes.stairs(
        blocked, edges, fill=True, color=ORANGE, label=f"blocked throats, {blocked.sum():.0f}"
    )
    offset: Any = {"xytext": (0, 3), "textcoords": "offset points"}
    for middle, height in zip((edges[1:] + edges[:-1]) / 2, blocked, strict=True):
        axes.annotate(
            f"{height:.3g}", (middle, height), ha="center", fontsize=9, color="black", **offset
        )
    ours = percent(float(np.mean([section.blocked.mean() for section in sections])))
    compared = "".join(
        f" (thesis: {one.words})" for one in thesis.statistics if one.quantity == "throats blocked"
    )
    _title(axes, specimen, [f"blocked: {ours} of the throats{compared}"])
    axes.set(
        xlabel="depth from the formation face (mm)", ylabel="throats per 0.1 mm (–)", xlim=(0, 1)
    )
    axes.margins(y=0.2)
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper left", ncols=2, fontsize=9.5)


def contents(section: WholePores) -> dict[str, float]:
    """Shares of the throats that grains close, that hold no fines, hold fines, or are blocked."""
    closed = section.throat_radius <= 0.0
    fines = section.throat_fines > 0
    masks = {
        "closed by\nthe grains": closed,
        "without\nfines": ~closed & ~fines & ~section.blocked,
        "with fines": ~closed & fines & ~section.blocked,
        "blocked by\na fine": ~closed & section.blocked,
    }
    return {name: float(np.mean(mask)) for name, mask in masks.items()}


def throat_porosity(figure: Any, sources: Sources, *, specimen: str) -> None:
    """What the throats hold (left), and the porosity of open throats with fines (right)."""
    runs = sources.examined[specimen]
    sections = [whole_pores(run) for run in runs]
    figure.set_size_inches(9.6, 4.4)
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.6))
    shares = [contents(section) for section in sections]
    names = list(shares[0])
    heights = [np.mean([one[name] for one in shares]) for name in names]
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
    held = [
        section.throat_porosity[(section.throat_fines > 0) & ~section.blocked]
        for section in sections
    ]
    mean = np.mean([one.mean() if len(one) else np.nan for one in held])
    label = f"throats with fines, their mean {mean:.2f}{seeds(runs)}"
    steps(right, edges, [density(one, edges) for one in held], colour=GREEN, label=label)
    right.set(xlabel="porosity of the throat (–)", ylabel="probability density (–)", xlim=(0, 1))
    right.margins(y=0.15)
    right.set_ylim(bottom=0)
    right.legend(loc="upper left", fontsize=9.5)
    given = [one for one in sources.numbers(specimen).statistics if one.quantity in CONTENTS]
    _title(left, specimen, [f"thesis: {one.quantity} {one.words}" for one in given] or [""])


def conductances(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Density per decade of the throats' conductance before and after, by the thesis's laws."""
    runs = sources.examined[specimen]
    sections = [whole_pores(run) for run in runs]
    first = np.concatenate([section.conductance_initial for section in sections])
    low, high = np.log10(np.quantile(first[first > 0], [1 - TAIL, TAIL]))
    edges = np.linspace(np.floor(2 * low) / 2, np.ceil(2 * high) / 2, BINS + 1)
    axes = figure.add_subplot()
    for name, words, colour, line in (
        ("conductance_initial", "intact", BLUE, "-"),
        ("conductance_damaged", "with fines", ORANGE, (0, (3, 1))),
    ):
        values = [getattr(section, name) for section in sections]
        # A conductance of 0 counts in the total, but lies in no bin.
        rows = [density(np.log10(np.where(one > 0, one, 1e-300)), edges) for one in values]
        closed = percent(float(np.mean([np.mean(one <= 0) for one in values])))
        steps(
            axes,
            10**edges,
            rows,
            colour=colour,
            line=line,
            label=f"{words}, {closed} of the throats closed{seeds(runs)}",
        )
    _title(
        axes,
        specimen,
        [
            "by the thesis's laws, without the viscosity: "
            "flux = conductance × pressure drop / viscosity"
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
