"""The figures of a comparison, as SVG texts: depth, heat map, small multiples."""

import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.campaign.page.depth import DepthCurve, depth_curves
from fdnet.campaign.result.comparison import Comparison, is_number
from fdnet.campaign.result.words import label, unit_of

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#5A5A5A", "#8C564B")
"""The palette of Okabe and Ito (2008), which readers with any colour vision can tell apart."""
MOST_CURVES = 8
"""Most variants that one figure of curves shows: the first of the ranking."""


def draw_figures(comparison: Comparison) -> list[tuple[str, str]]:
    """SVG text and caption of each figure that the comparison has data for."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "fdnet"
    figures = [_ranking(comparison), _depth(comparison)]
    keys = _number_keys(comparison)
    if len(keys) == 2:
        figures.append(_heat_map(comparison, keys))
    if keys:
        figures.append(_multiples(comparison, keys))
    return [figure for figure in figures if figure is not None]


def _number_keys(comparison: Comparison) -> list[str]:
    """Varied keys that hold different numbers."""
    result = []
    for key in comparison.keys:
        values = [comparison.keys_of(name).get(key) for name in comparison.variants]
        if (
            all(number_of(value) is not None for value in values)
            and len(set(map(str, values))) > 1
        ):
            result.append(key)
    return result


def number_of(value: Any) -> float | None:
    """A number, or the number that a text with a unit begins with; None for anything else."""
    if is_number(value):
        return float(value)
    try:
        return float(str(value).split()[0]) if isinstance(value, str) else None
    except (ValueError, IndexError):
        return None


def _ranking(comparison: Comparison) -> tuple[str, str] | None:
    """Every run as a dot, the mean of each variant with its band."""
    names = [n for n in comparison.ranking() if comparison.values(n, comparison.ranked_by)]
    if not names:
        return None
    factor, unit = unit_of(comparison.ranked_by)
    figure, axes = _axes(7.2, 0.9 + 0.42 * len(names))
    for place, name in enumerate(names):
        values = np.array(list(comparison.values(name, comparison.ranked_by).values()))
        band = comparison.band(name, comparison.ranked_by)
        axes.plot(factor * values, np.full(len(values), place), "o", ms=4, color="0.6", zorder=2)
        if not math.isnan(band.low):
            axes.hlines(
                place, factor * band.low, factor * band.high, color=COLOURS[0], lw=5, alpha=0.4
            )
        axes.plot(factor * band.mean, place, "|", ms=16, mew=2.5, color=COLOURS[0], zorder=3)
    axes.set_yticks(range(len(names)), [_short(name) for name in names])
    axes.invert_yaxis()
    axes.margins(y=0.25 / len(names) + 0.05)
    axes.set_xlabel(_with_unit(label(comparison.ranked_by), unit))
    axes.grid(axis="x", lw=0.4, color="0.85")
    caption = (
        "Every run (grey), the mean over the seeds of each variant (line) and its 95 % band "
        "(blue), best first."
    )
    return _svg(figure), caption


def _depth(comparison: Comparison) -> tuple[str, str] | None:
    curves = {name: depth_curves(comparison, name) for name in comparison.ranking()[:MOST_CURVES]}
    curves = {name: curve for name, curve in curves.items() if curve is not None}
    if not curves:
        return None
    figure, axes = _axes(7.2, 4.2)
    for index, (name, curve) in enumerate(curves.items()):
        assert curve is not None
        _draw_curve(axes, name, curve, COLOURS[index % len(COLOURS)])
    axes.set_xlabel("depth (mm)")
    axes.set_ylabel("permeability in place (mD)")
    axes.set_ylim(bottom=0)
    axes.grid(lw=0.4, color="0.85")
    axes.legend(fontsize=8, framealpha=0.9)
    left_out = len(comparison.variants) - len(curves)
    more = f" {left_out} variants further down the ranking are left out." if left_out > 0 else ""
    caption = (
        "Permeability of the slabs by depth after the invasion, mean over the seeds with its 95 % "
        f"band; dashed is the intact sand.{more}"
    )
    return _svg(figure), caption


def _draw_curve(axes: Any, name: str, curve: DepthCurve, colour: str) -> None:
    """A stair of slabs with its band."""
    edges = 1e3 * curve.edges
    axes.stairs(curve.damaged, edges, baseline=None, color=colour, lw=2, label=_short(name))
    axes.stairs(curve.intact, edges, baseline=None, color=colour, lw=1, ls="--")
    if curve.low is not None and curve.high is not None:
        axes.stairs(
            curve.high,
            edges,
            baseline=curve.low,
            fill=True,
            color=colour,
            alpha=0.18,
        )


def _heat_map(comparison: Comparison, keys: Sequence[str]) -> tuple[str, str] | None:
    """The mean of the ranked quantity over two swept keys."""
    factor, unit = unit_of(comparison.ranked_by)
    cells: dict[tuple[float, float], list[float]] = {}
    for name in comparison.variants:
        held = comparison.keys_of(name)
        place = tuple(number_of(held.get(key)) for key in keys)
        mean = comparison.band(name, comparison.ranked_by).mean
        if not math.isnan(mean):
            cells.setdefault((place[0] or 0.0, place[1] or 0.0), []).append(factor * mean)
    xs, ys = sorted({x for x, _ in cells}), sorted({y for _, y in cells})
    if len(xs) < 2 or len(ys) < 2:
        return None
    grid = np.full((len(ys), len(xs)), np.nan)
    for (x, y), values in cells.items():
        grid[ys.index(y), xs.index(x)] = float(np.mean(values))
    figure, axes = _axes(1.8 + 0.9 * len(xs), 1.4 + 0.55 * len(ys))
    image = axes.imshow(grid, origin="lower", aspect="auto", cmap="viridis")
    middle = (np.nanmin(grid) + np.nanmax(grid)) / 2
    for (j, i), value in np.ndenumerate(grid):
        if not math.isnan(value):
            ink = "white" if value < middle else "black"
            axes.text(i, j, f"{value:.3g}", ha="center", va="center", color=ink, fontsize=9)
    axes.set_xticks(range(len(xs)), [f"{x:g}" for x in xs])
    axes.set_yticks(range(len(ys)), [f"{y:g}" for y in ys])
    axes.set_xlabel(keys[0])
    axes.set_ylabel(keys[1])
    figure.colorbar(image, ax=axes, label=_with_unit(label(comparison.ranked_by), unit))
    return _svg(figure), f"Mean of {label(comparison.ranked_by)} over the two swept keys."


def _multiples(comparison: Comparison, keys: Sequence[str]) -> tuple[str, str] | None:
    """One panel for each swept key: every variant with its band."""
    import matplotlib.pyplot as plt

    factor, unit = unit_of(comparison.ranked_by)
    columns = min(3, len(keys))
    lines = math.ceil(len(keys) / columns)
    figure, grid = plt.subplots(
        lines,
        columns,
        figsize=(3.2 * columns + 0.6, 2.8 * lines),
        squeeze=False,
        sharey=True,
        constrained_layout=True,
    )
    for panel, key in zip(grid.flat, keys, strict=False):
        for name in comparison.variants:
            band = comparison.band(name, comparison.ranked_by)
            x = number_of(comparison.keys_of(name).get(key))
            if math.isnan(band.mean):
                continue
            if not math.isnan(band.low):
                panel.vlines(
                    x, factor * band.low, factor * band.high, color=COLOURS[0], lw=4, alpha=0.3
                )
            panel.plot([x], [factor * band.mean], "o", color=COLOURS[0], ms=5)
        panel.set_xlabel(key)
        panel.grid(lw=0.4, color="0.85")
    for panel in list(grid.flat)[len(keys) :]:
        panel.set_visible(False)
    for row in grid:
        row[0].set_ylabel(_with_unit(label(comparison.ranked_by), unit))
    return _svg(figure), "Every variant against each swept key, with its 95 % band."


def _axes(width: float, height: float) -> tuple[Any, Any]:
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(width, height), constrained_layout=True)


def _svg(figure: Any) -> str:
    import matplotlib.pyplot as plt

    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return text.getvalue()


def _short(name: str) -> str:
    """A name as it is drawn: not too long, and no sign of it read as a formula."""
    shown = name if len(name) <= 40 else f"{name[:37]}..."
    return shown.replace("$", r"\$")


def _with_unit(text: str, unit: str) -> str:
    return f"{text} ({unit})" if unit else text
