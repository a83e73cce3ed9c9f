"""Figures 9, 13, 21, 73 and 74: packs, and the fines in them, seen from the side."""

from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array, Snapshot
from validation.engine.palette import BLACK, BLUE, GREY, ORANGE
from validation.thesis.figures.canvas import MM, circles, sized, titled
from validation.thesis.figures.sources import Sources

LIGHT, DARK = 0.93, 0.62
TONES = 12
"""Grey of the nearest and the farthest grains."""
FINE, FINE_EDGE = "#D55E00", "#7A3500"
DEPTH_STEP = 0.5
CLASS_COLOURS = (BLACK, ORANGE)
"""Of the small and the large fines."""


def pack(figure: Any, sources: Sources, *, specimen: str) -> None:
    """All grains; near ones cover far ones."""
    run = sources.examined[specimen][0]
    axes = _view(figure, run.state.grains, start=0.0)
    _grains(axes, run.state.grains)
    axes.set_title(f"{titled(specimen)}: {len(run.state.grains)} grains", fontsize=11, loc="left")


def growth(figure: Any, sources: Sources) -> None:
    """A slab through the middle of a growing pack, with the velocities of its grains as arrows.

    Each state has its own scale of the arrows.
    """
    stages = sources.tables.growth
    figure.set_size_inches(7.2, 10.2)
    words = (
        "small spheres, after the first stage of growth",
        "grown to their size, before they relax",
        "at rest",
    )
    for axes, spheres, state in zip(figure.subplots(len(stages), 1), stages, words, strict=True):
        slab = middle_slab(spheres)
        _frame(axes, slab, start=0.0)
        _grains(axes, slab)
        x, _, z = (slab.position * MM).T
        arrows: Any = {"color": FINE, "width": 0.0025, "angles": "xy"}
        axes.quiver(x, z, slab.velocity[:, 0], slab.velocity[:, 2], **arrows)
        fastest = float(np.linalg.norm(spheres.velocity, axis=1).max())
        axes.set_title(f"{state}; fastest grain {fastest:.2g} m/s", fontsize=11, loc="left")


def invaded_pack(figure: Any, sources: Sources, *, specimen: str) -> None:
    """A slab one grain thick through the middle: grains grey, fines and cake coloured."""
    run = sources.examined[specimen][0]
    slab = middle_slab(run.state.damaged)
    fines = slab.fines()
    start = float(np.min(fines.position[:, 0] - fines.radius, initial=0.0)) * MM
    axes = _view(figure, run.state.damaged, start=max(start, -1.5))
    both = np.argsort(-slab.position[:, 1])
    spheres = slab.where(both)
    grain = np.isin(spheres.id, slab.grains().id)
    colours = np.where(grain[:, None], _greys(spheres), _rgba(FINE))
    edges = np.where(grain[:, None], _rgba("#6E6E6E"), _rgba(FINE_EDGE))
    widths = np.where(grain, 0.5, 0.25)
    style: Any = {"facecolors": colours, "edgecolors": edges, "linewidths": widths}
    circles(axes, spheres.position[:, ::2] * MM, spheres.radius * MM, **style)
    counts = f"{run.thesis.invaded_count} invaded; the slab holds {_inside(slab)} of them"
    axes.set_title(f"{sized(run, specimen)}, {counts}", fontsize=11, loc="left")


def middle_slab(spheres: Snapshot) -> Snapshot:
    """Spheres centred less than the largest grain diameter behind the middle plane, along y."""
    behind = spheres.position[:, 1] - spheres.box[1].mean()
    return spheres.where((behind >= 0) & (behind < 2 * spheres.grains().radius.max()))


def fines_by_size(figure: Any, sources: Sources, *, specimen: str) -> None:
    """The invaded fines, large and small ones coloured; below, their number by depth."""
    run, thesis = sources.examined[specimen][0], sources.numbers(specimen)
    fines = run.state.damaged.fines()
    low, high = fines.box[0]
    fines = fines.where((fines.position[:, 0] >= low) & (fines.position[:, 0] < high))
    figure.set_size_inches(7.2, 6.4)
    above, below = figure.subplots(2, 1, height_ratios=(2.2, 1), sharex=True)
    _frame(above, fines, start=0.0)
    radius = fines.radius * MM
    circles(above, fines.position[:, ::2] * MM, radius, facecolors="#E4E4E4", edgecolors="none")
    edges = np.linspace(0.0, (high - low) * MM, max(1, round((high - low) * MM / DEPTH_STEP)) + 1)
    classes = sorted(thesis.size_classes_mm)
    kind = np.full(len(fines), -1)
    for index, (least, most) in enumerate(classes):
        kind[(radius >= least) & (radius <= most)] = index
    order = np.argsort(-fines.position[:, 1])
    order = order[kind[order] >= 0]
    colours = np.array([_rgba(one) for one in CLASS_COLOURS])[kind[order]]
    circles(
        above,
        fines.position[order][:, ::2] * MM,
        radius[order],
        facecolors=colours,
        edgecolors="none",
    )
    for index, (least, most) in enumerate(classes):
        chosen, colour, line = (
            fines.where(kind == index),
            CLASS_COLOURS[index],
            ("--", "-")[index % 2],
        )
        count = np.histogram((chosen.position[:, 0] - low) * MM, edges)[0]
        label = f"radius {least:g}–{most:g} mm, {len(chosen)} fines"
        below.stairs(
            count, edges, baseline=None, color=colour, linestyle=line, linewidth=2, label=label
        )
    below.set(xlabel="depth from the formation face (mm)", ylabel=f"fines per {DEPTH_STEP} mm (–)")
    below.set_ylim(bottom=0)
    if classes:
        below.legend(loc="upper right", fontsize=9.5)
    above.set_title(
        f"{titled(specimen)}: the {len(fines)} invaded fines, the rest grey",
        fontsize=11,
        loc="left",
    )


def _inside(spheres: Snapshot) -> int:
    x = spheres.fines().position[:, 0]
    return int(np.sum((x >= spheres.box[0, 0]) & (x < spheres.box[0, 1])))


def _grains(axes: Any, grains: Snapshot) -> None:
    spheres = grains.where(np.argsort(-grains.position[:, 1]))
    style: Any = {"facecolors": _greys(spheres), "edgecolors": "#6E6E6E", "linewidths": 0.5}
    circles(axes, spheres.position[:, ::2] * MM, spheres.radius * MM, **style)


def _greys(spheres: Snapshot) -> Array:
    """Colours (N, 4); nearer spheres are lighter."""
    y = spheres.position[:, 1]
    near = (y.max() - y) / max(float(np.ptp(y)), 1e-12)
    tone = DARK + (LIGHT - DARK) * np.round(near * (TONES - 1)) / (TONES - 1)
    return np.column_stack([tone, tone, tone, np.ones(len(tone))])


def _rgba(colour: str) -> Array:
    return np.array([*(int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)), 1.0])


def _view(figure: Any, spheres: Snapshot, *, start: float) -> Any:
    axes = figure.add_subplot()
    _frame(axes, spheres, start=start)
    axes.set_xlabel("x, depth from the formation face (mm)")
    width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    figure.set_size_inches(7.2, min(9.0, 6.2 * height / width + 1.2))
    return axes


def _frame(axes: Any, spheres: Snapshot, *, start: float) -> None:
    (x_low, x_high), _, (z_low, z_high) = spheres.box * MM
    edge = 0.02 * (x_high - x_low)
    axes.plot(
        [x_low, x_high, x_high, x_low],
        [z_low, z_low, z_high, z_high],
        color=GREY,
        linewidth=1,
        zorder=3,
    )
    axes.axvline(x_low, color=BLUE, linestyle="--", linewidth=1.6, zorder=3)
    axes.set(xlim=(min(start, x_low) - edge, x_high + edge), ylim=(z_low - edge, z_high + edge))
    axes.set(aspect="equal", ylabel="z (mm)")
    axes.grid(False)
