"""Tetrahedra of all spheres of the first section, and of its grains alone.

Figures 33 to 35 of the thesis (Shi 2011) show them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Array, Kind
from validation.engine.csv_rows import write_flat
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.grains_alone import delaunay_of
from validation.thesis.numbers.values import thesis_values


@dataclass(frozen=True, slots=True, kw_only=True)
class TetrahedraCount:
    """Delaunay tetrahedra of the spheres centred in the first section of one run.

    Attributes:
        id: name of the run.
        seed: seed of the run.
        grains: number of grains.
        fines: number of fines.
        tetrahedra_all: tetrahedra of grains and fines together.
        tetrahedra_grains: tetrahedra of the grains alone.
        ratio: the former over the latter.
    """

    id: str
    seed: int
    grains: int
    fines: int
    tetrahedra_all: int
    tetrahedra_grains: int
    ratio: float


def count_tetrahedra(examined: Examined) -> TetrahedraCount:
    """Count them in the final positions.

    Only the centres count, as in the thesis; walls and periodic sides play no part.
    """
    spheres = examined.state.damaged
    low, high = spheres.box[0]
    x = spheres.position[:, 0]
    spheres = spheres.where(
        (x >= low) & (x < min(low + 1e-3 * thesis_values().first_section_mm, high))
    )
    grain = spheres.kind == Kind.GRAIN
    every, grains = tetrahedra(spheres.position), tetrahedra(spheres.position[grain])
    return TetrahedraCount(
        id=examined.id,
        seed=examined.seed,
        grains=int(grain.sum()),
        fines=int(np.sum(~grain)),
        tetrahedra_all=every,
        tetrahedra_grains=grains,
        ratio=every / grains if grains else np.nan,
    )


def tetrahedra(position: Array) -> int:
    """Number of Delaunay tetrahedra of the points (N, 3) m; 0 for fewer than four points."""
    tessellation = delaunay_of(position)
    return 0 if tessellation is None else len(tessellation[0])


def write_tetrahedra(path: Path, counts: Sequence[TetrahedraCount]) -> Path:
    """Write tetrahedra.csv, one line for each run."""
    return write_flat(path, TetrahedraCount, counts)
