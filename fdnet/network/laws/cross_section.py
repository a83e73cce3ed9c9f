"""The flow through sections of throats: between three grains, at a wall and in an edge.

Each section is a plane parallel to the facet of its throat. The functions that end in `_fluxes`
take the sections of many throats at once.
"""

from typing import NamedTuple

import numpy as np

from fdnet.network.compiled import loops_in_place, loops_inside
from fdnet.network.laws.wedges import (
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
    shear_ratio,
    sine_of,
)
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array


class Sections(NamedTuple):
    """The sections of S sides of throats, n of each side at equal steps of height."""

    throat: Array
    """(S,) number of the throat among those of a part."""
    side: Array
    """(S,) 0 for the side of the first pore, 1 for that of the second."""
    low: Array
    """(S,) m, the first section above the facet, on its side."""
    step: Array
    """(S,) m between two sections."""
    disc: Array
    """(S, 3, n) m, radii of the discs of the grains on the corners."""


# ------------------------------------------------------------------------------------------------
# The flow on rays from the three corners of a section, whatever discs lie on them.
#
# Each disc keeps what its rays see of the triangle before a line midway to the rim of another disc
# or the opposite side. The directions of the rays do not change with the radii of the discs, so
# they are set up once for all sections of a throat.


RAYS = len(FINE_POINTS)
"""Rays of each corner."""
STEEPEST = 1e-3
"""Smallest cosine of the angle between a ray and the normal of the opposite side."""


class CornerRays(NamedTuple):
    """The rays of the three corners of a triangle."""

    corner: Array
    """(3, 3): the angle rad, and the distances m to the next two corners."""
    ray: Array
    """(3, 3, 12): the far side m, and the cosines of the angles to these two."""
    reach: Array
    """(3, 12) m, where the rays end."""
    part: Array
    """(12,) m4, the fluxes of the rays of one corner."""


def corner_rays() -> CornerRays:
    """Room for the rays of a section."""
    return CornerRays(
        corner=np.empty((3, 3)),
        ray=np.empty((3, 3, RAYS)),
        reach=np.empty((3, RAYS)),
        part=np.empty(RAYS),
    )


@loops_inside
def aim_corners(base: Array, rays: CornerRays) -> None:
    """Sets up the rays of the corners of a triangle `base` (3, 2) m."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        jx, jy = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        kx, ky = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        aj, ak = np.sqrt(jx * jx + jy * jy), np.sqrt(kx * kx + ky * ky)
        across = np.sqrt((kx - jx) ** 2 + (ky - jy) ** 2)
        twice, inner = abs(jx * ky - jy * kx), jx * kx + jy * ky
        height, foot = twice / across, -(jx * (kx - jx) + jy * (ky - jy)) / across
        opening = np.arctan2(twice, inner)
        rays.corner[i, 0], rays.corner[i, 1], rays.corner[i, 2] = opening, aj, ak
        far, to_j, to_k = rays.ray[i, 0], rays.ray[i, 1], rays.ray[i, 2]
        for p in range(len(far)):
            turn = 0.5 * opening * (1.0 + FINE_POINTS[p]) - QUARTER
            cosine, sine = -sine_of(turn), cosine_of(turn)
            far[p] = height / max((cosine * height + sine * foot) / aj, STEEPEST)
            to_j[p] = cosine
            to_k[p] = (cosine * inner + sine * twice) / (aj * ak)


@loops_inside
def corner_flux(rays: CornerRays, disc: Array, table: Array) -> float:
    """Flux m4 on the rays from discs of the radii `disc` (3,) m to the lines midway."""
    total, part = 0.0, rays.part
    for i in range(3):
        corner, ray, reach = rays.corner[i], rays.ray[i], rays.reach[i]
        far, to_j, to_k = ray[0], ray[1], ray[2]
        aj, ak = corner[1], corner[2]
        ej, ek = disc[(i + 1) % 3] - disc[i], disc[(i + 2) % 3] - disc[i]
        half_j, half_k = 0.5 * (aj * aj - ej * ej), 0.5 * (ak * ak - ek * ek)
        for p in range(len(reach)):
            before = midway(half_j, aj * to_j[p] + ej), midway(half_k, ak * to_k[p] + ek)
            reach[p] = min(far[p], before[0], before[1])
        for p in range(len(reach)):
            part[p] = FINE_WEIGHTS[p] * flux_on_ray(reach[p], disc[i])
        flux, nearest = 0.0, np.inf
        for p in range(len(reach)):
            flux += part[p]
            nearest = min(nearest, reach[p])
        if flux > 0.0:
            closest = min(disc[i] / nearest, 1.0) if nearest > 0.0 else 1.0
            angle = 0.5 * corner[0]
            total += angle * flux * shear_ratio(angle, closest, table)
    return total


# ------------------------------------------------------------------------------------------------
# The flow through a triangle between any number of discs, summed over rays.
#
# Every disc keeps what its rays see inside the triangle, from its rim or from where they enter the
# triangle to the far side, or to the line midway to the rim of another disc. The rays end in
# Gauss's points on the far sides, so the sum does not depend on the order of the corners and is
# the same for a mirrored triangle.


SECTOR = np.pi / 3.0
"""Half angle, rad, between two of the three rims that surround a disc."""
ON_SIDE = 1e-9
"""A disc centred nearer to a side than this share of the side lies on it."""
UNTOUCHED, NARROWED, SWALLOWED = 0, 1, 2
"""What another disc does to the rays of a disc."""


@loops_inside
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
        side[i, 0], side[i, 1], side[i, 2] = nx, ny, length


@loops_inside
def inwards(base: Array, side: Array, i: int, x: float, y: float) -> float:
    """How far m the place `x`, `y` m lies inwards of the side `i`."""
    return side[i, 0] * (x - base[i, 0]) + side[i, 1] * (y - base[i, 1])


@loops_inside
def depth_within(base: Array, side: Array, x: float, y: float) -> float:
    """How far m a place lies within a triangle, from the nearest side line; negative outside.

    A disc that is no larger than its place is far outside does not reach in.
    """
    least = np.inf
    for i in range(3):
        least = min(least, inwards(base, side, i, x, y))
    return least


@loops_inside
def aim(base: Array, side: Array, x: float, y: float, rays: Array) -> int:
    """Sets up the rays of a disc centred at `x`, `y` m, 12 to each far side; gives their number.

    `side` is what `set_sides` sets. The rows of `rays` (6, 36) are the direction, where a ray
    meets the far side and where it enters the triangle, m, its angle rad, and room.
    """
    first = 0
    for far in range(3):
        depth = inwards(base, side, far, x, y)
        if depth <= ON_SIDE * side[far, 2]:
            continue
        one = (far + 1) % 3
        ex, ey = base[one, 0] - base[far, 0], base[one, 1] - base[far, 1]
        vx, vy = base[far, 0] - x, base[far, 1] - y
        of_turn = 0.5 * side[far, 2] * depth
        ux, uy, end = rays[0, first:], rays[1, first:], rays[2, first:]
        entry, turn = rays[3, first:], rays[4, first:]
        for p in range(min(RAYS, len(entry))):
            along = 0.5 * (1.0 + FINE_POINTS[p])
            rx, ry = vx + along * ex, vy + along * ey
            long = np.sqrt(rx * rx + ry * ry)
            ux[p], uy[p], end[p] = rx / long, ry / long, long
            entry[p] = 0.0
            turn[p] = of_turn * FINE_WEIGHTS[p] / (long * long)
        for near in range(1, 3):
            i = (far + near) % 3
            away = -inwards(base, side, i, x, y)
            if away > ON_SIDE * side[i, 2]:
                nx, ny = side[i, 0], side[i, 1]
                for p in range(min(RAYS, len(entry))):
                    speed = nx * ux[p] + ny * uy[p]
                    begin = away / speed if speed > 0.0 else np.inf
                    entry[p] = max(entry[p], begin)
        first += RAYS
    return first


@loops_inside
def end_midway(
    rays: Array,
    count: int,
    x: float,
    y: float,
    radius: float,
    other_x: float,
    other_y: float,
    other_radius: float,
) -> int:
    """Ends the first `count` rays of a disc midway to another one; centre and radius m of both.

    The last row of `rays` (6, 36) holds where they end. Returns what the other disc does.
    """
    qx, qy, wider = other_x - x, other_y - y, other_radius - radius
    square = qx * qx + qy * qy
    if wider > 0.0 and square <= wider * wider:
        return SWALLOWED
    half = 0.5 * (square - wider * wider)
    ux, uy, reach = rays[0], rays[1], rays[5]
    for p in range(count):
        reach[p] = min(reach[p], midway(half, qx * ux[p] + qy * uy[p] + wider))
    return NARROWED


@loops_inside
def flux_on_rays(rays: Array, count: int, own: float, part: Array, table: Array) -> float:
    """Flux m4 on the first `count` rays of a disc of radius `own` m, to where they end.

    `rays` (6, 36) is what `aim` and `end_midway` set, `part` (36,) is written to. A ray that
    enters the triangle outside its disc carries the part from there of what `flux_on_ray` sums
    from the rim.
    """
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
# Flow along the axis through a section with a disc of each grain on its corners.
#
# Every disc slows the fluid between its rim and the line midway to the next rim; these shares are
# cut into wedges (`wedges`).
#
# The line midway between two rims is a hyperbola. From the centre of a disc it lies at the
# distance d(t) = (a^2 - e^2) / (2 (a cos t + e)) on the ray at the angle t from the line between
# the centres, with the difference e of the radii and the distance a of the centres. The shares
# meet in the centre of the circle that touches all three discs. The flux on rays is summed by
# Gauss points, and the shear between rays is that of the wedge of the same angle and half gap.
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


class DiscRoom(NamedTuple):
    """Room for `disc_fluxes`."""

    wedge: Array
    """(7, 6 n): of each wedge the excess of the radius of the other disc, half the gap squared,
    the distance of the centres, the place of the circle along their line and across it, which
    becomes its angle rad, the own radius, and the flux on rays."""
    edges: Array
    """(6, 4), from each corner to the two others: unit vector, length m, and 1 where the third
    corner lies to the left, else -1."""
    rays: CornerRays


def disc_room(count: int) -> DiscRoom:
    """Room for `count` sections."""
    return DiscRoom(wedge=np.empty((7, 6 * count)), edges=np.empty((6, 4)), rays=corner_rays())


@loops_in_place
def disc_fluxes(
    rows: Array, sections: Sections, base: Array, table: Array, room: DiscRoom, flux: Array
) -> None:
    """Writes the `flux` (S, n) m4 of laplacian(w) = -1 in the sides `rows` between three discs.

    The first corner of a facet is the origin, the second lies on the x axis. The flux is 0 where
    the discs close the triangle.

    Args:
        rows: numbers of the sides.
        sections: of all sides.
        base: (K, 3, 2) m, corners of the facets.
        table: of `shear_ratio`.
        room: written to.
        flux: of all sides.
    """
    aimed = -1
    for s in rows:
        t = sections.throat[s]
        disc, out = sections.disc[s], flux[s]
        touching_fluxes(base[t], disc, table, room, out)
        for k in range(len(out)):
            beyond = 0.0 if out[k] > 0.0 else TURN
            for m in range(6 * k, 6 * k + 6):
                beyond = max(beyond, -room.wedge[4, m])
            if beyond > 0.0:
                if aimed != t:
                    aim_corners(base[t], room.rays)
                    aimed = t
                more = corner_flux(room.rays, disc[:, k], table) - out[k]
                out[k] += min(beyond / TURN, 1.0) * max(more, 0.0)


@loops_inside
def touching_fluxes(base: Array, disc: Array, table: Array, room: DiscRoom, flux: Array) -> None:
    """Writes the flux (n,) m4 where a circle touches all three discs (3, n) m, else 0.

    Shares are negative where the circle lies beyond an edge of the triangle.
    """
    wedge, edges = room.wedge, room.edges
    for i in range(3):
        for step in range(1, 3):
            j, k = (i + step) % 3, (i + 3 - step) % 3
            ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
            a = np.sqrt(ex * ex + ey * ey)
            turned = ex * (base[k, 1] - base[i, 1]) - ey * (base[k, 0] - base[i, 0])
            edge = edges[2 * i + step - 1]
            edge[0], edge[1], edge[2], edge[3] = ex / a, ey / a, a, 1.0 if turned > 0.0 else -1.0
    for k in range(len(flux)):
        touches = _set_wedges(edges, base, disc[:, k], wedge[:, 6 * k : 6 * k + 6])
        flux[k] = 1.0 if touches else 0.0
    _sum_wedges(wedge, 6 * len(flux))
    wider, apart, turn, own, total = wedge[0], wedge[2], wedge[4], wedge[5], wedge[6]
    for k in range(len(flux)):
        if flux[k] > 0.0:
            flux[k] = 0.0
            for m in range(6 * k, 6 * k + 6):
                disc_of_gap = own[m] / (0.5 * (apart[m] - wider[m]))
                flux[k] += total[m] * shear_ratio(abs(turn[m]), disc_of_gap, table)


@loops_inside
def _set_wedges(edges: Array, base: Array, disc: Array, wedge: Array) -> bool:
    """Sets five rows and the own radius of six wedges; whether a circle touches three discs."""
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


@loops_inside
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


@loops_inside
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
# Discs and wall share the fluid as discs do. The line midway between the rims of i and j
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


class WallCuts(NamedTuple):
    """How walls that hold the fluid cut each of K throats."""

    order: Array
    """(K, 2) which corners of the facet are i and j. On an edge j is -1, and both are -1 where no
    wall cuts the throat."""
    place: Array
    """(K, 3) m, heights of i and j above the wall, and their distance along it; on an edge heights
    of i above both walls, and 0."""
    part: Array
    """(K,) flux of the whole throat over that of the half-section, quarter-section, or slipping
    section."""


def wall_cuts(network: Network) -> WallCuts:
    """How walls that hold the fluid cut each throat.

    A trapezoid is two triangles, each with share 1/2, so each carries the half-section; a triangle
    with j on the wall is alone and carries two. The rectangle of an edge (`edge_fluxes`) is
    two triangles, each with share 1/4, so each carries two quarter-sections. Only grains centred
    on walls have other edges; their throats carry `DOUBLE_EDGE_SHARE` of the slipping flux.
    """
    count = len(network.throat_share)
    order, place, part = np.full((count, 2), -1), np.zeros((count, 3)), np.ones(count)
    if network.walls == "slip":
        return WallCuts(order, place, part)
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
    part[double] = DOUBLE_EDGE_SHARE
    corner = network.corners_of(double)
    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        one, two = corner[:, j] - corner[:, i], corner[:, k] - corner[:, i]
        right = _mirrored(one, 1, tolerance) & _mirrored(two, 2, tolerance)
        t = double[right]
        order[t, 0], part[t] = i, 2.0
        place[t, 0], place[t, 1] = 0.5 * np.abs(one[right, 1]), 0.5 * np.abs(two[right, 2])
    return WallCuts(order, place, part)


def _mirrored(apart: Array, axis: int, tolerance: float) -> Array:
    """Whether steps (K, 3) m lead across a wall normal to an axis, and along no other one."""
    rest = np.delete(apart, axis, axis=1)
    return np.all(np.abs(rest) <= tolerance, axis=1) & (np.abs(apart[:, axis]) > tolerance)


@loops_in_place
def wall_fluxes(
    rows: Array, sections: Sections, cuts: WallCuts, table: Array, lanes: Array, flux: Array
) -> None:
    """Writes the `flux` (S, n) m4 of the sides `rows` between a wall and two discs.

    `lanes` (`LANES`, n) is written to; the others are as in `disc_fluxes`.
    """
    for s in rows:
        t = sections.throat[s]
        place, out = cuts.place[t], flux[s]
        one, two = sections.disc[s, cuts.order[t, 0]], sections.disc[s, cuts.order[t, 1]]
        along, above, split, share = lanes[0], lanes[1], lanes[2], lanes[3]
        first, last = lanes[4], lanes[5]
        apart = np.hypot(place[2], place[0] - place[1])
        # where the parabolas meet, along the wall and above it; midway where they do not
        for k in range(len(out)):
            wide, wide_2 = place[0] + one[k], place[1] + two[k]
            near, far = place[0] ** 2 - one[k] ** 2, place[1] ** 2 - two[k] ** 2
            middle = wide * place[2]
            rest = wide_2 * near - wide * (place[2] ** 2 + far)
            square = middle**2 - (wide_2 - wide) * rest
            meeting = -rest / (middle + np.sqrt(max(square, 0.0)))
            along[k] = meeting if square >= 0.0 else 0.5 * place[2]
            above[k] = 0.5 * (along[k] ** 2 + near) / wide
            out[k] = 0.0
        for i in range(2):
            height, other = place[i], place[1 - i]
            disc, next_disc = (one, two) if i == 0 else (two, one)
            edge = np.arctan2(place[2], height - other)
            upright = (height - other) / apart
            for k in range(len(out)):
                x = along[k] if i == 0 else place[2] - along[k]
                split[k] = min(max(angle_of(x, height - above[k]), 0.0), edge)
                first[k], last[k] = 0.0, edge
            for part in range(2):
                low, high = (first, split) if part == 0 else (split, last)
                _set_shares(height, place[2], apart, upright, disc, next_disc, low, high, share)
                for k in range(len(out)):
                    if part == 0:
                        turn, closest = split[k], 2.0 * disc[k] / (height + disc[k])
                    else:
                        gap = max(apart - next_disc[k] + disc[k], disc[k])
                        turn, closest = edge - split[k], min(2.0 * disc[k] / gap, 1.0)
                    out[k] += share[k] * shear_ratio(turn, closest, table)
        for k in range(len(out)):
            first[k], split[k], last[k] = 0.0, min(max(along[k], 0.0), place[2]), place[2]
        for part in range(2):
            low, high = (first, split) if part == 0 else (split, last)
            _add_film(place, one, two, low, high, out)


@loops_inside
def _set_shares(
    height: float,
    far: float,
    apart: float,
    upright: float,
    disc: Array,
    other: Array,
    low: Array,
    high: Array,
    share: Array,
) -> None:
    """Sets the flux (n,) m4 on the rays of a disc between two angles from the normal of the wall.

    A ray ends at the nearest line midway, or at the far side of the trapezoid.

    Args:
        height: m, of the disc above the wall.
        far: m to the other disc, along the wall.
        apart: m to the other disc.
        upright: sine of the slope from the other up to it.
        disc: (n,) m, its radii.
        other: (n,) m, those of the other.
        low: (n,) rad, the lower angle.
        high: (n,) rad, the upper one.
        share: the flux.
    """
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


@loops_inside
def _add_film(place: Array, one: Array, two: Array, low: Array, high: Array, flux: Array) -> None:
    """Adds the share of the wall, m4, between two distances (n,) m from the first foot."""
    for p in range(len(FINE_POINTS)):
        part, weight = 0.5 * (1.0 + FINE_POINTS[p]), 0.5 * FINE_WEIGHTS[p]
        for k in range(len(flux)):
            width = high[k] - low[k]
            x = low[k] + part * width
            below = (x**2 + place[0] ** 2 - one[k] ** 2) / (2.0 * (place[0] + one[k]))
            rest = place[2] - x
            beyond = (rest**2 + place[1] ** 2 - two[k] ** 2) / (2.0 * (place[1] + two[k]))
            edge = place[0] + (place[1] - place[0]) * x / place[2]
            flux[k] += weight * width * max(min(below, beyond, edge), 0.0) ** 3 / 3.0


# ------------------------------------------------------------------------------------------------
# Flow along the axis through a section of a throat on an edge of the box, between two side walls.
#
# The facet of the throat has a grain and its mirror images across both walls as corners. Its plane
# is normal to both walls. Two such triangles make the rectangle between the grain and its three
# images, and a quarter of that lies inside the box: the rectangle between the centre of the disc,
# of radius rho, its feet on the walls, H_1 and H_2 away, and the edge of the box.
#
# Disc and walls share the fluid as at one wall. The line midway between the rim and a
# wall is a parabola, that between the two walls halves their angle, and all three lines meet at
# the distance d from both walls,
#
#     d = b - sqrt(b^2 - H_1^2 - H_2^2 + rho^2),  b = H_1 + H_2 + rho.
#
# There is no constant. Against finite differences the flux is within 5 % for H_2 / H_1 from 1 to 2
# and rho / H_1 from 0.2 to 1.


@loops_in_place
def edge_fluxes(
    rows: Array, sections: Sections, cuts: WallCuts, table: Array, lanes: Array, flux: Array
) -> None:
    """Writes the `flux` (S, n) m4 of the sides `rows` between two walls and a disc.

    The arguments are those of `wall_fluxes`.
    """
    for s in rows:
        t = sections.throat[s]
        disc, place, out = sections.disc[s, cuts.order[t, 0]], cuts.place[t], flux[s]
        near, turn, share = lanes[0], lanes[1], lanes[2]
        for k in range(len(out)):
            b = place[0] + place[1] + disc[k]
            rest = place[0] ** 2 + place[1] ** 2 - disc[k] ** 2
            near[k] = b - np.sqrt(max(b * b - rest, 0.0))
            out[k] = 0.0
        for i in range(2):
            height, along = place[i], place[1 - i]
            for k in range(len(out)):
                turn[k] = angle_of(max(along - near[k], 0.0), height - near[k])
                share[k] = 0.0
            # on the rays of the disc up to `turn` from the normal of the wall
            for p in range(len(FINE_POINTS)):
                part, weight = 0.5 * (1.0 + FINE_POINTS[p]), 0.5 * FINE_WEIGHTS[p]
                for k in range(len(out)):
                    angle = part * turn[k] - QUARTER
                    cosine, sine = -sine_of(angle), cosine_of(angle)
                    reach = min((height + disc[k]) / (1.0 + cosine), along / max(sine, TOLERANCE))
                    share[k] += weight * turn[k] * flux_on_ray(reach, disc[k])
            for k in range(len(out)):
                closest = min(2.0 * disc[k] / (height + disc[k]), 1.0)
                out[k] += share[k] * shear_ratio(turn[k], closest, table)
            # in the film on the wall, from the foot of the disc to the edge of the box
            for p in range(len(FINE_POINTS)):
                x = 0.5 * along * (1.0 + FINE_POINTS[p])
                weight = 0.5 * along * FINE_WEIGHTS[p]
                for k in range(len(out)):
                    line = x * x + height * height - disc[k] * disc[k]
                    film = min(line / (2.0 * (height + disc[k])), along - x, height)
                    out[k] += weight * max(film, 0.0) ** 3 / 3.0
