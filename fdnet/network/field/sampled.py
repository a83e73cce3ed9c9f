"""The velocity between the nodes of a staggered grid, down to the walls.

Linear interpolation from node to node knows nothing of a wall between them. So the nodes carry
velocity / phi, with the profile phi that the walls allow (`nearby`), which is smooth up to the
walls; it is interpolated linearly and multiplied by phi at the point. Nodes in the solid, or of a
phi below LEAST_PROFILE, take the mean of their neighbours; in the solid, without its part across
the wall.

What happens at the walls is in `wall_laws`.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.field.lattice import Lattice
from fdnet.network.field.nearby import Nearby, wall_profile
from fdnet.network.field.wall_laws import Parts, Walls, linear, sample_points
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

LEAST_PROFILE = 0.02
"""Least phi of a node whose own velocity is used."""


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
        sample_points(place, (shape, step, wraps), nearby, self.smooth, result)
        return result


def sample_velocity(lattice: Lattice, nearby: Nearby, flow: list[Array]) -> Sampled:
    """Prepares the interpolation of a velocity, three arrays of the grid's shape."""
    step = lattice.spacing / lattice.unit
    walls = (nearby.first, nearby.place, nearby.sides)
    smooth = []
    for d, part in enumerate(flow):
        phi = _profile_at_nodes(np.array(lattice.shape), step, d, walls)
        smooth.append(_filled(_padded(part, lattice, d), _padded(phi, lattice, d)))
    mean = (smooth[0], smooth[1], smooth[2])
    bounded = []
    for d, part in enumerate(mean):
        inner = part[2:-2, 2:-2, 2:-2].copy()
        _turn_along_walls(d, step, walls, mean, inner)
        bounded.append(_padded(inner, lattice, d))
        if lattice.walled[d]:
            # no flow through the walls: their own nodes carry nothing
            across = np.moveaxis(bounded[d], d, 0)
            across[:3], across[lattice.shape[d] + 2 :] = 0.0, 0.0
    return Sampled(lattice=lattice, nearby=nearby, smooth=(bounded[0], bounded[1], bounded[2]))


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
def _turn_along_walls(
    component: int, step: Array, walls: Walls, smooth: Parts, part: Array
) -> None:
    """Takes the part across its sphere from velocity / phi at nodes in the solid.

    Across a wall velocity / phi is 0 at the wall, where along it it is not. `part` holds the nodes
    of this component of `smooth` without those added around, and is changed.
    """
    first, place, sides = walls
    shape = part.shape
    away = np.full(3, 0.5)
    away[component] = 0.0
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                if part[i, j, k] == 0.0:
                    continue
                x, y, z = i + away[0], j + away[1], k + away[2]
                node = (x * step[0], y * step[1], z * step[2])
                cell = (i * shape[1] + j) * shape[2] + k
                near = wall_profile(node, (first[cell], first[cell + 1]), place, sides)
                row = near[3]
                if near[0] > 0.0 or row < 0:
                    continue
                p, q, r = node[0] - place[row, 0], node[1] - place[row, 1], node[2] - place[row, 2]
                square = p * p + q * q + r * r
                u = linear(smooth[0], x + 2.0, y + 1.5, z + 1.5)
                v = linear(smooth[1], x + 1.5, y + 2.0, z + 1.5)
                w = linear(smooth[2], x + 1.5, y + 1.5, z + 2.0)
                own = p if component == 0 else (q if component == 1 else r)
                part[i, j, k] -= own * (u * p + v * q + w * r) / square
