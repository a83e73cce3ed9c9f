"""The figures of the thesis, all drawn from one table of panels, panels.csv.

A panel has the number of the thesis's figure, a kind of plot, quantities and specimens, and its
axes; each kind is one function, which may return lines for the head. Curves are means over seeds
with their range as a band. Diamonds and dotted lines in black are the thesis's numbers.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from fdnet.report.figures import BLUE, GREEN, GREY, ORANGE, draw
from fdnet.spheres.snapshot import Array, Kind, Snapshot
from validation.picture import with_few_colours
from validation.thesis import published as known
from validation.thesis import quantities
from validation.thesis.compare import QUANTITIES, values_of
from validation.thesis.published import reductions, specimen_of, thesis_of
from validation.thesis.quantities import POROSITY, WHOLE, Run, first_section, measure, weighted
from validation.thesis.runs import points

COLOURS = ("", BLUE, GREEN, ORANGE, "#56B4E9", "#E69F00", "#000000", "#CC79A7", GREY)
MARK: Any = {"color": "black", "marker": "D", "markerfacecolor": "white", "linestyle": ""}
MARK |= {"zorder": 5, "clip_on": False}
LOST, SHARE = "porosity lost", "share of the fines per 0.25 mm"


class Sources(NamedTuple):
    """What figures are drawn from: examined runs by specimen, one a seed, and results.csv."""

    runs: Mapping[str, Sequence[Run]]
    results: pd.DataFrame


def draw_all(sources: Sources, folder: Path) -> list[dict[str, str]]:
    """Draw every panel that has its sources; returns the panels with what is `missing` of each."""
    rows = []
    for row in known.rows_in("panels.csv"):
        names, specimens = row.names.split("|"), row.specimens.split("|")
        panel = row._replace(names=names, specimens=specimens)
        missing = [one for one in specimens if not sources.runs.get(one)]
        if panel.kind == "scan":
            ids = [o.id for o in points() if o.group == specimens[0] and o.setting]
            missing = [] if sources.results.id.isin(ids).any() else ["runs"]
        if panel.kind == "distance" and not missing and not len(_distances(panel, sources)):
            missing = ["fines in such throats"]
        rows.append(row._asdict() | {"missing": "; ".join(missing)})
        if not missing:
            path = folder / f"figure_{panel.figure}.png"
            with_few_colours(draw(path, partial(_fill, panel=panel, sources=sources)), path)
    return rows


def _fill(figure: Any, *, panel: Any, sources: Sources) -> None:
    """Axes below each other, so narrow that a phone can show them, a head, and one legend."""
    kind, count = KINDS[panel.kind]
    figure.set_size_inches(5.0, 3.7 if count == 1 else 1.2 + 2.2 * count)
    figure.set_dpi(160)
    every = figure.subplots(count, 1, squeeze=False, sharex=True)[:, 0]
    every[-1].set_xlabel(panel.x)
    for axes in every:
        axes.set_ylabel(panel.y)
    lines = kind(every if count > 1 else every[0], panel, sources) or []
    numbers = [one.removeprefix("specimen") for one in panel.specimens if "specimen" in one]
    of = f", specimen{'s' * (len(numbers) > 1)} {', '.join(numbers)}" if numbers else ""
    head = f"Figure {panel.figure}{of}: {panel.text}" if panel.figure[0].isdigit() else panel.text
    figure.suptitle("\n".join([head, *lines]), fontsize=9, x=0.02, ha="left")
    entries = [axes.get_legend_handles_labels() for axes in figure.axes]
    once = {name: line for pair in entries for line, name in zip(*pair, strict=True)}
    if once:
        place = {"loc": "outside lower center", "ncols": min(count, 2), "fontsize": 9}
        figure.legend([*once.values()], [*once], **place)


def _stairs(axes: Any, edges: Array, rows: Any, *, color: str, **style: Any) -> None:
    """Steps of the mean of `rows` (S, B), one a seed, between `edges` (B+1,), with their range."""
    rows = np.atleast_2d(np.asarray(rows, float))
    axes.stairs(rows.mean(axis=0), edges, baseline=None, linewidth=2, color=color, **style)
    if len(rows) > 1:
        low, high = (np.append(one, one[-1]) for one in (rows.min(axis=0), rows.max(axis=0)))
        axes.fill_between(edges, low, high, step="post", color=color, alpha=0.2, linewidth=0)


def _style(runs: Sequence[Run]) -> dict[str, str]:
    """Colour of a specimen, and its name with the diameter of its fines."""
    number = specimen_of(runs[0].item.name)[-1]
    radii = dict.fromkeys(runs[0].state.case.fines.radius_range_m)
    across = "–".join(f"{2e3 * one:.3g}" for one in radii)
    seeds = f", {len(runs)} seeds" if len(runs) > 1 else ""
    return {"color": COLOURS[int(number)], "label": f"{number}: fines {across} mm{seeds}"}


# ---- The kinds of plot.
def _by_depth(run: Run, name: str) -> tuple[Array, Array]:
    """Edges (B+1,) mm and values (B,) of a quantity along depth."""
    if name == LOST:
        profile = run.thesis.profile
        return 1e3 * profile.edges, profile.porosity_initial - profile.porosity_damaged
    if name == SHARE:
        length = 1e3 * float(np.ptp(run.state.damaged.box[0]))
        edges = np.linspace(0.0, length, max(1, round(length / 0.25)) + 1)
        return edges, np.histogram(1e3 * run.depth, edges)[0] / max(len(run.depth), 1)
    section, edges = first_section(run, WHOLE), np.linspace(0.0, 1.0, 11)
    depth, weight = weighted(section, "throat depth")
    weight = weight * (section.fines.blocked if name == "throats blocked" else 1.0)
    return edges, np.histogram(depth, edges, weights=weight)[0]


def _depth(axes: Any, panel: Any, sources: Sources) -> None:
    """A quantity along depth, one curve a specimen or a quantity; marks of the thesis."""
    for specimen in panel.specimens:
        runs, thesis = sources.runs[specimen], thesis_of(specimen)
        for name, colour in zip(panel.names, (BLUE, ORANGE), strict=False):
            edges = _by_depth(runs[0], name)[0]
            style = {"color": colour, "label": name} if len(panel.names) > 1 else _style(runs)
            _stairs(axes, edges, [_by_depth(run, name)[1] for run in runs], **style)
            axes.set_xlim(0, edges[-1])
    alone = panel.names[0] if len(panel.specimens) == 1 else ""
    if alone == LOST:
        whole, face = thesis["porosity_loss"], thesis.get("face_porosity_loss")
        words = f"thesis, whole specimen: {whole:.2g}"
        axes.axhline(whole, color="black", linestyle=":", label=words)
        if face is not None:
            axes.plot(0, face, label="thesis, at the face: about", **MARK)
    if alone == SHARE:
        deep, first = thesis["invaded_depth_mm"], thesis.get("fraction_first_bin")
        axes.axvline(deep, color="black", linestyle=":", label=f"thesis, depth {deep:g} mm")
        if first is not None:
            axes.plot(0.25, first, label="thesis, its first bin: about", **MARK)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


def _density(axes: Any, panel: Any, sources: Sources) -> list[str]:
    """Probability density of quantities of pores and throats, and the thesis's shares."""
    (specimen,), names = panel.specimens, panel.names
    sections = [first_section(run, WHOLE) for run in sources.runs[specimen]]
    every = np.concatenate([v[w > 0] for v, w in (weighted(one, names[0]) for one in sections)])
    scale: Any = np.log10 if names[0] == "conductance" else np.asarray
    if scale is np.log10:
        low, high = scale(np.quantile(every[every > 0], [0.005, 0.995]))
        edges = 10 ** np.linspace(np.floor(2 * low) / 2, np.ceil(2 * high) / 2, 41)
        axes.set_xscale("log")
    else:
        last = 1.0 if names[0] == POROSITY else float(np.quantile(every, 0.995))
        edges = np.linspace(0.0, last, 41)
    for name, colour, line in zip(names, (BLUE, ORANGE), ("-", (0, (3, 1))), strict=False):
        pairs = [weighted(section, name) for section in sections]
        rows = [np.histogram(np.maximum(v, 0.0), edges, weights=w)[0] / w.sum() for v, w in pairs]
        label = f"{name}, {np.mean([w.sum() for _, w in pairs]):.0f} a seed"
        style: Any = {"color": colour, "label": label, "linestyle": line}
        _stairs(axes, edges, rows / np.diff(scale(edges)), **style)
    axes.set(xlim=edges[[0, -1]])
    axes.set_ylim(bottom=0)
    lines = []
    for (name, between), one in known.statistics_of(specimen).items():
        if name in names or (names[0] == POROSITY and "throats with" in name):
            ours = np.mean([measure(section, name, between)[0] for section in sections])
            span = (
                f" {between[0]:g}–{between[1]:g} {quantities.FIELDS[name][0]}".rstrip()
                if between
                else ""
            )
            given = f"{one['sense']} {100 * one['value']:g} %".replace("exact ", "")
            lines.append(f"{name}{span}: {100 * ours:.2g} % (thesis {given})")
    return lines


def _distances(panel: Any, sources: Sources) -> Array:
    between = (float(panel.names[0]), float(panel.names[1]))
    sections = [first_section(run, WHOLE) for run in sources.runs[panel.specimens[0]]]
    return np.concatenate(
        [quantities.fines_in_class(one, between)["distance"] for one in sections]
    )


def _distance(axes: Any, panel: Any, sources: Sources) -> list[str]:
    """Where fines sit in throats: nearer the axis, nearer the wall, centred beyond it."""
    values, edges = _distances(panel, sources), np.linspace(0.0, 2.0, 21)
    height = np.histogram(values, edges)[0] / len(values)
    words = ("nearer the axis", "nearer the wall", "centred beyond the wall")
    parts, ends = (slice(0, 5), slice(5, 10), slice(10, 20)), [0.0, 0.5, 1.0, np.inf]
    shares = np.histogram(values, ends)[0] / len(values)
    for part, color, word, one in zip(parts, (ORANGE, BLUE, GREY), words, shares, strict=True):
        style = {"align": "edge", "color": color, "label": f"{word}: {100 * one:.2g} %"}
        axes.bar(edges[part], height[part], 0.1, **style)
    lines = [f"{len(values)} fines"]
    for claim in known.published()["deposition"]:
        if claim["throat_porosity"] == [float(one) for one in panel.names] and "nearer" in claim:
            share = f"{claim['sense']} {100 * claim['value']:g} %"
            lines.append(f"thesis: {share} nearer the {claim['nearer']}")
    return lines


def _sections(every: Any, panel: Any, sources: Sources) -> None:
    """k / k0 of sections by the thesis's laws (above) and fdnet's (below), and in the thesis."""
    for axes, laws in zip(every, ("thesis", "own"), strict=True):
        for specimen in panel.specimens:
            runs, style = sources.runs[specimen], _style(sources.runs[specimen])
            slabs = [getattr(run, laws).sections for run in runs]
            edges = 1e3 * np.array([slabs[0][0].x_lo, *(one.x_hi for one in slabs[0])])
            for where, line in (("", "-"), ("_inplace", ":")):
                after, before = (attrgetter(f"k_{one}{where}") for one in ("damaged", "initial"))
                rows = [[after(slab) / before(slab) for slab in one] for one in slabs]
                more = {"linestyle": line} | ({"label": ""} if where else {})
                _stairs(axes, edges, rows, **style | more)
            given = 1.0 - np.array(reductions(thesis_of(specimen)))
            if laws == "thesis" and len(given):
                mark = MARK | {"color": style["color"], "label": "thesis"}
                axes.plot(np.arange(len(given)) + 0.5, given, **mark)
        axes.plot([], [], ":", color=GREY, label="in place")
        axes.set(xlim=(0, edges[-1]), ylim=(0, 1.05))
        words = "the thesis's" if laws == "thesis" else "fdnet's"
        axes.set_title(f"by {words} laws", fontsize=9, loc="left")


def _bars(axes: Any, panel: Any, sources: Sources) -> None:
    """A bar of each quantity a specimen, with the range over seeds, and the thesis's loss."""
    places, runs = np.arange(len(panel.specimens)), [sources.runs[o] for o in panel.specimens]
    for name, shift, colour in zip(panel.names, (-0.2, 0.2), (BLUE, ORANGE), strict=True):
        rows = [values_of(sources.results, one[0].item.name, name) for one in runs]
        means = [float(np.mean(one)) for one in rows]
        made = axes.bar(places + shift, means, 0.38, color=colour, alpha=0.75, label=name)
        axes.bar_label(made, fmt="%.2g", fontsize=9)
        ends = [min(one) for one in rows], [max(one) for one in rows]
        axes.vlines(places + shift, *ends, color="black", linewidth=1)
    given = [100 * thesis_of(one)["porosity_loss"] for one in panel.specimens]
    axes.plot(places, given, label="thesis, whole specimen", **MARK)
    axes.set_xticks(places, [_style(one[:1])["label"].replace(": ", ":\n") for one in runs])
    axes.tick_params(axis="x", labelsize=9)
    axes.grid(axis="x", visible=False)


def _scan(every: Any, panel: Any, sources: Sources) -> None:
    """Quantities against what is scanned, one curve a case, with the range over its seeds."""
    (group,) = panel.specimens
    plan = [one for one in points() if one.group == group]
    for axes, name in zip(every, panel.names, strict=True):
        for case in dict.fromkeys(one.name for one in plan):
            seeds = {one.seed for one in plan if one.name == case}
            rows = sources.results[sources.results.seed.isin(seeds)]
            ids = {float(one.value): one.id for one in plan if one.name == case}
            curve = {x: values_of(rows, ids[x], name) for x in sorted(ids)}
            curve = {x: values for x, values in curve.items() if len(values)}
            colour = COLOURS[int(specimen_of(case)[-1])]
            low, mean, high = ([f(one) for one in curve.values()] for f in (min, np.mean, max))
            axes.plot([*curve], mean, "o-", color=colour, label=case)
            axes.fill_between([*curve], low, high, color=colour, alpha=0.2, linewidth=0)
        if name == "deepest fine":
            axes.plot(
                1.0, thesis_of("table3")["invaded_depth_mm"], label="thesis, Table 3", **MARK
            )
        axes.set_xscale("log" if group == "drag" else "linear")
        axes.set_ylim(bottom=0)
        unit = QUANTITIES[name].unit
        axes.set_ylabel(f"{name} ({unit})" if unit else name, fontsize=8)


# ---- Spheres seen from the side.
def _colours(spheres: Snapshot, by_size: bool) -> Array:
    """Greys (N, 3) of grains, lighter when nearer; fines orange, or by size as in Figure 21."""
    y = spheres.position[:, 1]
    near = (y.max() - y) / max(float(np.ptp(y)), 1e-12)
    grey = np.repeat((0.62 + 0.31 * np.round(11 * near) / 11)[:, None], 3, axis=1)
    colours = np.where((spheres.kind == Kind.GRAIN)[:, None], grey, [0.84, 0.37, 0.0])
    if by_size:
        small, large = sorted(thesis_of("specimen7")["size_classes_mm"])
        radius = 1e3 * spheres.radius
        colours[(radius > small[1]) & (radius < large[0])] = 0.89
        colours[radius <= small[1]] = 0.0
    return colours


def _paint(axes: Any, spheres: Snapshot, *, by_size: bool) -> None:
    """Circles of the spheres, near ones over far ones, with the face dashed."""
    from matplotlib.collections import EllipseCollection

    spheres = spheres.where(np.argsort(-spheres.position[:, 1], kind="stable"))
    wide, where = 2e3 * spheres.radius, 1e3 * spheres.position[:, ::2]
    style: Any = {"facecolors": _colours(spheres, by_size), "edgecolors": "#5E5E5E"}
    style["linewidths"] = np.where(spheres.kind == Kind.GRAIN, 0.5, 0.1)
    places: Any = {"units": "xy", "offsets": where, "offset_transform": axes.transData}
    axes.add_collection(EllipseCollection(wide, wide, np.zeros(len(wide)), **places, **style))
    (low, high), _, (bottom, top) = 1e3 * spheres.box
    axes.axvline(low, color=BLUE, linestyle="--")
    start = max(-1.5, min(0.0, float(where[:, 0].min())))
    axes.set(xlim=(start - 0.2, high + 0.2), ylim=(bottom - 0.1, top + 0.1))
    axes.set(aspect="equal", ylabel="z (mm)")
    axes.grid(False)


def _spheres(axes: Any, panel: Any, sources: Sources) -> list[str]:
    """The pack, a slab a grain thick through the invaded one, or the invaded fines by size."""
    run, what = sources.runs[panel.specimens[0]][0], panel.names[0]
    if what == "pack":
        _paint(axes, run.state.grains, by_size=False)
        return [f"{len(run.state.grains):,} grains"]
    spheres = run.state.damaged
    behind = spheres.position[:, 1] - spheres.box[1].mean()
    shown = (behind >= 0) & (behind < 2 * spheres.grains().radius.max())
    if what == "sizes":
        shown = (spheres.kind == Kind.FINE) & (spheres.position[:, 0] >= spheres.box[0, 0])
    _paint(axes, spheres.where(shown), by_size=what == "sizes")
    return [f"{run.thesis.invaded_count:,} invaded fines"]


_ALL = (_depth, _density, _distance, _bars, _spheres)
KINDS: dict[str, tuple[Callable[..., Any], int]] = {one.__name__[1:]: (one, 1) for one in _ALL}
KINDS |= {"sections": (_sections, 2), "scan": (_scan, 3)}
"""The function of each kind of plot, and the number of its axes."""
