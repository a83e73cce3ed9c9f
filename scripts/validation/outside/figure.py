"""The figure of the outside numbers: throats, probability of a clog, fines before a clog."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.files import replacing
from validation.engine.palette import BLUE, NEARLY_BLACK, ORANGE
from validation.engine.study import DONE, Row
from validation.outside import throat
from validation.outside.clogs import FEWEST, after_first
from validation.outside.constriction import HIGH, LOW, cloggings_of, line_of, runs_of

DOTS = 130
"""Per inch of the figure."""
_STYLES = ((LOW, BLUE, "o"), (HIGH, ORANGE, "s"))


def draw(rows: Sequence[Row], path: Path) -> None:
    """The axes whose rows are there, side by side."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    clogged = any(runs_of(rows, friction) for friction, *_ in _STYLES)
    drawn = [_draw_throats, *([_draw_chances, _draw_counts] if clogged else [])]
    figure, axes = plt.subplots(
        1, len(drawn), figsize=(5.5 * len(drawn), 5.0), squeeze=False, constrained_layout=True
    )
    for one, draw_on in zip(axes.flat, drawn, strict=True):
        draw_on(one, rows)
        one.grid(which="major", lw=0.4, color="0.85")
        if one.get_legend_handles_labels()[0]:
            one.legend(fontsize=8, framealpha=0.9, loc="upper right")
    with replacing(path) as part:
        figure.savefig(part, dpi=DOTS)
    plt.close(figure)


def _draw_throats(axes: Any, rows: Sequence[Row]) -> None:
    own = [row for row in rows if row.series == throat.SERIES and row.status == DONE]
    along = np.linspace(0.0, 0.075, 50)
    exact = [throat.passing_ratio(float(overlap)) for overlap in along]
    axes.plot(100 * along, exact, color=NEARLY_BLACK, label="closed form")
    axes.plot(
        [100 * float(row.value) for row in own],
        [row.observed for row in own],
        "o",
        color=BLUE,
        mfc="none",
        ms=8,
        label="bisected on the binary",
    )
    axes.set_xlabel("overlap of the grains, % of the diameter")
    axes.set_ylabel("largest fine that passes, d/D")
    axes.set_title("throat of three grains", fontsize=10)


def _draw_chances(axes: Any, rows: Sequence[Row]) -> None:
    for friction, colour, marker in _STYLES:
        cloggings = cloggings_of(rows, friction)
        seen = {ratio: one for ratio, one in cloggings.items() if one.clogs}
        x = np.array([ratio**2 - 1 for ratio in seen])
        chance = np.array([one.probability for one in seen.values()])
        low = chance - [one.low for one in seen.values()]
        high = [one.high for one in seen.values()] - chance
        axes.errorbar(
            x, chance, [low, high], fmt=marker, color=colour, label=f"friction {friction:g}"
        )
        none = {ratio: one for ratio, one in cloggings.items() if not one.clogs and one.escapes}
        axes.plot(
            [ratio**2 - 1 for ratio in none],
            [one.high for one in none.values()],
            "v",
            color=colour,
            mfc="none",
            ms=9,
            label=f"friction {friction:g}: none, P is below" if none else None,
        )
        try:
            line = line_of(rows, friction)
        except ValueError:
            continue
        for ends, style in (((line.least, line.most), "-"), ((min(seen), max(seen)), ":")):
            along = np.array(ends) ** 2 - 1
            axes.plot(along, np.exp(line.start + line.slope * along), style, color=colour, lw=1.2)
    axes.axvline(8.0, color="0.6", lw=0.8, ls="--", label="R = 3")
    axes.set(yscale="log", xlabel="R² − 1, R = hole over fine")
    axes.set_ylabel("probability of a clog, each fine")
    axes.set_title("one constriction (bars: binomial 95 %)", fontsize=10)


def _draw_counts(axes: Any, rows: Sequence[Row]) -> None:
    """Share of runs that let more fines out, over their mean: exp(-x) if geometric."""
    for friction, colour, marker in _STYLES:
        label: str | None = f"friction {friction:g}, every hole"
        for ratio, runs in runs_of(rows, friction).items():
            kept, _ = after_first(runs, ratio)
            if len(kept) < FEWEST or not all(clogged for _, clogged in kept):
                continue
            counts = np.sort([escaped for escaped, _ in kept])
            share = 1 - (np.arange(len(counts)) + 0.5) / len(counts)
            axes.plot(
                counts / counts.mean(), share, marker, color=colour, ms=3, alpha=0.6, label=label
            )
            label = None
    along = np.linspace(0.0, 4.0, 2)
    axes.plot(along, np.exp(-along), color=NEARLY_BLACK, label="geometric law of many")
    axes.set(yscale="log", ylim=(5e-3, 1.2), xlim=(0, 5))
    axes.set_xlabel("fines escaped before a clog, over the mean")
    axes.set_ylabel("share of runs with more")
    axes.set_title("fines before a clog", fontsize=10)
