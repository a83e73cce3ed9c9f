"""The frame of a facet, and the spheres around it that reach into the sections of its throat."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network import geometry
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


class SpheresBeside(NamedTuple):
    """Spheres near K throats, as seen from their facets."""

    first: Array  # (K+1,) the first sphere of each throat, and their number N at the end
    place: Array
    """(N, 5): m along the first edge of the facet, across it towards the third corner, and above
    it towards the second pore, from the first corner to the centre; the radius m, and 1."""


def sphere_trees(network: Network) -> list[tuple[Array, cKDTree]]:
    """The images of a network of one size, to a factor of 2, and where they are; size by size."""
    size = np.round(np.log2(network.image_radius / network.image_radius.min()))
    kinds = [np.nonzero(size == one)[0] for one in np.unique(size)]
    return [(kind, cKDTree(network.image_position[kind])) for kind in kinds]


NEAREST = 12  # Spheres around a facet that are looked for among those of one size


def with_open_sections(network: Network, part: slice, heights: Array) -> Array:
    """Those of the throats `part` (K) that have sections beyond a sphere's reach.

    `heights` (K, 2) m are those of their nodes above the facet.
    """
    least = (network.image_own_radius - np.abs(network.image_outward))[network.throat_images[part]]
    return np.flatnonzero(least.min(axis=1) < np.abs(heights).max(axis=1))


def spheres_around(
    network: Network, part: slice, rows: Array, heights: Array, trees: list[tuple[Array, cKDTree]]
) -> SpheresBeside:
    """The spheres around `rows` (R,) of the throats `part` (K).

    They are those nearer to the centroid of the facet than its farthest corner or node, which are
    `heights` (K, 2) m above it. The spheres of the facet are not among them. `trees` are those of
    `sphere_trees`.
    """
    images = network.throat_images[part]
    facet = network.image_position[images[rows]]
    middle = facet.mean(axis=1)
    corner = np.linalg.norm(facet - middle[:, None], axis=2).max(axis=1)
    reach = np.maximum(corner, np.abs(heights[rows]).max(axis=1))
    found, which = [np.empty(0, int)], [np.empty(0, int)]
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
        found.append(row[near])
        which.append(kind[one[near]])
    row, image = np.concatenate(found), np.concatenate(which)
    other = ~np.any(image[:, None] == images[rows][row], axis=1)
    order = np.argsort(row[other], kind="stable")
    row, image = row[other][order], image[other][order]
    axes = facet_axes(network, part.start + rows, facet)
    apart = network.image_position[image] - facet[row, 0]
    apart[:, 0] += network.image_outward[image]
    place = np.ones((len(row), 5))
    for k, one in enumerate(axes):
        place[:, k] = geometry.dot(apart, one[row])
    place[:, 3] = network.image_own_radius[image]
    return SpheresBeside(first=np.searchsorted(rows[row], np.arange(len(images) + 1)), place=place)
