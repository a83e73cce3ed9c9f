"""The resistance of a throat between spheres of any size, grains and fines alike.

Throats that a fine bounds have sections of their own, which are summed over points; all others
have those of `lubrication`, narrowed by the spheres around.
"""

from typing import NamedTuple

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import loops_in_place, loops_inside, on_all_cores
from fdnet.network.fines.deposit import cells_between, grid_of, images_near, size_classes
from fdnet.network.laws.cross_section import depth_within, set_sides
from fdnet.network.laws.lubrication import THROATS, TIP, half_resistances, spans_of
from fdnet.network.laws.reaching_grains import facet_axes, own_radius
from fdnet.network.laws.wedges import OPEN_WIDENING, WIDENING, log_of, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

# ------------------------------------------------------------------------------------------------
# The flow through a triangle among discs, summed over points.
#
# A point belongs to the nearest rim, at the distance s from it. On the ray from the centre of that
# disc, of radius rho, through the point the speed is largest midway to the next rim, at the
# distance d from the centre, whichever disc that is and wherever it stands. The speed is the
# geometric mean of those in an annulus without shear at d (Happel 1959, AIChE J. 5, 174) and
# between two plates,
#
#     w0 = d^2 / 2 ln(r / rho) - (r^2 - rho^2) / 4,  w1 = s (2 (d - rho) - s) / 2,  r = rho + s.
#
# Against finite elements the first is too large, most of all where a small disc stands among large
# ones, and the second too small, most of all around small discs (docs/physics_network.md, section
# 8).


def parts_of_triangle(divisions: int) -> Array:
    """Weights (2, n) of the second and third corner at the centroids of equal parts of a triangle.

    They are the same seen from each of its corners.
    """
    rows = range(divisions)
    up = [((i + 1 / 3), (j + 1 / 3)) for i in rows for j in range(divisions - i)]
    down = [((i + 2 / 3), (j + 2 / 3)) for i in rows for j in range(divisions - i - 1)]
    return np.ascontiguousarray(np.transpose(up + down)) / divisions


class PointRoom(NamedTuple):
    """The points of a section, and room for what belongs to each of them."""

    points: Array
    """(2, p) of `parts_of_triangle`."""
    lanes: Array
    """(7, p): place x and y, or direction of the ray; distance m of the nearest rim; centre x and
    y and radius m of its disc; and the way m from that rim to the line midway to the next."""


def point_room(divisions: int) -> PointRoom:
    """Points that divide each side of a triangle into so many parts, and their room."""
    points = parts_of_triangle(divisions)
    return PointRoom(points=points, lanes=np.empty((7, points.shape[1])))


@loops_inside
def points_flux(
    base: Array, discs: Array, many: int, lines: Array, cutting: int, room: PointRoom
) -> float:
    """Flux m4 of laplacian(w) = -1 through a triangle among discs.

    Where a ray meets no line midway to another disc, the longest side is taken as the way to it.
    A wall that cuts the triangle is the mirror of what lies beyond it.

    Args:
        base: (3, 2) m, its corners.
        discs: (n, 4) m, centres, radii, and how far the rims at least are from the triangle.
        many: how many of them count.
        lines: (n, 3) unit normal into the box and distance m from the origin, of the lines in
            which walls cut the section.
        cutting: how many of them count.
        room: written to.
    """
    points, lanes = room.points, room.lanes
    x, y, least, way = lanes[0], lanes[1], lanes[2], lanes[6]
    own_x, own_y, rho = lanes[3], lanes[4], lanes[5]
    number, nearest = len(x), way
    ex, ey = base[1, 0] - base[0, 0], base[1, 1] - base[0, 1]
    fx, fy = base[2, 0] - base[0, 0], base[2, 1] - base[0, 1]
    gx, gy = ex - fx, ey - fy
    longest = np.sqrt(max(ex * ex + ey * ey, fx * fx + fy * fy, gx * gx + gy * gy))
    for p in range(number):
        x[p] = base[0, 0] + points[0, p] * ex + points[1, p] * fx
        y[p] = base[0, 1] + points[0, p] * ey + points[1, p] * fy
        least[p] = np.inf
    for w in range(cutting):
        nx, ny, gap = lines[w, 0], lines[w, 1], lines[w, 2]
        for p in range(number):
            beyond = 2.0 * min(gap + nx * x[p] + ny * y[p], 0.0)
            x[p] -= beyond * nx
            y[p] -= beyond * ny
    # the nearest rim of each point
    farthest = np.inf
    for q in range(many):
        if discs[q, 3] >= farthest:
            continue
        qx, qy, radius, disc = discs[q, 0], discs[q, 1], discs[q, 2], float(q)
        for p in range(number):
            dx, dy = qx - x[p], qy - y[p]
            away = np.sqrt(dx * dx + dy * dy) - radius
            nearest[p] = disc if away < least[p] else nearest[p]
            least[p] = min(away, least[p])
        farthest = 0.0
        for p in range(number):
            farthest = max(farthest, least[p])
    for p in range(number):
        q = int(nearest[p])
        own_x[p], own_y[p], rho[p] = discs[q, 0], discs[q, 1], discs[q, 2]
    # the way from there to the line midway to the next rim, d - rho, on the ray through the point;
    # a disc whose rim is farther than twice this way from a point cannot end its ray
    for p in range(number):
        r = rho[p] + least[p]
        x[p] = (x[p] - own_x[p]) / r
        y[p] = (y[p] - own_y[p]) / r
        way[p] = longest
    most = longest
    for q in range(many):
        if discs[q, 3] >= 2.0 * most:
            continue
        cx, cy, radius = discs[q, 0], discs[q, 1], discs[q, 2]
        for p in range(number):
            qx, qy, wider = cx - own_x[p], cy - own_y[p], radius - rho[p]
            below = qx * x[p] + qy * y[p] + wider
            half = 0.5 * (qx * qx + qy * qy - wider * wider)
            one = half / below - rho[p]
            way[p] = min(way[p], one if half > 0.0 and below > 0.0 else np.inf)
        most = 0.0
        for p in range(number):
            most = max(most, way[p])
    total = 0.0
    for p in range(number):
        s = max(least[p], 0.0)
        r = rho[p] + s
        d = max(rho[p] + way[p], r)
        annulus = 0.5 * d * d * log_of(r / rho[p]) - 0.25 * (r * r - rho[p] * rho[p])
        plates = 0.5 * s * (2.0 * (d - rho[p]) - s)
        total += np.sqrt(max(annulus * plates, 0.0))
    return total * 0.5 * abs(ex * fy - ey * fx) / number


# ------------------------------------------------------------------------------------------------
# The flow through a section next to side walls that hold the fluid, and to planes of pressure.
#
# A wall is one more disc, of huge radius, and what lies beyond it is the mirror image of what lies
# in the box. A plane of constant pressure holds the fluid along it as a wall does. With n the
# component of the normal of the section along x, the flux is n^2 M + (1 - n^2) M_held, where
# M_held has the planes as more such discs.


SQUARE = 1e-6
"""Square of the sine of the angle between a section and a plane up to which they do not meet."""
HUGE = 1e3
"""Radius of the disc that stands for a plane, in lengths of the facet."""
MOST_PLANES = 6


def planes_of(network: Network) -> Array:
    """The planes (6, 3) of a box that hold fluid: axis, sense of the normal into the box, place m.

    Those of pressure, across x, come first. The place of a side that holds no fluid is infinite.
    """
    planes = np.empty((MOST_PLANES, 3))
    for axis in range(3):
        open_side = network.periodic[axis] or (axis > 0 and network.walls == "slip")
        for side in range(2):
            sense = 1.0 - 2.0 * side
            place = -sense * np.inf if open_side else network.box[axis, side]
            planes[2 * axis + side] = axis, sense, place
    return planes


def turned_inside(network: Network, facet: Array, axes: Array) -> tuple[Array, Array]:
    """Facets (K, 3, 3) m and their axes (3, K, 3), of which none lies beyond a no-slip wall.

    Those whose centroid does are replaced by their mirror images, which are the same throats.
    """
    facet, axes = facet.copy(), axes.copy()
    for axis, sense, place in planes_of(network)[2:]:
        beyond = sense * (facet[:, :, int(axis)].mean(axis=1) - place) < 0.0
        facet[beyond, :, int(axis)] = 2.0 * place - facet[beyond, :, int(axis)]
        axes[:, beyond, int(axis)] *= -1.0
    return facet, axes


@loops_inside
def held_flux(
    base: Array,
    discs: Array,
    many: int,
    planes: Array,
    origin: Array,
    axes: Array,
    z: float,
    lines: Array,
    room: PointRoom,
) -> float:
    """Flux m4 of laplacian(w) = -1 through a section, among discs, walls and planes of pressure.

    Args:
        base: (3, 2) m, the corners of the facet.
        discs: as of `points_flux`, with room for `MOST_PLANES` more.
        many: how many there are.
        planes: of `planes_of`.
        origin: (3,) m, the first corner of the facet.
        axes: (3, 3), its axes as rows.
        z: m, the height of the section above it.
        lines: (`MOST_PLANES`, 3), written to.
        room: of `point_room`.
    """
    longest, most = 0.0, 0.0
    for i in range(3):
        longest = max(longest, abs(base[i, 0]), abs(base[i, 1]))
    held, cutting, walled, flux = many, np.int64(0), many, 0.0
    for turn in range(MOST_PLANES):
        number = (turn + 2) % MOST_PLANES  # those of pressure, which come first, are the last
        if turn == MOST_PLANES - 2:
            flux = points_flux(base, discs, held, lines, cutting, room)
            walled = held
            for p in range(room.lanes.shape[1]):
                most = max(most, room.lanes[6, p])
        wall = turn < MOST_PLANES - 2
        line = lines[cutting if wall else MOST_PLANES - 1]
        axis, sense, place = int(planes[number, 0]), planes[number, 1], planes[number, 2]
        ux, uy, uz = sense * axes[0, axis], sense * axes[1, axis], sense * axes[2, axis]
        square, least = ux * ux + uy * uy, np.inf
        if not np.isinf(place) and square > SQUARE:
            slope = np.sqrt(square)
            line[0], line[1] = ux / slope, uy / slope
            line[2] = (sense * (origin[axis] - place) + z * uz) / slope
            for i in range(3):
                least = min(least, line[2] + line[0] * base[i, 0] + line[1] * base[i, 1])
        if least < 2.0 * (longest if wall else most):
            # a disc of huge radius stands beyond the line
            disc, away = discs[held], -(line[2] + HUGE * longest)
            disc[0], disc[1] = line[0] * away, line[1] * away
            disc[2], disc[3] = HUGE * longest, least
            held += 1
            cutting += 1 if wall and least < 0.0 else 0
    if held == walled:
        return flux
    across = axes[0, 0] ** 2 + axes[1, 0] ** 2
    more = points_flux(base, discs, held, lines, cutting, room)
    return (1.0 - across) * flux + across * more


# ------------------------------------------------------------------------------------------------
# The spheres themselves around the throats of a network, and which of them come near a place.
#
# A network stands on images, and at an x face on half ellipsoids in place of caps. The sections of
# throats that a fine bounds need the bodies that hold the fluid: every sphere once, where it is,
# with its images across periodic sides and its mirror images beyond the other faces.


class Solids(NamedTuple):
    """N spheres, sorted by size (S classes) and by the cells of a grid."""

    body: Array
    """(N, 4) centre and radius, m."""
    corner: Array
    """(S, 3) m, low corners of the cells."""
    edge: Array
    """(S,) m, of the cells."""
    shape: Array
    """(S, 4) number of cells along each axis, and where the first of them stands in `first`."""
    first: Array
    """The first sphere of each cell, and after the last cell of a size the end."""
    largest: Array
    """(S,) m, the largest radius."""


def solids_of(network: Network, low: Array, high: Array) -> Solids:
    """The spheres of a network and all images that reach between the corners (3,) m of a box."""
    position, radius = _spheres(network)
    parts, corner, edge, shape, first, largest = [], [], [], [], [], []
    before = sphere = 0
    for some in size_classes(radius):
        widest = float(radius[some].max())
        centre, owner = images_near(network, position[some], low, high, widest)
        across = float(np.ptp(centre, axis=0).max())
        # as many cells as spheres along a side, none of them narrower than a sphere
        wide = max(2.0 * widest, across / len(centre) ** (1.0 / 3.0))
        (start, width, number, begin), order = grid_of(centre, wide)
        parts.append(np.column_stack([centre, radius[some][owner]])[order])
        corner.append(start)
        edge.append(width)
        shape.append([*number, before])
        first.append(begin + sphere)
        largest.append(widest)
        before, sphere = before + len(begin), sphere + len(centre)
    return Solids(
        body=np.concatenate(parts),
        corner=np.array(corner),
        edge=np.array(edge),
        shape=np.array(shape, np.int64),
        first=np.concatenate(first).astype(np.int64),
        largest=np.array(largest),
    )


def _spheres(network: Network) -> tuple[Array, Array]:
    """Centres (n, 3) m, in the box but along x, and radii (n,) m of the spheres of a network."""
    image = np.unique(network.image_grain, return_index=True)[1]
    position, outward = network.image_position[image].copy(), network.image_outward[image]
    for axis in np.flatnonzero(~np.array(network.periodic)):
        low, high = network.box[axis]
        x = position[:, axis]
        beyond = np.sign((x > high).astype(float) - (x < low))
        position[:, axis] = np.where(
            beyond > 0, 2 * high - x, np.where(beyond < 0, 2 * low - x, x)
        )
        if axis == 0:
            outward = np.where(beyond == 0, outward, -outward)
    position[:, 0] += outward
    return position, own_radius(network, image)


@loops_inside
def set_near(x: float, y: float, z: float, reach: float, solids: Solids, near: Array) -> int:
    """Sets the spheres whose bodies come nearer than `reach` m to a place, and gives their number.

    `near` are indices of the bodies (N, 4) of `solids`; those beyond its length are not written.
    """
    body, corner, edge, shape = solids.body, solids.corner, solids.edge, solids.shape
    first, count = solids.first, 0
    for s in range(len(edge)):
        far = reach + solids.largest[s]
        i0, i1 = cells_between(x - far, x + far, corner[s, 0], edge[s], shape[s, 0])
        j0, j1 = cells_between(y - far, y + far, corner[s, 1], edge[s], shape[s, 1])
        k0, k1 = cells_between(z - far, z + far, corner[s, 2], edge[s], shape[s, 2])
        for i in range(i0, i1):
            for j in range(j0, j1):
                row = shape[s, 3] + (i * shape[s, 1] + j) * shape[s, 2]
                for b in range(first[row + k0], first[row + max(k1, k0)]):
                    dx, dy, dz = body[b, 0] - x, body[b, 1] - y, body[b, 2] - z
                    away = reach + body[b, 3]
                    if dx * dx + dy * dy + dz * dz < away * away:
                        if count < len(near):
                            near[count] = b
                        count += 1
    return count


# ------------------------------------------------------------------------------------------------
# Resistance of throats that a fine bounds.
#
# Where a fine and grains bound a throat, its sections are open on the side on which the fine has
# ended, and what holds the fluid there is whatever stands beyond the triangle: all discs that the
# section meets, side walls that hold the fluid, and planes of constant pressure.


NARROW = 0.1
"""Inscribed radius over longest edge below which the points are too few for a section: between
three equal discs they give 13 % too little at 0.10, 17 % too much at 0.12, and 1 % too little from
0.16 on."""
STEPS = 4
"""Steps in height between the facet and a node; with 8, k of slabs changes by 0.2 % on average."""
DIVISIONS = 6
"""Parts of each side of the triangle; their square is the number of points."""
REACH = 1.0
"""Spheres around a facet are those nearer to its centroid than this, in units of the distance of
its farthest corner, or than its farther node."""
ROOM = 64
"""Spheres around a facet for which there is room at first."""


def bounded_by_fines(network: Network) -> Array:
    """Whether throats (T,) have the sections of `bounded_resistances`.

    A fine is at one corner of them, and they are not `NARROW`. A bed of fines alone, such as a
    cake, is a pack like others and has none.
    """
    if network.image_fine.all():
        return np.zeros(len(network.throat_radius), bool)
    facet = network.image_position[network.throat_images]
    edge = np.linalg.norm(facet - np.roll(facet, 1, axis=1), axis=2).max(axis=1)
    fine = network.image_fine[network.throat_images].any(axis=1)
    return fine & (network.throat_radius > NARROW * edge)


def mixed_pores(network: Network) -> Array:
    """Whether polyhedra (G,), numbered as `pore_group`, are bounded by grains and by fines."""
    group = network.pore_group
    fine = network.image_fine[network.pore_images]
    count = int(group.max()) + 1
    some = np.bincount(group, weights=fine.any(axis=1), minlength=count) > 0
    grains = np.bincount(group, weights=~fine.all(axis=1), minlength=count) > 0
    return some & grains


class Bounded(NamedTuple):
    """K throats that a fine bounds, and the spheres around them."""

    base: Array
    """(K, 3, 2) m, corners of the facets in their own planes."""
    axes: Array
    """(K, 3, 3), axes of the facets as rows."""
    origin: Array
    """(K, 3) m, the first corners."""
    middle: Array
    """(K, 3) m, the centroids."""
    reach: Array
    """(K,) m, how far from there spheres count."""
    spans: Array
    """(K, 2, 2) m of `spans_of`."""
    whole: Array
    """(K,) whether all sections are wanted, not only those at the ends."""
    radius: Array
    """(K, 3) m, of the spheres at the corners."""


class NearRoom(NamedTuple):
    """Room for the spheres around a facet."""

    near: Array
    """(M,) their numbers."""
    local: Array
    """(M, 4) m, centres along the axes of the facet, and radii."""
    discs: Array
    """(M + `MOST_PLANES` + 3, 4) of `points_flux`."""
    side: Array
    """(3, 3) of `set_sides`."""
    lines: Array
    """(`MOST_PLANES`, 3) of `held_flux`."""


def near_room(most: int) -> NearRoom:
    """Room for `most` spheres."""
    return NearRoom(
        near=np.empty(most, np.int64),
        local=np.empty((most, 4)),
        discs=np.empty((most + MOST_PLANES + 3, 4)),
        side=np.empty((3, 3)),
        lines=np.empty((MOST_PLANES, 3)),
    )


def bounded_resistances(
    network: Network, throats: Array, whole: Array, heights: Array
) -> tuple[Array, Array]:
    """Resistance (K, 2) 1/m3 of the sides of `throats` (K,), and how narrow they are at the ends.

    The second is 1/a (K, 3) 1/m at both nodes and at the facet, where a is the radius of the round
    tube that carries as much; nan where the throat has no such section, or a closed one. A
    resistance is 0 where the throat has no side, and infinite where a section is closed. It is
    that of the `whole` (K,) throats alone. `heights` (K, 2) m are those of their nodes.
    """

    def around(part: slice) -> Bounded:
        some = throats[part]
        facet = network.image_position[network.throat_images[some]]
        facet, axes = turned_inside(network, facet, np.array(facet_axes(network, some, facet)))
        middle = facet.mean(axis=1)
        corner = np.linalg.norm(facet - middle[:, None], axis=2).max(axis=1)
        return Bounded(
            base=geometry.flat(facet),
            axes=np.ascontiguousarray(axes.transpose(1, 0, 2)),
            origin=facet[:, 0].copy(),
            middle=middle,
            reach=np.hypot(REACH * corner, np.maximum(heights[part].max(axis=1), 0.0)),
            spans=spans_of(heights[part], LENGTH_FLOOR * network.grain_radius),
            whole=whole[part],
            radius=network.throat_corner_radius[some],
        )

    # made twice, for those of all throats at once take more room than the network
    parts = [*geometry.slices(len(throats), THROATS)]
    boxes = [
        (
            (one.middle - one.reach[:, None]).min(axis=0),
            (one.middle + one.reach[:, None]).max(axis=0),
        )
        for one in map(around, parts)
    ]
    low, high = (
        np.min([box[0] for box in boxes], axis=0),
        np.max([box[1] for box in boxes], axis=0),
    )
    solids, planes = solids_of(network, low, high), planes_of(network)
    resistance, ends = np.zeros((len(throats), 2)), np.full((len(throats), 3), np.nan)

    def measure(part: slice) -> None:
        room, points = near_room(ROOM), point_room(DIVISIONS)
        some = around(part)
        flux = np.full((len(some.reach), 2, STEPS + 1), np.nan)
        t, wanted = 0, 0
        while t < len(flux):
            if wanted > len(room.near):
                room = near_room(2 * wanted)
            t, wanted = _set_bounded_fluxes(
                t, some, solids, planes, points, room, flux, ends[part]
            )
        row, side = np.nonzero(some.whole[:, None] & (some.spans[:, :, 1] > 0.0))
        span = some.spans[row, side]
        step = (span[:, 1] - span[:, 0]) / STEPS
        clear = np.ones(len(row))
        resistance[part][row, side] = resistance_of(flux[row, side], clear, step, OPEN_WIDENING)

    on_all_cores(measure, parts)
    return resistance, ends


@loops_in_place
def _set_bounded_fluxes(
    first: int,
    throats: Bounded,
    solids: Solids,
    planes: Array,
    points: PointRoom,
    room: NearRoom,
    flux: Array,
    ends: Array,
) -> tuple[int, int]:
    """Sets the `flux` (K, 2, n) m4 of throats from `first` on, and 1/a (K, 3) 1/m at their ends.

    Where there is no room for the spheres around a throat, it returns its number and theirs, else
    K and 0.
    """
    near, local = room.near, room.local
    for t in range(first, len(throats.reach)):
        x, y, z = throats.middle[t, 0], throats.middle[t, 1], throats.middle[t, 2]
        count = set_near(x, y, z, throats.reach[t], solids, near)
        if count > len(near):
            return t, count
        base, axes, origin = throats.base[t], throats.axes[t], throats.origin[t]
        for i in range(count):
            body = solids.body[near[i]]
            dx, dy, dz = body[0] - origin[0], body[1] - origin[1], body[2] - origin[2]
            for a in range(3):
                local[i, a] = axes[a, 0] * dx + axes[a, 1] * dy + axes[a, 2] * dz
            local[i, 3] = body[3]
        set_sides(base, room.side)
        at_facet = np.nan
        for side in range(2):
            low, high = throats.spans[t, side, 0], throats.spans[t, side, 1]
            if not high > 0.0:
                continue
            step, whole = (high - low) / STEPS, throats.whole[t]
            # the section at the facet stands for the node where the throat has one side alone
            begin = 0 if whole or not throats.spans[t, 1 - side, 1] > 0.0 else STEPS
            for k in range(begin, STEPS + 1, 1 if whole else STEPS):
                height = (2.0 * side - 1.0) * (low + k * step)
                if height == 0.0 and not np.isnan(at_facet):
                    flux[t, side, k] = at_facet
                    continue
                many = _meet(local, count, base, throats.radius[t], height, room)
                flux[t, side, k] = held_flux(
                    base, room.discs, many, planes, origin, axes, height, room.lines, points
                )
                at_facet = flux[t, side, k] if height == 0.0 else at_facet
            ends[t, side] = _narrowness(flux[t, side, STEPS])
        ends[t, 2] = _narrowness(at_facet)
    return len(throats.reach), 0


@loops_inside
def _narrowness(flux: float) -> float:
    """1/a 1/m of the round tube that carries the `flux` m4; nan if that is not positive."""
    return (8.0 / np.pi * flux) ** -0.25 if flux > 0.0 else np.nan


@loops_inside
def _meet(local: Array, count: int, base: Array, radius: Array, z: float, room: NearRoom) -> int:
    """Sets the discs of a section at `z` m, and gives their number.

    `base` are the corners and `radius` the radii of their spheres. A section that meets no sphere
    has discs of 1 % of these radii on its corners.
    """
    wide, many = 0.0, 0
    x, y = (base[0, 0] + base[1, 0] + base[2, 0]) / 3, (base[0, 1] + base[1, 1] + base[2, 1]) / 3
    for i in range(3):
        wide = max(wide, (base[i, 0] - x) ** 2 + (base[i, 1] - y) ** 2)
    wide = REACH * np.sqrt(wide)
    for i in range(count):
        square = local[i, 3] ** 2 - (local[i, 2] - z) ** 2
        if square > 0.0:
            own, px, py = np.sqrt(square), local[i, 0], local[i, 1]
            if (px - x) ** 2 + (py - y) ** 2 < (wide + own) ** 2:
                disc, outside = room.discs[many], -depth_within(base, room.side, px, py)
                disc[0], disc[1], disc[2], disc[3] = px, py, own, outside - own
                many += 1
    if many > 0:
        return many
    for i in range(3):
        disc = room.discs[i]
        disc[0], disc[1], disc[2], disc[3] = base[i, 0], base[i, 1], TIP * radius[i], 0.0
    return 3


# ------------------------------------------------------------------------------------------------
# Resistance of the throats between grains and fines.
#
# In a pore between grains and fines the throats are of very different width, and the fluid goes on
# spreading behind the node, from the section of a throat at the node to the width of the pore. Its
# sideways shear is that of a tube that widens (`lubrication`, dR = 8 / (pi a^4) (8/3)^(1/2) |da|).
# The fluid spreads along the grains at the corners of the throat, and hardly along fines, which
# end behind it. With g grains at the corners this adds
#
#     R = 0.6 g 8 / (3 pi) (8/3)^(1/2) (1 / a^3 - 1 / <a^3>)
#
# where that is positive. a is the radius of the round tube that carries as much as the section at
# the node, and < > the mean over the throats of the pore, weighted with their conductances. The
# number 0.6 is fitted to resolved flow (docs/evidence/accuracy.md).


SPREAD = 0.6
"""Share of that shear for each grain at the corners of a throat, fitted to resolved flow."""


def deposit_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the node on either side.

    As `half_resistances` gives it, for a network of grains and fines (`Network.image_fine`).
    """
    bounded, mixed = bounded_by_fines(network), mixed_pores(network)
    heights = nodes_of(network).heights
    halves = half_resistances(network, around=True, heights=heights, but=bounded)
    near = mixed[network.pore_group[network.throat_pores]].any(axis=1)
    throats = np.flatnonzero(bounded | (near & np.isfinite(halves.sum(axis=1))))
    if not len(throats):
        return halves
    own, ends = bounded_resistances(network, throats, bounded[throats], heights[throats])
    halves[bounded] = own[bounded[throats]]
    halves[throats] += node_resistances(network, throats, halves[throats], ends, mixed)
    return halves


def grain_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of the throats between grains.

    As `half_resistances` gives it. Spheres that lie mostly inside a grain, as those of a clump do,
    leave of their throats what fines in a corner leave, so there it is `deposit_resistances`.
    """
    return deposit_resistances(network) if network.image_fine.any() else half_resistances(network)


def node_resistances(
    network: Network, throats: Array, halves: Array, ends: Array, mixed: Array
) -> Array:
    """What spreading behind the nodes adds to the sides of `throats` (K,), (K, 2) 1/m3.

    Args:
        network: of grains and fines.
        throats: those that bound the mixed pores.
        halves: (K, 2) 1/m3, their resistances to the nodes.
        ends: (K, 3) 1/m, 1/a at both nodes and at the facet (`bounded_resistances`).
        mixed: (G,) whether the polyhedra are `mixed_pores`.
    """
    pores = network.pore_group[network.throat_pores[throats]]
    cube = np.where(np.isnan(ends[:, :2]), ends[:, 2:], ends[:, :2]) ** 3
    whole = halves.sum(axis=1, keepdims=True)
    real = np.isfinite(cube) & np.isfinite(whole) & (pores[:, :1] != pores[:, 1:])
    weight = np.where(real, 1.0 / whole, 0.0)
    total = np.bincount(pores.ravel(), weights=weight.ravel(), minlength=len(mixed))
    volume = np.divide(weight, cube, out=np.zeros(cube.shape), where=real)
    summed = np.bincount(pores.ravel(), weights=volume.ravel(), minlength=len(mixed))
    inverse = np.divide(total, summed, out=np.zeros(len(mixed)), where=summed > 0.0)
    excess = np.where(mixed[pores] & real, np.maximum(cube - inverse[pores], 0.0), 0.0)
    grains = np.sum(~network.image_fine[network.throat_images[throats]], axis=1)
    return SPREAD * grains[:, None] * 8.0 / (3.0 * np.pi) * np.sqrt(WIDENING) * excess
