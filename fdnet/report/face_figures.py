"""Figures of what happens at the formation face: clean-up, cake, filtrate, bridging."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fdnet.report.figures import BLUE, DEPTH_LABEL, GREY, MM, ORANGE
from fdnet.spheres.snapshot import Array


def fill_clean_up(
    figure: Any,
    *,
    rows: Sequence[Mapping[str, Any]],
    depths: tuple[Array, Array],
    whole: tuple[float | None, float | None],
) -> None:
    """Permeability of each section after the invasion and after the clean-up; fines by depth.

    `depths` are those of all fines before and of those that stayed, m; `whole` is k/k0 of the
    specimen after the invasion and after the clean-up.
    """
    above, below = figure.subplots(2, 1, sharex=True)
    edges = MM * np.array([row["x_lo_m"] for row in rows] + [rows[-1]["x_hi_m"]])
    for key, share, colour, line, name in (
        ("damaged_k_over_k0", whole[0], ORANGE, "--", "after the invasion"),
        ("return_k_over_k0", whole[1], BLUE, "-", "after the clean-up"),
    ):
        values = np.array([np.nan if row[key] is None else row[key] for row in rows], float)
        label = name if share is None else f"{name}, whole {share:.3f}"
        above.stairs(
            values, edges, baseline=None, color=colour, linestyle=line, linewidth=2, label=label
        )
    above.axhline(1.0, color=GREY, linewidth=0.8)
    above.set(ylabel="k / intact k (–)", ylim=(0, None))
    bins = np.linspace(edges[0], edges[-1], 41)
    for depth, colour, name in (
        (depths[0], ORANGE, "before"),
        (depths[1], BLUE, "stayed"),
    ):
        label = f"{name}: {len(depth)}"
        below.hist(MM * depth, bins=bins, color=colour, alpha=0.6, label=label)
    below.set(xlabel=DEPTH_LABEL, ylabel="fines (–)", xlim=edges[[0, -1]])
    above.legend()
    below.legend()
