"""Draws the picture of README.md from a finished run: a cut through the specimen above its k.

.venv/bin/python docs/_ext/readme_picture.py runs/quick docs/quick_answer.png
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

MILLIDARCY = 9.869233e-16
"""One millidarcy in m2."""
MM = 1e3
GRAIN, FINE, BEFORE, AFTER = "#D9D9D9", "#D55E00", "#7F7F7F", "#0072B2"


def draw_cut(axes: Any, spheres: pd.DataFrame) -> None:
    """The specimen at the plane through its middle, in mm: grains cut, fines it meets whole."""
    from matplotlib.collections import EllipseCollection

    grains = spheres[spheres.kind == "grain"]
    middle = (grains.y_m.min() + grains.y_m.max()) / 2
    squared = spheres.radius_m**2 - (spheres.y_m - middle) ** 2
    for kind, colour in (("grain", GRAIN), ("fine", FINE)):
        cut = spheres[(spheres.kind == kind) & (squared > 0)]
        width = 2 * np.sqrt(squared[cut.index].to_numpy()) * MM
        if kind == "fine":
            width = 2 * cut.radius_m.to_numpy() * MM
        axes.add_collection(
            EllipseCollection(
                width,
                width,
                np.zeros(len(cut)),
                units="xy",
                offsets=cut[["x_m", "z_m"]].to_numpy() * MM,
                offset_transform=axes.transData,
                facecolor=colour,
                edgecolor="black",
                linewidth=0.3,
            )
        )
    height = float((grains.z_m + grains.radius_m).max()) * MM
    axes.set(aspect="equal", ylim=(0, height), yticks=[], ylabel="cut through the sand")
    axes.tick_params(axis="x", labelbottom=False)


def draw_permeability(axes: Any, sections: pd.DataFrame) -> None:
    """Permeability of each section before and after the invasion, in mD, with its loss."""
    edges = np.append(sections.x_lo_m, sections.x_hi_m.iloc[-1]) * MM
    before = sections.k_initial_m2 / MILLIDARCY
    after = sections.k_damaged_m2 / MILLIDARCY
    axes.stairs(before, edges, color=BEFORE, linewidth=2, label="before", baseline=None)
    axes.stairs(after, edges, color=AFTER, linewidth=2, label="after the invasion", baseline=None)
    axes.stairs(before, edges, baseline=after, fill=True, color=FINE, alpha=0.25)
    for row, low in zip(sections.itertuples(), after, strict=True):
        text = f"\N{MINUS SIGN}{100 * row.k_reduction:.0f} %"
        place = (row.x_lo_m + row.x_hi_m) / 2 * MM
        axes.annotate(text, (place, low), (0, -14), textcoords="offset points", ha="center")
    axes.set(
        ylim=(0, None), xlabel="depth from the formation face (mm)", ylabel="permeability (mD)"
    )
    axes.yaxis.set_major_formatter("{x:,.0f}")
    axes.legend(loc="lower right", frameon=False)


def main() -> int:
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    parser = argparse.ArgumentParser(description="The picture of README.md from a finished run.")
    parser.add_argument("run", type=Path, help="the run folder")
    parser.add_argument("target", type=Path, help="the PNG file to write")
    given = parser.parse_args()
    run, target = given.run, given.target
    sections = pd.read_csv(run / "sections.csv")
    figure, (upper, lower) = plt.subplots(
        2, sharex=True, figsize=(6.6, 7.0), height_ratios=[1.6, 1], layout="constrained"
    )
    draw_cut(upper, pd.read_csv(run / "spheres_damaged.csv"))
    draw_permeability(lower, sections)
    lower.set_xlim(-0.3, sections.x_hi_m.iloc[-1] * MM)
    for axes in (upper, lower):
        axes.axvline(0, color="black", linestyle="--", linewidth=1)
        axes.spines[["top", "right"]].set_visible(False)
    upper.set_title("mud enters here \N{RIGHTWARDS ARROW}", loc="left", fontsize=10)
    figure.savefig(target, dpi=110)
    return 0


if __name__ == "__main__":
    sys.exit(main())
