"""How far the error from two grids holds, on the slabs whose permeability three grids give."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np

from fdnet.network.stokes import estimate
from validation.engine.csv_rows import read_named
from validation.engine.markdown import markdown_table
from validation.truth.grids import flow_of
from validation.truth.packs import MM
from validation.truth.slab_grids import DEPOSIT
from validation.truth.slabs import SLAB_GRIDS, SLAB_TRUTH, read_specimen

LEAST_RATIO, MOST_RATIO = 1.25, 1.61
"""Cells of the finer grid over those of the coarser one."""
BOUNDS = (3.0, 3.5, 4.0, 5.0, 8.0)
"""Cells across the mean radius of a fine, on the finer grid."""
HEAVY = 0.7
"""k / k0 below which a deposit counts; lighter ones are easier."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two grids of a slab with its deposit: cells across a fine, stated and true error of k."""

    across: float
    stated: float
    true: float


def pairs_of_grids(folder: Path) -> Iterator[Pair]:
    """All pairs of grids in the table of `folder` that are as far apart as those of fdnet."""
    grids = [row for row in read_named(folder / SLAB_GRIDS) if row["solid"] == DEPOSIT]
    for truth in read_named(folder / SLAB_TRUTH):
        if float(truth["k_over_k0"]) > HEAVY:
            continue
        spheres = read_specimen(folder / truth["file"])
        r, k = spheres.fines().radius, float(truth["k_mm2"])
        longest = max(spheres.box[1, 1], MM * (float(truth["x_hi_mm"]) - float(truth["x_lo_mm"])))
        flows = [flow_of(row) for row in grids if row["slab"] == truth["slab"]]
        for coarse, fine in combinations(sorted(flows, key=lambda flow: flow.cells), 2):
            if LEAST_RATIO <= fine.cells / coarse.cells <= MOST_RATIO:
                end = estimate(coarse, fine, with_fines=True)
                across = float(np.sum(r**3) / np.sum(r**2) * fine.cells / longest)
                yield Pair(across=across, stated=end.error, true=abs(end.k / k - 1.0))


def two_grids_table(folder: Path) -> str:
    """Stated and true errors by cells across a fine, in Markdown, from the files in `folder`."""
    pairs, lines = list(pairs_of_grids(folder)), []
    for low, high in pairwise(BOUNDS):
        some = [pair for pair in pairs if low < pair.across <= high]
        if some:
            true = [pair.true for pair in some]
            lines.append(
                [
                    f"{low:g} to {high:g}",
                    str(len(some)),
                    f"{100 * np.mean([pair.stated for pair in some]):.1f} %",
                    f"{100 * math.hypot(*true) / math.sqrt(len(some)):.1f} %",
                    f"{100 * max(true):.1f} %",
                    f"{100 * np.mean([pair.true <= pair.stated for pair in some]):.0f} %",
                ]
            )
    header = ["cells across", "pairs of grids", "stated error"]
    header += ["true, rms", "true, largest", "within the stated"]
    return markdown_table(header, lines)
