"""The flow through a section of a throat: between three grains, at a wall and in an edge.

The flow on rays from the three corners of a section, whatever discs lie on them.

Each disc keeps what its rays see of the triangle before a line midway to the rim of another disc
or the opposite side. The directions of the rays do not change with the radii of the discs, so they
are set up once for all sections of a throat. A fourth disc may reach into the triangle.
"""

import numpy as np

from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.laws.wedges import (
    DISCS,
    FINE_POINTS,
    FINE_WEIGHTS,
    POINTS,
    QUARTER,
    WEIGHTS,
    angle_of,
    cosine_of,
    flux_on_ray,
    log_of,
    midway,
    ray_flux,
    ray_parts,
    shear_ratio,
    sine_of,
    table_row,
)
from fdnet.network.network import Network
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


# ------------------------------------------------------------------------------------------------
# The flow through a triangle between any number of discs, summed over rays.
#
# Every disc keeps what its rays see inside the triangle, from its rim or from where they enter the
# triangle to the far side, or to the line midway to the rim of another disc (`cross_section`). The
# rays end in Gauss's points on the far sides, so the sum does not depend on the order of the
# corners and is the same for a mirrored triangle. The directions of the rays do not change with
# the radii of the discs, so they are set up once for all sections of a throat.


SECTOR = np.pi / 3.0
"""Half angle, rad, between two of the three rims that surround a disc."""
ON_SIDE = 1e-9
"""A disc centred nearer to a side than this share of the side lies on it."""
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


# ------------------------------------------------------------------------------------------------
# Flow along the axis through one plane section of a throat.
#
# The section is a triangle with a disc of each grain on its corners. Every disc slows the fluid
# between its rim and the line midway to the next rim; these shares are cut into wedges (`wedge`).
#
# Equal discs in a triangle that holds its circumcentre: six right-angled wedges about it, in
# closed form.
#
# Unequal discs: the line midway between two rims is a hyperbola. From the centre of a disc it lies
# at the distance d(t) = (a^2 - e^2) / (2 (a cos t + e)) on the ray at the angle t from the line
# between the centres, with the difference e of the radii and the distance a of the centres. The
# shares meet in the centre of the circle that touches all three discs. The flux on rays is summed
# by Gauss points, and the shear between rays is that of the wedge of the same angle and half gap.
#
# Where that circle lies beyond an edge, as in every obtuse triangle with equal discs, the shares
# there are negative, and they take away too much: all of the flux between touching discs at an
# angle of 98 degrees. Where no circle touches all three discs (one disc lies in the shadow of the
# others), there is no such sum. In both cases each disc keeps what its rays see of the triangle
# before a line midway or the opposite side, if that is more. So that the flux does not jump, the
# rays take over while the centre moves beyond the edge by `TURN`, as seen from the centre of a
# disc.


TURN = 0.05
"""Angle, rad, seen from the centre of a disc: where the centre of the circle lies so far beyond an
edge, the rays have taken over. Finite elements agree with them there (test_section_flux.py)."""


@loops_in_place
def set_wedges(base: Array, rows: Array) -> None:
    """Sets the six wedges of a triangle `base` (3, 2) m with equal discs, for `even_fluxes`.

    There are two of each of the `rows` (3, 7): half edge m, tangent and angle rad, both negative
    where the circumcentre lies beyond that edge; what of `ray_flux` depends on these alone, and
    the row of the table of `shear_ratio`.
    """
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        fx, fy = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        gx, gy = base[k, 0] - base[j, 0], base[k, 1] - base[j, 1]
        # the angle at the far corner is that at the centre over half the edge
        slope = (fx * gx + fy * gy) / abs(ex * fy - ey * fx)
        half, angle = 0.5 * np.hypot(ex, ey), np.arctan(slope)
        constant, of_log = ray_parts(abs(angle), abs(slope))
        rows[i] = half, slope, angle, constant, of_log, np.log(half), table_row(abs(angle))


@compiled
def even_room(sections: int) -> tuple[Array, Array]:
    """Room for so many sections in `even_fluxes`, and for a row of the table of `shear_ratio`."""
    return np.empty((2, sections)), np.empty(len(DISCS))


@loops_in_place
def even_fluxes(
    wedge: Array, discs: Array, room: tuple[tuple[Array, Array], Array], flux: Array
) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 for the radii `discs` (K,) m of K sections.

    `wedge` is what `set_wedges` sets. In an obtuse triangle the sum of the signed wedges is too
    small, and `uneven_fluxes` does it.

    `room` is what `even_room` gives, and the table of `shear_ratio`.
    """
    (lanes, ratio), table = room
    log_disc, rays = lanes[0], lanes[1]
    for k in range(len(discs)):
        log_disc[k] = log_of(discs[k])
        flux[k] = 0.0
    for i in range(3):
        half, slope, angle = wedge[i, 0], abs(wedge[i, 1]), abs(wedge[i, 2])
        constant, of_log, log_half = wedge[i, 3], wedge[i, 4], wedge[i, 5]
        factor = 2.0 * half**4 if wedge[i, 1] > 0.0 else -2.0 * half**4
        row = min(int(wedge[i, 6]), len(table) - 2)
        part = wedge[i, 6] - row
        low, high = table[row], table[row + 1]
        for j in range(len(ratio)):
            ratio[j] = (1.0 - part) * low[j] + part * high[j]
        for k in range(len(discs)):
            x = discs[k] / half
            square = x * x
            whole = constant - of_log * (log_disc[k] - log_half)
            rays[k] = factor * (whole + square * (4.0 * slope - square * angle) / 16.0)
        for k in range(len(discs)):
            x = discs[k] / half
            if x > 1.0:
                rays[k] = factor * ray_flux(angle, slope, x)
            column = min(x, 1.0) * (len(ratio) - 1)
            j = min(int(column), len(ratio) - 2)
            flux[k] += rays[k] * (ratio[j] + (column - j) * (ratio[j + 1] - ratio[j]))


@compiled
def uneven_room(sections: int) -> tuple[Array, Array]:
    """Room for the wedges of so many sections, and for the edges, in `uneven_fluxes`."""
    return np.empty((7, 6 * sections)), np.empty((6, 4))


@loops_in_place
def uneven_fluxes(
    base: Array,
    discs: Array,
    room: tuple[tuple[Array, Array], CornerRoom, Array],
    flux: Array,
) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 for the radii `discs` (K, 3) m of K sections.

    The first corner of the triangle `base` (3, 2) m is the origin, the second lies on the x axis.
    The flux is 0 where the discs close the triangle.

    `room` is what `uneven_room` and `corner_room` give for this triangle, and the table of
    `shear_ratio`.
    """
    lanes, corners, table = room
    wedge = lanes[0]
    touching_fluxes(base, discs, (lanes, table), flux)
    for k in range(len(discs)):
        beyond = 0.0 if flux[k] > 0.0 else TURN
        for m in range(6 * k, 6 * k + 6):
            beyond = max(beyond, -wedge[4, m])
        if beyond > 0.0:
            aim_corners(base, corners)
            corner_reaches(corners, discs[k])
            more = corner_flux(corners, discs[k], table) - flux[k]
            flux[k] += min(beyond / TURN, 1.0) * max(more, 0.0)


@loops_in_place
def touching_fluxes(
    base: Array, discs: Array, room: tuple[tuple[Array, Array], Array], flux: Array
) -> None:
    """Writes the flux (K,) m4 where a circle touches all three discs, else 0.

    Shares are negative where the circle lies beyond an edge of the triangle.
    """
    (wedge, edges), table = room
    count = 6 * len(discs)
    _set_edges(base, edges)
    for k in range(len(discs)):
        flux[k] = 1.0 if _set_wedges(edges, base, discs[k], wedge[:, 6 * k : 6 * k + 6]) else 0.0
    _sum_wedges(wedge, count)
    total = wedge[6]
    for k in range(len(discs)):
        if flux[k] > 0.0:
            flux[k] = 0.0
            for m in range(6 * k, 6 * k + 6):
                disc_of_gap = wedge[5, m] / (0.5 * (wedge[2, m] - wedge[0, m]))
                flux[k] += total[m] * shear_ratio(abs(wedge[4, m]), disc_of_gap, table)


@loops_in_place
def _set_edges(base: Array, edges: Array) -> None:
    """Sets `edges` (6, 4), from each corner to the two others: unit vector, length m, sense.

    The sense is 1 where the third corner lies to the left, else -1.
    """
    for i in range(3):
        for step in (1, 2):
            j, k = (i + step) % 3, (i + 3 - step) % 3
            ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
            a = np.sqrt(ex * ex + ey * ey)
            turned = ex * (base[k, 1] - base[i, 1]) - ey * (base[k, 0] - base[i, 0])
            edges[2 * i + step - 1] = ex / a, ey / a, a, 1.0 if turned > 0.0 else -1.0


@loops_in_place
def _set_wedges(edges: Array, base: Array, disc: Array, wedge: Array) -> bool:
    """Writes the six wedges (7, 6) of a section; whether a circle touches its three discs.

    The rows are the excess of the radius of the other disc, half the gap squared, the distance of
    the centres, the place of the circle along their line and across it, and the own radius.
    """
    cx, cy, radius = _inscribed(base, disc)
    touches = not np.isnan(radius)
    if not touches:
        cx, cy = 0.0, 0.0
    for i in range(3):
        vx, vy = cx - base[i, 0], cy - base[i, 1]
        away = np.sqrt(vx * vx + vy * vy)
        for m in (2 * i, 2 * i + 1):
            a, wider = edges[m, 2], disc[(i + 1 + m - 2 * i) % 3] - disc[i]
            along = edges[m, 0] * vx + edges[m, 1] * vy
            wedge[0, m], wedge[1, m], wedge[2, m] = wider, 0.5 * (a * a - wider * wider), a
            wedge[3, m] = along
            wedge[4, m] = edges[m, 3] * (edges[m, 0] * vy - edges[m, 1] * vx)
            wedge[5, m] = disc[i]
            touches = touches and a > wider and a * along + wider * away > 0.0
    return touches


@loops_in_place
def _sum_wedges(wedge: Array, count: int) -> None:
    """Turns the places of the circles into angles rad, and sums the flux m4 on rays up to them."""
    wider, gap, apart, along = wedge[0], wedge[1], wedge[2], wedge[3]
    turn, own, total = wedge[4], wedge[5], wedge[6]
    for m in range(count):
        turn[m] = angle_of(turn[m], along[m])
        total[m] = 0.0
    for p in range(len(POINTS)):
        part, weight = 0.5 * (1.0 + POINTS[p]), 0.5 * WEIGHTS[p]
        for m in range(count):
            cosine = -sine_of(part * abs(turn[m]) - QUARTER)
            reach = gap[m] / (apart[m] * cosine + wider[m])
            total[m] += weight * turn[m] * flux_on_ray(reach, own[m])


@loops_in_place
def _inscribed(base: Array, disc: Array) -> tuple[float, float, float]:
    """Centre and radius m of the circle that touches three discs; NaN where there is none."""
    a, px, py = base[1, 0], base[2, 0], base[2, 1]
    r0, r1, r2 = disc[0], disc[1], disc[2]
    ax = 0.5 * (a * a + r0 * r0 - r1 * r1) / a
    bx = -(r1 - r0) / a
    ay = (0.5 * (px * px + py * py + r0 * r0 - r2 * r2) - px * ax) / py
    by = (-(r2 - r0) - px * bx) / py
    square = bx * bx + by * by - 1.0
    half = r0 - ax * bx - ay * by
    rest = ax * ax + ay * ay - r0 * r0
    under = half * half - square * rest
    if under < 0.0:
        return 0.0, 0.0, np.nan
    below = half + np.sqrt(under)
    if below == 0.0:
        return 0.0, 0.0, np.nan
    radius = rest / below
    if radius <= -min(r0, r1, r2):
        return 0.0, 0.0, np.nan
    return ax + bx * radius, ay + by * radius, radius


# ------------------------------------------------------------------------------------------------
# Flow along the axis through a section of a throat that a side wall cuts and holds still.
#
# The facet of the throat has a grain i, its mirror image across the wall, and a grain j or its
# image as corners. Its plane is normal to the wall, and inside the box every section parallel to
# it is the trapezoid between the centres of two discs and their feet on the wall.
#
# Discs and wall share the fluid as in `cross_section`. The line midway between the rims of i and j
# is a hyperbola. The line midway between the rim of i (radius rho, centre H above the wall) and
# the wall is a parabola: on the ray at the angle t from the normal of the wall it lies at the
# distance (H + rho) / (1 + cos t) from the centre; at the distance x from the foot of i its height
# above the wall is (x^2 + H^2 - rho^2) / (2 (H + rho)). The lines meet in the centre of the circle
# that touches discs and wall. The share of the wall is a plane film, with the flux y^3 / 3 per
# length for a film of thickness y. Where that centre lies outside the trapezoid, every ray still
# ends at the nearest of these lines or of the sides of the trapezoid: no share is negative, none
# is missing.


DOUBLE_EDGE_SHARE = 0.25
"""Part of the slipping flux that a throat carries which two walls cut between several grains."""
TOLERANCE = 1e-9
"""Lengths up to this many mean grain radii are 0, and sines up to this are taken as this."""
LANES = 6
"""Numbers a section for which `wall_fluxes` needs room."""


def wall_cuts(network: Network) -> tuple[Array, Array, Array]:
    """How walls that hold the fluid cut each throat.

    A trapezoid is two triangles, each with share 1/2, so each carries the half-section; a triangle
    with j on the wall is alone and carries two. The rectangle of an edge (`edge_cross_section`) is
    two triangles, each with share 1/4, so each carries two quarter-sections. Only grains centred
    on walls have other edges; their throats carry `DOUBLE_EDGE_SHARE` of the slipping flux.

    Returns:
        order: (T, 2) which corners of the facet are i and j. On an edge j is -1, and both are -1
        where no wall cuts the throat. place: (T, 3) m, heights of i and j above the wall, and
        their distance along it; on an edge heights of i above both walls, and 0. part: (T,)
        flux of the whole throat over that of the half-section, quarter-section, or slipping
            section.
    """
    count = len(network.throat_share)
    order, place, part = np.full((count, 2), -1), np.zeros((count, 3)), np.ones(count)
    if network.walls == "slip":
        return order, place, part
    single, double = (np.flatnonzero(network.throat_share == share) for share in (0.5, 0.25))
    corner, tolerance = network.corners_of(single), TOLERANCE * network.grain_radius
    own = network.image_grain[network.throat_images[single]]
    sides = [axis for axis in (1, 2) if not network.periodic[axis]]
    for i, image, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        apart = corner[:, image] - corner[:, i]
        for axis in sides:
            pair = (own[:, i] == own[:, image]) & _mirrored(apart, axis, tolerance)
            t = single[pair]
            across = corner[pair, j] - 0.5 * (corner[pair, i] + corner[pair, image])
            height = np.abs(across[:, axis])
            order[t] = i, j
            place[t, 0], place[t, 1] = 0.5 * np.abs(apart[pair, axis]), height
            place[t, 2] = np.linalg.norm(np.delete(across, axis, axis=1), axis=1)
            part[t] = np.where(height <= tolerance, 2.0, 1.0)
    _set_wall_edges(network, double, (order, place, part))
    return order, place, part


def _mirrored(apart: Array, axis: int, tolerance: float) -> Array:
    """Whether steps (K, 3) m lead across a wall normal to an axis, and along no other one."""
    rest = np.delete(apart, axis, axis=1)
    return np.all(np.abs(rest) <= tolerance, axis=1) & (np.abs(apart[:, axis]) > tolerance)


def _set_wall_edges(network: Network, double: Array, cuts: tuple[Array, Array, Array]) -> None:
    """Sets what `wall_cuts` returns of the throats `double` (K,), which two walls cut."""
    order, place, part = cuts
    part[double] = DOUBLE_EDGE_SHARE
    corner, tolerance = network.corners_of(double), TOLERANCE * network.grain_radius
    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        one, two = corner[:, j] - corner[:, i], corner[:, k] - corner[:, i]
        right = _mirrored(one, 1, tolerance) & _mirrored(two, 2, tolerance)
        t = double[right]
        order[t, 0], part[t] = i, 2.0
        place[t, 0], place[t, 1] = 0.5 * np.abs(one[right, 1]), 0.5 * np.abs(two[right, 2])


@loops_in_place
def wall_fluxes(
    place: Array, discs: tuple[Array, Array], room: tuple[Array, Array], flux: Array
) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 between the wall and two discs in K sections.

    `place` (3,) m are the heights of their centres above the wall and their distance along it,
    `discs` (K,) m their radii. `room` is that (`LANES`, K) for the sections, and the table of
    `shear_ratio`.
    """
    lanes, table = room
    along, above, split, share = lanes[0], lanes[1], lanes[2], lanes[3]
    first, last = lanes[4], lanes[5]
    apart = np.hypot(place[2], place[0] - place[1])
    _set_meeting(place, discs, lanes)
    for k in range(len(flux)):
        flux[k] = 0.0
    for i in range(2):
        height, other = place[i], place[1 - i]
        disc, next_disc = discs[i], discs[1 - i]
        edge = np.arctan2(place[2], height - other)
        across = (height, place[2], apart, (height - other) / apart)
        for k in range(len(flux)):
            x = along[k] if i == 0 else place[2] - along[k]
            split[k] = min(max(angle_of(x, height - above[k]), 0.0), edge)
            first[k], last[k] = 0.0, edge
        _set_shares(across, (disc, next_disc), (first, split), share)
        for k in range(len(flux)):
            flux[k] += share[k] * shear_ratio(split[k], 2.0 * disc[k] / (height + disc[k]), table)
        _set_shares(across, (disc, next_disc), (split, last), share)
        for k in range(len(flux)):
            gap = max(apart - next_disc[k] + disc[k], disc[k])
            ratio = shear_ratio(edge - split[k], min(2.0 * disc[k] / gap, 1.0), table)
            flux[k] += share[k] * ratio
    for k in range(len(flux)):
        first[k], split[k], last[k] = 0.0, min(max(along[k], 0.0), place[2]), place[2]
    _add_film(place, discs, (first, split), flux)
    _add_film(place, discs, (split, last), flux)


@loops_in_place
def _set_meeting(place: Array, discs: tuple[Array, Array], lanes: Array) -> None:
    """Sets where the two parabolas meet: m along the wall from the first foot, and m above it.

    That is the centre of the circle that touches both discs and the wall. Where the parabolas do
    not meet, it is the place midway along the wall. The two numbers are the first two rows of
    `lanes` (`LANES`, K).
    """
    along, above = lanes[0], lanes[1]
    first, second = discs
    for k in range(len(along)):
        one, two = place[0] + first[k], place[1] + second[k]
        near, far = place[0] ** 2 - first[k] ** 2, place[1] ** 2 - second[k] ** 2
        middle = one * place[2]
        rest = two * near - one * (place[2] ** 2 + far)
        square = middle**2 - (two - one) * rest
        meeting = -rest / (middle + np.sqrt(max(square, 0.0)))
        along[k] = meeting if square >= 0.0 else 0.5 * place[2]
        above[k] = 0.5 * (along[k] ** 2 + near) / one


@loops_in_place
def _set_shares(
    across: tuple[float, float, float, float],
    discs: tuple[Array, Array],
    turns: tuple[Array, Array],
    share: Array,
) -> None:
    """Sets the flux (K,) m4 on the rays of a disc between two angles from the normal of the wall.

    A ray ends at the nearest line midway, or at the far side of the trapezoid. `discs` (K,) m are
    the radii, `turns` (K,) rad the angles. `across` is the height m of the disc, its distance m
    from the other along the wall and in all, and the sine of the slope from the other up to it.
    """
    height, far, apart, upright = across
    disc, other = discs
    low, high = turns
    along = far / apart
    for k in range(len(share)):
        share[k] = 0.0
    for p in range(len(POINTS)):
        part, weight = 0.5 * (1.0 + POINTS[p]), 0.5 * WEIGHTS[p]
        for k in range(len(share)):
            width = max(high[k] - low[k], 0.0)
            turn = low[k] + part * width - QUARTER
            cosine, sine = -sine_of(turn), cosine_of(turn)
            wider = other[k] - disc[k]
            reach = min((height + disc[k]) / (1.0 + cosine), far / max(sine, TOLERANCE))
            # the line midway to the other disc, at the angle between the ray and the two centres
            below = apart * (upright * cosine + along * sine) + wider
            reach = min(reach, midway(0.5 * (apart * apart - wider * wider), below))
            share[k] += weight * width * flux_on_ray(reach, disc[k])


@loops_in_place
def _add_film(
    place: Array, discs: tuple[Array, Array], ends: tuple[Array, Array], flux: Array
) -> None:
    """Adds the share of the wall, m4, between two distances (K,) m from the first foot."""
    first, second = discs
    low, high = ends
    for p in range(len(FINE_POINTS)):
        part, weight = 0.5 * (1.0 + FINE_POINTS[p]), 0.5 * FINE_WEIGHTS[p]
        for k in range(len(flux)):
            width = high[k] - low[k]
            x = low[k] + part * width
            one = (x**2 + place[0] ** 2 - first[k] ** 2) / (2.0 * (place[0] + first[k]))
            rest = place[2] - x
            two = (rest**2 + place[1] ** 2 - second[k] ** 2) / (2.0 * (place[1] + second[k]))
            edge = place[0] + (place[1] - place[0]) * x / place[2]
            flux[k] += weight * width * max(min(one, two, edge), 0.0) ** 3 / 3.0


# ------------------------------------------------------------------------------------------------
# Flow along the axis through a section of a throat on an edge of the box, between two side walls.
#
# The facet of the throat has a grain and its mirror images across both walls as corners. Its plane
# is normal to both walls. Two such triangles make the rectangle between the grain and its three
# images, and a quarter of that lies inside the box: the rectangle between the centre of the disc,
# of radius rho, its feet on the walls, H_1 and H_2 away, and the edge of the box.
#
# Disc and walls share the fluid as in `wall_cross_section`. The line midway between the rim and a
# wall is a parabola, that between the two walls halves their angle, and all three lines meet at
# the distance d from both walls,
#
#     d = b - sqrt(b^2 - H_1^2 - H_2^2 + rho^2),  b = H_1 + H_2 + rho.
#
# The film on a wall has the flux y^3 / 3 per length for the thickness y up to the nearest line.
# There is no constant. Against finite differences the flux is within 5 % for H_2 / H_1 from 1 to 2
# and rho / H_1 from 0.2 to 1.


@loops_in_place
def edge_fluxes(place: Array, disc: Array, room: tuple[Array, Array], flux: Array) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 between two walls and a disc in K sections.

    `place` (2,) m are the heights of its centre above the walls, `disc` (K,) m its radii. `room`
    is as in `wall_fluxes`.
    """
    lanes, table = room
    near, turn, share = lanes[0], lanes[1], lanes[2]
    for k in range(len(flux)):
        b = place[0] + place[1] + disc[k]
        rest = place[0] ** 2 + place[1] ** 2 - disc[k] ** 2
        near[k] = b - np.sqrt(max(b * b - rest, 0.0))
        flux[k] = 0.0
    for i in range(2):
        height, along = place[i], place[1 - i]
        for k in range(len(flux)):
            turn[k] = angle_of(max(along - near[k], 0.0), height - near[k])
        _set_rays((height, along), disc, turn, share)
        for k in range(len(flux)):
            ratio = shear_ratio(turn[k], min(2.0 * disc[k] / (height + disc[k]), 1.0), table)
            flux[k] += share[k] * ratio
        _add_edge_film((height, along), disc, flux)


@loops_in_place
def _set_rays(place: tuple[float, float], disc: Array, turn: Array, share: Array) -> None:
    """Sets the flux (K,) m4 on the rays of the disc up to `turn` (K,) rad from the normal.

    `place` are the height m of the disc above the wall, and its distance m from the other wall.
    """
    height, along = place
    for k in range(len(share)):
        share[k] = 0.0
    for p in range(len(FINE_POINTS)):
        part, weight = 0.5 * (1.0 + FINE_POINTS[p]), 0.5 * FINE_WEIGHTS[p]
        for k in range(len(share)):
            angle = part * turn[k] - QUARTER
            cosine, sine = -sine_of(angle), cosine_of(angle)
            reach = min((height + disc[k]) / (1.0 + cosine), along / max(sine, TOLERANCE))
            share[k] += weight * turn[k] * flux_on_ray(reach, disc[k])


@loops_in_place
def _add_edge_film(place: tuple[float, float], disc: Array, flux: Array) -> None:
    """Adds the share of one wall, m4, from the foot of the disc to the edge of the box."""
    height, along = place
    for p in range(len(FINE_POINTS)):
        x, weight = 0.5 * along * (1.0 + FINE_POINTS[p]), 0.5 * along * FINE_WEIGHTS[p]
        for k in range(len(flux)):
            midway = (x * x + height * height - disc[k] * disc[k]) / (2.0 * (height + disc[k]))
            film = max(min(midway, along - x, height), 0.0)
            flux[k] += weight * film**3 / 3.0
