"""The one picture of a study: signed errors in percent with their bands, against run time."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from fdnet.files import replacing
from validation.judge import Level, Shortcut, among, levels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#5A5A5A", "#8C564B")
"""Okabe and Ito (2008), which readers with any colour vision can tell apart."""
MARKERS = "osD^vP<X"
WIDTH, HEIGHT, ROW, DPI = 3.6, 2.2, 0.32, 190
"""Inches: a phone shows the whole width with letters of its own size."""
COSTS = {"core_s": "core seconds", "steps": "steps"}


def draw(panels: Sequence[Mapping[str, Any]], rows: pd.DataFrame, path: Path) -> None:
    """Draw one axes below the other, each with one quantity of some series.

    A panel with `lines` has a line of words for each value, any other has run time along x.
    """
    shown = [panel for panel in panels if _series(panel, rows)]
    lines = [_lines(panel, rows) if "lines" in panel else [] for panel in shown]
    heights = [ROW * len(own) + 0.55 if own else HEIGHT for own in lines]

    def fill(places: Sequence["Axes"]) -> None:
        for panel, own, axes in zip(shown, lines, places, strict=False):
            if own:
                _draw_lines(axes, own, panel)
            else:
                _draw_panel(axes, panel, rows)

    _save(path, heights or [HEIGHT], fill)


def _save(path: Path, heights: Sequence[float], fill: Callable[[Sequence["Axes"]], None]) -> None:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"font.size": 8, "axes.titlesize": 8, "legend.fontsize": 7}):
        figure = Figure(figsize=(WIDTH, sum(heights)), layout="constrained")
        fill(figure.subplots(len(heights), squeeze=False, height_ratios=heights)[:, 0])
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
    """Run time on a logarithm, errors by `_error_scale`."""
    from matplotlib.ticker import LogLocator

    axes.set_xscale("log")
    few = max(one.cost for one in points) < 10 * min(one.cost for one in points)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if few else (1,)))
    _plain(axes.xaxis)
    _error_scale(axes, "y", [(100 * one.error, 100 * one.band) for one in points], panel)
    axes.margins(x=0.1)
    axes.grid(alpha=0.3, linewidth=0.5)


def _error_scale(
    axes: "Axes", way: str, points: Sequence[tuple[float, float]], panel: Mapping[str, Any]
) -> None:
    """Errors and bands in percent: shares as they are, magnitudes on a logarithm, others signed
    about zero and on a logarithm beyond."""
    from matplotlib.ticker import LogLocator, SymmetricalLogLocator

    axis = getattr(axes, f"{way}axis")
    sizes = [max(abs(error), band) for error, band in points]
    sizes = [size for size in sizes if size > 0] or [1.0]
    if panel.get("share"):
        axes.set(**{f"{way}lim": (-4, 104)})
        return
    if panel.get("magnitude"):
        axes.set(**{f"{way}scale": "log"})
        least = min(abs(error) for error, _ in points if error)
        axes.set(**{f"{way}lim": (0.3 * least, 3 * max(sizes))})
        axis.set_major_locator(LogLocator(numticks=6))
    else:
        least = max(min(sizes), max(sizes) / 10.0 ** panel.get("decades", 2))
        linear = 10.0 ** math.floor(math.log10(least))
        getattr(axes, f"set_{way}scale")("symlog", linthresh=linear)
        axis.set_major_locator(SymmetricalLogLocator(base=10, linthresh=linear))
        (axes.axhline if way == "y" else axes.axvline)(0.0, color="black", linewidth=0.7)
        axes.margins(**{way: 0.12})
    _plain(axis)


def _plain(axis: Any) -> None:
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _short(value: str) -> str:
    """A value of a knob in few letters: 1e4, but 1,525."""
    try:
        number = float(value)
    except ValueError:
        return value
    if number != float(f"{number:.3g}") and number.is_integer():
        return f"{number:,.0f}"
    return f"{number:.3g}".replace("e+0", "e").replace("e-0", "e-")


class _Line(NamedTuple):
    """An error with its band and the words above it; an open dot is not resolved."""

    words: str
    error: float
    band: float
    resolved: bool
    colour: str


def _lines(panel: Mapping[str, Any], rows: pd.DataFrame) -> list[_Line]:
    """A line for each value; `lines` says it with {series}, {value} and {cost} in seconds."""
    made = []
    for number, name in enumerate(_series(panel, rows)):
        series = name.removesuffix(panel.get("common", "")).removeprefix(panel.get("begin", ""))
        for one in levels(rows, name, panel["quantity"]):
            value = _short(one.value)
            if among(value, panel.get("values", "*")):
                words = panel["lines"].format(series=series, value=value, cost=f"{one.cost:.2g}")
                words = words.replace(" to own", "")
                colour = CURVES[number % len(CURVES)]
                sure = one.resolved or "label" in panel
                made.append(_Line(words, one.error, one.band, sure, colour))
    return made


def _draw_lines(axes: "Axes", lines: Sequence[_Line], panel: Mapping[str, Any]) -> None:
    size = 7 if max(len(one.words) for one in lines) < 52 else 6.2
    for place, one in enumerate(reversed(lines)):
        face = one.colour if one.resolved else "white"
        axes.errorbar(
            100 * one.error, place, xerr=100 * one.band, fmt="o", color=one.colour, mfc=face,
            capsize=2, markersize=4,
        )  # fmt: skip
        axes.text(
            0.01, place + 0.24, one.words, fontsize=size, transform=axes.get_yaxis_transform(),
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
        )  # fmt: skip
    _error_scale(axes, "x", [(100 * one.error, 100 * one.band) for one in lines], panel)
    if "limits" in panel:
        axes.set_xlim(panel["limits"])
    label = panel.get("label", "error, % (open: not resolved)")
    axes.set(xlabel=label, ylim=(-0.6, len(lines) - 0.2), yticks=[])
    axes.set_title(panel.get("title", ""))
    axes.grid(alpha=0.3, linewidth=0.5, axis="x")


def draw_answer(shortcuts: Sequence[Shortcut], path: Path) -> None:
    """Draw the error that each shortcut makes, one below the other, and what it saves."""
    lines = [
        _Line(
            f"{one.says}: {one.error_of}, {1 / one.saves:.2g} × time",
            one.level.error,
            one.level.band,
            one.resolved,
            CURVES[0] if one.resolved else CURVES[6],
        )
        for one in shortcuts
    ]
    panel = {"limits": (-100, 100), "decades": 2}
    _save(path, [ROW * len(lines) + 0.4], lambda places: _draw_lines(places[0], lines, panel))
