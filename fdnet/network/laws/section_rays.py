"""The flow through a triangle between any number of discs, summed over rays.

Every disc keeps what its rays see inside the triangle, from its rim or from where they enter the
triangle to the far side, or to the line midway to the rim of another disc (`cross_section`). The
rays end in Gauss's points on the far sides, so the sum does not depend on the order of the corners
and is the same for a mirrored triangle. The directions of the rays do not change with the radii of
the discs, so they are set up once for all sections of a throat.
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.network.laws.elementary import log_of
from fdnet.network.laws.rays import FINE_POINTS, FINE_WEIGHTS, midway
from fdnet.network.laws.wedge import shear_ratio
from fdnet.spheres.snapshot import Array

SECTOR = np.pi / 3.0
"""Half angle, rad, between two of the three rims that surround a disc."""
ON_SIDE = 1e-9
"""A disc centred nearer to a side than this share of the side lies on it."""
RAYS = len(FINE_POINTS)
"""Rays to each side."""
UNTOUCHED, NARROWED, SWALLOWED = 0, 1, 2
"""What another disc does to the rays of a disc."""


@loops_in_place
def set_sides(base: Array, side: Array) -> None:
    """Sets `side` (3, 3): of each side of a triangle `base` (3, 2) m its normal inwards, length m.

    The normal is a unit vector.
    """
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        length = np.sqrt(ex * ex + ey * ey)
        nx, ny = -ey / length, ex / length
        if nx * (base[k, 0] - base[i, 0]) + ny * (base[k, 1] - base[i, 1]) < 0.0:
            nx, ny = -nx, -ny
        side[i] = nx, ny, length


@loops_in_place
def inwards(base: Array, side: Array, i: int, x: float, y: float) -> float:
    """How far m the place `x`, `y` m lies inwards of the side `i`."""
    return side[i, 0] * (x - base[i, 0]) + side[i, 1] * (y - base[i, 1])


@loops_in_place
def aim(base: Array, side: Array, x: float, y: float, rays: Array) -> int:
    """Sets up the rays of a disc centred at `x`, `y` m, and gives their number.

    `side` is what `set_sides` sets. The rows of `rays` (6, 36) are the direction, where a ray
    meets the far side and where it enters the triangle, m, its angle rad, and room.
    """
    depth = (_depth(base, side, 0, x, y), _depth(base, side, 1, x, y), _depth(base, side, 2, x, y))
    count = 0
    for far in range(3):
        if depth[far] > 0.0:
            _aim_at_side(base, side, (x, y, far, count), depth, rays)
            count += RAYS
    return count


@loops_in_place
def _depth(base: Array, side: Array, i: int, x: float, y: float) -> float:
    """How far m a place lies inwards of the side `i`, 0 where it lies on it."""
    depth = inwards(base, side, i, x, y)
    return 0.0 if abs(depth) <= ON_SIDE * side[i, 2] else depth


@loops_in_place
def _aim_at_side(
    base: Array,
    side: Array,
    given: tuple[float, float, int, int],
    depth: tuple[float, float, float],
    rays: Array,
) -> None:
    """The 12 rays to a side; `given` are the place of the disc, the side and the first ray."""
    x, y, far, first = given
    one, two = (far + 1) % 3, (far + 2) % 3
    ex, ey = base[one, 0] - base[far, 0], base[one, 1] - base[far, 1]
    vx, vy = base[far, 0] - x, base[far, 1] - y
    of_turn = 0.5 * side[far, 2] * depth[far]
    ux, uy, end = rays[0, first:], rays[1, first:], rays[2, first:]
    entry, turn = rays[3, first:], rays[4, first:]
    for p in range(min(RAYS, len(entry))):
        along = 0.5 * (1.0 + FINE_POINTS[p])
        rx, ry = vx + along * ex, vy + along * ey
        long = np.sqrt(rx * rx + ry * ry)
        ux[p], uy[p], end[p] = rx / long, ry / long, long
        entry[p] = 0.0
        turn[p] = of_turn * FINE_WEIGHTS[p] / (long * long)
    for i in (one, two):
        if depth[i] < 0.0:
            nx, ny, away = side[i, 0], side[i, 1], -depth[i]
            for p in range(min(RAYS, len(entry))):
                speed = nx * ux[p] + ny * uy[p]
                begin = away / speed if speed > 0.0 else np.inf
                entry[p] = max(entry[p], begin)


@loops_in_place
def narrow(
    rays: Array,
    count: int,
    disc: tuple[float, float, float],
    other: tuple[float, float, float],
) -> int:
    """Ends the first `count` rays of a disc midway to another one; x, y and radius m of both.

    The last row of `rays` (6, 36) holds where they end. Returns what the other disc does.
    """
    qx, qy, wider = other[0] - disc[0], other[1] - disc[1], other[2] - disc[2]
    square = qx * qx + qy * qy
    if wider > 0.0 and square <= wider * wider:
        return SWALLOWED
    half = 0.5 * (square - wider * wider)
    ux, uy, reach = rays[0], rays[1], rays[5]
    for p in range(count):
        reach[p] = min(reach[p], midway(half, qx * ux[p] + qy * uy[p] + wider))
    return NARROWED


@loops_in_place
def flux_on_rays(rays: Array, count: int, own: float, room: tuple[Array, Array]) -> float:
    """Flux m4 on the first `count` rays of a disc of radius `own` m, to where they end.

    `rays` (6, 36) is what `aim` and `narrow` set, `room` are 36 numbers, which are written to, and
    the table of `shear_ratio`. A ray that enters the triangle outside its disc carries the part
    from there of what `rays.flux_on_ray` sums from the rim.
    """
    part, table = room
    entry, turn, reach = rays[3], rays[4], rays[5]
    r2, farthest = own * own, 0.0
    for p in range(count):
        start = max(entry[p], own)
        d2, t2 = reach[p] * reach[p], start * start
        whole = d2 * d2 * (0.25 * log_of(reach[p] / own) - 3.0 / 16.0) + r2 * d2 / 8.0
        part[p] = whole + d2 * t2 / 8.0 + t2 * t2 / 16.0 - r2 * t2 / 8.0
    for p in range(count):
        farthest = max(farthest, entry[p])
    if farthest > own:
        for p in range(count):
            start = max(entry[p], own)
            part[p] -= 0.25 * (reach[p] * start) ** 2 * log_of(start / own)
    total, nearest = 0.0, np.inf
    for p in range(count):
        if reach[p] > max(entry[p], own):
            total += turn[p] * part[p]
            nearest = min(nearest, reach[p])
    return total * shear_ratio(SECTOR, min(own / nearest, 1.0), table) if total > 0.0 else 0.0
