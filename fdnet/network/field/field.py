"""The velocity of the fluid in the pores of a pack, with a deposit of fines or without.

A coarse resolved Stokes flow on a staggered grid (`solved`), interpolated down to the walls
(`sampled`). Formulas and checks: docs/velocity_field.md.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.field.lattice import Lattice
from fdnet.network.field.nearby import find_nearby
from fdnet.network.field.pressure import Gradient, find_gradient
from fdnet.network.field.sampled import Sampled, sample_velocity
from fdnet.network.field.solved import Skeleton, Solved, Spheres, solve
from fdnet.spheres.snapshot import Array, frozen


@dataclass(frozen=True, eq=False, kw_only=True)
class VelocityField:
    """Fluid velocity and pressure gradient around grains and fines; all over viscosity mu and
    superficial velocity U along x.

    Attributes:
        skeleton: the grains and their grid.
        fines: centres (N, 3) m and radii (N,) m of the fines that hold the fluid.
        left_out: number of fines that were given but lie outside of the grid.
        tolerance: rms velocity over U that may be left at the walls.
        solved: the flow on the grid.
        inside: (N,) which of the fines given are on the grid.
    """

    skeleton: Skeleton
    fines: Spheres
    left_out: int
    tolerance: float
    solved: Solved
    inside: Array

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.lattice.shape))
        return (
            f"VelocityField({len(self.skeleton.grains[1])} grains, {len(self.fines[1])} fines, "
            f"{shape} cells, k {self.k:.4g} m2)"
        )

    @property
    def lattice(self) -> Lattice:
        """The grid."""
        return self.skeleton.lattice

    @cached_property
    def resistance(self) -> float:
        """Pressure drop over the specimen over mu U, 1/m; clear fluid around it adds nothing."""
        lattice = self.lattice
        along = float(lattice.spacing[0] * lattice.shape[0])
        force = float(self.solved.sphere_force[:, 0].sum() + self.solved.wall_force[0])
        return force / (lattice.volume / along)

    @property
    def k(self) -> float:
        """Permeability of the specimen on this grid, m2; it is too high on a coarse one."""
        return (self.lattice.specimen[1] - self.lattice.specimen[0]) / self.resistance

    @property
    def grain_force(self) -> Array:
        """Force of the fluid on each grain over mu U, (G, 3) m, the pressure gradient included."""
        return np.asarray(self.solved.sphere_force[: len(self.skeleton.grains[1])])

    @property
    def fine_force(self) -> Array:
        """Force of the fluid on each fine given over mu U, (N, 3) m, likewise; 0 off the grid.

        The forces on grains, fines and side walls add up to the pressure drop times the area.
        """
        force = np.zeros((len(self.inside), 3))
        force[self.inside] = self.solved.sphere_force[len(self.skeleton.grains[1]) :]
        return force

    @property
    def wall_force(self) -> Array:
        """Force of the fluid on the side walls over mu U, (3,) m."""
        return self.solved.wall_force

    def at(self, points: Any) -> Array:
        """Fluid velocity over U, (N, 3), at points (N, 3) m.

        It is 0 in the solid and (1, 0, 0) before and beyond the grid of a specimen that is not
        periodic along x.

        Raises:
            CaseError: the points are not (N, 3) finite numbers.
        """
        return self._sampled.velocity(_checked(points))

    def pressure_gradient_at(self, points: Any) -> Array:
        """Gradient of the pressure over mu U, (N, 3) 1/m2, at points (N, 3) m.

        In the solid it is that of the fluid around it.

        Raises:
            CaseError: the points are not (N, 3) finite numbers.
        """
        return self._gradient.at(_checked(points))

    @cached_property
    def _flow(self) -> list[Array]:
        flow = self.skeleton.response.velocity(list(self.solved.force))
        return [
            part + np.float32(drift) for part, drift in zip(flow, self.solved.drift, strict=True)
        ]

    @cached_property
    def _sampled(self) -> Sampled:
        grains = self.skeleton.grains
        nearby = find_nearby(
            self.lattice,
            np.concatenate([grains[0], self.fines[0]]),
            np.concatenate([grains[1], self.fines[1]]),
        )
        return sample_velocity(self.lattice, nearby, self._flow)

    @cached_property
    def _gradient(self) -> Gradient:
        lattice = self.lattice
        mean = -self.resistance / float(lattice.spacing[0] * lattice.shape[0])
        return find_gradient(lattice, self.skeleton.response, self.solved, mean)


def solved_field(skeleton: Skeleton, deposit: Spheres, tolerance: float) -> VelocityField:
    """The field around grains and fines; `deposit` are centres (N, 3) m and radii (N,) m."""
    place, radius = deposit
    inside = on_grid(skeleton.lattice, place, radius)
    fines = frozen(place[inside]), frozen(radius[inside])
    return VelocityField(
        skeleton=skeleton,
        fines=fines,
        left_out=int(np.sum(~inside)),
        tolerance=tolerance,
        solved=solve(skeleton, fines, tolerance),
        inside=frozen(inside),
    )


def on_grid(lattice: Lattice, position: Array, radius: Array) -> Array:
    """True (N,) for spheres that lie wholly between the ends of the grid along x."""
    if lattice.repeats:
        return np.ones(len(position), bool)
    low, high = lattice.low[0], lattice.high[0]
    return (position[:, 0] - radius >= low) & (position[:, 0] + radius <= high)


def _checked(points: Any) -> Array:
    """Numbers (N, 3). Raises CaseError on others."""
    array = np.asarray(points, float)
    if array.ndim != 2 or array.shape[1] != 3:
        raise CaseError(
            f"velocity field: numbers of shape {array.shape}, expected (N, 3), x, y, z"
        )
    if not np.all(np.isfinite(array)):
        raise CaseError("velocity field: a value is not finite, expected numbers, x, y, z")
    return array
