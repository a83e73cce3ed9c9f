"""The velocity field of a pack, with a deposit of fines or without.

A coarse resolved Stokes flow (`fdnet.network.stokes`), interpolated down to the walls (`sampled`).
Formulas and checks: docs/theory/resolved_flow.md.
"""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any

import numpy as np
from scipy import fft

from fdnet.errors import CaseError, NetworkError
from fdnet.network.field.sampled import (
    Nearby,
    Parts,
    find_nearby,
    gradient_at,
    gradient_parts,
    smooth_parts,
    velocity_at,
)
from fdnet.network.stokes import FEWEST_CELLS, GridFlow, Lattice, Walled, solve
from fdnet.spheres.snapshot import Array, Directions, Snapshot, frozen, sides_of


@dataclass(frozen=True, eq=False, kw_only=True)
class VelocityField:
    """Fluid velocity and pressure gradient around grains and fines; all over viscosity mu and
    superficial velocity U along x.

    Attributes:
        position: (N, 3) m, centres of the spheres on the grid: first the grains, then the fines.
        radius: (N,) m, of these spheres.
        grains: number of grains among them.
        solved: the flow on the grid.
    """

    position: Array
    radius: Array
    grains: int
    solved: GridFlow

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.lattice.shape))
        return (
            f"VelocityField({self.grains} grains, {len(self.radius) - self.grains} fines, "
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
        on_spheres, on_walls = self.forces
        force = float(on_spheres[:, 0].sum() + on_walls[0])
        return force / (float(np.prod(edges)) / float(edges[0]))

    @property
    def k(self) -> float:
        """Permeability of the specimen on this grid, m2; it is too high on a coarse one."""
        return (self.lattice.specimen[1] - self.lattice.specimen[0]) / self.resistance

    def at(self, points: Any) -> Array:
        """Fluid velocity over U, (N, 3), at points (N, 3) m. Raises CaseError on other shapes.

        It is 0 in the solid and (1, 0, 0) before and beyond the grid of a specimen that is not
        periodic along x.
        """
        return velocity_at(self.lattice, *self._smooth, _checked(points))

    def pressure_gradient_at(self, points: Any) -> Array:
        """Gradient of the pressure over mu U, (N, 3) 1/m2, at points (N, 3) m.

        In the solid it is that of the fluid around it. Raises CaseError as `at` does.
        """
        return gradient_at(self.lattice, self._gradient, _checked(points))

    @cached_property
    def forces(self) -> tuple[Array, Array]:
        """Forces of the fluid on each sphere (N, 3) and on the side walls (3,), over mu U, m.

        They include the pressure gradient, and add up to the pressure drop times the area.
        """
        return self.solved.forces(len(self.radius))

    @cached_property
    def _smooth(self) -> tuple[Nearby, Parts]:
        flow = self.lattice.response.velocity(list(self.solved.force))
        for part, drift in zip(flow, self.solved.drift, strict=True):
            part += np.float32(drift)
        nearby = find_nearby(self.lattice, self.position, self.radius)
        return nearby, smooth_parts(self.lattice, nearby, flow)

    @cached_property
    def _gradient(self) -> Parts:
        mean = -self.resistance / float(self.lattice.spacing[0] * self.lattice.shape[0])
        return gradient_parts(self.solved, mean)


def _checked(points: Any) -> Array:
    """Numbers (N, 3). Raises CaseError on others."""
    array = np.asarray(points, float)
    if array.ndim != 2 or array.shape[1] != 3 or not np.all(np.isfinite(array)):
        raise CaseError(
            f"velocity field: points of shape {array.shape}, or one that is not finite; expected "
            "(N, 3) finite numbers x, y, z"
        )
    return array


# ---- The velocity field of a pack, from its spheres.
COARSEST, FINEST, AFFORDED = 10.0, 18.0, 1_000_000
"""Cells across a mean grain where none is given: as many between the first two as keep the grid
below the third number of cells (`python scripts/validation.py velocity-field`)."""
SLIP_LEFT = 0.05  # Rms velocity left at the walls over the superficial velocity
UPSTREAM, DOWNSTREAM = 1.0, 0.5
"""Clear fluid before and beyond a specimen that is not periodic along x, in grain diameters."""


def velocity_field(
    grains: Snapshot,
    *,
    periodic: Directions | None = None,
    fines: Snapshot | None = None,
    cells: float | None = None,
    tolerance: float = SLIP_LEFT,
) -> VelocityField:
    """The velocity of a slow fluid in the pores of a pack, over the superficial one along x.

    Stokes flow is solved on a grid of `cells` cells across a mean grain. Fines are resolved as the
    grains are. The sides y and z that are not periodic are walls that hold the fluid. A specimen
    that is not periodic along x has clear fluid before and beyond it, which moves evenly: a grain
    diameter more than the fines reach upstream, and half of one downstream.

    Args:
        grains: the skeleton, m; `box` is the specimen. Fines among them are the deposit where
            `fines` is not given.
        periodic: sides that repeat, letters such as "yz" or three truth values (x, y, z);
            without it those that the file of the grains gives, else none.
        fines: the deposit; its spheres of kind grain are ignored where it has any of kind fine.
        cells: across a mean grain diameter; without it 10 to 18, as a million cells allow.
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
        deposit = fines.fines() if len(fines.fines()) else fines
    diameter, sides = 2.0 * float(skeleton.radius.mean()), sides_of(grains, periodic)
    reach = grains.box[0, 0] - (deposit.position[:, 0] - deposit.radius)
    upstream = UPSTREAM * diameter + float(max(0.0, reach.max(initial=0.0)))
    downstream = DOWNSTREAM * diameter
    if cells is None:
        edges = np.ptp(grains.box, axis=1)
        edges[0] += 0.0 if sides[0] else upstream + downstream
        affordable = diameter * (AFFORDED / np.prod(edges)) ** (1.0 / 3.0)
        cells = float(np.clip(affordable, COARSEST, FINEST))
    lattice = build_lattice(
        grains.box, sides, spacing=diameter / cells, upstream=upstream, downstream=downstream
    )
    return solved_field(lattice, skeleton, deposit, tolerance)


def build_lattice(
    box: Array, periodic: Walled, *, spacing: float, upstream: float, downstream: float
) -> Lattice:
    """The grid of a specimen in a `box` (3, 2) m, which always wraps along x.

    No edge of a cell is longer than `spacing` m. A specimen that is not periodic along x lies in a
    gap of clear fluid, `upstream` m and at least `downstream` m long, in which the flow becomes
    even again. Raises NetworkError where the box has no extent or the spacing is not positive.
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


def solved_field(
    lattice: Lattice, grains: Snapshot, deposit: Snapshot, tolerance: float
) -> VelocityField:
    """The field around the grains and the deposit that lie wholly between the ends of the grid."""
    low, high = lattice.low[0], lattice.high[0]
    kept = []
    for one in (grains, deposit):
        x = one.position[:, 0]
        inside = (x - one.radius >= low) & (x + one.radius <= high)
        kept.append(one.where(lattice.repeats | inside))
    position = np.concatenate([one.position for one in kept])
    radius = np.concatenate([one.radius for one in kept])
    return VelocityField(
        position=frozen(position),
        radius=frozen(radius),
        grains=len(kept[0]),
        solved=solve(lattice, position, radius, slip=tolerance),
    )
