"""The velocity between the nodes of a staggered grid, down to the walls.

Linear interpolation from node to node knows nothing of a wall between them. So the nodes carry
velocity / phi, with the profile phi that the walls allow (`nearby`), which is smooth up to the
walls; it is interpolated linearly and multiplied by phi at the point. Nodes in the solid, or
nearer than LEAST_PROFILE to it, take the mean of their neighbours.

Fluid that cannot slip and keeps its volume approaches a wall like the square of the distance d.
Nearer than PROBE to a sphere, the velocity is therefore that at the distance PROBE on the same
normal, its part along the wall times phi/phi(PROBE), its part across times (d / PROBE)^2 instead.
Between two spheres nearer than that the probe stays on this side of the middle.
"""

from dataclasses import dataclass
from math import floor, sqrt

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.field.lattice import Lattice
from fdnet.network.field.nearby import Nearby, Place, wall_profile
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

LEAST_PROFILE = 0.15
"""Least phi, in spacings, of a node whose own velocity is used."""
PROBE = 0.7
"""Distance from a sphere, in spacings, within which the flow across its surface is quadratic."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sampled:
    """What is interpolated.

    Attributes:
        lattice: the grid.
        nearby: the walls near each of its cells.
        smooth: for each component (n0 + 4, n1 + 4, n2 + 4) velocity / phi; two nodes are added
            before and two after those of the grid.
    """

    lattice: Lattice
    nearby: Nearby
    smooth: tuple[Array, Array, Array]

    __repr__ = one_line

    def velocity(self, points: Array) -> Array:
        """Velocity (N, 3) at points (N, 3) m.

        It is 0 in the solid and outside of walls, and (1, 0, 0) before and beyond the grid along
        x where that does not repeat.
        """
        lattice = self.lattice
        step = lattice.spacing / lattice.unit
        shape = np.array(lattice.shape)
        nearby = (self.nearby.first, self.nearby.place, self.nearby.sides)
        wraps = np.array([lattice.repeats, not lattice.walled[1], not lattice.walled[2]])
        result = np.zeros(points.shape)
        place = np.ascontiguousarray((points - lattice.low) / lattice.unit)
        _sample(place, (shape, step, wraps), nearby, self.smooth, result)
        return result


def sample_velocity(lattice: Lattice, nearby: Nearby, flow: list[Array]) -> Sampled:
    """Prepares the interpolation of a velocity, three arrays of the grid's shape."""
    step = lattice.spacing / lattice.unit
    walls = (nearby.first, nearby.place, nearby.sides)
    smooth = []
    for d, part in enumerate(flow):
        phi = _profile_at_nodes(np.array(lattice.shape), step, d, walls)
        smooth.append(_filled(_padded(part, lattice, d), _padded(phi, lattice, d)))
        if lattice.walled[d]:
            # no flow through the walls: their own nodes carry nothing
            across = np.moveaxis(smooth[d], d, 0)
            across[:3], across[lattice.shape[d] + 2 :] = 0.0, 0.0
    return Sampled(lattice=lattice, nearby=nearby, smooth=(smooth[0], smooth[1], smooth[2]))


def _padded(part: Array, lattice: Lattice, component: int) -> Array:
    """Two more nodes before and two after those of the grid, repeated or continued."""
    for axis in range(3):
        pads = [(2, 2) if a == axis else (0, 0) for a in range(3)]
        if not lattice.walled[axis]:
            part = np.pad(part, pads, mode="wrap")
        else:
            part = np.pad(part, pads, mode="constant" if axis == component else "edge")
    return np.asarray(part, np.float32)


@compiled
def _profile_at_nodes(
    shape: Array, step: Array, component: int, walls: tuple[Array, Array, Array]
) -> Array:
    first, place, sides = walls
    phi = np.zeros((shape[0], shape[1], shape[2]), np.float32)
    away = np.full(3, 0.5)
    away[component] = 0.0
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                cell = (i * shape[1] + j) * shape[2] + k
                node = ((i + away[0]) * step[0], (j + away[1]) * step[1], (k + away[2]) * step[2])
                phi[i, j, k] = wall_profile(node, (first[cell], first[cell + 1]), place, sides)[0]
    return phi


@compiled
def _filled(flow: Array, phi: Array) -> Array:
    """Velocity over phi, at nodes of too small a phi the mean of the neighbours."""
    shape = flow.shape
    smooth = np.zeros(shape, np.float32)
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                if phi[i, j, k] >= LEAST_PROFILE:
                    smooth[i, j, k] = flow[i, j, k] / phi[i, j, k]
                    continue
                total, weights = 0.0, 0.0
                for a in range(max(i - 1, 0), min(i + 2, shape[0])):
                    for b in range(max(j - 1, 0), min(j + 2, shape[1])):
                        for c in range(max(k - 1, 0), min(k + 2, shape[2])):
                            if phi[a, b, c] >= LEAST_PROFILE:
                                weight = 1.0 / ((a - i) ** 2 + (b - j) ** 2 + (c - k) ** 2)
                                total += weight * flow[a, b, c] / phi[a, b, c]
                                weights += weight
                if weights > 0.0:
                    smooth[i, j, k] = total / weights
    return smooth


@compiled
def _linear(part: Array, x: float, y: float, z: float) -> float:
    """Linear interpolation at (x, y, z), in nodes of the padded grid."""
    i, j, k = int(x), int(y), int(z)
    a, b, c = x - i, y - j, z - k
    low = (1.0 - b) * ((1.0 - c) * part[i, j, k] + c * part[i, j, k + 1]) + b * (
        (1.0 - c) * part[i, j + 1, k] + c * part[i, j + 1, k + 1]
    )
    i += 1
    high = (1.0 - b) * ((1.0 - c) * part[i, j, k] + c * part[i, j, k + 1]) + b * (
        (1.0 - c) * part[i, j + 1, k] + c * part[i, j + 1, k + 1]
    )
    return float((1.0 - a) * low + a * high)


@compiled
def _off_the_wall(
    point: Place, profile: tuple[float, float, float, int], place: Array
) -> tuple[Place, Place, float]:
    """Where to sample, the normal of the nearest sphere, and d / probe (1 away from spheres)."""
    x, y, z = point
    _, least, second, row = profile
    probe = min(PROBE, 0.5 * (least + second))
    if row < 0 or least >= probe:
        return point, (0.0, 0.0, 0.0), 1.0
    p, q, r = x - place[row, 0], y - place[row, 1], z - place[row, 2]
    length = sqrt(p * p + q * q + r * r)
    p, q, r = p / length, q / length, r / length
    more = probe - least
    return (x + more * p, y + more * q, z + more * r), (p, q, r), least / probe


@compiled
def _sample(
    point: Array,
    grid: tuple[Array, Array, Array],
    nearby: tuple[Array, Array, Array],
    smooth: tuple[Array, Array, Array],
    result: Array,
) -> None:
    """Writes the velocity at each `point` (N, 3), in spacings, to `result`."""
    shape, step, wraps = grid
    first, place, sides = nearby
    cell, inside = np.zeros(3, np.int64), np.zeros(3)
    for s in range(len(point)):
        out = -1
        for axis in range(3):
            length = shape[axis] * step[axis]
            at = point[s, axis]
            if wraps[axis]:
                at -= floor(at / length) * length
            elif at < 0.0 or at >= length:
                out = axis
            inside[axis] = at
            cell[axis] = max(0, min(int(at / step[axis]), shape[axis] - 1))
        if out >= 0:
            result[s, 0] = 1.0 if out == 0 else 0.0
            continue
        number = (cell[0] * shape[1] + cell[1]) * shape[2] + cell[2]
        here = (inside[0], inside[1], inside[2])
        profile = wall_profile(here, (first[number], first[number + 1]), place, sides)
        if profile[0] <= 0.0:
            continue
        there, normal, share = _off_the_wall(here, profile, place)
        x, y, z = there[0] / step[0], there[1] / step[1], there[2] / step[2]
        u = profile[0] * _linear(smooth[0], x + 2.0, y + 1.5, z + 1.5)
        v = profile[0] * _linear(smooth[1], x + 1.5, y + 2.0, z + 1.5)
        w = profile[0] * _linear(smooth[2], x + 1.5, y + 1.5, z + 2.0)
        across = (share - 1.0) * (u * normal[0] + v * normal[1] + w * normal[2])
        result[s, 0] = u + across * normal[0]
        result[s, 1] = v + across * normal[1]
        result[s, 2] = w + across * normal[2]
