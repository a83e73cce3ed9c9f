"""The flow on rays from the three corners of a section, whatever discs lie on them.

Each disc keeps what its rays see of the triangle before a line midway to the rim of another disc
or the opposite side. The directions of the rays do not change with the radii of the discs, so they
are set up once for all sections of a throat. A fourth disc may reach into the triangle.
"""

import numpy as np

from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.laws.elementary import QUARTER, cosine_of, sine_of
from fdnet.network.laws.rays import FINE_POINTS, FINE_WEIGHTS, flux_on_ray, midway
from fdnet.network.laws.wedge import shear_ratio
from fdnet.spheres.snapshot import Array

RAYS = len(FINE_POINTS)
"""Rays of each corner."""
STEEPEST = 1e-3
"""Smallest cosine of the angle between a ray and the normal of the opposite side."""

CornerRoom = tuple[Array, Array, Array, Array]
"""Of each corner (3, 4) the angle rad, the distances m to the next two and to a fourth disc; of
each ray (3, 4, 12) the far side m, and the cosines of the angles to these three; and of each ray
(3, 2, 12) where it ends, m, and its flux, m4."""


@compiled
def corner_room() -> CornerRoom:
    """Room for the rays of a section."""
    aimed = np.zeros(1, np.bool_)
    return np.empty((3, 4)), np.empty((3, 4, RAYS)), np.empty((3, 2, RAYS)), aimed


@loops_in_place
def aim_corners(base: Array, room: CornerRoom) -> None:
    """Sets up the rays of the corners of a triangle `base` (3, 2) m, if that is not yet done."""
    corner, ray, _, aimed = room
    if aimed[0]:
        return
    aimed[0] = True
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        jx, jy = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        kx, ky = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        aj, ak = np.sqrt(jx * jx + jy * jy), np.sqrt(kx * kx + ky * ky)
        across = np.sqrt((kx - jx) ** 2 + (ky - jy) ** 2)
        twice, inner = abs(jx * ky - jy * kx), jx * kx + jy * ky
        height, foot = twice / across, -(jx * (kx - jx) + jy * (ky - jy)) / across
        opening = np.arctan2(twice, inner)
        corner[i, 0], corner[i, 1], corner[i, 2] = opening, aj, ak
        far, to_j, to_k = ray[i, 0], ray[i, 1], ray[i, 2]
        for p in range(len(far)):
            turn = 0.5 * opening * (1.0 + FINE_POINTS[p]) - QUARTER
            cosine, sine = -sine_of(turn), cosine_of(turn)
            far[p] = height / max((cosine * height + sine * foot) / aj, STEEPEST)
            to_j[p] = cosine
            to_k[p] = (cosine * inner + sine * twice) / (aj * ak)


@loops_in_place
def aim_at_fourth(base: Array, x: float, y: float, room: CornerRoom) -> None:
    """Sets up the angles to a fourth disc centred at `x`, `y` m, after `aim_corners`."""
    corner, ray, _, _ = room
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        jx, jy = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        kx, ky = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        qx, qy = x - base[i, 0], y - base[i, 1]
        aj, aq = corner[i, 1], np.sqrt(qx * qx + qy * qy)
        sense = 1.0 if jx * ky - jy * kx > 0.0 else -1.0
        along, across = 1.0, 0.0
        if aq > 0.0:
            along = (jx * qx + jy * qy) / (aj * aq)
            across = sense * (jx * qy - jy * qx) / (aj * aq)
        corner[i, 3] = aq
        to_q = ray[i, 3]
        for p in range(len(to_q)):
            turn = 0.5 * corner[i, 0] * (1.0 + FINE_POINTS[p]) - QUARTER
            to_q[p] = cosine_of(turn) * across - sine_of(turn) * along


@loops_in_place
def corner_reaches(room: CornerRoom, disc: Array) -> None:
    """Sets where the rays end between discs of the radii `disc` (3,) m."""
    corner, ray, out, _ = room
    for i in range(3):
        aj, ak = corner[i, 1], corner[i, 2]
        ej, ek = disc[(i + 1) % 3] - disc[i], disc[(i + 2) % 3] - disc[i]
        half_j, half_k = 0.5 * (aj * aj - ej * ej), 0.5 * (ak * ak - ek * ek)
        far, to_j, to_k, reach = ray[i, 0], ray[i, 1], ray[i, 2], out[i, 0]
        for p in range(len(reach)):
            before = midway(half_j, aj * to_j[p] + ej), midway(half_k, ak * to_k[p] + ek)
            reach[p] = min(far[p], before[0], before[1])


@loops_in_place
def fourth_reaches(room: CornerRoom, disc: Array, fourth: float) -> None:
    """Ends the rays midway to a fourth disc of the radius `fourth` m, where that is nearer."""
    corner, ray, out, _ = room
    for i in range(3):
        aq, wider = corner[i, 3], fourth - disc[i]
        half = 0.5 * (aq * aq - wider * wider)
        to_q, reach = ray[i, 3], out[i, 0]
        hidden = aq <= wider
        for p in range(len(reach)):
            end = min(reach[p], midway(half, aq * to_q[p] + wider))
            reach[p] = 0.0 if hidden else end


@loops_in_place
def corner_flux(room: CornerRoom, disc: Array, table: Array) -> float:
    """Flux m4 on the rays from discs of the radii `disc` (3,) m to where they end."""
    corner, _, out, _ = room
    total = 0.0
    for i in range(3):
        reach, part = out[i, 0], out[i, 1]
        for p in range(len(reach)):
            part[p] = FINE_WEIGHTS[p] * flux_on_ray(reach[p], disc[i])
        flux, nearest = 0.0, np.inf
        for p in range(len(reach)):
            flux += part[p]
            nearest = min(nearest, reach[p])
        if flux > 0.0:
            closest = min(disc[i] / nearest, 1.0) if nearest > 0.0 else 1.0
            angle = 0.5 * corner[i, 0]
            total += angle * flux * shear_ratio(angle, closest, table)
    return total
