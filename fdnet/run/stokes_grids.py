"""Resolved Stokes flow through one slab of a run, on two grids that the run folder keeps."""

import json
from collections.abc import Callable
from dataclasses import dataclass, fields
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from scipy import fft

from fdnet.errors import CaseError
from fdnet.files.atomic import write_text
from fdnet.network.stokes.staggered import Closed, stagger
from fdnet.network.stokes.stokes import StokesFlow, solve_slab
from fdnet.network.stokes.two_grids import Estimate, estimate
from fdnet.run.session import cores
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot

ACROSS_A_GRAIN, ACROSS_A_FINE = 15.0, 3.5
"""Cells of the finer grid across the mean radius of the grains, and of the fines."""
COARSER = 1.5
"""Edge of a cell of the coarser grid over that of the finer one."""
TOLERANCE = 1e-3
"""Of the solves, as of `solve_stokes`."""
MOST_CELLS = 60_000_000
BYTES = 200
"""Memory for each cell."""
SECONDS = {"initial": 1.5e-5, "damaged": 4e-5}
"""For each cell, on one core of the machine of docs/stokes.md."""
Follow = Callable[[str], None]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Slab:
    """Spheres between two planes.

    Attributes:
        spheres: those that reach into it.
        span: lower and upper plane, x in m.
        closed: which sides are walls.
        state: "initial" or "damaged".
        digest: of the file of the spheres.
    """

    spheres: Snapshot
    span: tuple[float, float]
    closed: Closed
    state: str
    digest: str

    __repr__ = one_line

    @property
    def edges(self) -> Array:
        """(3,) m."""
        return np.array([self.span[1] - self.span[0], *np.diff(self.spheres.box[1:])[:, 0]])

    @property
    def words(self) -> str:
        """The slab in words."""
        state = "after the invasion" if self.state == "damaged" else "before it"
        return f"{1e3 * self.span[0]:g} to {1e3 * self.span[1]:g} mm, {state}"

    def cells(self, across: float) -> tuple[int, int]:
        """Cells on the longest edge of the coarser and of the finer grid.

        `across` is their number across the mean radius of a fine in the finer one.
        """
        grains, fines = self.spheres.grains(), self.spheres.fines()
        wanted = [ACROSS_A_GRAIN / _mean(grains.radius)] if len(grains) else []
        wanted += [across / _mean(fines.radius)] if len(fines) else []
        if not wanted:
            raise CaseError(f"{self.words}: no sphere reaches into it, expected grains")
        fine = ceil(float(self.edges.max()) * max(wanted))
        return ceil(fine / COARSER), fine

    def cell(self, across: float) -> float:
        """Edge of a cell of the finer grid, m."""
        return float(self.edges.max()) / self.cells(across)[1]

    def size(self, cells: int) -> int:
        """Cells of the grid with `cells` on the longest edge."""
        return int(np.prod(stagger(self.edges, cells, closed=self.closed)[0].shape))


def _mean(radius: Array) -> float:
    """Sauter mean: sum of cubes over sum of squares."""
    return float(np.sum(radius**3) / np.sum(radius**2))


class KeptGrids:
    """The solved grids of a run in a file, which is whole after each of them."""

    def __init__(self, path: Path) -> None:
        """Reads what `path` holds. Raises CaseError where it cannot be understood."""
        self.path = path
        self.rows: list[dict[str, Any]] = []
        if path.is_file():
            names = {one.name for one in fields(StokesFlow)}
            try:
                rows = json.loads(path.read_text(encoding="utf-8"))
                if not isinstance(rows, list):
                    raise ValueError(f"{type(rows).__name__}, expected a list")
                self.rows = [dict(row) for row in rows]
                if not all(names <= row.keys() for row in self.rows):
                    raise ValueError(f"a grid lacks one of {', '.join(sorted(names))}")
                if not all(0.0 < float(row["k"]) < np.inf for row in self.rows):
                    raise ValueError("a permeability k is not positive and finite")
            except (ValueError, TypeError) as error:
                raise CaseError(
                    f"{path}: cannot be read as solved grids ({error}); remove it, and its grids "
                    "are solved again"
                ) from error

    def find(self, key: dict[str, Any]) -> StokesFlow | None:
        """The flow of a grid that was solved."""
        names = [one.name for one in fields(StokesFlow)]
        for row in self.rows:
            if all(row.get(name) == value for name, value in key.items()):
                return StokesFlow(**{name: row[name] for name in names})
        return None

    def add(self, key: dict[str, Any], flow: StokesFlow) -> None:
        """Keeps a solved grid."""
        self.rows.append(key | {one.name: getattr(flow, one.name) for one in fields(StokesFlow)})
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_text(self.path, json.dumps(self.rows, indent=1) + "\n")


def refuse_large(slab: Slab, across: float) -> None:
    """Raises CaseError where the finer grid would take more than `MOST_CELLS`."""
    size = slab.size(slab.cells(across)[1])
    if size > MOST_CELLS:
        raise CaseError(
            f"{slab.words}: {size / 1e6:.0f} million cells, expected at most "
            f"{MOST_CELLS / 1e6:.0f} million; lower --across from {across:g}, or analyse the run "
            "with thinner sections"
        )


def permeability_of(slab: Slab, across: float, kept: KeptGrids, follow: Follow) -> Estimate:
    """Permeability of the slab along x, m2, and its error."""
    coarse, fine = (_flow(slab, cells, kept, follow) for cells in slab.cells(across))
    return estimate(coarse, fine, with_fines=len(slab.spheres.fines()) > 0)


def _flow(slab: Slab, cells: int, kept: KeptGrids, follow: Follow) -> StokesFlow:
    key = {
        "state": slab.state,
        "x_lo_m": slab.span[0],
        "x_hi_m": slab.span[1],
        "cells": cells,
        "spheres": slab.digest,
    }
    flow = kept.find(key)
    if flow is None:
        follow(_expected(slab, slab.size(cells)))
        with fft.set_workers(cores()):
            flow = solve_slab(
                slab.spheres, slab.span, cells=cells, tolerance=TOLERANCE, closed=slab.closed
            )
        kept.add(key, flow)
    return flow


def _expected(slab: Slab, size: int) -> str:
    seconds = max(1.0, SECONDS[slab.state] * size / cores() ** 0.5)
    took = f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
    memory = BYTES * size / 2**30
    return f"{slab.words}: {size / 1e6:.1f} million cells, about {took} and {memory:.1f} GiB"
