"""The spheres around the facet of a throat, for the sections that one of its spheres misses.

Among unequal spheres a node often lies farther from a facet than its smallest sphere reaches.
Sections between the two have no disc on that corner, so the triangle is open there: no sphere of
the facet holds the fluid on that side, but the spheres around it do. Without them the throats of a
light deposit of fine fines carry 2 to 16 times too much.

The flow through such a section is multiplied by the share that the spheres around leave of it.
Both fluxes are summed over rays (`section_rays`). Adding a solid never adds flow, so the share is
at most 1.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network import geometry
from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.laws.facet_axes import facet_axes
from fdnet.network.laws.section_rays import (
    RAYS,
    SWALLOWED,
    UNTOUCHED,
    aim,
    flux_on_rays,
    narrow,
)
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

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
