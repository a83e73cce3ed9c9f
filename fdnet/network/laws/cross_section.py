"""The flow through sections of throats: grains, walls, a pressure plane, and fines.

Each section is a plane parallel to the facet of its throat, and what of it lies inside the box is
a polygon: the triangle of the facet, or its part beside side walls that hold the fluid. A sphere
that the section meets shows a disc in it, wherever its centre lies, and a wall is a disc of huge
radius. Every disc keeps the fluid that is nearer to its rim than to any other: what its rays see
of the polygon, from its rim or from where they enter the polygon, to the far side or to the line
midway to the rim of another disc. There the fluid has no shear.

From the centre of a disc the line midway to another one lies at d(t) = (a^2 - e^2) / (2 (a cos t +
e)) on the ray at the angle t from the line between the centres, with their distance a and the
excess e of the radius of the other disc. The flux on rays (`wedges`) neglects the shear between
them. Rays that one other disc ends on one side of the line between the centres are a wedge, and
are multiplied by the ratio of the exact flux through such a wedge to that on its rays.

The rays end in Gauss's points on the far sides, so the sum does not depend on the order of the
corners and is the same for a mirrored section.
"""

from typing import NamedTuple

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import loops_in_place, loops_inside
from fdnet.network.laws.reaching_grains import SpheresBeside, facet_axes
from fdnet.network.laws.wedges import log_of, ratio_table, shear_ratio
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

TIP = 1e-2
"""Smallest radius of the disc that a sphere of the facet shows in a section, in its own radii."""
HUGE = 100.0  # Radius of the disc that stands for a wall, in widths of the section
MOST_BODIES = 5  # What holds the fluid of a throat: three spheres at the corners and two walls
DOUBLE_EDGE_SHARE = 0.25
"""Part of the slipping flux that a throat carries which two walls cut between several grains."""
TOLERANCE = 1e-9  # Lengths up to this many mean grain radii are 0


class Shapes(NamedTuple):
    """The sections of K throats, whatever their height; x along the first edge of the facet, y
    towards its third corner, z above it towards the second pore, from the first corner."""

    corner: Array  # (K, 4, 2) m, of the polygon
    corners: Array  # (K,) how many it has, 3 or 4
    body: Array
    """(K, 5, 5) of the throat's own bodies: x, y, z and radius m, and flatness, 1 of a sphere and
    0 of a wall. There is none where the radius is 0."""
    part: Array  # (K,) flux of the whole throat over that of the polygon
    middle: Array
    """(K, 2) m, the place in the facet that is farthest from its discs; about it beside walls."""


class Sections(NamedTuple):
    """The sections of S sides of throats, n of each side at equal steps of height."""

    throat: Array  # (S,) number of the throat among those of a part
    side: Array  # (S,) 0 for the side of the first pore, 1 for that of the second
    low: Array  # (S,) m, the first section above the facet, on its side
    step: Array  # (S,) m between two sections
    many: int  # n


# ------------------------------------------------------------------------------------------------
# The polygons of throats, and the bodies on them.
#
# The facet of a throat that one side wall cuts has a grain i, its mirror image across the wall,
# and a grain j or its image as corners. Inside the box it is the trapezoid between i, j and their
# feet on the wall, half of a trapezoid that two such throats make up; a triangle with j on the
# wall is alone and stands for two. On an edge of the box the facet has a grain and its images
# across both walls. Two such throats make up a rectangle, a quarter of which lies inside the box.


def shapes_of(network: Network, part: slice) -> Shapes:
    """The polygons of the throats `part` (K), and their own bodies.

    A grain centred beyond an x face, of which the pack has a cap, is the whole grain, where it is.
    """
    images = network.throat_images[part]
    facet = network.image_position[images]
    count, outward = len(images), network.image_outward[images]
    corner, body = np.zeros((count, 4, 2)), np.zeros((count, MOST_BODIES, 5))
    corner[:, :3] = geometry.flat(facet)
    body[:, :3, :2], body[:, :3, 4] = corner[:, :3], 1.0
    body[:, :3, 3] = network.image_own_radius[images]
    row = np.flatnonzero(np.any(outward != 0.0, axis=1))
    if len(row):
        for i, axis in enumerate(facet_axes(network, part.start + row, facet[row])):
            body[row, :3, i] += outward[row] * axis[:, :1]
    middle = _middles(corner, network.image_radius[images], network.throat_radius[part])
    shapes = Shapes(corner, np.full(count, 3), body, np.ones(count), middle)
    if network.walls == "no-slip":
        _cut_at_wall(network, part, shapes)
        _cut_at_edge(network, part, shapes)
    return shapes


def _middles(corner: Array, radius: Array, inscribed: Array) -> Array:
    """Centres (K, 2) m of the circles of radius `inscribed` (K,) m that touch three discs.

    Their radii are `radius` (K, 3) m, and they stand on the first three of `corner` (K, 4, 2) m.
    From |x - p_i| = s + r_i at the three corners, by differences.
    """
    (a, _), (px, py) = corner[:, 1].T, corner[:, 2].T
    own, second, third = ((inscribed + one) ** 2 for one in radius.T)
    x = 0.5 * (a * a + own - second) / a
    return np.column_stack([x, (0.5 * (px * px + py * py + own - third) - px * x) / py])


def _cut_at_wall(network: Network, part: slice, shapes: Shapes) -> None:
    """Sets the polygons of throats that one wall cuts."""
    single = np.flatnonzero(network.throat_share[part] == 0.5)
    place, tolerance = network.corners_of(part)[single], TOLERANCE * network.grain_radius
    own = network.throat_grains[part][single]
    sides = [axis for axis in (1, 2) if not network.periodic[axis]]
    for one, other, third in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        apart = place[:, other] - place[:, one]
        pair = [_mirrored(apart, axis, tolerance) for axis in sides]
        cut = (own[:, one] == own[:, other]) & np.any(pair, axis=0)
        t = single[cut]
        first, second, j = (shapes.corner[t, k].copy() for k in (one, other, third))
        foot, inward = 0.5 * (first + second), 0.5 * (first - second)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        height = np.sum((j - foot) * inward, axis=1)
        beyond, flat = (height < -tolerance)[:, None], np.abs(height) <= tolerance
        first, inward = np.where(beyond, second, first), np.where(beyond, -inward, inward)
        other_foot = j - np.abs(height)[:, None] * inward
        shapes.body[t, np.where(beyond[:, 0], one, other), 3] = 0.0
        four = np.stack([first, j, other_foot, foot], axis=1)
        three = np.stack([first, j, foot, foot], axis=1)
        shapes.corner[t] = np.where(flat[:, None, None], three, four)
        shapes.corners[t], shapes.part[t] = np.where(flat, 3, 4), np.where(flat, 2.0, 1.0)
        shapes.middle[t] = shapes.corner[t].mean(axis=1)
        _set_wall(shapes, t, 3, 0.5 * (foot + other_foot), -inward)


def _cut_at_edge(network: Network, part: slice, shapes: Shapes) -> None:
    """Sets the polygons of throats on an edge of two walls.

    Only grains centred on walls have other throats there, which keep their triangle.
    """
    double = np.flatnonzero(network.throat_share[part] == 0.25)
    place, tolerance = network.corners_of(part)[double], TOLERANCE * network.grain_radius
    shapes.part[double] = DOUBLE_EDGE_SHARE
    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        right = _mirrored(place[:, j] - place[:, i], 1, tolerance)
        right &= _mirrored(place[:, k] - place[:, i], 2, tolerance)
        t = double[right]
        own, one, two = (shapes.corner[t, corner].copy() for corner in (i, j, k))
        feet, far = (0.5 * (own + one), 0.5 * (own + two)), 0.5 * (one + two)
        shapes.body[t, j, 3] = shapes.body[t, k, 3] = 0.0
        shapes.corner[t] = np.stack([own, feet[0], far, feet[1]], axis=1)
        shapes.corners[t], shapes.part[t] = 4, 2.0
        shapes.middle[t] = shapes.corner[t].mean(axis=1)
        for number, foot in enumerate(feet):
            outward = foot - own
            outward /= np.linalg.norm(outward, axis=1)[:, None]
            _set_wall(shapes, t, 3 + number, 0.5 * (foot + far), outward)


def _mirrored(apart: Array, axis: int, tolerance: float) -> Array:
    """Whether steps (K, 3) m lead across a wall normal to an axis, and along no other one."""
    rest = np.delete(apart, axis, axis=1)
    return np.all(np.abs(rest) <= tolerance, axis=1) & (np.abs(apart[:, axis]) > tolerance)


def _set_wall(shapes: Shapes, throats: Array, number: int, place: Array, outward: Array) -> None:
    """Sets a body to the disc that stands for the wall through `place` (K, 2) m."""
    away = shapes.corner[throats] - shapes.middle[throats, None]
    radius = 2.0 * HUGE * np.linalg.norm(away, axis=2).max(axis=1)
    shapes.body[throats, number, :2] = place + radius[:, None] * outward
    shapes.body[throats, number, 3] = radius


# ---- The flow through one polygon between any number of discs, summed over rays.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
HALF = len(POINTS)
RAYS = 2 * HALF  # Rays of a disc to each far side
NEAR_END = 0.05  # Least share of a far side that half of the rays end on
ON_SIDE = 1e-9  # A disc centred nearer to a side than this share of the side lies on it


class RayRoom(NamedTuple):
    """Room for the rays of the discs that the sections of a throat meet, D at most."""

    side: Array  # (4, 3) of `set_sides`
    rays: Array  # (D, 7, 48) of `aim`
    number: Array  # (D,) of rays of each disc; -1 before they are aimed
    longest: Array  # (D,) m, the farthest end of the rays of each disc
    which: Array  # (D,) the discs that a section meets
    disc: Array  # (D, 4): their centres x and y, and radii, m, and flatness
    part: Array  # (48,) for `flux_on_rays`


def ray_room(most: int) -> RayRoom:
    """Room for the bodies of a throat and `most` spheres near it."""
    most += MOST_BODIES
    return RayRoom(
        side=np.empty((4, 3)),
        rays=np.empty((most, 7, 4 * RAYS)),
        number=np.full(most, -1),
        longest=np.empty(most),
        which=np.empty(most, np.int64),
        disc=np.empty((most, 4)),
        part=np.empty(4 * RAYS),
    )


@loops_inside
def set_sides(base: Array, side: Array) -> None:
    """Sets `side` (n, 3): of each side of a polygon `base` (n, 2) m its normal inwards, length m.

    The polygon is convex, and the normal a unit vector.
    """
    many = len(base)
    for i in range(many):
        j, k = (i + 1) % many, (i + 2) % many
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
def aim(base: Array, side: Array, middle: Array, x: float, y: float, rays: Array) -> int:
    """Sets up the rays of a disc centred at `x`, `y` m, 12 to each far side; gives their number.

    Half of them pass on either side of the `middle` (2,) m, where the flux has a peak. `side` is
    what `set_sides` sets. The rows of `rays` (7, 48) are the direction, where a ray
    meets the far side and where it enters the polygon, m, its angle rad, and room.
    """
    first, many, lead = 0, len(base), np.int64(0)
    for i in range(many):  # the first far side, so that neighbouring rays are neighbours
        here = inwards(base, side, i, x, y) > ON_SIDE * side[i, 2]
        if here and inwards(base, side, i - 1, x, y) <= ON_SIDE * side[i - 1, 2]:
            lead = np.int64(i)
    for place in range(lead, lead + many):
        far = place % many
        depth = inwards(base, side, far, x, y)
        if depth <= ON_SIDE * side[far, 2]:
            continue
        one = (far + 1) % many
        ex, ey = base[one, 0] - base[far, 0], base[one, 1] - base[far, 1]
        vx, vy = base[far, 0] - x, base[far, 1] - y
        of_turn = 0.5 * side[far, 2] * depth
        ux, uy, end = rays[0, first:], rays[1, first:], rays[2, first:]
        entry, turn = rays[3, first:], rays[4, first:]
        dx, dy = middle[0] - x, middle[1] - y
        across = dx * ey - dy * ex
        there = abs(across) <= ON_SIDE * side[far, 2] ** 2  # the disc is centred in the middle
        split = 0.5 if there else (dy * vx - dx * vy) / across
        split = split if NEAR_END < split < 1.0 - NEAR_END else 0.5
        for p in range(min(RAYS, len(entry))):
            low, wide = (0.0, split) if p < HALF else (split, 1.0 - split)
            along = low + 0.5 * wide * (1.0 + POINTS[p % HALF])
            rx, ry = vx + along * ex, vy + along * ey
            long = np.sqrt(rx * rx + ry * ry)
            ux[p], uy[p], end[p] = rx / long, ry / long, long
            entry[p] = 0.0
            turn[p] = of_turn * wide * WEIGHTS[p % HALF] / (long * long)
        for near in range(1, many):
            i = (far + near) % many
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
def end_midway(rays: Array, count: int, disc: Array, other: Array, number: int) -> bool:
    """Ends the first `count` rays of a disc midway to another one, both (4,) of a room's discs.

    The last rows of `rays` (7, 48) hold where they end and by what: twice the `number` of the
    other disc, and 1 more on the right of it. Returns whether the disc lies in the other.
    """
    qx, qy, wider = other[0] - disc[0], other[1] - disc[1], other[2] - disc[2]
    square = qx * qx + qy * qy
    if wider > 0.0 and square <= wider * wider:
        return True
    half, code = 0.5 * (square - wider * wider), 2.0 * number
    ux, uy, reach, what = rays[0], rays[1], rays[5], rays[6]
    for p in range(count):
        below = qx * ux[p] + qy * uy[p] + wider
        way = half / below
        way = max(way, 0.0) if below > 0.0 else np.inf
        own = code if qx * uy[p] > qy * ux[p] else code + 1.0
        what[p] = own if way < reach[p] else what[p]
        reach[p] = min(reach[p], way)
    return False


@loops_inside
def flux_on_rays(
    rays: Array, count: int, number: int, around: bool, room: RayRoom, table: Array
) -> tuple[float, float]:
    """Flux m4 on the first `count` rays of the disc `number`, to where they end.

    `rays` (7, 48) is what `aim` and `end_midway` set. A ray that enters the polygon outside its
    disc carries the part from there of what an annulus carries from the rim. Neighbouring rays
    that one other disc ends, on one side of it, are a wedge, and so are those that end on one side
    of the polygon. Wedges of rays `around` the disc, whose first is anyone, end at each far side.
    The second flux is that without the shear between rays.
    """
    entry, turn, reach, what, part = rays[3], rays[4], rays[5], rays[6], room.part
    x, y, own = room.disc[number, 0], room.disc[number, 1], room.disc[number, 2]
    r2, farthest = own * own, 0.0
    if room.disc[number, 3] == 0.0:  # a wall, from which all rays start: the flux as a series
        for p in range(count):
            gap = (reach[p] - own) * (reach[p] + own) / r2
            part[p] = r2 * r2 * gap**3 * (1.0 / 24.0 - gap * (1.0 / 96.0 - gap / 240.0))
    else:
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
    total, on_rays, wedge, angle, nearest = 0.0, 0.0, 0.0, 0.0, np.inf
    for p in range(count):
        angle += turn[p]
        if reach[p] > max(entry[p], own):
            wedge += turn[p] * part[p]
            nearest = min(nearest, reach[p])
        ends = (p + 1) % RAYS == 0 and (around or what[p] < 0.0)
        if ends or p + 1 == count or what[p + 1] != what[p]:
            if wedge > 0.0:
                if what[p] >= 0.0:  # the point midway on the line between the centres
                    other = room.disc[int(what[p]) // 2]
                    apart = np.sqrt((other[0] - x) ** 2 + (other[1] - y) ** 2)
                    nearest = 0.5 * (apart - other[2] + own)
                closest = min(own / nearest, 1.0) if nearest > 0.0 else 1.0
                total += wedge * shear_ratio(angle, closest, table)
            on_rays += wedge
            wedge, angle, nearest = 0.0, 0.0, np.inf
    return total, on_rays


@loops_inside
def flux_among(
    base: Array, middle: Array, count: int, room: RayRoom, table: Array
) -> tuple[float, float]:
    """Flux m4 of laplacian(w) = -1 through a polygon, whose sides are set, among `count` discs.

    The second flux is that without the shear between rays.
    """
    total, on_rays = 0.0, 0.0
    for number in range(count):
        disc, slot = room.disc[number], room.which[number]
        rays = room.rays[slot]
        if room.number[slot] < 0:
            room.number[slot] = aim(base, room.side, middle, disc[0], disc[1], rays)
            room.longest[slot] = 0.0
            for p in range(room.number[slot]):
                room.longest[slot] = max(room.longest[slot], rays[2, p])
        many, longest = room.number[slot], room.longest[slot]
        for p in range(many):
            rays[5, p], rays[6, p] = rays[2, p], -1.0
        swallowed = False
        for k in range(count):
            other = room.disc[k]
            apart = np.sqrt((other[0] - disc[0]) ** 2 + (other[1] - disc[1]) ** 2)
            # the nearest point midway is on the line between the centres
            if k != number and not swallowed and apart - other[2] + disc[2] < 2.0 * longest:
                swallowed = end_midway(rays, many, disc, other, k)
        if many > 0 and not swallowed:
            one, plain = flux_on_rays(rays, many, number, many == RAYS * len(base), room, table)
            total, on_rays = total + one, on_rays + plain
    return total, on_rays


@loops_inside
def meet(bodies: Array, z: float, tip: float, first: int, count: int, room: RayRoom) -> int:
    """Adds the discs of `bodies` (N, 5) in the section at `z` m to the first `count`.

    A body that the section misses has a disc of `tip` radii, or none where that is 0. `first` is
    the place of the bodies' rays. Returns the number of discs.
    """
    for i in range(len(bodies)):
        whole = bodies[i, 3] ** 2
        square = whole - bodies[i, 4] * (bodies[i, 2] - z) ** 2
        square = max(square, tip * tip * whole)
        if square > 0.0:
            own = room.disc[count]
            room.which[count] = first + i
            own[0], own[1], own[2] = bodies[i, 0], bodies[i, 1], np.sqrt(square)
            own[3] = bodies[i, 4]
            count += 1
    return count


BEYOND, EVERYWHERE, OPEN = 0, 1, 2
"""Where spheres around count: in sections that one of the spheres at the corners does not reach,
in all, or in all and as the spheres at the corners do."""


@loops_in_place
def _set_fluxes(
    sections: Sections,
    shapes: Shapes,
    first: Array,
    place: Array,
    kind: int,
    table: Array,
    room: RayRoom,
    flux: Array,
    left: Array,
) -> None:
    before = -1
    for s in range(len(flux)):
        t = sections.throat[s]
        base, own = shapes.corner[t, : shapes.corners[t]], shapes.body[t]
        middle = shapes.middle[t]
        others = place[first[t] : first[t + 1]]
        if t != before:
            before = t
            set_sides(base, room.side)
            for i in range(len(others) + MOST_BODIES):
                room.number[i] = -1
        for k in range(flux.shape[1]):
            z = (2.0 * sections.side[s] - 1.0) * (sections.low[s] + k * sections.step[s])
            if kind == OPEN:
                count = meet(own, z, 0.0, 0, 0, room)
                count = meet(others, z, 0.0, MOST_BODIES, count, room)
                if count > 0:
                    flux[s, k], left[s, k] = flux_among(base, middle, count, room, table)
                    continue
            count, wanted = meet(own, z, TIP, 0, 0, room), kind == EVERYWHERE
            flux[s, k], clear = flux_among(base, middle, count, room, table)
            left[s, k] = 1.0
            for i in range(3):
                wanted = wanted or (own[i, 2] - z) ** 2 > own[i, 3] ** 2 > 0.0
            if wanted and len(others) > 0 and flux[s, k] > 0.0:
                more = meet(others, z, 0.0, MOST_BODIES, count, room)
                if more > count:
                    among = flux_among(base, middle, more, room, table)[1]
                    left[s, k] = min(among / clear, 1.0)


def section_fluxes(
    shapes: Shapes, sections: Sections, around: SpheresBeside | None = None, kind: int = BEYOND
) -> tuple[Array, Array]:
    """Fluxes (S, n) m4 among the own bodies of throats, and the share that spheres around leave.

    The share is that of the fluxes on rays, for the wedges about a sphere among others are no
    wedges of the table. Adding a solid never adds flow, so it is at most 1. For `OPEN` the first
    are the fluxes among all spheres, and a sphere at a corner has no disc beyond its reach.
    """
    count = len(shapes.corners)
    if around is None:
        around = SpheresBeside(first=np.zeros(count + 1, int), place=np.zeros((0, 5)))
    room = ray_room(int(np.diff(around.first).max(initial=0)))
    flux, left = np.empty((2, len(sections.throat), sections.many))
    given = (sections, shapes, around.first, around.place, kind, ratio_table(), room)
    _set_fluxes(*given, flux, left)
    return flux, left
