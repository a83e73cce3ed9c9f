"""Figures of the studies of mechanics: means and ranges over the seeds, on linear axes."""

from collections.abc import Callable, Sequence
from pathlib import Path

from fdnet.files import replacing
from validation.engine.study import DONE, Row

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#7F7F7F")
Panel = tuple[str, str, tuple[str, ...], str, Callable[[Row], float]]
"""Label of the values, of the knob, series, quantity, and the value that is drawn of a row."""


def draw_ranges(rows: Sequence[Row], path: Path, panels: Sequence[Panel]) -> None:
    """One axes for each panel; a bar is the range over the seeds, the line joins the means."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.2 * len(panels), 4.4), layout="constrained", dpi=140)
    for number, (label, knob, series, quantity, value) in enumerate(panels, start=1):
        axes = figure.add_subplot(1, len(panels), number)
        for name, colour in zip(series, COLOURS, strict=False):
            groups: dict[float, list[float]] = {}
            for row in rows:
                if (row.series, row.quantity, row.status) == (name, quantity, DONE):
                    groups.setdefault(float(row.value), []).append(value(row))
            knobs = sorted(groups)
            means = [sum(groups[one]) / len(groups[one]) for one in knobs]
            axes.plot(knobs, means, color=colour, marker="o", label=name)
            axes.vlines(
                knobs,
                [min(groups[one]) for one in knobs],
                [max(groups[one]) for one in knobs],
                color=colour,
                linewidth=4,
                alpha=0.3,
            )
        axes.set(xlabel=knob, ylabel=label)
        axes.grid(color="#DDDDDD")
        axes.legend(fontsize="small", frameon=False)
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png")
