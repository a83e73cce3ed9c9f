"""The intact pack's flow at the fines, taken again only where they moved."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.field.field import VelocityField
from fdnet.spheres.snapshot import Array, Snapshot, unmoved


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sampled:
    """What the intact pack's flow is at N fines.

    Attributes:
        id: (N,) of the fines.
        position: (N, 3) m, where it was taken.
        velocity: (N, 3) over the superficial velocity.
        gradient: (N, 3) 1/m2, of the pressure over mu U.
    """

    id: Array
    position: Array
    velocity: Array
    gradient: Array

    def at(self, fines: Snapshot, shape: VelocityField) -> "Sampled":
        """The same at other `fines`; it is kept for those at the same place."""
        new, old = unmoved((fines.id, fines.position), (self.id, self.position))
        moved = np.ones(len(fines), bool)
        moved[new] = False
        velocity, gradient = (np.empty((len(fines), 3)) for _ in range(2))
        velocity[new], velocity[moved] = self.velocity[old], shape.at(fines.position[moved])
        gradient[new] = self.gradient[old]
        gradient[moved] = shape.pressure_gradient_at(fines.position[moved])
        return Sampled(id=fines.id, position=fines.position, velocity=velocity, gradient=gradient)


class Places:
    """What is kept from one update to the next: the flow at the fines."""

    def __init__(self) -> None:
        none = np.zeros((0, 3))
        self._last = Sampled(id=np.zeros(0, int), position=none, velocity=none, gradient=none)

    def at(self, fines: Snapshot, shape: VelocityField) -> Sampled:
        """The flow of the intact pack, `shape`, at the fines."""
        self._last = self._last.at(fines, shape)
        return self._last
