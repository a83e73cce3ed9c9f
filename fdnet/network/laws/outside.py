"""The spheres around the facet of a throat, for the sections that one of its spheres misses.

Among unequal spheres a power centre often lies farther from a facet than its smallest sphere
reaches. Sections between the two have no disc on that corner, so the triangle is open there: no
sphere of the facet holds the fluid on that side, but the spheres around it do. Without them the
throats of a light deposit of fine fines carry 2 to 16 times too much.

The flow through such a section is multiplied by the share that the spheres around leave of it.
Both fluxes are summed over rays (`section_rays`). Adding a solid never adds flow, so the share is
at most 1.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network import geometry
from fdnet.network.compiled import compiled
from fdnet.network.laws.section_rays import discs_flux
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

    def near_facets(self, part: slice) -> Around:
        """The spheres around the throats `part` (K) that have sections beyond a sphere's reach.

        They are those nearer to the centroid of the facet than its farthest corner or power
        centre. The spheres of the facet are not among them.
        """
        network = self.network
        images, heights = network.throat_images[part], network.throat_heights[part]
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
    along = facet[:, 1] - facet[:, 0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    normal = geometry.cross(along, facet[:, 2] - facet[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    across = geometry.cross(normal, along)
    pore = network.pore_images[network.throat_pores[part][open_row, 0]]
    away = geometry.dot(network.image_position[pore] - facet[:, :1], normal[:, None])
    apex = np.take_along_axis(away, np.argmax(np.abs(away), axis=1)[:, None], axis=1)
    normal *= -np.sign(apex)
    apart = network.image_position[image] - facet[row, 0]
    return np.stack([geometry.dot(apart, one[row]) for one in (along, across, normal)], axis=1)


@compiled
def share_around(
    base: Array, disc: Array, z: float, around: Array, room: tuple[Array, Array]
) -> float:
    """Share of the flux at the height `z` m that the spheres `around` a facet leave, 0 to 1.

    Args:
        base: (3, 2) m, corners of the facet.
        disc: (3,) m, radii of the discs on them at this height.
        z: m above the facet.
        around: (N, 5): place (3) m, radius m and flatness (`lubrication`), heights as `z`.
        room: at least N + 3 rows of three, which are written to, and the table of `shear_ratio`.
    """
    discs, table = room
    count = 3
    for i in range(3):
        discs[i] = base[i, 0], base[i, 1], disc[i]
    for i in range(len(around)):
        square = around[i, 3] ** 2 - around[i, 4] * (around[i, 2] - z) ** 2
        if square > 0.0:
            discs[count] = around[i, 0], around[i, 1], np.sqrt(square)
            count += 1
    if count == 3:
        return 1.0
    clear = discs_flux(base, discs, 3, table)
    if not clear > 0.0:
        return 1.0
    return min(discs_flux(base, discs, count, table) / clear, 1.0)
