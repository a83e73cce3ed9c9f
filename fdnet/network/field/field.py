"""The velocity of the fluid in the pores of a pack, with a deposit of fines or without.

A coarse resolved Stokes flow on a staggered grid (`solved`), interpolated down to the walls
(`sampled`). Formulas and checks: docs/velocity_field.md.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.field.lattice import Lattice, build_lattice
from fdnet.network.field.nearby import find_nearby
from fdnet.network.field.pressure import Gradient, find_gradient
from fdnet.network.field.sampled import Sampled, sample_velocity
from fdnet.network.field.solved import Skeleton, Solved, Spheres, build_skeleton, solve
from fdnet.spheres.directions import Directions, periodic_axes
from fdnet.spheres.snapshot import Array, Kind, Snapshot, frozen

CELLS = 10.0
"""Cells across a mean grain (docs/validation/velocity-field.md)."""
TOLERANCE = 0.05
"""Rms velocity left at the walls over the superficial velocity."""
UPSTREAM, DOWNSTREAM = 1.0, 0.5
"""Clear fluid before and beyond a specimen that is not periodic along x, in grain diameters."""


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

    def updated(self, position: Any, radius: Any, *, velocity: Any = None) -> "VelocityField":
        """The field with the fines at `position` (N, 3) m of `radius` (N,) m, or one for all.

        The solve starts from this flow. The grid stays, so fines beyond its ends along x are left
        out and counted. Each fine holds the fluid at its surface, or takes it along with its
        `velocity` (N, 3) over U.

        Raises:
            CaseError: shapes disagree or values are not finite.
            FlowError: the iterations run out.
        """
        place = _checked(position)
        sizes = np.asarray(radius, float)
        if sizes.shape not in ((), (len(place),)) or not np.all(sizes > 0.0):
            raise CaseError(
                f"velocity field: radius of shape {sizes.shape}, expected positive numbers, one "
                f"or ({len(place)},)"
            )
        wanted = _Wanted(
            place=place,
            radius=np.broadcast_to(sizes, len(place)),
            velocity=None if velocity is None else _checked(velocity, len(place)),
            tolerance=self.tolerance,
        )
        return _solved_field(self.skeleton, wanted, self.solved)

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


def velocity_field(
    grains: Snapshot,
    *,
    periodic: Directions = "",
    fines: Snapshot | None = None,
    cells: float = CELLS,
    upstream: float | None = None,
    tolerance: float = TOLERANCE,
) -> VelocityField:
    """The velocity of a slow fluid in the pores of a pack, over the superficial one along x.

    Stokes flow is solved on a grid of `cells` cells across a mean grain. Fines are resolved as the
    grains are. The sides y and z that are not periodic are walls that hold the fluid. A specimen
    that is not periodic along x has clear fluid before and beyond it, which moves evenly.

    Args:
        grains: the skeleton, m; `box` is the specimen. Fines among them are the deposit where
            `fines` is not given.
        periodic: sides that repeat, letters such as "yz" or three truth values (x, y, z).
        fines: the deposit; its spheres of kind grain are ignored where it has any of kind fine.
        cells: across a mean grain diameter.
        upstream: m of grid before the specimen; without it, a grain diameter more than the fines
            reach. Without meaning where x is periodic.
        tolerance: rms velocity over the superficial one that may be left at the walls.

    Raises:
        CaseError: there is no grain, or a value is outside its range.
        NetworkError: the box has no extent, or no grain reaches into the grid.
        FlowError: the iterations run out, as in a closed pore space.

    Examples:
        >>> import fdnet, numpy as np
        >>> lattice = 1e-3 * (np.indices((2, 2, 2)).reshape(3, -1).T + 0.5)
        >>> grains = fdnet.Snapshot.from_arrays(lattice, 0.5e-3)
        >>> field = fdnet.velocity_field(grains, periodic="xyz")
        >>> print(f"{field.at([[1e-3, 1e-3, 1e-3]])[0, 0]:.1f}")
        4.2
    """
    if not len(grains.grains()):
        raise CaseError("velocity field: no grain among the spheres, expected at least one")
    if not (np.isfinite(cells) and cells >= 1.0 and 0.0 < tolerance < 1.0):
        raise CaseError(
            f"velocity field: {cells!r} cells across a grain and a tolerance of {tolerance!r}, "
            "expected at least 1 cell and a tolerance between 0 and 1"
        )
    deposit = _deposit(grains if fines is None else fines, fines is not None)
    skeleton = _skeleton(
        grains, periodic_axes(periodic), (cells, _upstream(grains, deposit, upstream))
    )
    wanted = _Wanted(
        place=deposit.position, radius=deposit.radius, velocity=None, tolerance=tolerance
    )
    return _solved_field(skeleton, wanted, None)


def _upstream(grains: Snapshot, deposit: Snapshot, wanted: float | None) -> float:
    """Metres of grid before the specimen."""
    if wanted is not None:
        return wanted
    reach = grains.box[0, 0] - (deposit.position[:, 0] - deposit.radius)
    clear = UPSTREAM * 2.0 * float(grains.grains().radius.mean())
    return clear + float(max(0.0, reach.max(initial=0.0)))


def _skeleton(
    spheres: Snapshot, sides: tuple[bool, bool, bool], grid: tuple[float, float]
) -> Skeleton:
    """The grains on a grid of so many cells across a grain and so many metres upstream."""
    grains, (cells, upstream) = spheres.grains(), grid
    diameter = 2.0 * float(grains.radius.mean())
    lattice = build_lattice(
        spheres.box,
        sides,
        spacing=diameter / cells,
        upstream=upstream,
        downstream=DOWNSTREAM * diameter,
    )
    on_grid = grains.where(_on_grid(lattice, grains.position, grains.radius))
    return build_skeleton(lattice, (on_grid.position, on_grid.radius))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Wanted:
    """Fines at `place` (N, 3) m of `radius` (N,) m and `velocity` (N, 3), and the tolerance."""

    place: Array
    radius: Array
    velocity: Array | None
    tolerance: float


def _solved_field(skeleton: Skeleton, wanted: _Wanted, former: Solved | None) -> VelocityField:
    inside = _on_grid(skeleton.lattice, wanted.place, wanted.radius)
    fines = frozen(wanted.place[inside]), frozen(wanted.radius[inside])
    moves = None if wanted.velocity is None else wanted.velocity[inside]
    return VelocityField(
        skeleton=skeleton,
        fines=fines,
        left_out=int(np.sum(~inside)),
        tolerance=wanted.tolerance,
        solved=solve(skeleton, fines, wanted.tolerance, velocity=moves, former=former),
        inside=frozen(inside),
    )


def _on_grid(lattice: Lattice, position: Array, radius: Array) -> Array:
    """True (N,) for spheres that lie wholly between the ends of the grid along x."""
    if lattice.repeats:
        return np.ones(len(position), bool)
    low, high = lattice.low[0], lattice.high[0]
    return (position[:, 0] - radius >= low) & (position[:, 0] + radius <= high)


def _deposit(spheres: Snapshot, given: bool) -> Snapshot:
    """The spheres of kind fine; all of them where they were given as fines and none is."""
    fines = spheres.fines()
    if given and not len(fines):
        return replace(spheres, kind=np.full(len(spheres), Kind.FINE))
    return fines


def _checked(points: Any, count: int | None = None) -> Array:
    """Numbers (N, 3). Raises CaseError on others."""
    array = np.asarray(points, float)
    rows = "N" if count is None else count
    if array.ndim != 2 or array.shape[1] != 3 or count not in (None, len(array)):
        raise CaseError(
            f"velocity field: numbers of shape {array.shape}, expected ({rows}, 3), x, y, z"
        )
    if not np.all(np.isfinite(array)):
        raise CaseError("velocity field: a value is not finite, expected numbers, x, y, z")
    return array
