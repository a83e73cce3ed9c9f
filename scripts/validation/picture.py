"""The one picture of a study: errors in percent with their bands, a line of words for each."""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from fdnet.files import replacing
from validation.judge import Shortcut, among, levels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVES = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#5A5A5A", "#8C564B")
"""Okabe and Ito (2008), which readers with any colour vision can tell apart."""
WIDTH, ROW, DPI = 3.6, 0.32, 190
"""Inches: a phone shows the whole width with letters of its own size."""
MOST_VALUES = 4
"""Values of a series that are drawn; of more, as many with equal steps between them."""
UNITS = {"core_s": "s", "steps": "steps"}


class Line(NamedTuple):
    """An error with its band and the words above it; an open dot is not resolved."""

    words: str
    error: float
    band: float
    resolved: bool
    colour: str


def draw(panels: Sequence[Mapping[str, Any]], rows: pd.DataFrame, path: Path) -> None:
    """Draw one axes below the other, each with one quantity of some series."""
    shown = [(panel, lines) for panel in panels if (lines := _lines(panel, rows))]

    def fill(places: Sequence["Axes"]) -> None:
        for (panel, lines), axes in zip(shown, places, strict=False):
            _draw_lines(axes, lines, panel)

    _save(path, [ROW * len(lines) + 0.55 for _, lines in shown] or [ROW], fill)


def draw_answer(shortcuts: Sequence[Shortcut], path: Path) -> None:
    """Draw the error that each shortcut makes, one below the other, and what it saves."""
    lines = [
        Line(
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


def _save(path: Path, heights: Sequence[float], fill: Callable[[Sequence["Axes"]], None]) -> None:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"font.size": 8, "axes.titlesize": 8}):
        figure = Figure(figsize=(WIDTH, sum(heights)), layout="constrained")
        fill(list(figure.subplots(len(heights), squeeze=False, height_ratios=heights)[:, 0]))
        drawn = io.BytesIO()
        figure.savefig(drawn, dpi=DPI, format="png")
    with_few_colours(drawn, path)


def with_few_colours(drawn: Any, path: Path) -> None:
    """Keep 64 colours of a drawn picture, which is then a third as large."""
    from PIL import Image

    few = Image.open(drawn).convert("RGB").quantize(64, dither=Image.Dither.NONE)
    with replacing(path) as part:
        few.save(part, format="png", optimize=True)


def _lines(panel: Mapping[str, Any], rows: pd.DataFrame) -> list[Line]:
    """A line for each value; `lines` says it with {series}, {value} and {cost}."""
    own = rows[(rows.quantity == panel["quantity"]) & rows.error.notna()]
    names = [name for name in dict.fromkeys(own.series) if among(name, panel.get("series", "*"))]
    many, cost = "{series}: " * (len(names) > 1), panel.get("cost", "core_s")
    made = []
    for number, name in enumerate(names):
        series = name.removesuffix(panel.get("common", "")).removeprefix(panel.get("begin", ""))
        known = levels(rows, name, panel["quantity"], cost=cost)
        known = [one for one in known if among(_short(one.value), panel.get("values", "*"))]
        few = np.linspace(0, len(known) - 1, min(len(known), MOST_VALUES)).round().astype(int)
        for one in (known[index] for index in few):
            took = f"{one.cost:,.0f}" if one.cost >= 100 else f"{one.cost:.2g}"
            words = panel.get("lines", f"{many}{{value}}, {{cost}}").format(
                series=series, value=_short(one.value), cost=f"{took} {UNITS[cost]}"
            )
            sure, colour = one.resolved or "label" in panel, CURVES[number % len(CURVES)]
            words = words.replace(" to own", "")
            made.append(Line(words, one.error, one.band, sure, colour))
    return made


def _draw_lines(axes: "Axes", lines: Sequence[Line], panel: Mapping[str, Any]) -> None:
    size = 7 if max(len(one.words) for one in lines) < 52 else 6.2
    for place, one in enumerate(reversed(lines)):
        face = one.colour if one.resolved else "white"
        dot: Any = {"fmt": "o", "color": one.colour, "mfc": face, "capsize": 2, "markersize": 4}
        axes.errorbar(100 * one.error, place, xerr=100 * one.band, **dot)
        above: Any = {"fontsize": size, "transform": axes.get_yaxis_transform()}
        white = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
        axes.text(0.01, place + 0.24, one.words, bbox=white, **above)
    _scale(axes, lines, panel)
    if "limits" in panel:
        axes.set_xlim(panel["limits"])
    label = panel.get("label", "error, % (open: not resolved)")
    axes.set(xlabel=label, ylim=(-0.6, len(lines) - 0.2), yticks=[], title=panel.get("title", ""))
    axes.grid(alpha=0.3, linewidth=0.5, axis="x")


def _scale(axes: "Axes", lines: Sequence[Line], panel: Mapping[str, Any]) -> None:
    """Shares as they are, magnitudes on a logarithm, errors about zero and on one beyond."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, SymmetricalLogLocator

    if panel.get("share"):
        axes.set(xlim=(-4, 104))
        return
    sizes = [100 * max(abs(one.error), one.band) for one in lines]
    sizes = [size for size in sizes if size > 0] or [1.0]
    if panel.get("magnitude"):
        least = 100 * min((abs(one.error) for one in lines if one.error), default=0.01)
        axes.set(xscale="log", xlim=(0.3 * least, 3 * max(sizes)))
        axes.xaxis.set_major_locator(LogLocator(numticks=6))
    else:
        least = max(min(sizes), max(sizes) / 10.0 ** panel.get("decades", 2))
        linear = 10.0 ** math.floor(math.log10(least))
        axes.set_xscale("symlog", linthresh=linear)
        axes.xaxis.set_major_locator(SymmetricalLogLocator(base=10, linthresh=linear))
        axes.axvline(0.0, color="black", linewidth=0.7)
        axes.margins(x=0.12)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _short(value: str) -> str:
    """A value of a knob in few letters: 1e4, but 1,525."""
    try:
        number = float(value)
    except ValueError:
        return value
    if number != float(f"{number:.3g}") and number.is_integer():
        return f"{number:,.0f}"
    return f"{number:.3g}".replace("e+0", "e").replace("e-0", "e-")
