"""The figure of the accuracy page: every law against truth, without and with fines."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.files.atomic import replacing
from fdnet.network.laws.named import LAWS
from fdnet.studies.accuracy.goals import DAMAGE_GOAL, GOALS, Row
from fdnet.studies.accuracy.rows import RULES
from fdnet.studies.engine.palette import (
    GREEN,
    NEARLY_BLACK,
    ORANGE,
    PALE_BLUE,
    PALE_GREEN,
    RED,
    SALMON,
    VIOLET,
)

LAW_STYLES = ((RED, "v"), (SALMON, "^"), (PALE_BLUE, "s"), (VIOLET, "D"), (NEARLY_BLACK, "o"))
RULE_STYLES = (
    (RED, "v"),
    (SALMON, "1"),
    (PALE_BLUE, "s"),
    (NEARLY_BLACK, "o"),
    (ORANGE, "d"),
    (GREEN, "+"),
    (VIOLET, "x"),
)
"""Colour and marker of each of `LAWS` and of each of `RULES`."""


def draw_accuracy(intact: Sequence[Row], damage: Sequence[Row], path: Path) -> None:
    """Left: model over truth by case without fines. Right: k/k0 of the model against truth."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(13, 6.2), constrained_layout=True)
    _draw_intact(left, intact)
    _draw_damage(right, damage)
    with replacing(path) as part:
        figure.savefig(part, dpi=110)
    plt.close(figure)


def _draw_intact(axes: Any, rows: Sequence[Row]) -> None:
    place = np.arange(len(rows))[::-1]
    goal = np.array([GOALS.get(row["group"], (None, np.nan))[1] for row in rows])
    axes.barh(
        place,
        2 * goal,
        left=1 - goal,
        height=1.0,
        color=PALE_GREEN,
        label="goal, worst case",
        zorder=0,
    )
    for law, (colour, marker) in zip(LAWS, LAW_STYLES, strict=True):
        axes.plot(
            [row[law] for row in rows], place, marker, color=colour, ms=6, label=law, alpha=0.85
        )
    axes.axvline(1.0, color="k", lw=0.6)
    axes.set(
        xscale="log", xlim=(0.17, 3.4), ylim=(-0.6, len(rows) - 0.4), xlabel="k, model over truth"
    )
    axes.set_xticks([0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
    _plain_numbers(axes.xaxis)
    axes.set_yticks(place, [row["case"] for row in rows], fontsize=8)
    axes.grid(axis="x", lw=0.3)
    axes.set_title("intact: lattices and packs against resolved Stokes flow", fontsize=10)
    axes.legend(fontsize=8, loc="lower right")


def _draw_damage(axes: Any, rows: Sequence[Row]) -> None:
    truth = np.array([row["k_over_k0"] for row in rows])
    line = np.array([0.7 * truth.min(), 1.2])
    most = DAMAGE_GOAL[1]
    axes.fill_between(
        line, (1 - most) * line, (1 + most) * line, color=PALE_GREEN, label="goal, worst case"
    )
    axes.plot(line, line, "k-", lw=0.6)
    for name, (colour, marker) in zip(RULES, RULE_STYLES, strict=True):
        model = truth * np.array([row[name] for row in rows])
        axes.plot(truth, model, marker, color=colour, ms=7, label=name, alpha=0.85)
    axes.set(
        xscale="log",
        yscale="log",
        xlim=line,
        ylim=(line[0] * 0.85, 1.2),
        xlabel="k/k0, truth",
        ylabel="k/k0, model",
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_ticks([0.02, 0.05, 0.1, 0.2, 0.5, 1.0])
        _plain_numbers(axis)
    axes.grid(lw=0.3)
    axes.set_title("with fines: share of the permeability left", fontsize=10)
    axes.legend(fontsize=8, loc="lower right")


def _plain_numbers(axis: Any) -> None:
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(lambda *_: "")
