"""The figure of a study: error against run time, with bands over seeds and fdnet's default."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fdnet.files import replacing
from validation.engine.levels import Level, levels
from validation.engine.palette import CURVES
from validation.engine.study import Panel, Row, Study, shown

MARKERS = "osD^vP<X"
TURN = 0.75
"""Share of the range of run times beyond which names stand to the left of their markers."""
PLACES = ((4, -11), (8, -3), (4, 14), (4, -20), (14, 5), (14, -11), (4, 23), (4, -29), (24, -3))
"""Where a label may stand from its point, in points, in the order in which it is tried."""
_WIDTH, _HEIGHT = 6.2, 4.6
_COST_LABELS = {
    "core_s": "run time, core s",
    "wall_s": "run time, s",
    "peak_memory_mb": "peak memory, MB",
    "steps": "steps",
}


def draw_study(study: Study, rows: Sequence[Row], path: Path) -> None:
    """Draws one axes for each panel that has rows, up to three side by side.

    A study that draws its own figure does that.
    """
    if study.draw:
        study.draw(rows, path)
        return
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    panels = [panel for panel in study.panels if series_of(panel, rows)]
    columns = 2 if len(panels) == 4 else min(3, max(len(panels), 1))
    lines = max(math.ceil(len(panels) / columns), 1)
    figure, axes = plt.subplots(
        lines,
        columns,
        figsize=(_WIDTH * columns, _HEIGHT * lines),
        squeeze=False,
        constrained_layout=True,
    )
    flat = list(axes.flat)
    for panel, place in zip(panels, flat, strict=False):
        _draw_panel(place, study, panel, rows)
    figure.draw_without_rendering()
    for place in flat[: len(panels)]:
        spread_labels(place)
    for place in flat[len(panels) :]:
        place.set_visible(False)
    figure.suptitle(f"{study.title} (labels: {study.knob_label})", fontsize=11)
    with replacing(path) as part:
        figure.savefig(part, dpi=110)
    plt.close(figure)


def series_of(panel: Panel, rows: Sequence[Row]) -> list[str]:
    """The series a panel shows, in the order of the table."""
    having = dict.fromkeys(row.series for row in rows if row.quantity == panel.quantity)
    return [name for name in having if not panel.series or name in panel.series]


def _draw_panel(axes: Any, study: Study, panel: Panel, rows: Sequence[Row]) -> None:
    shown_levels = {
        name: levels(rows, name, panel.quantity, cost=panel.cost)
        for name in series_of(panel, rows)
    }
    floor = _floor([level for of_series in shown_levels.values() for level in of_series])
    costs = [
        level.cost for of_series in shown_levels.values() for level in of_series if level.cost > 0
    ]
    turn = min(costs, default=1.0) * (max(costs, default=1.0) / min(costs, default=1.0)) ** TURN
    for index, (name, of_series) in enumerate(shown_levels.items()):
        if of_series:
            _draw_series(
                axes,
                name.removesuffix(panel.common),
                of_series,
                study.defaults.get(name),
                index,
                floor,
            )
            if panel.cost != "value":
                _label(axes, of_series, index, floor, turn)
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel(
        panel.knob if panel.cost == "value" else _COST_LABELS.get(panel.cost, panel.cost)
    )
    axes.set_ylabel(panel.label)
    axes.set_title(panel.title, fontsize=10)
    axes.grid(which="major", lw=0.4, color="0.85")
    axes.margins(0.12)
    _widen(axes)
    _plain_ticks(axes)
    axes.tick_params(which="minor", labelsize=6)
    handles, names = axes.get_legend_handles_labels()
    once = dict(zip(names, handles, strict=True))
    if once:
        axes.legend(
            [*once.values()],
            [*once],
            fontsize=8,
            frameon=False,
            loc="upper center",
            bbox_to_anchor=(0.5, -0.13),
            ncols=2,
        )


def _floor(of_series: Sequence[Level]) -> float:
    """Where errors of 0 are drawn: below the smallest error, or well within the bands."""
    sizes = [level.size for level in of_series if level.size > 0]
    bands = [level.half_width for level in of_series if level.half_width > 0]
    return 0.5 * min(sizes) if sizes else 0.1 * min(bands, default=1e-15)


def _widen(axes: Any) -> None:
    """At least a decade of error, so that what does not change looks so."""
    low, high = axes.get_ylim()
    if high < 10 * low:
        middle = math.sqrt(low * high)
        axes.set_ylim(middle / math.sqrt(10), middle * math.sqrt(10))


def _plain_ticks(axes: Any) -> None:
    """Some plain numbers along a cost of less than a decade, where powers of ten would crowd."""
    from matplotlib.ticker import MaxNLocator, NullLocator, StrMethodFormatter

    low, high = axes.get_xlim()
    if high < 10 * low:
        axes.xaxis.set_major_locator(MaxNLocator(6))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _draw_series(
    axes: Any, name: str, of_series: Sequence[Level], default: Any, index: int, floor: float
) -> None:
    colour, marker = CURVES[index % len(CURVES)], MARKERS[index % len(MARKERS)]
    cost = [level.cost for level in of_series]
    size = [max(level.size, floor) for level in of_series]
    low = [max(level.size - level.half_width, 0.3 * floor) for level in of_series]
    high = [max(level.size + level.half_width, floor) for level in of_series]
    # values that are names and not numbers are not joined by a line
    places = zip(of_series, cost, size, strict=True)
    line = sorted(
        (level.value, c, s) for level, c, s in places if not isinstance(level.value, str)
    )
    axes.plot([c for _, c, _ in line], [s for *_, s in line], "-", color=colour, lw=1.0, alpha=0.6)
    for level, x, bottom, top in zip(of_series, cost, low, high, strict=True):
        if level.half_width > 0:
            axes.vlines(x, bottom, top, color=colour, lw=2.5, alpha=0.3)
    zero = [level.size == 0 for level in of_series]
    axes.plot(
        [c for c, z in zip(cost, zero, strict=True) if not z],
        [s for s, z in zip(size, zero, strict=True) if not z],
        marker,
        color=colour,
        ms=6,
        label=name,
    )
    if any(zero):
        at = [c for c, z in zip(cost, zero, strict=True) if z]
        axes.plot(
            at,
            [floor] * len(at),
            "v",
            mfc="none",
            color=colour,
            ms=8,
            label="reference, or no error",
        )
    for level, x, y in zip(of_series, cost, size, strict=True):
        if level.value == default:
            axes.plot(
                [x],
                [y],
                "*",
                color=colour,
                mec="k",
                mew=0.8,
                ms=17,
                zorder=5,
                label="fdnet's default",
            )


def _label(axes: Any, of_series: Sequence[Level], index: int, floor: float, turn: float) -> None:
    """The values of the knob next to their markers; names stand to the left from `turn` on."""
    for level in of_series:
        left = isinstance(level.value, str) and level.cost > turn
        axes.annotate(
            shown(level.value),
            (level.cost, max(level.size, floor)),
            xytext=(-5 if left else 4, 5),
            textcoords="offset points",
            ha="right" if left else "left",
            fontsize=7,
            color=CURVES[index % len(CURVES)],
        )


def spread_labels(axes: Any) -> None:
    """Move each label that lies on an earlier one to a free place around its point.

    The figure must have been laid out. A label for which no place is free stays where it is.
    """
    placed: list[Any] = []
    for label in axes.texts:
        if not hasattr(label, "xyann"):
            continue
        side = -1 if label.get_ha() == "right" else 1
        start = label.xyann
        for x, y in ((start[0], start[1]), *((side * x, y) for x, y in PLACES)):
            label.xyann = (x, y)
            box = label.get_window_extent()
            if not any(box.overlaps(other) for other in placed):
                break
        else:
            label.xyann = start
        placed.append(label.get_window_extent())
