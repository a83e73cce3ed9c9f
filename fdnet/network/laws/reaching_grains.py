"""Grains that reach into the sections of a throat besides its own three."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network import geometry
from fdnet.network.compiled import loops_in_place, loops_inside
from fdnet.network.laws.cross_section import (
    RAYS,
    SWALLOWED,
    UNTOUCHED,
    Sections,
    aim,
    end_midway,
    flux_on_rays,
    set_sides,
)
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array


def facet_axes(network: Network, throats: Array, facet: Array) -> tuple[Array, Array, Array]:
    """Unit vectors (K, 3) along the first edge of a facet, across it, and normal to it.

    The second points towards the third corner, the normal to the side of the second pore.

    Args:
        network: pores and throats.
        throats: (K,) numbers of the throats.
        facet: (K, 3, 3) m, their corners, at the places of the images.
    """
    along = facet[:, 1] - facet[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    normal = geometry.cross(along, facet[:, 2] - facet[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    across = geometry.cross(normal, along)
    first, second = (_apex(network, throats, facet[:, 0], normal, side) for side in (0, 1))
    # a flat tetrahedron lies on neither side, so the taller one decides
    upward = np.where(np.abs(first) > np.abs(second), -first, second)
    normal *= np.where(upward < 0.0, -1.0, 1.0)[:, None]
    return along, across, normal


def _apex(network: Network, throats: Array, origin: Array, normal: Array, side: int) -> Array:
    """Height (K,) m, along `normal` (K, 3), of the fourth corner of the tetrahedron on a side.

    `origin` (K, 3) m is the first corner of the facet, at the place of its image.
    """
    pores = network.throat_pores[throats]
    periods = network.pore_wrap[pores[:, 0]] - network.pore_wrap[pores[:, side]]
    periods = periods + side * network.throat_shift[throats]
    corner = network.image_position[network.pore_images[pores[:, side]]]
    away = corner + (periods * np.ptp(network.box, axis=1) - origin)[:, None]
    height = geometry.dot(away, normal[:, None])
    return np.take_along_axis(height, np.argmax(np.abs(height), axis=1)[:, None], axis=1)[:, 0]


# ------------------------------------------------------------------------------------------------
# The spheres around the facet of a throat, for the sections that one of its spheres misses.
#
# Among unequal spheres a node often lies farther from a facet than its smallest sphere reaches.
# Sections between the two have no disc on that corner, so the triangle is open there: no sphere of
# the facet holds the fluid on that side, but the spheres around it do. Without them the throats of
# a light deposit of fine fines carry 2 to 16 times too much.
#
# The flow through such a section is multiplied by the share that the spheres around leave of it,
# both summed over rays. Adding a solid never adds flow, so the share is at most 1.


class SpheresBeside(NamedTuple):
    """Spheres near K throats, as seen from their facets."""

    first: Array
    """(K+1,) the first sphere of each throat, and their number N at the end."""
    place: Array
    """(N, 5): m along the first edge of the facet, across it towards the third corner, and above
    it towards the second pore, from the first corner to the centre; the radius m, and the flatness
    (1 of a sphere)."""


def sphere_trees(network: Network) -> list[tuple[Array, cKDTree]]:
    """The images of a network of one size, to a factor of 2, and where they are; size by size."""
    size = np.round(np.log2(network.image_radius / network.image_radius.min()))
    kinds = [np.nonzero(size == one)[0] for one in np.unique(size)]
    return [(kind, cKDTree(network.image_position[kind])) for kind in kinds]


NEAREST = 12
"""Spheres around a facet that are looked for among those of one size."""


def spheres_around(
    network: Network, part: slice, heights: Array, trees: list[tuple[Array, cKDTree]]
) -> SpheresBeside:
    """The spheres around the throats `part` (K) that have sections beyond a sphere's reach.

    They are those nearer to the centroid of the facet than its farthest corner or node, which are
    `heights` (K, 2) m above it. The spheres of the facet are not among them. `trees` are those of
    `sphere_trees`.
    """
    images = network.throat_images[part]
    low = np.minimum(network.image_radius, network.image_height)[images].min(axis=1)
    open_row = np.nonzero(low < np.abs(heights).max(axis=1))[0]
    facet = network.image_position[images[open_row]]
    middle = facet.mean(axis=1)
    corner = np.linalg.norm(facet - middle[:, None], axis=2).max(axis=1)
    reach = np.maximum(corner, np.abs(heights[open_row]).max(axis=1))
    rows, which = [np.empty(0, int)], [np.empty(0, int)]
    for kind, tree in trees if len(middle) else []:
        radius = network.image_radius[kind]
        apart, closest = tree.query(
            middle,
            k=list(range(1, min(NEAREST, len(kind)) + 1)),
            distance_upper_bound=float(reach.max() + radius.max()),
        )
        row, column = np.nonzero(np.isfinite(apart))
        one = closest[row, column]
        near = apart[row, column] - radius[one] < reach[row]
        rows.append(row[near])
        which.append(kind[one[near]])
    row, image = np.concatenate(rows), np.concatenate(which)
    other = ~np.any(image[:, None] == images[open_row][row], axis=1)
    order = np.argsort(row[other], kind="stable")
    row, image = row[other][order], image[other][order]
    axes = facet_axes(network, part.start + open_row, facet)
    apart = network.image_position[image] - facet[row, 0]
    place = np.stack([geometry.dot(apart, one[row]) for one in axes], axis=1)
    radius, flatness = discs_of(network, image[:, None], facet[row])
    return SpheresBeside(
        first=np.searchsorted(open_row[row], np.arange(len(images) + 1)),
        place=np.concatenate([place, radius, flatness], axis=1),
    )


def discs_of(network: Network, images: Array, corner: Array) -> tuple[Array, Array]:
    """Radius (K, n) m of the discs of `images` (K, n) in the plane of a facet, and flatness.

    The radius at the height z above the facet is sqrt(radius^2 - flatness z^2); a sphere has the
    flatness 1. An ellipsoid of semi-axes h along x and a across reaches H above a plane whose
    normal makes the angle t with x, H^2 = (h cos t)^2 + (a sin t)^2, and shows ellipses of the
    area of a disc of radius sqrt(a^2 h / H (1 - z^2 / H^2)). `corner` (K, 3, 3) m is the facet.
    """
    radius, height = network.image_radius[images], network.image_height[images]
    flatness = np.ones(radius.shape)
    row, which = np.nonzero(height < radius)
    if len(row):
        normal = geometry.cross(corner[row, 1] - corner[row, 0], corner[row, 2] - corner[row, 0])
        cosine = normal[:, 0] ** 2 / geometry.dot(normal, normal)
        h, volume = height[row, which], radius[row, which] ** 3
        reach = np.sqrt(cosine * h**2 + (1.0 - cosine) * volume / h)
        radius[row, which] = np.sqrt(volume / reach)
        flatness[row, which] = volume / reach**3
    return radius, flatness


class RayRoom(NamedTuple):
    """Room for the rays of the discs that the sections of a throat meet, D at most."""

    side: Array
    """(3, 3) of `set_sides`."""
    rays: Array
    """(D, 6, 36) of `aim`."""
    number: Array
    """(D,) of rays of each disc; -1 before they are aimed."""
    longest: Array
    """(D,) m, the farthest end of the rays of each disc."""
    which: Array
    """(D,) the discs that a section meets."""
    disc: Array
    """(D, 3) m, their centres x and y, and radii."""
    part: Array
    """(36,) for `flux_on_rays`."""


def ray_room(most: int) -> RayRoom:
    """Room for the three grains of a throat and `most` spheres near it."""
    return RayRoom(
        side=np.empty((3, 3)),
        rays=np.empty((most + 3, 6, 3 * RAYS)),
        number=np.full(most + 3, -1),
        longest=np.empty(most + 3),
        which=np.empty(most + 3, np.int64),
        disc=np.empty((most + 3, 3)),
        part=np.empty(3 * RAYS),
    )


@loops_inside
def meet(disc: Array, base: Array, z: float, around: Array, room: RayRoom) -> int:
    """Sets the discs that the section at the height `z` m meets, and gives their number.

    They are those of radius `disc` (3,) m on the corners `base` (3, 2) m, and those of the spheres
    `around` (N, 5) of `SpheresBeside`.
    """
    for i in range(3):
        room.which[i] = i
        room.disc[i, 0], room.disc[i, 1], room.disc[i, 2] = base[i, 0], base[i, 1], disc[i]
    count = 3
    for i in range(len(around)):
        square = around[i, 3] ** 2 - around[i, 4] * (around[i, 2] - z) ** 2
        if square > 0.0:
            own = room.disc[count]
            room.which[count] = 3 + i
            own[0], own[1], own[2] = around[i, 0], around[i, 1], np.sqrt(square)
            count += 1
    return count


@loops_inside
def share_around(base: Array, count: int, room: RayRoom, table: Array) -> float:
    """Share of the flux through a section that the spheres around its facet leave, 0 to 1.

    `base` (3, 2) m are the corners of the facet, whose sides are set, and `count` is how many
    discs the section meets (`meet`). Of each disc two fluxes on its rays are summed: between the
    discs on the corners alone, for the first three, and among all.
    """
    if count == 3:
        return 1.0
    clear, left = 0.0, 0.0
    for number in range(count):
        x, y, radius = room.disc[number, 0], room.disc[number, 1], room.disc[number, 2]
        slot = room.which[number]
        rays = room.rays[slot]
        if room.number[slot] < 0:
            room.number[slot] = aim(base, room.side, x, y, rays)
            room.longest[slot] = 0.0
            for p in range(room.number[slot]):
                room.longest[slot] = max(room.longest[slot], rays[2, p])
        many, longest, end, reach = room.number[slot], room.longest[slot], rays[2], rays[5]
        for p in range(many):
            reach[p] = end[p]
        own, done = 0.0, UNTOUCHED
        for k in range(count):
            if k == 3 and number < 3 and done != SWALLOWED:
                own = flux_on_rays(rays, many, radius, room.part, table)
                done = UNTOUCHED
            qx, qy, other = room.disc[k, 0], room.disc[k, 1], room.disc[k, 2]
            apart = np.sqrt((qx - x) ** 2 + (qy - y) ** 2)
            # the nearest point midway is on the line between the centres
            if k == number or done == SWALLOWED or apart - other + radius >= 2.0 * longest:
                continue
            done = max(done, end_midway(rays, many, x, y, radius, qx, qy, other))
        clear += own
        if done == UNTOUCHED and number < 3:
            left += own
        elif done != SWALLOWED:
            left += flux_on_rays(rays, many, radius, room.part, table)
    return min(left / clear, 1.0) if clear > 0.0 else 1.0


@loops_in_place
def narrow_fluxes(
    sections: Sections,
    base: Array,
    square: Array,
    flatness: Array,
    around: SpheresBeside,
    table: Array,
    room: RayRoom,
    flux: Array,
) -> None:
    """Multiplies the `flux` (S, n) of sections beyond a sphere by what the spheres around leave.

    Args:
        sections: of the sides.
        base: (K, 3, 2) m, corners of the facets.
        square: (K, 3) m2, of the radii of the discs in them.
        flatness: (K, 3) of these.
        around: of `spheres_around`.
        table: the table of `shear_ratio`.
        room: for so many spheres around a throat as there are at most.
        flux: of the sections among the grains on the corners.
    """
    before = -1
    for s in range(len(flux)):
        t = sections.throat[s]
        spheres = around.place[around.first[t] : around.first[t + 1]]
        if not len(spheres):
            continue
        if t != before:
            before = t
            set_sides(base[t], room.side)
            for i in range(len(spheres) + 3):
                room.number[i] = -1
        for k in range(flux.shape[1]):
            z, beyond = sections.low[s] + k * sections.step[s], False
            for i in range(3):
                beyond = beyond or square[t, i] - flatness[t, i] * z * z <= 0.0
            if beyond and flux[s, k] > 0.0:
                z *= 2.0 * sections.side[s] - 1.0
                count = meet(sections.disc[s, :, k], base[t], z, spheres, room)
                flux[s, k] *= share_around(base[t], count, room, table)


# ------------------------------------------------------------------------------------------------
# Sections of throats at a pressure plane, with the discs of the grains that the plane cuts.
#
# Of a grain centred beyond an x face the pack has a cap. The tessellation has a half sphere or
# half ellipsoid on the face in its place, whose section is a disc on the corner of the throat.
# What the section really meets is the disc of the grain itself, centred beyond the corner. The
# flux of the section with the discs on its corners is multiplied by
#
#     M_cut / M_corner,
#
# both summed over rays, M_cut with the discs of the grains themselves and M_corner with those on
# the corners. Only what lies in the triangle counts, as a ray begins where it enters.


LEAST = 1e-2
"""Smallest radius of the disc of a cut grain in a section, in radii of the grain."""


def cut_corners(network: Network, part: slice, facet: Array) -> Array:
    """Where the grains themselves lie whose caps are corners of the throats `part` (K).

    `facet` (K, 3, 3) m are the corners. The result (K, 3, 4) m holds, for each corner, the way
    from it to the centre of the grain: along the first edge of the facet, across it and above it,
    towards the second pore; then the radius of the grain. Grains that no face cuts so have 0.
    """
    images = network.throat_images[part]
    outward = network.image_outward[images]
    cut = np.zeros((*images.shape, 4))
    row = np.flatnonzero(np.any(outward != 0.0, axis=1))
    if len(row):
        axes = facet_axes(network, part.start + row, facet[row])
        for i, axis in enumerate(axes):
            cut[row, :, i] = outward[row] * axis[:, :1]
        cut[row, :, 3] = np.where(outward[row] != 0.0, own_radius(network, images[row]), 0.0)
    return cut


def own_radius(network: Network, images: Array) -> Array:
    """Radius (...) m of the grains themselves that `images` (...) are, those of caps included."""
    radius, outward = network.image_radius[images], network.image_outward[images]
    # a half ellipsoid of semi-axes h and a has the volume of a half sphere of r^3 = a^2 h
    base = radius**3 / network.image_height[images]
    return np.where(outward != 0.0, np.sqrt(base + outward**2), radius)


@loops_in_place
def cut_fluxes(
    rows: Array,
    sections: Sections,
    base: Array,
    cut: Array,
    table: Array,
    room: RayRoom,
    discs: Array,
    flux: Array,
) -> None:
    """Multiplies the `flux` (S, n) of the sides `rows` by M_cut / M_corner.

    `cut` (K, 3, 4) m is of `cut_corners`, `discs` (2, 3, 3) is written to; the others are as in
    `disc_fluxes`.
    """
    for s in rows:
        t = sections.throat[s]
        for k in range(flux.shape[1]):
            z = (2.0 * sections.side[s] - 1.0) * (sections.low[s] + k * sections.step[s])
            disc = sections.disc[s, :, k]
            flux[s, k] *= share_of_cut(base[t], disc, z, cut[t], discs, room, table)


@loops_inside
def share_of_cut(
    base: Array,
    disc: Array,
    z: float,
    cut: Array,
    discs: Array,
    room: RayRoom,
    table: Array,
) -> float:
    """Flux at the height `z` m with the discs of cut grains, over that with discs on the corners.

    Args:
        base: (3, 2) m, corners of the facet.
        disc: (3,) m, radii of the discs on them at this height.
        z: m above the facet, towards the second pore.
        cut: (3, 4) m of `cut_corners`.
        discs: (2, 3, 3), room for twice three discs.
        room: for the rays of a disc.
        table: the table of `shear_ratio`.
    """
    own, moved = discs[0], discs[1]
    set_sides(base, room.side)
    for i in range(3):
        x, y, radius = base[i, 0], base[i, 1], disc[i]
        moved[i, 0], moved[i, 1], moved[i, 2] = x, y, radius
        if cut[i, 3] > 0.0:
            square = cut[i, 3] ** 2 - (z - cut[i, 2]) ** 2
            radius = LEAST * cut[i, 3]
            if square > radius * radius:
                x, y, radius = x + cut[i, 0], y + cut[i, 1], np.sqrt(square)
        own[i, 0], own[i, 1], own[i, 2] = x, y, radius
    corner = _flux_between(base, moved, room, table)
    return _flux_between(base, own, room, table) / corner if corner > 0.0 else 1.0


@loops_inside
def _flux_between(base: Array, discs: Array, room: RayRoom, table: Array) -> float:
    """Flux m4 on the rays of three discs (3, 3), x, y and radius m, within the triangle."""
    rays, total = room.rays[0], 0.0
    for i in range(3):
        x, y, radius = discs[i, 0], discs[i, 1], discs[i, 2]
        count, done = aim(base, room.side, x, y, rays), UNTOUCHED
        for p in range(count):
            rays[5, p] = rays[2, p]
        for j in range(3):
            if j != i and done != SWALLOWED:
                qx, qy, other = discs[j, 0], discs[j, 1], discs[j, 2]
                done = max(done, end_midway(rays, count, x, y, radius, qx, qy, other))
        if done != SWALLOWED and count > 0:
            total += flux_on_rays(rays, count, radius, room.part, table)
    return total
