"""Tetrahedra of all spheres of the first section against those of its grains alone (Shi 2011, Figures 33 to 35)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.spheres.snapshot import Array, Kind
from fdnet.studies.engine.csv_rows import write_flat
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.sizes import tessellated
from fdnet.studies.thesis.numbers.values import thesis_values


@dataclass(frozen=True, slots=True, kw_only=True)
class TetrahedraCount:
    """Delaunay tetrahedra of the `grains` and `fines` centred in the first section; `ratio` of all to those of the
    grains alone."""

    id: str
    seed: int
    grains: int
    fines: int
    tetrahedra_all: int
    tetrahedra_grains: int
    ratio: float


def count_tetrahedra(examined: Examined) -> TetrahedraCount:
    """Counted in the final positions; by centres only, as the thesis does, walls and periodic sides apart."""
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
    """How many Delaunay tetrahedra the points (N, 3) m have; 0 for fewer than four."""
    found = tessellated(position)
    return 0 if found is None else len(found[0])


def write_counts(path: Path, counts: Sequence[TetrahedraCount]) -> Path:
    """One line a run."""
    return write_flat(path, TetrahedraCount, counts)
