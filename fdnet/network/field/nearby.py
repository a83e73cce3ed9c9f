"""Which walls stand near a point of the grid, and the profile of the flow that they allow.

Between walls at distances d_1, d_2, ... below R the velocity is taken as a smooth vector times

    phi = product of d_i (2R - d_i) / R^2,

which is 0 at every wall, grows like the distance from it, and becomes flat at R. Between two
plates the product of the distances is the exact profile of the flow, and so is that of the three
distances in a duct whose section is an equilateral triangle. Lengths are in the spacing along x,
from the lower corner of the grid.
"""

from dataclasses import dataclass
from math import ceil, floor, sqrt

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.field.lattice import Lattice
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

REACH = 2.0
"""R, distance from which a wall no longer shapes the profile, in spacings."""

Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Nearby:
    """Walls near each cell of a grid.

    Attributes:
        first: (cells + 1,) row where the spheres of each cell begin.
        place: (K, 4) centre and radius of a sphere, shifted by periods to where it stands next to
            the cell.
        sides: (6,) lower and upper x between which the side walls hold the fluid; places of the
            lower and upper walls across y, then z, infinitely far away where there is none.
    """

    first: Array
    place: Array
    sides: Array

    __repr__ = one_line


def find_nearby(lattice: Lattice, position: Array, radius: Array) -> Nearby:
    """Spheres within REACH of some point of each cell; centres (N, 3) m, radii (N,) m."""
    centre = (position - lattice.low) / lattice.unit
    step = lattice.spacing / lattice.unit
    size = np.asarray(radius) / lattice.unit
    grid = (np.array(lattice.shape), step, np.array(lattice.walled))
    count = np.zeros(lattice.cells, np.int64)
    _visit(centre, size, grid, count, np.zeros((0, 4), np.float32))
    first = np.concatenate([[0], np.cumsum(count)])
    place = np.zeros((int(first[-1]), 4), np.float32)
    if len(place):
        _visit(centre, size, grid, first[:-1].copy(), place)
    return Nearby(first=frozen(first), place=place, sides=frozen(_sides(lattice, step)))


def _sides(lattice: Lattice, step: Array) -> Array:
    held = (np.array(lattice.specimen) - lattice.low[0]) / lattice.unit
    if lattice.repeats:
        held = np.array([-np.inf, np.inf])
    walls = [
        wall
        for axis in (1, 2)
        for wall in (
            (0.0, lattice.shape[axis] * step[axis]) if lattice.walled[axis] else (-np.inf, np.inf)
        )
    ]
    return np.array([*held, *walls])


@compiled
def _visit(
    centre: Array, radius: Array, grid: tuple[Array, Array, Array], count: Array, place: Array
) -> None:
    """Counts the spheres near each cell; writes them from `count` on where `place` has room."""
    shape, step, walled = grid
    half = 0.5 * sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for s in range(len(radius)):
        reach = radius[s] + REACH
        for axis in range(3):
            low[axis] = floor((centre[s, axis] - reach) / step[axis])
            high[axis] = ceil((centre[s, axis] + reach) / step[axis])
            if walled[axis]:
                low[axis], high[axis] = max(low[axis], 0), min(high[axis], shape[axis] - 1)
        for i in range(low[0], high[0] + 1):
            x = (i + 0.5) * step[0] - centre[s, 0]
            for j in range(low[1], high[1] + 1):
                y = (j + 0.5) * step[1] - centre[s, 1]
                for k in range(low[2], high[2] + 1):
                    z = (k + 0.5) * step[2] - centre[s, 2]
                    if x * x + y * y + z * z > (reach + half) ** 2:
                        continue
                    a, b, c = i % shape[0], j % shape[1], k % shape[2]
                    cell = (a * shape[1] + b) * shape[2] + c
                    if len(place):
                        row = count[cell]
                        place[row, 0] = centre[s, 0] + (a - i) * step[0]
                        place[row, 1] = centre[s, 1] + (b - j) * step[1]
                        place[row, 2] = centre[s, 2] + (c - k) * step[2]
                        place[row, 3] = radius[s]
                    count[cell] += 1


@compiled
def wall_profile(
    point: Place, rows: tuple[int, int], place: Array, sides: Array
) -> tuple[float, float, float, int]:
    """phi at a point, least and second least distance to a sphere, row of the nearest sphere.

    The point must lie in the cell of the `rows` of `place`. Distances are REACH, and the row -1,
    where no sphere is nearer. Inside a solid phi is 0.
    """
    x, y, z = point
    profile, least, second, nearest = 1.0, REACH, REACH, -1
    for row in range(rows[0], rows[1]):
        dx, dy, dz = x - place[row, 0], y - place[row, 1], z - place[row, 2]
        away = sqrt(dx * dx + dy * dy + dz * dz) - place[row, 3]
        if away <= 0.0:
            return 0.0, away, away, row
        if away < REACH:
            profile *= away * (2.0 * REACH - away) / REACH**2
            if away < least:
                least, second, nearest = away, least, row
            elif away < second:
                second = away
    if sides[0] <= x <= sides[1]:
        for side in range(4):
            away = y if side < 2 else z
            away = away - sides[2 + side] if side % 2 == 0 else sides[2 + side] - away
            if away <= 0.0:
                return 0.0, away, away, -1
            if away < REACH:
                profile *= away * (2.0 * REACH - away) / REACH**2
                second = min(second, away)
    return profile, least, second, nearest
