"""The velocity and the pressure gradient between the nodes of a staggered grid.

The nodes carry velocity / phi, with the profile phi that the walls allow; it is interpolated
linearly and multiplied by phi at the point. Nearer than PROBED_AT to a sphere it is taken at that
distance on the same normal, and the part across the wall follows from the divergence of the part
along it (docs/theory/resolved_flow.md). Nodes in the solid, or of a phi below LEAST_PROFILE, take
the mean of their neighbours. Lengths are in the spacing along x, from the lower corner.
"""

from math import ceil, cos, floor, sin, sqrt
from typing import NamedTuple

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.stokes import GridFlow, Lattice
from fdnet.spheres.snapshot import Array

WALL_REACH = 2.0  # R, distance from which a wall no longer shapes the profile, in spacings
PROBED_AT = 0.8
"""Distance from a sphere, in spacings, within which the flow follows the laws at a wall."""
ALONG = 0.5  # Length, in spacings, over which the velocity along a sphere is differentiated
LEAST_PROFILE = 0.02  # Least phi of a node whose own velocity is used

Place = tuple[float, float, float]
Parts = tuple[Array, Array, Array]


class CellFrame(NamedTuple):
    """Cells (3,) of a grid, their edges (3,), and whether (3,) it repeats along each axis."""

    shape: Array
    step: Array
    wraps: Array


class Nearby(NamedTuple):
    """Walls near each cell of a grid."""

    first: Array  # (cells + 1,) row where the spheres of each cell begin
    place: Array
    """(K, 4) centre and radius of a sphere, shifted by periods to stand next to the cell."""
    sides: Array
    """(6,) lower and upper x between which the side walls hold the fluid; places of the lower and
    upper walls across y, then z, infinitely far away where there is none."""


class Near(NamedTuple):
    """phi at a point, least and second least distance to a sphere, row of the nearest sphere.

    Distances are WALL_REACH, and the row -1, where no sphere is nearer. In a solid phi is 0.
    """

    profile: float
    least: float
    second: float
    row: int


def find_nearby(lattice: Lattice, position: Array, radius: Array) -> Nearby:
    """Spheres within WALL_REACH of some point of each cell; centres (N, 3) m, radii (N,) m."""
    step = lattice.spacing / lattice.unit
    frame = CellFrame(np.array(lattice.shape), step, ~np.array(lattice.walled))
    centre, size = (position - lattice.low) / lattice.unit, radius / lattice.unit
    count = np.zeros(lattice.cells, np.int64)
    _visit(centre, size, frame, count, np.zeros((0, 4), np.float32))
    first = np.concatenate([[0], np.cumsum(count)])
    place = np.zeros((int(first[-1]), 4), np.float32)
    if len(place):
        _visit(centre, size, frame, first[:-1].copy(), place)
    sides = np.tile([-np.inf, np.inf], 3)
    if not lattice.repeats:
        sides[:2] = (np.array(lattice.specimen) - lattice.low[0]) / lattice.unit
    for axis in np.flatnonzero(lattice.walled):
        sides[2 * axis : 2 * axis + 2] = 0.0, lattice.shape[axis] * step[axis]
    return Nearby(first, place, sides)


@compiled
def _visit(centre: Array, radius: Array, grid: CellFrame, count: Array, place: Array) -> None:
    """Counts the spheres near each cell; writes them from `count` on where `place` has room."""
    shape, step, wraps = grid
    half = 0.5 * sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for s in range(len(radius)):
        reach = radius[s] + WALL_REACH
        for axis in range(3):
            low[axis] = floor((centre[s, axis] - reach) / step[axis])
            high[axis] = ceil((centre[s, axis] + reach) / step[axis])
            if not wraps[axis]:
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
def wall_profile(point: Place, cell: int, nearby: Nearby) -> Near:
    """phi at a point in a `cell`, and the spheres that are nearest."""
    x, y, z = point
    place, sides = nearby.place, nearby.sides
    profile, least, second, nearest = 1.0, WALL_REACH, WALL_REACH, -1
    for row in range(nearby.first[cell], nearby.first[cell + 1]):
        dx, dy, dz = x - place[row, 0], y - place[row, 1], z - place[row, 2]
        away = sqrt(dx * dx + dy * dy + dz * dz) - place[row, 3]
        if away <= 0.0:
            return Near(0.0, away, away, row)
        if away < WALL_REACH:
            profile *= away * (2.0 * WALL_REACH - away) / WALL_REACH**2
            if away < least:
                least, second, nearest = away, least, row
            elif away < second:
                second = away
    if sides[0] <= x <= sides[1]:
        for side in range(4):
            away = y if side < 2 else z
            away = away - sides[2 + side] if side % 2 == 0 else sides[2 + side] - away
            if away <= 0.0:
                return Near(0.0, away, away, -1)
            if away < WALL_REACH:
                profile *= away * (2.0 * WALL_REACH - away) / WALL_REACH**2
                second = min(second, away)
    return Near(profile, least, second, nearest)


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
def _interpolated(smooth: Parts, x: float, y: float, z: float) -> Place:
    """Velocity / phi at (x, y, z), in cells."""
    return (
        linear(smooth[0], x + 2.0, y + 1.5, z + 1.5),
        linear(smooth[1], x + 1.5, y + 2.0, z + 1.5),
        linear(smooth[2], x + 1.5, y + 1.5, z + 2.0),
    )


@compiled
def _unbalanced(
    point: Place, cell: int, grid: CellFrame, nearby: Nearby, smooth: Parts
) -> tuple[Place, Place, float, Near]:
    """Velocity, its part across a near wall as sampled; normal (or 0), d / probe (or 1), walls."""
    x, y, z = point
    normal, share = (0.0, 0.0, 0.0), 1.0
    near = wall_profile(point, cell, nearby)
    if near.profile <= 0.0:
        return (0.0, 0.0, 0.0), normal, share, near
    probe = min(PROBED_AT, 0.5 * (near.least + near.second))
    if near.row >= 0 and near.least < probe:
        sphere = nearby.place[near.row]
        p, q, r = x - sphere[0], y - sphere[1], z - sphere[2]
        length = sqrt(p * p + q * q + r * r)
        p, q, r = p / length, q / length, r / length
        more, normal, share = probe - near.least, (p, q, r), near.least / probe
        x, y, z = x + more * p, y + more * q, z + more * r
    step = grid.step
    u, v, w = _interpolated(smooth, x / step[0], y / step[1], z / step[2])
    return (near.profile * u, near.profile * v, near.profile * w), normal, share, near


@compiled
def _on_axis(at: float, axis: int, grid: CellFrame) -> float:
    """A place along an axis, brought into the grid where that repeats."""
    length = grid.shape[axis] * grid.step[axis]
    return at - floor(at / length) * length if grid.wraps[axis] else at


@compiled
def _place_on(point: Place, grid: CellFrame) -> tuple[Place, int]:
    """The point within the grid, and its cell; -1 - axis for a point outside along an axis."""
    shape, step, wraps = grid
    place = _on_axis(point[0], 0, grid), _on_axis(point[1], 1, grid), _on_axis(point[2], 2, grid)
    number, out = 0, 0
    for axis in range(3):
        at = place[axis]
        if not wraps[axis] and (at < 0.0 or at >= shape[axis] * step[axis]):
            out = -1 - axis
        number = number * shape[axis] + max(0, min(int(at / step[axis]), shape[axis] - 1))
    return place, out if out < 0 else number


@compiled
def _spreading(
    point: Place, normal: Place, radius: float, grid: CellFrame, nearby: Nearby, smooth: Parts
) -> float:
    """Divergence along a sphere of the velocity along it, at `radius` from its centre."""
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
    turn = ALONG / radius
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
    return total / (2.0 * ALONG)


@compiled
def _sample_velocity(
    point: Array, grid: CellFrame, nearby: Nearby, smooth: Parts, result: Array
) -> None:
    """Writes the velocity at each `point` (N, 3), in spacings, to `result`."""
    for s in range(len(point)):
        inside, cell = _place_on((point[s, 0], point[s, 1], point[s, 2]), grid)
        if cell < 0:
            result[s, 0] = 1.0 if cell == -1 else 0.0
            continue
        (u, v, w), normal, share, near = _unbalanced(inside, cell, grid, nearby, smooth)
        if share < 1.0:
            p, q, r = normal
            sampled = u * p + v * q + w * r
            radius = near.least + nearby.place[near.row, 3]
            spread = _spreading(inside, normal, radius, grid, nearby, smooth)
            depth = near.least * (WALL_REACH - near.least / 3.0) / (2.0 * WALL_REACH - near.least)
            across = -depth * spread - sampled
            u, v, w = u + across * p, v + across * q, w + across * r
        result[s, 0], result[s, 1], result[s, 2] = u, v, w


def velocity_at(lattice: Lattice, nearby: Nearby, smooth: Parts, points: Array) -> Array:
    """Velocity (N, 3) at points (N, 3) m, from the `smooth_parts` of a grid.

    It is 0 in the solid and outside of walls, (1, 0, 0) before and beyond a grid with ends.
    """
    wraps = np.array([lattice.repeats, not lattice.walled[1], not lattice.walled[2]])
    frame = CellFrame(np.array(lattice.shape), lattice.spacing / lattice.unit, wraps)
    result = np.zeros(points.shape)
    place = np.ascontiguousarray((points - lattice.low) / lattice.unit)
    _sample_velocity(place, frame, nearby, smooth, result)
    return result


def smooth_parts(lattice: Lattice, nearby: Nearby, flow: list[Array]) -> Parts:
    """Velocity / phi (n0 + 4, n1 + 4, n2 + 4) of each component of a `flow` (n0, n1, n2).

    Two nodes are added before and two after those of the grid.
    """
    step = lattice.spacing / lattice.unit
    smooth = []
    for d, part in enumerate(flow):
        phi = np.zeros(lattice.shape, np.float32)
        _set_profile(d, step, nearby, phi)
        smooth.append(_filled(_padded(part, lattice, d), _padded(phi, lattice, d)))
    mean, bounded = (smooth[0], smooth[1], smooth[2]), []
    for d, part in enumerate(mean):
        inner = part[2:-2, 2:-2, 2:-2].copy()
        _turn_along_walls(d, step, nearby, mean, inner)
        bounded.append(_padded(inner, lattice, d))
        if lattice.walled[d]:
            # no flow through the walls: their own nodes carry nothing
            across = np.moveaxis(bounded[d], d, 0)
            across[:3], across[lattice.shape[d] + 2 :] = 0.0, 0.0
    return bounded[0], bounded[1], bounded[2]


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
def _set_profile(component: int, step: Array, nearby: Nearby, phi: Array) -> None:
    """Sets `phi` at the nodes of a component."""
    shape = phi.shape
    away = np.full(3, 0.5)
    away[component] = 0.0
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                node = ((i + away[0]) * step[0], (j + away[1]) * step[1], (k + away[2]) * step[2])
                cell = (i * shape[1] + j) * shape[2] + k
                phi[i, j, k] = wall_profile(node, cell, nearby).profile


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
    component: int, step: Array, nearby: Nearby, smooth: Parts, part: Array
) -> None:
    """Takes the part across its sphere from velocity / phi at nodes in the solid, in `part`."""
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
                near = wall_profile(node, (i * shape[1] + j) * shape[2] + k, nearby)
                if near.profile > 0.0 or near.row < 0:
                    continue
                sphere = nearby.place[near.row]
                p, q, r = node[0] - sphere[0], node[1] - sphere[1], node[2] - sphere[2]
                u, v, w = _interpolated(smooth, x, y, z)
                own = (p, q, r)[component]
                part[i, j, k] -= own * (u * p + v * q + w * r) / (p * p + q * q + r * r)


def gradient_at(lattice: Lattice, parts: Parts, points: Array) -> Array:
    """Pressure gradient (N, 3) 1/m2 at points (N, 3) m, linear between the faces of the cells.

    It is 0 before and beyond a grid that does not repeat along x. `parts` are `gradient_parts`.
    """
    result, inside = np.zeros(points.shape), np.ones(len(points), bool)
    if not lattice.repeats:
        inside = (points[:, 0] >= lattice.low[0]) & (points[:, 0] < lattice.high[0])
    place = np.ascontiguousarray((points[inside] - lattice.low) / lattice.spacing)
    sampled = np.zeros(place.shape)
    _sample(place, np.array(lattice.walled), parts, sampled)
    result[inside] = sampled
    return result


def gradient_parts(flow: GridFlow, gradient: float) -> Parts:
    """The pressure gradient of a flow whose mean is `gradient` 1/m2 along x, on the faces.

    For each component (n0, n1, n2) the difference across the face over its spacing, over viscosity
    and superficial velocity. Faces in the solid carry the mean of their neighbours in the fluid,
    from the surface inwards.
    """
    lattice = flow.lattice
    pressure = lattice.response.pressure(list(flow.force))
    parts = []
    for axis in range(3):
        step = pressure - np.roll(pressure, 1, axis=axis)
        if lattice.walled[axis]:
            np.moveaxis(step, axis, 0)[0] = 0.0
        part = step / (lattice.spacing[axis] * lattice.unit)
        if axis == 0:
            part += gradient
        part, known = part.astype(np.float32), ~flow.walls[axis].solid
        while _fill_layer(part, known):
            pass
        parts.append(part)
    return parts[0], parts[1], parts[2]


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
def _sample(place: Array, walled: Array, parts: Parts, result: Array) -> None:
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
