"""The files by which a batch of fines enters LIGGGHTS."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fdnet.case.case import InvasionCase
from fdnet.dem.deck import number, render_text
from fdnet.dem.measured_fines import densities
from fdnet.dem.scene import write_data
from fdnet.files.atomic import write_text
from fdnet.spheres.snapshot import Array, Snapshot

SUPPLY = "supply"
"""Folder of the batches."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchFiles:
    """The files of the batches of an invasion.

    Attributes:
        case: what is run.
        folder: of the invasion.
        counts: number of fines in each batch.
        first: id of the first fine.
        bounds: (3, 2) m, of the simulation box.
        drag: variables of the drag in a deck.
    """

    case: InvasionCase
    folder: Path
    counts: Sequence[int]
    first: int
    bounds: Array
    drag: Mapping[str, Any]

    @cached_property
    def density(self) -> Array:
        """(N,) kg/m3, of the fines of all batches in the order of their ids."""
        return densities(self.case, self.counts)

    def write(self, which: int, fines: Snapshot, velocity: float) -> str:
        """Write supply/batch_N.data and .in of batch `which` (from 0), which moves at `velocity`.

        Returns the name of the second in the folder of the invasion.
        """
        name = f"{SUPPLY}/batch_{which}"
        (self.folder / SUPPLY).mkdir(exist_ok=True)
        density = self.density[fines.id.astype(int) - self.first]
        path = self.folder / f"{name}.data"
        write_data(path, fines, bounds=self.bounds, density=density, types=3)
        values = {
            "name": name,
            "first": int(fines.id[0]),
            "last": int(fines.id[-1]),
            "start_velocity": number(velocity),
            "drag": self.drag,
        }
        write_text(self.folder / f"{name}.in", render_text("batch.in.j2", values))
        return f"{name}.in"
