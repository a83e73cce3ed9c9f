"""The fluid that fines meet on the way that they will go until they are looked at again.

Between two updates a fine passes places where the fluid is faster or slower. It is given the mean
over its way, and not what is at its place when the way begins.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fdnet.spheres.snapshot import Array

PARTS = 4
"""Parts of the way; in each the fluid is taken half-way."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Movers:
    """N fines that move.

    Attributes:
        position: (N, 3) m.
        velocity: (N, 3) m/s.
        rate: (N,) 1/s, drag coefficient over mass.
    """

    position: Array
    velocity: Array
    rate: Array

    def after(self, time: float, fluid: Array) -> "Movers":
        """The same after `time` s in a `fluid` of constant velocity (N, 3) m/s.

        Drag takes up the slip: dv/dt = rate (u - v).
        """
        kept, slip = np.exp(-self.rate * time)[:, None], self.velocity - fluid
        way = fluid * time + slip * (1.0 - kept) / self.rate[:, None]
        return Movers(position=self.position + way, velocity=fluid + slip * kept, rate=self.rate)

    def where(self, some: Array) -> "Movers":
        """Those of them for which `some` (N,) is true."""
        return Movers(
            position=self.position[some], velocity=self.velocity[some], rate=self.rate[some]
        )


def mean_ahead(
    movers: Movers, fluid: Callable[[Array], Array], time: float, *, even_to: float = -np.inf
) -> Array:
    """Mean velocity (N, 3) m/s of the `fluid` over the way of the `movers` in `time` s.

    `fluid` gives the velocity (N, 3) m/s at places (N, 3) m. Before the depth `even_to` m it is
    the same everywhere. Other spheres are not looked at, but where the way leads into a grain or a
    wall, where no fluid is, a fine stays before it.
    """
    mean = fluid(movers.position)
    fastest = np.maximum(movers.velocity[:, 0], mean[:, 0])
    some = movers.position[:, 0] + np.maximum(fastest, 0.0) * time >= even_to
    mean[some] = _mean(movers.where(some), fluid, time, mean[some])
    return mean


def _mean(movers: Movers, fluid: Callable[[Array], Array], time: float, here: Array) -> Array:
    met = np.zeros_like(movers.position)
    for left in reversed(range(PARTS)):
        half = fluid(movers.after(0.5 * time / PARTS, here).position)
        there = np.where(_wet(half), half, here)
        met += there / PARTS
        if left:
            further = movers.after(time / PARTS, there)
            beyond = fluid(further.position)
            free = _wet(beyond)
            here = np.where(free, beyond, here)
            place = np.where(free, further.position, movers.position)
            movers = Movers(position=place, velocity=further.velocity, rate=movers.rate)
    return met


def _wet(velocity: Array) -> Array:
    """Where there is fluid, (N, 1)."""
    return np.any(velocity != 0.0, axis=1, keepdims=True)
