"""Resistance of throats that a fine bounds.

Where a fine and grains bound a throat, its sections (`lubrication`) are open on the side on which
the fine has ended, and what holds the fluid there is whatever stands beyond the triangle. The
flux through a section is that of `point_sections`, among all discs that it meets.

Side walls that hold the fluid and planes of constant pressure hold it too (`held_sections`).
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled_for_loops, loops_in_place
from fdnet.network.cores import on_all_cores
from fdnet.network.laws.facet_axes import facet_axes
from fdnet.network.laws.fourth_grain import depth_within
from fdnet.network.laws.held_sections import MOST_PLANES, held_flux, planes_of, turned_inside
from fdnet.network.laws.lubrication import THROATS, spans_of
from fdnet.network.laws.open_sections import TIP
from fdnet.network.laws.point_sections import parts_of_triangle
from fdnet.network.laws.section_rays import set_sides
from fdnet.network.laws.solids import Cells, set_near, solids_of
from fdnet.network.laws.tube import OPEN_WIDENING, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.spheres.snapshot import Array

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
