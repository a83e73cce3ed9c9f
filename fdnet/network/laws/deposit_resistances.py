"""The resistance of a throat between spheres of any size, grains and fines alike.

The flow through a triangle among discs, summed over points.

A point belongs to the nearest rim, at the distance s from it. On the ray from the centre of that
disc, of radius rho, through the point the speed is largest midway to the next rim, at the distance
d from the centre, whichever disc that is and wherever it stands. The speed is the geometric mean
of those in an annulus without shear at d (Happel 1959, AIChE J. 5, 174) and between two plates,

    w0 = d^2 / 2 ln(r / rho) - (r^2 - rho^2) / 4,  w1 = s (2 (d - rho) - s) / 2,  r = rho + s.

Against finite elements the first is too large, most of all where a small disc stands among large
ones, and the second too small, most of all around small discs (docs/physics_network.md, section
8).
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import (
    compiled_for_loops,
    compiled_in_place,
    loops_in_place,
    on_all_cores,
)
from fdnet.network.fines.deposit import cells_between, grid_of, mirrored_images, size_classes
from fdnet.network.laws.cross_section import set_sides
from fdnet.network.laws.lubrication import THROATS, TIP, half_resistances, spans_of
from fdnet.network.laws.reaching_grains import depth_within, facet_axes, own_radius
from fdnet.network.laws.wedges import OPEN_WIDENING, WIDENING, log_of, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array, frozen, one_line


def parts_of_triangle(divisions: int) -> Array:
    """Weights (2, n) of the second and third corner at the centroids of equal parts of a triangle.

    They are the same seen from each of its corners.
    """
    rows = range(divisions)
    up = [((i + 1 / 3), (j + 1 / 3)) for i in rows for j in range(divisions - i)]
    down = [((i + 2 / 3), (j + 2 / 3)) for i in rows for j in range(divisions - i - 1)]
    return np.ascontiguousarray(np.transpose(up + down)) / divisions


@loops_in_place
def points_flux(
    base: Array,
    solid: tuple[Array, int],
    walls: tuple[Array, int],
    points: Array,
    lanes: Array,
) -> float:
    """Flux m4 of laplacian(w) = -1 through a triangle among the first discs of `solid`.

    Where a ray meets no line midway to another disc, the longest side is taken as the way to it.
    A wall that cuts the triangle is the mirror of what lies beyond it.

    Args:
        base: (3, 2) m, its corners.
        solid: (n, 4) m, centres, radii, and how far the rims at least are from the triangle; and
            how many of them count.
        walls: (n, 3) unit normal into the box and distance m from the origin, of the lines in
            which walls cut the section; and how many of them count.
        points: (2, p) of `parts_of_triangle`.
        lanes: (7, p) room.
    """
    discs, many = solid
    ex, ey = base[1, 0] - base[0, 0], base[1, 1] - base[0, 1]
    fx, fy = base[2, 0] - base[0, 0], base[2, 1] - base[0, 1]
    gx, gy = ex - fx, ey - fy
    longest = np.sqrt(max(ex * ex + ey * ey, fx * fx + fy * fy, gx * gx + gy * gy))
    x, y, least = lanes[0], lanes[1], lanes[2]
    number = len(x)
    for p in range(number):
        x[p] = base[0, 0] + points[0, p] * ex + points[1, p] * fx
        y[p] = base[0, 1] + points[0, p] * ey + points[1, p] * fy
        least[p] = np.inf
    for w in range(walls[1]):
        nx, ny, gap = walls[0][w, 0], walls[0][w, 1], walls[0][w, 2]
        for p in range(number):
            beyond = 2.0 * min(gap + nx * x[p] + ny * y[p], 0.0)
            x[p] -= beyond * nx
            y[p] -= beyond * ny
    _set_nearest_rims(discs, many, lanes)
    _set_midways(discs, many, longest, lanes)
    rho, way = lanes[5], lanes[6]
    total = 0.0
    for p in range(number):
        s = max(least[p], 0.0)
        r = rho[p] + s
        d = max(rho[p] + way[p], r)
        annulus = 0.5 * d * d * log_of(r / rho[p]) - 0.25 * (r * r - rho[p] * rho[p])
        plates = 0.5 * s * (2.0 * (d - rho[p]) - s)
        total += np.sqrt(max(annulus * plates, 0.0))
    return total * 0.5 * abs(ex * fy - ey * fx) / number


@loops_in_place
def _set_nearest_rims(discs: Array, many: int, lanes: Array) -> None:
    """Sets the distance of the nearest rim, and centre and radius of its disc, for each point."""
    x, y, least, nearest = lanes[0], lanes[1], lanes[2], lanes[6]
    farthest = np.inf
    for q in range(many):
        if discs[q, 3] >= farthest:
            continue
        qx, qy, radius, number = discs[q, 0], discs[q, 1], discs[q, 2], float(q)
        for p in range(len(x)):
            dx, dy = qx - x[p], qy - y[p]
            away = np.sqrt(dx * dx + dy * dy) - radius
            nearest[p] = number if away < least[p] else nearest[p]
            least[p] = min(away, least[p])
        farthest = 0.0
        for p in range(len(x)):
            farthest = max(farthest, least[p])
    for p in range(len(x)):
        q = int(nearest[p])
        lanes[3, p], lanes[4, p], lanes[5, p] = discs[q, 0], discs[q, 1], discs[q, 2]


@loops_in_place
def _set_midways(discs: Array, many: int, longest: float, lanes: Array) -> None:
    """Sets the way from the rim of a point's disc to the line midway to the next rim, d - rho.

    It is measured on the ray through the point. The directions of the rays take the place of the
    points. A disc whose rim is farther than twice this way from a point cannot end its ray.
    """
    ux, uy, least = lanes[0], lanes[1], lanes[2]
    own_x, own_y, rho, way = lanes[3], lanes[4], lanes[5], lanes[6]
    for p in range(len(ux)):
        r = rho[p] + least[p]
        ux[p] = (ux[p] - own_x[p]) / r
        uy[p] = (uy[p] - own_y[p]) / r
        way[p] = longest
    most = longest
    for q in range(many):
        if discs[q, 3] >= 2.0 * most:
            continue
        x, y, radius = discs[q, 0], discs[q, 1], discs[q, 2]
        for p in range(len(ux)):
            qx, qy, wider = x - own_x[p], y - own_y[p], radius - rho[p]
            below = qx * ux[p] + qy * uy[p] + wider
            half = 0.5 * (qx * qx + qy * qy - wider * wider)
            one = half / below - rho[p]
            way[p] = min(way[p], one if half > 0.0 and below > 0.0 else np.inf)
        most = 0.0
        for p in range(len(ux)):
            most = max(most, way[p])


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


@loops_in_place
def held_flux(
    section: tuple[Array, Array, Array, Array],
    solid: tuple[Array, int],
    where: tuple[Array, Array, Array, float],
) -> float:
    """Flux m4 of laplacian(w) = -1 through a section, among discs, walls and planes of pressure.

    Args:
        section: the corners (3, 2) m of the facet, points and lanes of `points_flux`, and room for
            `MOST_PLANES` lines.
        solid: as of `points_flux`, with room for `MOST_PLANES` more discs.
        where: the planes of `planes_of`, the first corner (3,) m of the facet, its axes (3, 3) as
            rows, and the height m of the section above it.
    """
    base, points, lanes, lines = section
    discs, many = solid
    planes, origin, axes, z = where
    longest = 0.0
    for i in range(3):
        longest = max(longest, abs(base[i, 0]), abs(base[i, 1]))
    held, cutting = many, 0
    for number in range(2, MOST_PLANES):
        line = lines[cutting]
        least = _set_line(line, planes[number], base, (origin, axes, z))
        if least < 2.0 * longest:
            _set_disc(discs[held], line, least, HUGE * longest)
            held += 1
            cutting += least < 0.0
    flux = points_flux(base, (discs, held), (lines, cutting), points, lanes)
    most, walled = 0.0, held
    for p in range(lanes.shape[1]):
        most = max(most, lanes[6, p])
    spare = lines[MOST_PLANES - 1]
    for number in range(2):
        least = _set_line(spare, planes[number], base, (origin, axes, z))
        if least < 2.0 * most:
            _set_disc(discs[held], spare, least, HUGE * longest)
            held += 1
    if held == walled:
        return flux
    across = axes[0, 0] ** 2 + axes[1, 0] ** 2
    more = points_flux(base, (discs, held), (lines, cutting), points, lanes)
    return (1.0 - across) * flux + across * more


@loops_in_place
def _set_line(line: Array, plane: Array, base: Array, where: tuple[Array, Array, float]) -> float:
    """Sets the line (3,), unit normal and distance m, in which a plane cuts a section.

    Returns its least distance m from the corners of the triangle, infinite where there is no line.
    """
    origin, axes, z = where
    axis, sense, place = int(plane[0]), plane[1], plane[2]
    ux, uy, uz = sense * axes[0, axis], sense * axes[1, axis], sense * axes[2, axis]
    square = ux * ux + uy * uy
    if np.isinf(place) or square <= SQUARE:
        return np.inf
    slope = np.sqrt(square)
    line[0], line[1] = ux / slope, uy / slope
    line[2] = (sense * (origin[axis] - place) + z * uz) / slope
    least = np.inf
    for i in range(3):
        least = min(least, line[2] + line[0] * base[i, 0] + line[1] * base[i, 1])
    return least


@loops_in_place
def _set_disc(disc: Array, line: Array, least: float, huge: float) -> None:
    """Sets the disc (4,) m of huge radius that stands beyond a line."""
    away = -(line[2] + huge)
    disc[0], disc[1], disc[2], disc[3] = line[0] * away, line[1] * away, huge, least


# ------------------------------------------------------------------------------------------------
# The spheres themselves around the throats of a network, and which of them come near a place.
#
# A network stands on images, and at an x face on half ellipsoids in place of caps. The sections of
# throats with fines (`fine_sections`) need the bodies that hold the fluid: every sphere once,
# where it is, with its images across periodic sides and its mirror images beyond the other faces.


Cells = tuple[Array, Array, Array, Array, Array]
"""Of each size of spheres (S): low corner (S, 3) m of its cells, their edge (S,) m, their number
(S, 4) along each axis and where the first of them stands in the next array; for each cell its
first sphere, and after the last cell of a size the end; and the largest radius (S,) m."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solids:
    """N spheres, sorted into cells by size and place.

    Attributes:
        body: (N, 4) centre and radius, m.
        cells: of the sizes.
    """

    body: Array
    cells: Cells

    __repr__ = one_line


def solids_of(network: Network, place: Array, reach: Array) -> Solids:
    """The spheres of a network and all images within `reach` (K,) m of places (K, 3) m."""
    position, radius = _spheres(network)
    low, high = (place - reach[:, None]).min(axis=0), (place + reach[:, None]).max(axis=0)
    parts, corner, edge, shape, first, largest = [], [], [], [], [], []
    before = sphere = 0
    for some in size_classes(radius):
        widest = float(radius[some].max())
        centre, owner = mirrored_images(network, position[some], low, high, widest)
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
        body=frozen(np.concatenate(parts)),
        cells=(
            np.array(corner),
            np.array(edge),
            np.array(shape, np.int64),
            np.concatenate(first).astype(np.int64),
            np.array(largest),
        ),
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


@compiled_in_place
def set_near(
    place: tuple[float, float, float], reach: float, solids: tuple[Array, Cells], near: Array
) -> int:
    """Sets the spheres whose bodies come nearer than `reach` m to a place, and gives their number.

    `near` are indices of the bodies (N, 4) of `solids`; those beyond its length are not written.
    """
    body, (corner, edge, shape, first, largest) = solids
    x, y, z = place
    count = 0
    for s in range(len(edge)):
        far = reach + largest[s]
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
# Where a fine and grains bound a throat, its sections (`lubrication`) are open on the side on
# which the fine has ended, and what holds the fluid there is whatever stands beyond the triangle.
# The flux through a section is that of `point_sections`, among all discs that it meets.
#
# Side walls that hold the fluid and planes of constant pressure hold it too (`held_sections`).


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
    """Whether throats (T,) have the sections of this module.

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


def fine_resistances(
    network: Network, throats: Array, whole: Array, heights: Array
) -> tuple[Array, Array]:
    """Resistance (K, 2) 1/m3 of the sides of `throats` (K,), and how narrow they are at the ends.

    The second is 1/a (K, 3) 1/m at both nodes and at the facet, where a is the radius of the round
    tube that carries as much; nan where the throat has no such section, or a closed one. A
    resistance is 0 where the throat has no side, and infinite where a section is closed. It is
    that of the `whole` (K,) throats alone. `heights` (K, 2) m are those of their nodes.
    """
    parts = list(geometry.slices(len(throats), THROATS))
    facets = [_facets(network, throats[part]) for part in parts]
    places = [
        _near_facets(facet, heights[part]) for (facet, _), part in zip(facets, parts, strict=True)
    ]
    middle, reach = np.concatenate([p[0] for p in places]), np.concatenate([p[1] for p in places])
    solids = solids_of(network, middle, reach)
    numbers = planes_of(network), LENGTH_FLOOR * network.grain_radius
    points = parts_of_triangle(DIVISIONS)
    out, ends = np.zeros((len(throats), 2)), np.full((len(throats), 3), np.nan)

    def measure(which: int) -> None:
        part, (facet, axes) = parts[which], facets[which]
        first, height = np.ascontiguousarray(facet[:, 0]), heights[part]
        _set_resistances(
            (geometry.flat(facet), axes, first, height, whole[part]),
            (solids.body, solids.cells, middle[part], reach[part]),
            (points, network.throat_corner_radius[throats[part]]),
            numbers,
            (out[part], ends[part]),
        )

    on_all_cores(measure, range(len(parts)))
    return out, ends


def _facets(network: Network, throats: Array) -> tuple[Array, Array]:
    """Corners (K, 3, 3) m of the facets of `throats` (K,), and their axes (3, K, 3)."""
    facet = network.image_position[network.throat_images[throats]]
    return turned_inside(network, facet, np.array(facet_axes(network, throats, facet)))


def _near_facets(facet: Array, heights: Array) -> tuple[Array, Array]:
    """Centroids (K, 3) m of facets (K, 3, 3) m, and how far (K,) m spheres count."""
    middle = facet.mean(axis=1)
    corner = np.linalg.norm(facet - middle[:, None], axis=2).max(axis=1)
    return middle, np.hypot(REACH * corner, np.maximum(heights.max(axis=1), 0.0))


@compiled_for_loops
def _set_resistances(
    throats: tuple[Array, Array, Array, Array, Array],
    solids: tuple[Array, Cells, Array, Array],
    shape: tuple[Array, Array],
    numbers: tuple[Array, float],
    out: tuple[Array, Array],
) -> None:
    """Sets the resistances (K, 2) 1/m3 and 1/a (K, 3) 1/m of `out`."""
    base, axes, origin, height, whole = throats
    body, cells, middle, reach = solids
    points, corner_radius = shape
    planes, floor = numbers
    resistance, ends = out
    near, local = np.empty(ROOM, np.int64), np.empty((ROOM, 4))
    discs, flux = np.empty((ROOM + MOST_PLANES + 3, 4)), np.empty(STEPS + 1)
    side_lines = np.empty((3, 3))
    lanes, lines = np.empty((7, points.shape[1])), np.empty((MOST_PLANES, 3))
    for t in range(len(base)):
        place = (middle[t, 0], middle[t, 1], middle[t, 2])
        count = set_near(place, reach[t], (body, cells), near)
        if count > len(near):
            near, local = np.empty(2 * count, np.int64), np.empty((2 * count, 4))
            discs = np.empty((2 * count + MOST_PLANES + 3, 4))
            count = set_near(place, reach[t], (body, cells), near)
        _measure(body, near[:count], origin[t], axes[:, t], local)
        spans = spans_of(height[t], floor)
        set_sides(base[t], side_lines)
        facet = (base[t], corner_radius[t], side_lines)
        facet_flux = np.nan
        for side in range(2):
            low, high, sense = spans[side]
            if not high > 0.0:
                continue
            step = (high - low) / STEPS
            # the section at the facet stands for the node where the throat has one side alone
            every = 1 if whole[t] else STEPS
            first = 0 if whole[t] or not spans[1 - side][1] > 0.0 else STEPS
            for k in range(first, STEPS + 1, every):
                z = sense * (low + k * step)
                if z == 0.0 and not np.isnan(facet_flux):
                    flux[k] = facet_flux
                    continue
                many = _meet(local, count, facet, z, discs)
                section = (base[t], points, lanes, lines)
                flux[k] = held_flux(section, (discs, many), (planes, origin[t], axes[:, t], z))
                facet_flux = flux[k] if z == 0.0 else facet_flux
            ends[t, side] = _narrowness(flux[STEPS])
            if whole[t]:
                resistance[t, side] = resistance_of(flux, (1.0, step, OPEN_WIDENING))
        ends[t, 2] = _narrowness(facet_flux)


@loops_in_place
def _narrowness(flux: float) -> float:
    """1/a 1/m of the round tube that carries the `flux` m4; nan if that is not positive."""
    return (8.0 / np.pi * flux) ** -0.25 if flux > 0.0 else np.nan


@loops_in_place
def _measure(body: Array, near: Array, origin: Array, axes: Array, local: Array) -> None:
    """Sets places and radii (N, 4) m of the bodies `near`, along the three `axes` of a facet."""
    for i in range(len(near)):
        dx = body[near[i], 0] - origin[0]
        dy = body[near[i], 1] - origin[1]
        dz = body[near[i], 2] - origin[2]
        for a in range(3):
            local[i, a] = axes[a, 0] * dx + axes[a, 1] * dy + axes[a, 2] * dz
        local[i, 3] = body[near[i], 3]


@loops_in_place
def _meet(
    local: Array, count: int, facet: tuple[Array, Array, Array], z: float, discs: Array
) -> int:
    """Sets the `discs` (n, 4) of a section at `z` m, and gives their number.

    They are x, y and radius, and how far the rim at least is from the triangle, m. `facet` are the
    corners, the radii of their spheres, and the sides of the triangle (`section_rays.set_sides`).
    A section that meets no sphere has discs of 1 % of these radii on its corners.
    """
    base, radius, side = facet
    wide = 0.0
    x, y = (base[0, 0] + base[1, 0] + base[2, 0]) / 3, (base[0, 1] + base[1, 1] + base[2, 1]) / 3
    for i in range(3):
        wide = max(wide, (base[i, 0] - x) ** 2 + (base[i, 1] - y) ** 2)
    wide, many = REACH * np.sqrt(wide), 0
    for i in range(count):
        square = local[i, 3] ** 2 - (local[i, 2] - z) ** 2
        if square > 0.0:
            disc, px, py = np.sqrt(square), local[i, 0], local[i, 1]
            if (px - x) ** 2 + (py - y) ** 2 < (wide + disc) ** 2:
                outside = -depth_within(base, side, px, py)
                discs[many] = px, py, disc, outside - disc
                many += 1
    if many == 0:
        for i in range(3):
            discs[i] = base[i, 0], base[i, 1], TIP * radius[i], 0.0
        many = 3
    return many


# ------------------------------------------------------------------------------------------------
# Resistance of the throats between grains and fines.
#
# Throats that a fine bounds have the sections of `fine_sections`, all others those of
# `lubrication`, narrowed by a fourth sphere and by those around. Both end at the nodes.
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
# number 0.6 is fitted to resolved flow (docs/accuracy.md).


SPREAD = 0.6
"""Share of that shear for each grain at the corners of a throat, fitted to resolved flow."""


def deposit_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the node on either side.

    As `half_resistances` gives it, for a network of grains and fines (`Network.image_fine`).
    """
    bounded, mixed = bounded_by_fines(network), mixed_pores(network)
    heights = nodes_of(network).heights
    halves = half_resistances(network, fourth=True, heights=heights, but=bounded)
    near = mixed[network.pore_group[network.throat_pores]].any(axis=1)
    throats = np.flatnonzero(bounded | (near & np.isfinite(halves.sum(axis=1))))
    if not len(throats):
        return halves
    own, ends = fine_resistances(network, throats, bounded[throats], heights[throats])
    halves[bounded] = own[bounded[throats]]
    halves[throats] += node_resistances(network, throats, halves[throats], (ends, mixed))
    return halves


def grain_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of the throats between grains.

    As `half_resistances` gives it. Spheres that lie mostly inside a grain, as those of a clump do,
    leave of their throats what fines in a corner leave, so there it is `deposit_resistances`.
    """
    return deposit_resistances(network) if network.image_fine.any() else half_resistances(network)


def node_resistances(
    network: Network, throats: Array, halves: Array, given: tuple[Array, Array]
) -> Array:
    """What spreading behind the nodes adds to the sides of `throats` (K,), (K, 2) 1/m3.

    Args:
        network: of grains and fines.
        throats: those that bound the mixed pores.
        halves: (K, 2) 1/m3, their resistances to the nodes.
        given: 1/a (K, 3) 1/m at both nodes and at the facet (`fine_resistances`), and whether the
            polyhedra (G,) are `mixed_pores`.
    """
    ends, mixed = given
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
