"""The directions in which places are measured from a facet."""

import numpy as np

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
