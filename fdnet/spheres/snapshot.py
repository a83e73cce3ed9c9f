"""All spheres of a specimen at one step. SI units."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from fdnet.errors import CaseError

Array = np.ndarray[Any, np.dtype[Any]]


class Kind(IntEnum):
    """What a sphere is; the number is its LIGGGHTS atom type."""

    GRAIN = 1
    FINE = 2


def frozen(values: Any, dtype: Any = None) -> Array:
    """A read-only array of its own over `values`."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Snapshot:
    """N spheres at one step.

    `box` (3, 2) lower and upper bound of the specimen, m (x = 0 is the formation face);
    `id` (N,) int64, `kind` (N,) int64 of `Kind`, `position` (N, 3) m, `radius` (N,) m,
    `velocity` (N, 3) m/s. Raises CaseError when shapes disagree or values are not finite.
    """

    step: int
    time_s: float
    box: Array
    id: Array
    kind: Array
    position: Array
    radius: Array
    velocity: Array

    def __post_init__(self) -> None:
        count = len(self.id)
        shapes = {
            "box": (3, 2),
            "id": (count,),
            "kind": (count,),
            "position": (count, 3),
            "radius": (count,),
            "velocity": (count, 3),
        }
        for name, shape in shapes.items():
            value = frozen(getattr(self, name), np.int64 if name in ("id", "kind") else np.float64)
            if value.shape != shape:
                raise CaseError(
                    f"snapshot at step {self.step}: {name} has shape {value.shape}, expected {shape}"
                )
            if not np.all(np.isfinite(value)):
                raise CaseError(
                    f"snapshot at step {self.step}: {name} holds values that are not finite"
                )
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.id)

    def where(self, mask: Array) -> "Snapshot":
        """The spheres for which `mask` (N,) is true."""
        return Snapshot(
            step=self.step,
            time_s=self.time_s,
            box=self.box,
            id=self.id[mask],
            kind=self.kind[mask],
            position=self.position[mask],
            radius=self.radius[mask],
            velocity=self.velocity[mask],
        )

    def grains(self) -> "Snapshot":
        """The big spheres, by kind."""
        return self.where(self.kind == Kind.GRAIN)

    def fines(self) -> "Snapshot":
        """The small spheres, by kind."""
        return self.where(self.kind == Kind.FINE)

    def joined(self, other: "Snapshot") -> "Snapshot":
        """This snapshot's spheres followed by those of `other`, at the step and time of `other`."""
        return Snapshot(
            step=other.step,
            time_s=other.time_s,
            box=self.box,
            id=np.concatenate([self.id, other.id]),
            kind=np.concatenate([self.kind, other.kind]),
            position=np.concatenate([self.position, other.position]),
            radius=np.concatenate([self.radius, other.radius]),
            velocity=np.concatenate([self.velocity, other.velocity]),
        )


def resting(
    position: Array, radius: Array | float, box: Array, kind: Array | int = Kind.GRAIN
) -> Snapshot:
    """Spheres at rest at `position` (N, 3) m, step 0, numbered from 1; `radius` m and `kind` of each or of all."""
    count = len(position)
    return Snapshot(
        step=0,
        time_s=0.0,
        box=box,
        id=np.arange(1, count + 1),
        kind=np.broadcast_to(kind, count),
        position=position,
        radius=np.broadcast_to(radius, count),
        velocity=np.zeros((count, 3)),
    )
