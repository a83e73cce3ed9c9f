"""The flow through a triangle between any number of discs, summed over rays.

Every disc keeps what its rays see inside the triangle, from its rim or from where they enter the
triangle to the far side, or to the line midway to the rim of another disc (`cross_section`). The
rays end in Gauss's points on the far sides, so the sum does not depend on the order of the corners
and is the same for a mirrored triangle.
"""

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.laws.cross_section import FINE_POINTS, FINE_WEIGHTS
from fdnet.network.laws.wedge import shear_ratio
from fdnet.spheres.snapshot import Array

SECTOR = np.pi / 3.0
"""Half angle, rad, between two of the three rims that surround a disc."""
ON_SIDE = 1e-9
"""A disc centred nearer to a side than this share of the side lies on it."""


@compiled
def discs_flux(base: Array, discs: Array, count: int, table: Array) -> float:
    """Flux m4 on the rays of the first `count` of `discs` (N, 3), x, y and radius m.

    `base` (3, 2) m are the corners of the triangle.
    """
    total = 0.0
    for number in range(count):
        total += disc_flux(base, discs, count, number, table)
    return total


@compiled
def disc_flux(base: Array, discs: Array, count: int, number: int, table: Array) -> float:
    """Flux m4 on the rays of the disc `number` among the first `count` of `discs`."""
    x, y, own = discs[number, 0], discs[number, 1], discs[number, 2]
    side = _sides(base, x, y)
    flux, nearest = 0.0, np.inf
    for far in range(3):
        if side[far, 2] <= 0.0:
            continue
        after = (far + 1) % 3
        ex, ey = base[after, 0] - base[far, 0], base[after, 1] - base[far, 1]
        length = np.hypot(ex, ey)
        # numba knows no strict zip
        for point, weight in zip(FINE_POINTS, FINE_WEIGHTS):  # noqa: B905
            along = 0.5 * (1.0 + point)
            vx, vy = base[far, 0] + along * ex - x, base[far, 1] + along * ey - y
            end = np.hypot(vx, vy)
            ux, uy = vx / end, vy / end
            start = max(_entry(side, ux, uy), own)
            if end <= start:
                continue
            reach = _midway_to_others(discs, count, number, (ux, uy), (start, end))
            if reach > start:
                turn = 0.5 * weight * length * side[far, 2] / (end * end)
                flux += turn * part_of_ray(start, reach, own)
                nearest = min(nearest, reach)
    return flux * shear_ratio(SECTOR, min(own / nearest, 1.0), table) if flux > 0.0 else 0.0


@compiled
def _sides(base: Array, x: float, y: float) -> Array:
    """Of each side (3, 3) the unit normal inwards, and how far a place lies inwards of it, m."""
    side = np.empty((3, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        length = np.hypot(ex, ey)
        nx, ny = -ey / length, ex / length
        if nx * (base[k, 0] - base[i, 0]) + ny * (base[k, 1] - base[i, 1]) < 0.0:
            nx, ny = -nx, -ny
        inwards = nx * (x - base[i, 0]) + ny * (y - base[i, 1])
        side[i] = nx, ny, inwards if abs(inwards) > ON_SIDE * length else 0.0
    return side


@compiled
def _entry(side: Array, ux: float, uy: float) -> float:
    """Where a ray of the direction u enters the triangle, m; 0 from a place inside."""
    start = 0.0
    for i in range(3):
        if side[i, 2] < 0.0:
            speed = side[i, 0] * ux + side[i, 1] * uy
            if speed <= 0.0:
                return np.inf
            start = max(start, -side[i, 2] / speed)
    return start


@compiled
def _midway_to_others(
    discs: Array, count: int, number: int, u: tuple[float, float], span: tuple[float, float]
) -> float:
    """Where a ray between `span` m meets the first line midway to the rim of another disc, m."""
    start, reach = span
    for other in range(count):
        if other == number:
            continue
        qx, qy = discs[other, 0] - discs[number, 0], discs[other, 1] - discs[number, 1]
        wider = discs[other, 2] - discs[number, 2]
        square = qx * qx + qy * qy
        if wider > 0.0 and square <= wider * wider:
            return 0.0
        below = qx * u[0] + qy * u[1] + wider
        if below > 0.0:
            reach = min(reach, max(0.5 * (square - wider * wider) / below, 0.0))
            if reach <= start:
                return 0.0
    return reach


@compiled
def part_of_ray(start: float, reach: float, disc: float) -> float:
    """Flux m4 per angle on a ray between `start` and `reach` m from the centre of its disc.

    It is what `cross_section.ray` sums from the rim, where there is no shear at `reach`.
    """
    d2, t2, r2 = reach * reach, start * start, disc * disc
    whole = d2 * d2 * (0.25 * np.log(reach / disc) - 3.0 / 16.0) + r2 * d2 / 8.0
    before = d2 * t2 * (0.25 * np.log(start / disc) - 1.0 / 8.0) - t2 * t2 / 16.0 + r2 * t2 / 8.0
    return whole - before
