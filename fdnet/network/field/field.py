"""The velocity field of a pack.

The velocity of the fluid in the pores of a pack, with a deposit of fines or without: a coarse
resolved Stokes flow (`fdnet.network.stokes`), interpolated down to the walls (`sampled`). Formulas
and checks: docs/theory/resolved_flow.md.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from scipy import fft

from fdnet.errors import CaseError, NetworkError
from fdnet.network.field.sampled import (
    Gradient,
    Sampled,
    find_gradient,
    find_nearby,
    sample_velocity,
)
from fdnet.network.stokes import FEWEST_CELLS, GridFlow, Lattice, Walled, solve
from fdnet.spheres.snapshot import Array, Directions, Snapshot, frozen, sides_of


@dataclass(frozen=True, eq=False, kw_only=True)
class VelocityField:
    """Fluid velocity and pressure gradient around grains and fines; all over viscosity mu and
    superficial velocity U along x.

    Attributes:
        grains: centres (G, 3) m and radii (G,) m of the grains that hold the fluid.
        fines: centres (N, 3) m and radii (N,) m of the fines that hold the fluid.
        solved: the flow on the grid.
        inside: (N,) which of the fines given are on the grid; the others are left out.
    """

    grains: tuple[Array, Array]
    fines: tuple[Array, Array]
    solved: GridFlow
    inside: Array

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.lattice.shape))
        return (
            f"VelocityField({len(self.grains[1])} grains, {len(self.fines[1])} fines, "
            f"{shape} cells, k {self.k:.4g} m2)"
        )

    @property
    def lattice(self) -> Lattice:
        """The grid."""
        return self.solved.lattice

    @cached_property
    def resistance(self) -> float:
        """Pressure drop over the specimen over mu U, 1/m; clear fluid around it adds nothing."""
        edges = self.lattice.spacing * self.lattice.shape
        force = float(self._forces[0][:, 0].sum() + self.wall_force[0])
        return force / (float(np.prod(edges)) / float(edges[0]))

    @property
    def k(self) -> float:
        """Permeability of the specimen on this grid, m2; it is too high on a coarse one."""
        return (self.lattice.specimen[1] - self.lattice.specimen[0]) / self.resistance

    @property
    def grain_force(self) -> Array:
        """Force of the fluid on each grain over mu U, (G, 3) m, the pressure gradient included."""
        return self._forces[0][: len(self.grains[1])]

    @property
    def fine_force(self) -> Array:
        """Force of the fluid on each fine given over mu U, (N, 3) m, likewise; 0 off the grid.

        The forces on grains, fines and side walls add up to the pressure drop times the area.
        """
        force = np.zeros((len(self.inside), 3))
        force[self.inside] = self._forces[0][len(self.grains[1]) :]
        return force

    @property
    def wall_force(self) -> Array:
        """Force of the fluid on the side walls over mu U, (3,) m."""
        return self._forces[1]

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
    def _forces(self) -> tuple[Array, Array]:
        return self.solved.forces(len(self.grains[1]) + len(self.fines[1]))

    @cached_property
    def _flow(self) -> list[Array]:
        flow = self.lattice.response.velocity(list(self.solved.force))
        return [
            part + np.float32(drift) for part, drift in zip(flow, self.solved.drift, strict=True)
        ]

    @cached_property
    def _sampled(self) -> Sampled:
        position, radius = map(np.concatenate, zip(self.grains, self.fines, strict=True))
        return sample_velocity(
            self.lattice, find_nearby(self.lattice, position, radius), self._flow
        )

    @cached_property
    def _gradient(self) -> Gradient:
        mean = -self.resistance / float(self.lattice.spacing[0] * self.lattice.shape[0])
        return find_gradient(self.solved, self.lattice.response, mean)


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


# ------------------------------------------------------------------------------------------------
# The velocity field of a pack, from its spheres.


COARSEST, FINEST, AFFORDED = 10.0, 18.0, 1_000_000
"""Cells across a mean grain where none is given: as many between the first two as keep the grid
below the third number of cells (`python scripts/validation.py velocity-field`)."""
SLIP_LEFT = 0.05
"""Rms velocity left at the walls over the superficial velocity."""
UPSTREAM, DOWNSTREAM = 1.0, 0.5
"""Clear fluid before and beyond a specimen that is not periodic along x, in grain diameters."""


def velocity_field(
    grains: Snapshot,
    *,
    periodic: Directions | None = None,
    fines: Snapshot | None = None,
    cells: float | None = None,
    upstream: float | None = None,
    tolerance: float = SLIP_LEFT,
) -> VelocityField:
    """The velocity of a slow fluid in the pores of a pack, over the superficial one along x.

    Stokes flow is solved on a grid of `cells` cells across a mean grain. Fines are resolved as the
    grains are. The sides y and z that are not periodic are walls that hold the fluid. A specimen
    that is not periodic along x has clear fluid before and beyond it, which moves evenly.

    Args:
        grains: the skeleton, m; `box` is the specimen. Fines among them are the deposit where
            `fines` is not given.
        periodic: sides that repeat, letters such as "yz" or three truth values (x, y, z);
            without it those that the file of the grains gives, else none.
        fines: the deposit; its spheres of kind grain are ignored where it has any of kind fine.
        cells: across a mean grain diameter; without it 10 to 18, as a million cells allow.
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
        >>> print(f"{field.at([[1e-3, 1e-3, 1e-3]])[0, 0]:.0f}")
        4
    """
    skeleton, deposit = grains.grains(), grains.fines()
    if not len(skeleton):
        raise CaseError("velocity field: no grain among the spheres, expected at least one")
    if not ((cells is None or 1.0 <= cells < np.inf) and 0.0 < tolerance < 1.0):
        raise CaseError(
            f"velocity field: {cells!r} cells across a grain and a tolerance of {tolerance!r}, "
            "expected at least 1 cell and a tolerance between 0 and 1"
        )
    if fines is not None:
        # all of them where none is of kind fine
        deposit = fines.fines() if len(fines.fines()) else fines
    diameter, sides = 2.0 * float(skeleton.radius.mean()), sides_of(grains, periodic)
    if upstream is None:
        reach = grains.box[0, 0] - (deposit.position[:, 0] - deposit.radius)
        upstream = UPSTREAM * diameter + float(max(0.0, reach.max(initial=0.0)))
    if cells is None:
        edges = np.ptp(grains.box, axis=1)
        edges[0] += 0.0 if sides[0] else upstream + DOWNSTREAM * diameter
        affordable = diameter * (AFFORDED / np.prod(edges)) ** (1.0 / 3.0)
        cells = float(np.clip(affordable, COARSEST, FINEST))
    lattice = build_lattice(
        grains.box,
        sides,
        spacing=diameter / cells,
        upstream=upstream,
        downstream=DOWNSTREAM * diameter,
    )
    kept = skeleton.where(on_grid(lattice, skeleton.position, skeleton.radius))
    return solved_field(
        lattice, (kept.position, kept.radius), (deposit.position, deposit.radius), tolerance
    )


def build_lattice(
    box: Array, periodic: Walled, *, spacing: float, upstream: float, downstream: float
) -> Lattice:
    """The grid of a specimen, which always wraps along x.

    A specimen that is not periodic along x lies in a gap of clear fluid that is wide enough for
    the flow to become even again.

    Args:
        box: (3, 2) m, bounds of the specimen.
        periodic: whether its sides x, y, z are periodic.
        spacing: m, the largest edge of a cell.
        upstream: m of clear fluid before the specimen; without meaning where x is periodic.
        downstream: m of clear fluid, at least, beyond the specimen; likewise.

    Raises:
        NetworkError: the box has no extent, or the spacing is not positive.
    """
    edges = box[:, 1] - box[:, 0]
    if not (np.all(edges > 0.0) and 0.0 < spacing < np.inf):
        raise NetworkError(
            f"velocity field: cells of {spacing:g} m in a box of edges {edges.tolist()} m, "
            "expected positive numbers; give the spheres a box"
        )

    def fast(length: float) -> int:
        """The least number of cells whose Fourier transform is fast."""
        return int(fft.next_fast_len(max(FEWEST_CELLS, ceil(length / spacing * (1.0 - 1e-9)))))

    low, shape = box[:, 0].copy(), [fast(edge) for edge in edges]
    steps = edges / shape
    if not periodic[0]:
        steps[0] = spacing
        low[0] -= upstream
        shape[0] = fast(edges[0] + upstream + downstream)
    return Lattice(
        low=frozen(low),
        spacing=frozen(steps),
        shape=(shape[0], shape[1], shape[2]),
        walled=(False, not periodic[1], not periodic[2]),
        specimen=(float(box[0, 0]), float(box[0, 1])),
        repeats=periodic[0],
    )


def on_grid(lattice: Lattice, position: Array, radius: Array) -> Array:
    """True (N,) for spheres that lie wholly between the ends of the grid along x."""
    low, high = lattice.low[0], lattice.high[0]
    inside = (position[:, 0] - radius >= low) & (position[:, 0] + radius <= high)
    return np.asarray(lattice.repeats | inside)


def solved_field(
    lattice: Lattice,
    grains: tuple[Array, Array],
    deposit: tuple[Array, Array],
    tolerance: float,
) -> VelocityField:
    """The field around grains on the grid and a deposit: centres (N, 3) m and radii (N,) m."""
    inside = on_grid(lattice, *deposit)
    fines = frozen(deposit[0][inside]), frozen(deposit[1][inside])
    position, radius = map(np.concatenate, zip(grains, fines, strict=True))
    return VelocityField(
        grains=grains,
        fines=fines,
        solved=solve(lattice, position, radius, slip=tolerance),
        inside=frozen(inside),
    )
