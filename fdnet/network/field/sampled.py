"""The velocity field at points, and its pressures.

The velocity at a point between the nodes of a staggered grid, by the laws that hold at a wall.

Fluid that cannot slip and keeps its volume approaches a wall like the square of the distance d.
Nearer than PROBE to a sphere, velocity / phi is therefore taken at the distance PROBE on the same
normal; between two spheres nearer than that the probe stays on this side of the middle. The part
of the velocity across the wall is replaced by what keeps the volume of the part along it,

    - (divergence along the sphere) (integral of phi from 0 to d) / phi(d),

which is d (R - d / 3) / (2 R - d) times the divergence for the profile phi = d (2 R - d) / R^2 of
one wall. The divergence is that of the velocity along the sphere at the distance d, by central
differences. Any share of the velocity across as sampled would make sources and sinks here, which
gather what the fluid carries at the walls.
"""

from dataclasses import dataclass
from math import cos, floor, sin, sqrt

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.field.grid import REACH, Lattice, Nearby, Place, Response, wall_profile
from fdnet.network.field.solved import Solved
from fdnet.spheres.snapshot import Array, one_line

PROBE = 0.8
"""Distance from a sphere, in spacings, within which the flow follows the laws at a wall."""
STEP = 0.5
"""Length, in spacings, over which the velocity along a sphere is differentiated."""

Near = tuple[float, float, float, int]
Frame = tuple[Array, Array, Array]
Walls = tuple[Array, Array, Array]
Parts = tuple[Array, Array, Array]


@compiled
def linear(part: Array, x: float, y: float, z: float) -> float:
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
def _off_the_wall(point: Place, near: Near, place: Array) -> tuple[Place, Place, float]:
    """Where to sample, the normal of the nearest sphere, and d / probe (1 away from spheres)."""
    x, y, z = point
    _, least, second, row = near
    probe = min(PROBE, 0.5 * (least + second))
    if row < 0 or least >= probe:
        return point, (0.0, 0.0, 0.0), 1.0
    p, q, r = x - place[row, 0], y - place[row, 1], z - place[row, 2]
    length = sqrt(p * p + q * q + r * r)
    p, q, r = p / length, q / length, r / length
    more = probe - least
    return (x + more * p, y + more * q, z + more * r), (p, q, r), least / probe


@compiled
def _place_on(point: Place, grid: Frame) -> tuple[Place, int]:
    """The point within the grid, and its cell; -1 - axis for a point outside along an axis."""
    shape, step, wraps = grid
    number, out = 0, 0
    x, y, z = point
    for axis in range(3):
        length = shape[axis] * step[axis]
        at = x if axis == 0 else (y if axis == 1 else z)
        if wraps[axis]:
            at -= floor(at / length) * length
        elif at < 0.0 or at >= length:
            out = -1 - axis
        if axis == 0:
            x = at
        elif axis == 1:
            y = at
        else:
            z = at
        number = number * shape[axis] + max(0, min(int(at / step[axis]), shape[axis] - 1))
    return (x, y, z), out if out < 0 else number


@compiled
def _unbalanced(
    point: Place, cell: int, grid: Frame, nearby: Walls, smooth: Parts
) -> tuple[Place, Place, float, Near]:
    """Velocity with its part across a near wall as sampled; normal, d / probe and walls near."""
    step = grid[1]
    first, place, sides = nearby
    near = wall_profile(point, (first[cell], first[cell + 1]), place, sides)
    if near[0] <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, near
    there, normal, share = _off_the_wall(point, near, place)
    x, y, z = there[0] / step[0], there[1] / step[1], there[2] / step[2]
    u = near[0] * linear(smooth[0], x + 2.0, y + 1.5, z + 1.5)
    v = near[0] * linear(smooth[1], x + 1.5, y + 2.0, z + 1.5)
    w = near[0] * linear(smooth[2], x + 1.5, y + 1.5, z + 2.0)
    return (u, v, w), normal, share, near


@compiled
def _spreading(
    point: Place, around: tuple[Place, float, float], grid: Frame, nearby: Walls, smooth: Parts
) -> float:
    """Divergence along a sphere of the velocity along it, at one distance from it.

    `around` are the normal, the radius from the centre, and the length of the steps.
    """
    normal, radius, step = around
    p, q, r = normal
    # two tangents: the normal crossed with the axis that it is farthest from, and with that
    if abs(p) <= abs(q) and abs(p) <= abs(r):
        a, b, c = 0.0, r, -q
    elif abs(q) <= abs(r):
        a, b, c = -r, 0.0, p
    else:
        a, b, c = q, -p, 0.0
    length = sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    turn = step / radius
    cosine, sine = cos(turn), sin(turn)
    total = 0.0
    for tangent in range(2):
        if tangent == 1:
            a, b, c = q * c - r * b, r * a - p * c, p * b - q * a
        for sign in (-1.0, 1.0):
            along, up = radius * sine * sign, radius * (cosine - 1.0)
            beside = (
                point[0] + along * a + up * p,
                point[1] + along * b + up * q,
                point[2] + along * c + up * r,
            )
            inside, cell = _place_on(beside, grid)
            if cell < 0:
                continue
            flow = _unbalanced(inside, cell, grid, nearby, smooth)[0]
            # the tangent, carried along the great circle
            across = -sine * sign
            total += sign * (
                flow[0] * (cosine * a + across * p)
                + flow[1] * (cosine * b + across * q)
                + flow[2] * (cosine * c + across * r)
            )
    return total / (2.0 * step)


@compiled
def sample_points(point: Array, grid: Frame, nearby: Walls, smooth: Parts, result: Array) -> None:
    """Writes the velocity at each `point` (N, 3), in spacings, to `result`."""
    place = nearby[1]
    for s in range(len(point)):
        inside, cell = _place_on((point[s, 0], point[s, 1], point[s, 2]), grid)
        if cell < 0:
            result[s, 0] = 1.0 if cell == -1 else 0.0
            continue
        (u, v, w), normal, share, near = _unbalanced(inside, cell, grid, nearby, smooth)
        if share < 1.0:
            p, q, r = normal
            sampled = u * p + v * q + w * r
            radius = near[1] + place[near[3], 3]
            spread = _spreading(inside, (normal, radius, STEP), grid, nearby, smooth)
            depth = near[1] * (REACH - near[1] / 3.0) / (2.0 * REACH - near[1])
            across = -depth * spread - sampled
            u, v, w = u + across * p, v + across * q, w + across * r
        result[s, 0], result[s, 1], result[s, 2] = u, v, w


# ------------------------------------------------------------------------------------------------
# The velocity between the nodes of a staggered grid, down to the walls.
#
# Linear interpolation from node to node knows nothing of a wall between them. So the nodes carry
# velocity / phi, with the profile phi that the walls allow (`nearby`), which is smooth up to the
# walls; it is interpolated linearly and multiplied by phi at the point. Nodes in the solid, or of
# a phi below LEAST_PROFILE, take the mean of their neighbours; in the solid, without its part
# across the wall.
#
# What happens at the walls is in `wall_laws`.


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


# ------------------------------------------------------------------------------------------------
# The pressure gradient between the nodes of a staggered grid.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Gradient:
    """The pressure gradient on the faces of the cells.

    Attributes:
        lattice: the grid.
        parts: for each component (n0, n1, n2) difference across the face over its spacing, over
            viscosity and superficial velocity, 1/m2. Faces in the solid carry the mean of their
            neighbours in the fluid, from the surface inwards.
    """

    lattice: Lattice
    parts: tuple[Array, Array, Array]

    __repr__ = one_line

    def at(self, points: Array) -> Array:
        """Gradient (N, 3) 1/m2 at points (N, 3) m, linear between the faces.

        It is 0 before and beyond a grid that does not repeat along x.
        """
        result, inside = np.zeros(points.shape), np.ones(len(points), bool)
        if not self.lattice.repeats:
            inside = points[:, 0] >= self.lattice.low[0]
            inside &= points[:, 0] < self.lattice.high[0]
        place = np.ascontiguousarray((points[inside] - self.lattice.low) / self.lattice.spacing)
        sampled = np.zeros(place.shape)
        _sample(place, np.array(self.lattice.walled), self.parts, sampled)
        result[inside] = sampled
        return result


def find_gradient(
    lattice: Lattice, response: Response, solved: Solved, gradient: float
) -> Gradient:
    """The pressure gradient of a flow whose mean is `gradient` 1/m2 along x."""
    pressure = response.pressure(list(solved.force))
    parts = []
    for axis in range(3):
        step = pressure - np.roll(pressure, 1, axis=axis)
        if lattice.walled[axis]:
            np.moveaxis(step, axis, 0)[0] = 0.0
        part = step / (lattice.spacing[axis] * lattice.unit)
        if axis == 0:
            part += gradient
        parts.append(_inwards(part.astype(np.float32), ~solved.solid[axis]))
    return Gradient(lattice=lattice, parts=(parts[0], parts[1], parts[2]))


def _inwards(part: Array, known: Array) -> Array:
    """Fills nodes that are not `known` with the mean of those next to them, layer by layer."""
    known = known.copy()
    while True:
        count = _fill_layer(part, known)
        if count == 0:
            return part


@compiled
def _fill_layer(part: Array, known: Array) -> int:
    """Fills the unknown nodes next to known ones; returns how many."""
    shape, filled = part.shape, []
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                if known[i, j, k]:
                    continue
                total, count = 0.0, 0
                for a in (i - 1, i, i + 1):
                    for b in (j - 1, j, j + 1):
                        for c in (k - 1, k, k + 1):
                            at = (a % shape[0], b % shape[1], c % shape[2])
                            if known[at]:
                                total += part[at]
                                count += 1
                if count > 0:
                    part[i, j, k] = total / count
                    filled.append((i, j, k))
    for node in filled:
        known[node] = True
    return len(filled)


@compiled
def _sample(place: Array, walled: Array, parts: tuple[Array, Array, Array], result: Array) -> None:
    """Writes the linear interpolation at each `place` (N, 3), in cells, to `result`."""
    base, rest, at = np.zeros(3, np.int64), np.zeros(3), np.zeros(3, np.int64)
    for s in range(len(place)):
        for component in range(3):
            part = parts[component]
            for axis in range(3):
                x = place[s, axis] - (0.0 if axis == component else 0.5)
                base[axis] = floor(x)
                rest[axis] = x - base[axis]
            total = 0.0
            for corner in range(8):
                weight = 1.0
                for axis in range(3):
                    up = (corner >> axis) & 1
                    weight *= rest[axis] if up else 1.0 - rest[axis]
                    node = base[axis] + up
                    if walled[axis]:
                        if axis == component and (node <= 0 or node >= part.shape[axis]):
                            weight = 0.0
                        at[axis] = max(0, min(node, part.shape[axis] - 1))
                    else:
                        at[axis] = node % part.shape[axis]
                if weight != 0.0:
                    total += weight * part[at[0], at[1], at[2]]
            result[s, component] = total
