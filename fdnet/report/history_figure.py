"""The invasion against time: counts of fines, and rate and permeability where they are known."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fdnet.report.depth_figure import legend_above

BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
FLOW_CURVES = (
    ("rate_over_initial", "rate of flow", BLUE, "-"),
    ("k_over_k0", "permeability of the specimen", ORANGE, "--"),
)
"""Columns of history.csv of a flow that follows the deposit, with label, colour and line."""


def fill_history(figure: Any, *, history: Sequence[Mapping[str, float]]) -> None:
    """Counts of fines against time, and under them rate and permeability where they are known."""
    flow = [name for name, *_ in FLOW_CURVES if all(name in row for row in history)]
    rows = figure.subplots(1 + bool(flow), 1, sharex=True, squeeze=False)[:, 0]
    time = np.array([row["physical_time_s"] for row in history])
    scale, unit = (1.0, "s") if time.max() >= 1 else (1e3, "ms")
    for name, label, colour, line in (
        ("invaded_count", "inside the specimen", BLUE, "-"),
        ("passed_count", "passed the outlet", GREEN, "--"),
        ("upstream_count", "upstream of the face", ORANGE, ":"),
    ):
        rows[0].plot(time * scale, [row[name] for row in history], line, color=colour, label=label)
    rows[0].set(ylabel="number of fines (–)", ylim=(0, None))
    for name, label, colour, line in FLOW_CURVES:
        if name in flow:
            values = [row[name] for row in history]
            rows[-1].plot(time * scale, values, line, color=colour, label=label)
            rows[-1].set(ylabel="over the first (–)", ylim=(0, None))
    rows[-1].set_xlabel(f"time since the fines were released ({unit})")
    for axes in rows:
        legend_above(axes)
