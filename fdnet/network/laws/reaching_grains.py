"""Grains that reach into the sections of a throat besides its own three.

The directions in which places are measured from a facet.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network import geometry
from fdnet.network.compiled import compiled, compiled_for_loops, loops_in_place
from fdnet.network.laws.cross_section import (
    RAYS,
    SWALLOWED,
    UNTOUCHED,
    CornerRoom,
    aim,
    corner_flux,
    corner_reaches,
    flux_on_rays,
    fourth_reaches,
    inwards,
    narrow,
    set_sides,
)
from fdnet.network.network import Network
from fdnet.network.tessellation.delaunay import along as inner
from fdnet.network.tessellation.delaunay import less, times
from fdnet.spheres.snapshot import Array, one_line


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
# The flow through such a section is multiplied by the share that the spheres around leave of it.
# Both fluxes are summed over rays (`section_rays`). Adding a solid never adds flow, so the share
# is at most 1.


NEAREST = 12
"""Spheres around a facet that are looked for among those of one size, to a factor of 2."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Around:
    """Spheres around the facets of K throats.

    Attributes:
        first: (K+1,) the first sphere of each throat, and their number at the end.
        image: (N,) index of the image in the network.
        place: (N, 3) m, along the first edge of the facet, across it towards the third corner,
            and height above the facet towards the second pore, of its centre from the first
            corner.
    """

    first: Array
    image: Array
    place: Array

    __repr__ = one_line


class Neighbourhood:
    """The images of a network, sorted by size and place."""

    def __init__(self, network: Network) -> None:
        self.network = network
        size = np.round(np.log2(network.image_radius / network.image_radius.min()))
        self._kinds = [np.nonzero(size == one)[0] for one in np.unique(size)]
        self._trees = [cKDTree(network.image_position[kind]) for kind in self._kinds]

    def near_facets(self, part: slice, heights: Array) -> Around:
        """The spheres around the throats `part` (K) that have sections beyond a sphere's reach.

        They are those nearer to the centroid of the facet than its farthest corner or node, which
        are `heights` (K, 2) m above it. The spheres of the facet are not among them.
        """
        network = self.network
        images = network.throat_images[part]
        low = np.minimum(network.image_radius, network.image_height)[images].min(axis=1)
        open_row = np.nonzero(low < np.abs(heights).max(axis=1))[0]
        facet = network.image_position[images[open_row]]
        middle = facet.mean(axis=1)
        corner = np.linalg.norm(facet - middle[:, None], axis=2).max(axis=1)
        reach = np.maximum(corner, np.abs(heights[open_row]).max(axis=1))
        row, image = self._nearest(middle, reach)
        own = np.any(image[:, None] == images[open_row][row], axis=1)
        order = np.argsort(row[~own], kind="stable")
        row, image = row[~own][order], image[~own][order]
        place = _from_facet(network, part, facet, (open_row, row, image))
        first = np.searchsorted(open_row[row], np.arange(len(images) + 1))
        return Around(first=first, image=image, place=place)

    def _nearest(self, middle: Array, reach: Array) -> tuple[Array, Array]:
        """Pairs of a row of `middle` (K, 3) m and an image whose body is within `reach` (K,)."""
        rows, images = [np.empty(0, int)], [np.empty(0, int)]
        for kind, tree in zip(self._kinds, self._trees, strict=True):
            radius = self.network.image_radius[kind]
            if not len(middle):
                break
            apart, closest = tree.query(
                middle,
                k=list(range(1, min(NEAREST, len(kind)) + 1)),
                distance_upper_bound=float(reach.max() + radius.max()),
            )
            row, column = np.nonzero(np.isfinite(apart))
            one = closest[row, column]
            near = apart[row, column] - radius[one] < reach[row]
            rows.append(row[near])
            images.append(kind[one[near]])
        return np.concatenate(rows), np.concatenate(images)


def _from_facet(
    network: Network, part: slice, facet: Array, of_row: tuple[Array, Array, Array]
) -> Array:
    """Places (N, 3) m of images from the first corner of their `facet` (K, 3, 3) m."""
    open_row, row, image = of_row
    axes = facet_axes(network, part.start + open_row, facet)
    apart = network.image_position[image] - facet[row, 0]
    return np.stack([geometry.dot(apart, one[row]) for one in axes], axis=1)


Bundles = tuple[Array, Array, Array, Array]
"""Rays (S, 6, 36) of discs (`section_rays.aim`), their numbers (S,) or -1 before they are aimed,
the farthest end (S,) m of each, and room for 36 numbers."""
Seen = tuple[Array, Array]
"""Numbers (S,) of the discs that a section meets, and x, y and radius (S, 3) m of them."""


@compiled
def bundles(most: int) -> tuple[Bundles, Seen]:
    """Room for the rays of `most` discs."""
    rays = np.empty((most, 6, 3 * RAYS)), np.full(most, -1), np.empty(most), np.empty(3 * RAYS)
    return rays, (np.empty(most, np.int64), np.empty((most, 3)))


@loops_in_place
def meet(disc: Array, base: Array, z: float, around: Array, seen: Seen) -> int:
    """Sets the discs that the section at the height `z` m meets, and gives their number.

    They are those of radius `disc` (3,) m on the corners `base` (3, 2) m, and those of the spheres
    `around` (N, 5): place (3) m, radius m and flatness (`lubrication`), heights as `z`.
    """
    which, place = seen
    for i in range(3):
        which[i] = i
        place[i] = base[i, 0], base[i, 1], disc[i]
    count = 3
    for i in range(len(around)):
        square = around[i, 3] ** 2 - around[i, 4] * (around[i, 2] - z) ** 2
        if square > 0.0:
            which[count] = 3 + i
            place[count] = around[i, 0], around[i, 1], np.sqrt(square)
            count += 1
    return count


@loops_in_place
def share_around(
    base: Array, side: Array, discs: tuple[int, Seen], bundle: Bundles, table: Array
) -> float:
    """Share of the flux through a section that the spheres around its facet leave, 0 to 1.

    Args:
        base: (3, 2) m, corners of the facet.
        side: what `section_rays.set_sides` sets for it.
        discs: how many discs the section meets, and which (`meet`).
        bundle: the rays of all discs of the facet, or room for them.
        table: the table of `shear_ratio`.
    """
    count, seen = discs
    if count == 3:
        return 1.0
    clear, left = 0.0, 0.0
    for number in range(count):
        own, one = _flux_of_disc(base, side, (number, count, seen), bundle, table)
        clear += own
        left += one
    return min(left / clear, 1.0) if clear > 0.0 else 1.0


@loops_in_place
def _flux_of_disc(
    base: Array, side: Array, discs: tuple[int, int, Seen], bundle: Bundles, table: Array
) -> tuple[float, float]:
    """Fluxes m4 on the rays of one disc: between the discs on the corners alone, and among all.

    The first is 0 for a disc that is not on a corner.
    """
    number, count, (which, place) = discs
    disc = (place[number, 0], place[number, 1], place[number, 2])
    slot = which[number]
    rays, room = bundle[0][slot], (bundle[3], table)
    many = _aimed(base, side, (slot, disc[0], disc[1]), bundle)
    longest, end, reach = bundle[2][slot], rays[2], rays[5]
    for p in range(many):
        reach[p] = end[p]
    clear, done = 0.0, UNTOUCHED
    for k in range(count):
        if k == 3 and number < 3:
            clear = flux_on_rays(rays, many, disc[2], room) if done != SWALLOWED else 0.0
            done = UNTOUCHED if done != SWALLOWED else SWALLOWED
        apart = np.sqrt((place[k, 0] - disc[0]) ** 2 + (place[k, 1] - disc[1]) ** 2)
        # the nearest point midway is on the line between the centres
        if k == number or done == SWALLOWED or apart - place[k, 2] + disc[2] >= 2.0 * longest:
            continue
        done = max(done, narrow(rays, many, disc, (place[k, 0], place[k, 1], place[k, 2])))
    if done == SWALLOWED:
        return clear, 0.0
    if done == UNTOUCHED and number < 3:
        return clear, clear
    return clear, flux_on_rays(rays, many, disc[2], room)


@loops_in_place
def _aimed(base: Array, side: Array, disc: tuple[int, float, float], bundle: Bundles) -> int:
    """The number of rays of a disc, which are aimed when they are first asked for."""
    rays, number, longest, _ = bundle
    i, x, y = disc
    if number[i] < 0:
        number[i] = aim(base, side, x, y, rays[i])
        longest[i] = 0.0
        for p in range(number[i]):
            longest[i] = max(longest[i], rays[i, 2, p])
    return number[i]


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
# both summed over rays (`section_rays`), M_cut with the discs of the grains themselves and
# M_corner with those on the corners. Only what lies in the triangle counts, as a ray begins where
# it enters.


LEAST = 1e-2
"""Smallest radius of the disc of a cut grain in a section, in radii of the grain."""

CutRoom = tuple[Array, Array, Array]
"""Room for the sides (3, 3) of a facet (`set_sides`), the rays (6, 36) of a disc, and for twice
three discs (2, 3, 3). Whoever uses it sets it first: its numbers do not last from call to call."""


@compiled
def cut_room() -> CutRoom:
    """Room for the discs of cut grains, for a fourth disc, or for discs of fines."""
    return np.empty((3, 3)), np.empty((6, 3 * RAYS)), np.empty((2, 3, 3))


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
def share_of_cut(
    base: Array, disc: Array, z: float, cut: Array, room: tuple[CutRoom, Array, Array]
) -> float:
    """Flux at the height `z` m with the discs of cut grains, over that with discs on the corners.

    Args:
        base: (3, 2) m, corners of the facet.
        disc: (3,) m, radii of the discs on them at this height.
        z: m above the facet, towards the second pore.
        cut: (3, 4) m of `cut_corners`.
        room: `CutRoom` and 36 numbers, which are written to, and the table of `shear_ratio`.
    """
    (side, _, places), _, _ = room
    own, moved = places[0], places[1]
    set_sides(base, side)
    for i in range(3):
        moved[i] = base[i, 0], base[i, 1], disc[i]
        own[i] = base[i, 0], base[i, 1], disc[i]
        if cut[i, 3] > 0.0:
            square = cut[i, 3] ** 2 - (z - cut[i, 2]) ** 2
            least = LEAST * cut[i, 3]
            if square > least * least:
                own[i] = base[i, 0] + cut[i, 0], base[i, 1] + cut[i, 1], np.sqrt(square)
            else:
                own[i, 2] = least
    corner = _flux_between(base, moved, room)
    return _flux_between(base, own, room) / corner if corner > 0.0 else 1.0


@loops_in_place
def _flux_between(base: Array, discs: Array, room: tuple[CutRoom, Array, Array]) -> float:
    """Flux m4 on the rays of three discs (3, 3), x, y and radius m, within the triangle."""
    (side, rays, _), part, table = room
    total = 0.0
    for i in range(3):
        disc = (discs[i, 0], discs[i, 1], discs[i, 2])
        count, done = aim(base, side, disc[0], disc[1], rays), UNTOUCHED
        for p in range(count):
            rays[5, p] = rays[2, p]
        for j in range(3):
            other = (discs[j, 0], discs[j, 1], discs[j, 2])
            if j != i and done != SWALLOWED:
                done = max(done, narrow(rays, count, disc, other))
        if done != SWALLOWED and count > 0:
            total += flux_on_rays(rays, count, disc[2], (part, table))
    return total


# ------------------------------------------------------------------------------------------------
# How much of the flow through a section a fourth grain leaves that reaches into it.
#
# The section of a throat has three grains on its corners. It may also be entered by the fourth
# grain of the tetrahedron on that side: by a large grain behind a small one, or by the mirror
# image of a grain near a face. Among equal grains this does not happen.
#
# The section is shared as in `cross_section`: each disc keeps what its rays see before a line
# midway to another rim or the far side of the triangle. The rays of the fourth disc run from where
# they enter the triangle to where they leave it or meet a line midway. Adding a solid never adds
# flow, so the share is at most 1.


def fourth_grains(network: Network, part: slice) -> tuple[Array, Array]:
    """The fourth grain of the tetrahedra on both sides of the throats `part` (K).

    Returns:
        image: (K, 2) index of its image in the network.
        place: (K, 2, 3) m, along the first edge of the facet, across it towards the third corner,
            and its height above the facet, of the centre of that image from the first corner.
    """
    pores = network.throat_pores[part]
    image, place = np.empty(pores.shape, int), np.empty((*pores.shape, 3))
    _find_fourth(
        (network.image_position, np.ptp(network.box, axis=1)),
        (network.throat_images[part], pores, network.throat_shift[part]),
        (network.pore_images, network.pore_wrap),
        (image, place),
    )
    return image, place


@compiled_for_loops
def _find_fourth(
    points: tuple[Array, Array],
    throats: tuple[Array, Array, Array],
    tetrahedra: tuple[Array, Array],
    out: tuple[Array, Array],
) -> None:
    """Sets the images and places of `fourth_grains`; the arguments are parts of the network.

    The fourth corner of a tetrahedron is the one farthest from the nearest corner of the facet.
    """
    position, size = points
    facets, pores, shift = throats
    vertex, wrap = tetrahedra
    image, place = out
    facet, apex, best = np.empty((3, 3)), np.empty(3), np.empty(3)
    for t in range(len(facets)):
        for k in range(3):
            for axis in range(3):
                turn = wrap[pores[t, 0], axis] * size[axis]
                facet[k, axis] = position[facets[t, k], axis] - turn
        for side in range(2):
            pore, farthest = pores[t, side], -1.0
            for corner in range(4):
                for axis in range(3):
                    turn = shift[t, axis] * side - wrap[pore, axis]
                    apex[axis] = position[vertex[pore, corner], axis] + turn * size[axis]
                nearest = np.inf
                for k in range(3):
                    square = 0.0
                    for axis in range(3):
                        square += (apex[axis] - facet[k, axis]) ** 2
                    nearest = min(nearest, square)
                if nearest > farthest:
                    farthest, image[t, side] = nearest, vertex[pore, corner]
                    best[:] = apex
            _set_place(facet, best, place[t, side])


@loops_in_place
def _set_place(facet: Array, apex: Array, place: Array) -> None:
    """Sets the `place` (3,) m of an apex (3,) m as `fourth_grains` gives it."""
    along, up = less(facet, 1, 0), less(facet, 2, 0)
    away = (apex[0] - facet[0, 0], apex[1] - facet[0, 1], apex[2] - facet[0, 2])
    long = np.sqrt(inner(along, along))
    normal = times(along, up)
    across = times(normal, along)
    wide = np.sqrt(inner(normal, normal))
    place[0] = inner(away, along) / long
    place[1] = inner(away, across) / (wide * long)
    place[2] = abs(inner(away, normal)) / wide


@loops_in_place
def share_left(
    disc: Array,
    fourth: tuple[float, float, float],
    corners: CornerRoom,
    rays: tuple[Array, int],
    more: tuple[Array, Array, Array],
) -> float:
    """Share of the flux through a triangle with discs that a fourth disc leaves, 0 to 1.

    Args:
        disc: (3,) m, the radii of the discs on the corners.
        fourth: the centre x, y and the radius m of the fourth disc.
        corners: the rays of the corners, aimed at the fourth disc (`aim_at_fourth`).
        rays: the rays (6, 36) of the fourth disc, and their number (`section_rays.aim`).
        more: the corners (3, 2) m, room for 36 numbers, and the table of `shear_ratio`.
    """
    own, count = rays
    base, room, table = more
    corner_reaches(corners, disc)
    clear = corner_flux(corners, disc, table)
    if not clear > 0.0:
        return 1.0
    fourth_reaches(corners, disc, fourth[2])
    left = corner_flux(corners, disc, table)
    end, reach = own[2], own[5]
    for p in range(count):
        reach[p] = end[p]
    done = UNTOUCHED
    for i in range(3):
        if done != SWALLOWED:
            done = narrow(own, count, fourth, (base[i, 0], base[i, 1], disc[i]))
    if done != SWALLOWED:
        left += flux_on_rays(own, count, fourth[2], (room, table))
    return min(left / clear, 1.0)


@loops_in_place
def depth_within(base: Array, side: Array, x: float, y: float) -> float:
    """How far m a place lies within a triangle, from the nearest side line; negative outside.

    A disc that is no larger than its place is far outside does not reach in.
    """
    return min(
        inwards(base, side, 0, x, y), inwards(base, side, 1, x, y), inwards(base, side, 2, x, y)
    )
