"""Scans of the drag (Figure 14), and of what the thesis leaves open: friction and supply."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array
from validation.engine.palette import BLUE, GREEN, ORANGE
from validation.thesis.figures.canvas import THESIS, own_style, seeds, titled
from validation.thesis.figures.sources import Sources
from validation.thesis.figures.tables import ScanRow
from validation.thesis.numbers.values import TABLE3, specimen_number

AS_TABLE3 = (TABLE3, "7")
"""Specimens with the pack and the fines of Table 3."""


def over_seeds(rows: Sequence[ScanRow], name: str) -> tuple[Array, Array]:
    """Scanned values (V,), ascending, and mean, least and largest (V, 3) of a field over seeds."""
    values = np.array(sorted({row.value for row in rows}))
    groups = [[getattr(row, name) for row in rows if row.value == value] for value in values]
    return values, np.array([[np.mean(one), min(one), max(one)] for one in groups]).reshape(-1, 3)


def invasion_depth(figure: Any, sources: Sources) -> None:
    """Depths of the invaded fines against the drag multiplier, one panel a specimen."""
    rows = sources.tables.drag
    specimens = sorted({row.specimen for row in rows})
    figure.set_size_inches(max(7.2, 3.6 * len(specimens)), 4.4)
    panels = figure.subplots(1, len(specimens), squeeze=False, sharey=True)[0]
    for axes, specimen in zip(panels, specimens, strict=True):
        _depths(
            axes,
            [row for row in rows if row.specimen == specimen],
            sources.numbers("table3").invaded_depth_mm,
        )
        axes.set_title(titled(specimen), fontsize=11, loc="left")
    panels[0].set_ylabel("depth of the invaded fines (mm)")
    panels[0].set_ylim(bottom=0)
    handles = [axes.get_legend_handles_labels() for axes in panels]
    once = {
        label: handle
        for some, labels in handles
        for handle, label in zip(some, labels, strict=True)
    }
    band = seeds({row.seed for row in rows}).removeprefix(", ")
    figure.legend(
        [*once.values()],
        [*once],
        loc="outside lower center",
        ncols=4,
        fontsize=9.5,
        title=band or None,
    )


def _depths(axes: Any, rows: Sequence[ScanRow], table3_mm: float | None) -> None:
    for name, words, style in (
        ("depth_max_mm", "deepest fine", {"color": ORANGE, "marker": "^"}),
        ("depth_p95_mm", "95 % lie shallower", {"color": BLUE, "marker": "o"}),
        ("depth_mean_mm", "mean depth", {"color": GREEN, "marker": "s"}),
    ):
        _curve(axes, rows, name, words, style)
    if table3_mm is not None and specimen_number(rows[0].specimen) in AS_TABLE3:
        label = f"thesis, Table 3, nominal drag: {table3_mm:g} mm"
        axes.plot([1.0], [table3_mm], linestyle="", zorder=5, label=label, **THESIS)
    ticks = sorted({row.value for row in rows})
    axes.set(xscale="log", xlabel="multiplier of Stokes's drag (–)")
    axes.minorticks_off()
    axes.set_xticks(ticks, [f"{one:g}" for one in ticks])
    axes.margins(y=0.1)


def _curve(
    axes: Any, rows: Sequence[ScanRow], name: str, label: str, style: dict[str, Any]
) -> None:
    values, ranges = over_seeds(rows, name)
    axes.plot(values, ranges[:, 0], label=label, **style)
    axes.fill_between(
        values, ranges[:, 1], ranges[:, 2], color=style["color"], alpha=0.2, linewidth=0
    )


def friction(figure: Any, sources: Sources) -> None:
    """First millimetre and depth against the friction of the fines."""
    _scan(figure, sources, sources.tables.friction, "friction of the fines (–)")


def supply(figure: Any, sources: Sources) -> None:
    """First millimetre and depth against the number of fines supplied."""
    _scan(figure, sources, sources.tables.supply, "fines supplied / those of the case (–)")


def _scan(figure: Any, sources: Sources, rows: Sequence[ScanRow], label: str) -> None:
    """Count and lost porosity of the first millimetre, and depth; one curve a specimen."""
    figure.set_size_inches(10.8, 4.2)
    panels = (
        ("count_first_mm", "fines in the first 1 mm (–)", "count_first_mm"),
        ("porosity_loss_first_mm", "porosity lost in the first 1 mm (–)", None),
        ("depth_p95_mm", "depth, 95 % lie shallower (mm)", None),
    )
    for axes, (name, words, given) in zip(figure.subplots(1, 3), panels, strict=True):
        for specimen in sorted({row.specimen for row in rows}):
            style = own_style(specimen)
            _curve(
                axes,
                [row for row in rows if row.specimen == specimen],
                name,
                titled(specimen),
                style,
            )
            mark = None if given is None else getattr(sources.numbers(specimen), given)
            if mark is not None:
                axes.axhline(
                    mark, color=style["color"], linestyle=":", label=f"thesis, {titled(specimen)}"
                )
        axes.set(xlabel=label, ylabel=words)
        axes.set_ylim(bottom=0)
        axes.locator_params(axis="x", nbins=4)
    handles, names = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, fontsize=9.5)
