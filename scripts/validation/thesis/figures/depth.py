"""Figures 15 to 20, 22, 66 to 68, 70 and 71: invaded fines and lost porosity along depth."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array
from validation.engine.palette import BLUE, GREY, ORANGE
from validation.thesis.figures.canvas import (
    DEPTH_LABEL,
    MM,
    SPECIMEN_COLOURS,
    THESIS,
    bars,
    seeds,
    sized,
    steps,
)
from validation.thesis.figures.sources import Sources
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.invasion import FIRST, SHALLOW, invaded_depth, porosity_loss
from validation.thesis.numbers.values import percent

BIN_MM = 0.25


def fraction_by_depth(run: Examined) -> tuple[Array, Array]:
    """Edges (B+1,) mm of bins of 0.25 mm, and the share (B,) of the invaded fines in each."""
    length = float(np.ptp(run.state.damaged.box[0])) * MM
    edges = np.linspace(0.0, length, max(1, round(length / BIN_MM)) + 1)
    depth = invaded_depth(run.state) * MM
    return edges, np.histogram(depth, edges)[0] / max(len(depth), 1)


def lost_by_depth(run: Examined) -> tuple[Array, Array]:
    """Edges (B+1,) mm of the profile's bins, and the porosity (B,) lost to the fines in each."""
    profile = run.thesis.profile
    return profile.edges * MM, profile.porosity_initial - profile.porosity_damaged


def invaded_fraction(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Share of the invaded fines in bins of 0.25 mm, with the thesis's numbers."""
    runs, thesis = sources.examined[specimen], sources.numbers(specimen)
    axes = figure.add_subplot()
    edges, rows = fraction_by_depth(runs[0])[0], [fraction_by_depth(run)[1] for run in runs]
    count = np.mean([run.thesis.invaded_count for run in runs])
    compared = "" if thesis.invaded_count is None else f" (thesis {thesis.invaded_count})"
    bars(
        axes, edges, rows, colour=ORANGE, label=f"{count:.0f} invaded fines{compared}{seeds(runs)}"
    )
    if thesis.fraction_first_bin is not None:
        label = (
            f"thesis, its first bin (width not given): about {percent(thesis.fraction_first_bin)}"
        )
        axes.plot(
            [edges[:2].mean()], [thesis.fraction_first_bin], linestyle="", label=label, **THESIS
        )
    _deepest(axes, runs, thesis.invaded_depth_mm)
    beyond = np.mean(
        [
            np.mean(invaded_depth(run.state) > SHALLOW) if run.thesis.invaded_count else 0.0
            for run in runs
        ]
    )
    compared = (
        ""
        if thesis.fraction_beyond_0p5mm is None
        else f" (thesis: below {percent(thesis.fraction_beyond_0p5mm)})"
    )
    axes.plot([], [], " ", label=f"deeper than {SHALLOW * MM:g} mm: {percent(beyond)}{compared}")
    axes.set(
        xlabel=DEPTH_LABEL,
        ylabel=f"share of the invaded fines per {BIN_MM} mm (–)",
        xlim=edges[[0, -1]],
    )
    axes.set_ylim(0, 1.1 * max(np.max(rows), thesis.fraction_first_bin or 0.0, 0.01))
    axes.legend(loc="upper right", fontsize=9.5)


def _deepest(axes: Any, runs: Sequence[Examined], thesis: float | None) -> None:
    ours = max(run.thesis.invasion_depth for run in runs) * MM
    axes.axvline(
        ours,
        ymax=0.6,
        color=ORANGE,
        linestyle="--",
        linewidth=1.5,
        label=f"deepest fine {ours:.2f} mm",
    )
    if thesis is not None:
        axes.axvline(
            thesis,
            ymax=0.6,
            color="black",
            linestyle=":",
            linewidth=1.5,
            label=f"thesis: depth {thesis:g} mm",
        )


def porosity_reduction(figure: Any, sources: Sources, *, specimen: str) -> None:
    """Porosity lost in bins of 0.25 mm, with the thesis's losses at the face and in the whole."""
    runs, thesis = sources.examined[specimen], sources.numbers(specimen)
    axes = figure.add_subplot()
    edges, rows = lost_by_depth(runs[0])[0], [lost_by_depth(run)[1] for run in runs]
    bars(
        axes,
        edges,
        rows,
        colour=BLUE,
        label=f"bins of {np.diff(edges).mean():.3g} mm{seeds(runs)}",
    )
    whole = float(
        np.mean([run.thesis.porosity_initial - run.thesis.porosity_damaged for run in runs])
    )
    axes.axhline(
        whole, color=BLUE, linestyle="--", linewidth=1.5, label=f"whole specimen {whole:.4f}"
    )
    if thesis.face_porosity_loss is not None:
        label = f"thesis, at the face: about {thesis.face_porosity_loss:g}"
        axes.plot(
            [0],
            [thesis.face_porosity_loss],
            linestyle="",
            clip_on=False,
            zorder=5,
            label=label,
            **THESIS,
        )
    if thesis.porosity_loss is not None:
        label = f"thesis, initial less damaged: {thesis.porosity_loss:.2g}"
        axes.axhline(
            thesis.porosity_loss, color="black", linestyle=":", linewidth=1.5, label=label
        )
    axes.axhline(0, color=GREY, linewidth=0.8)
    axes.set(
        xlabel=DEPTH_LABEL, ylabel="porosity reduction, intact − damaged (–)", xlim=edges[[0, -1]]
    )
    axes.margins(y=0.08)
    axes.legend(loc="upper right", fontsize=9.5)


def compared_porosity(figure: Any, sources: Sources, *, specimens: Sequence[str]) -> None:
    """Porosity lost along depth, one curve a specimen."""
    axes = _compared(figure, sources, specimens, lost_by_depth)
    axes.axhline(0, color=GREY, linewidth=0.8)
    axes.set_ylabel("porosity reduction, intact − damaged (–)")


def compared_fraction(figure: Any, sources: Sources, *, specimens: Sequence[str]) -> None:
    """Share of the invaded fines along depth, one curve a specimen."""
    axes = _compared(figure, sources, specimens, fraction_by_depth)
    axes.set_ylim(bottom=0)
    axes.set_ylabel(f"share of the invaded fines per {BIN_MM} mm (–)")


def _compared(figure: Any, sources: Sources, specimens: Sequence[str], measure: Any) -> Any:
    axes = figure.add_subplot()
    edges = np.zeros(2)
    for name in specimens:
        runs = sources.examined[name]
        edges = measure(runs[0])[0]
        label = f"{sized(runs[0], name)}, porosity {runs[0].thesis.porosity_initial:.2f}"
        steps(
            axes,
            edges,
            [measure(run)[1] for run in runs],
            colour=SPECIMEN_COLOURS[name],
            label=label,
        )
    axes.set(xlabel=DEPTH_LABEL, xlim=(0, edges[-1]))
    axes.legend(loc="upper right", fontsize=9.5)
    return axes


def total_reduction(figure: Any, sources: Sources, *, specimens: Sequence[str]) -> None:
    """Porosity lost in the whole specimen and its first millimetre, with the thesis's loss."""
    axes = figure.add_subplot()
    places = np.arange(len(specimens), dtype=float)
    whole = [
        [r.thesis.porosity_initial - r.thesis.porosity_damaged for r in sources.examined[s]]
        for s in specimens
    ]
    first = [
        [porosity_loss(r.state, r.thesis, FIRST) for r in sources.examined[s]] for s in specimens
    ]
    for shift, rows, colour, label in (
        (-0.2, whole, BLUE, "whole specimen"),
        (0.2, first, ORANGE, "first 1 mm"),
    ):
        axes.bar(
            places + shift,
            [np.mean(one) for one in rows],
            0.36,
            color=colour,
            alpha=0.7,
            label=label,
        )
        axes.vlines(
            places + shift,
            [min(r) for r in rows],
            [max(r) for r in rows],
            color="black",
            linewidth=1,
        )
    losses = [sources.numbers(name).porosity_loss for name in specimens]
    known = [place for place, one in zip(places, losses, strict=True) if one is not None]
    if known:
        heights = [one for one in losses if one is not None]
        axes.plot(
            known, heights, linestyle="", label="thesis, initial less damaged porosity", **THESIS
        )
    names = [sized(sources.examined[s][0], s).replace(": fines ", "\n") for s in specimens]
    axes.set_xticks(places, [name.replace(" across", "") for name in names])
    axes.set(
        xlabel="specimen, diameter of its fines", ylabel="porosity reduction, intact − damaged (–)"
    )
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper left", fontsize=9.5)
    axes.margins(y=0.35)
