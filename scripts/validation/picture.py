"""The one picture of a study: signed errors in percent with their bands, against run time."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from fdnet.files import replacing
from validation.judge import Level, Shortcut, among, levels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#5A5A5A", "#8C564B")
"""Okabe and Ito (2008), which readers with any colour vision can tell apart."""
MARKERS = "osD^vP<X"
WIDTH, HEIGHT, DPI = 3.6, 2.2, 190
"""Inches: a phone shows the whole width with letters of its own size."""
COSTS = {"core_s": "core seconds", "steps": "steps"}


def draw(panels: Sequence[Mapping[str, Any]], rows: pd.DataFrame, path: Path) -> None:
    """Draw one axes below the other, each with one quantity of some series."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = [panel for panel in panels if _series(panel, rows)]
    with rc_context({"font.size": 7.5, "axes.titlesize": 7.5, "legend.fontsize": 6.5}):
        size = (WIDTH, HEIGHT * max(len(shown), 1))
        figure = Figure(figsize=size, layout="constrained")
        places = figure.subplots(max(len(shown), 1), squeeze=False)[:, 0]
        for panel, axes in zip(shown, places, strict=False):
            _draw_panel(axes, panel, rows)
        with replacing(path) as part:
            figure.savefig(part, dpi=DPI, format="png")


def _series(panel: Mapping[str, Any], rows: pd.DataFrame) -> list[str]:
    own = rows[(rows.quantity == panel["quantity"]) & rows.error.notna()]
    return [name for name in dict.fromkeys(own.series) if among(name, panel.get("series", "*"))]


def _draw_panel(axes: "Axes", panel: Mapping[str, Any], rows: pd.DataFrame) -> None:
    cost = panel.get("cost", "core_s")
    by_series = {
        name: levels(rows, name, panel["quantity"], cost=cost) for name in _series(panel, rows)
    }
    points = [one for of_series in by_series.values() for one in of_series]
    labels = [
        name.removesuffix(panel.get("common", "")).removeprefix(panel.get("begin", ""))
        for name in by_series
    ]
    middle = math.sqrt(min(one.cost for one in points) * max(one.cost for one in points))
    for number, of_series in enumerate(by_series.values()):
        colour = CURVES[number % len(CURVES)]
        axes.errorbar(
            [one.cost for one in of_series],
            [100 * one.error for one in of_series],
            [100 * one.band for one in of_series],
            fmt=MARKERS[number % len(MARKERS)],
            color=colour,
            markersize=3.5,
            linewidth=0.8,
            capsize=1.5,
            label=labels[number],
        )
        for one in of_series:
            left = one.cost < 1.001 * middle
            axes.annotate(
                _short(one.value),
                (one.cost, 100 * one.error),
                (3 if left else -3, 3 if number % 2 == 0 else -8),
                textcoords="offset points",
                horizontalalignment="left" if left else "right",
                fontsize=5.5,
                color=colour,
            )
    _scale(axes, points, panel)
    axes.set(title=panel["title"], xlabel=COSTS[cost], ylabel=panel.get("label", "error, %"))
    if len(by_series) > 1:
        axes.legend(
            loc="upper center",
            bbox_to_anchor=(0.5, -0.26),
            ncols=1 if any(len(name) > 45 for name in labels) else 2,
            handletextpad=0.2,
            frameon=False,
            borderpad=0,
        )


def _scale(axes: "Axes", points: Sequence[Level], panel: Mapping[str, Any]) -> None:
    """Run time on a logarithm; errors too if they are magnitudes, else signed about zero."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, SymmetricalLogLocator

    plain = FuncFormatter(lambda value, _: f"{value:g}")
    sizes = [100 * max(abs(one.error), one.band) for one in points]
    sizes = [size for size in sizes if size > 0] or [1.0]
    axes.set_xscale("log")
    few = max(one.cost for one in points) < 10 * min(one.cost for one in points)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
    if panel.get("magnitude"):
        axes.set_yscale("log", nonpositive="clip")
        axes.set_ylim(
            0.3 * min(100 * abs(one.error) for one in points if one.error), 3 * max(sizes)
        )
        axes.yaxis.set_major_locator(LogLocator(numticks=6))
    else:
        least = max(min(sizes), max(sizes) / 10.0 ** panel.get("decades", 2))
        linear = 10.0 ** math.floor(math.log10(least))
        axes.set_yscale("symlog", linthresh=linear)
        axes.yaxis.set_major_locator(SymmetricalLogLocator(base=10, linthresh=linear))
        axes.axhline(0.0, color="black", linewidth=0.7)
        axes.margins(y=0.12)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(plain)
        axis.set_minor_formatter(NullFormatter())
    axes.margins(x=0.1)
    axes.grid(alpha=0.3, linewidth=0.5)


def _short(value: str) -> str:
    """A value of a knob in few letters: 1e4, but 1,525."""
    try:
        number = float(value)
    except ValueError:
        return value
    if number != float(f"{number:.3g}") and number.is_integer():
        return f"{number:,.0f}"
    return f"{number:.3g}".replace("e+0", "e").replace("e-0", "e-")


def draw_answer(shortcuts: Sequence[Shortcut], path: Path) -> None:
    """Draw the error that each shortcut makes, one below the other, and what it saves."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    with rc_context({"font.size": 7.5}):
        figure = Figure(figsize=(WIDTH, 0.42 * len(shortcuts) + 0.7), layout="constrained")
        axes = figure.subplots()
        for place, one in enumerate(reversed(shortcuts)):
            error, band = 100 * one.level.error, 100 * one.level.band
            colour = CURVES[0] if one.resolved else CURVES[6]
            face = colour if one.resolved else "white"
            axes.errorbar(
                error, place, xerr=band, fmt="o", color=colour, mfc=face, capsize=2, markersize=4
            )
            words = f"{one.says}: {one.error_of}, {1 / one.saves:.2g} × time"
            where = axes.get_yaxis_transform()
            axes.text(0.01, place + 0.26, words, fontsize=6.2, transform=where)
        axes.axvline(0.0, color="black", linewidth=0.7)
        axes.set_xscale("symlog", linthresh=1.0)
        axes.set_xlim(-100, 100)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:+g}"))
        axes.set(xlabel="error, % (open: not resolved)", ylim=(-0.6, len(shortcuts) - 0.3))
        axes.set_yticks([])
        axes.grid(alpha=0.3, linewidth=0.5, axis="x")
        with replacing(path) as part:
            figure.savefig(part, dpi=DPI, format="png")
