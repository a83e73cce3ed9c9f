"""Which fines reach into the box; their images, shifted or mirrored, beyond its faces."""

import numpy as np

from fdnet.network.network import Network
from fdnet.spheres.images import make_images
from fdnet.spheres.snapshot import Array, Snapshot


def centred_inside(network: Network, position: Array) -> Array:
    """True (N,) for `position` (N, 3) m within the box along the axes that are not periodic."""
    low, high = network.box.T
    return np.all(((position >= low) & (position < high)) | np.array(network.periodic), axis=1)


def reaching_inside(network: Network, fines: Snapshot) -> Array:
    """True (N,) for fines whose sphere reaches into the box along axes that are not periodic."""
    low, high = network.box.T
    reach = fines.radius[:, None]
    inside = (fines.position + reach > low) & (fines.position - reach < high)
    return np.all(inside | np.array(network.periodic), axis=1)


def periodic_images(
    network: Network, position: Array, low: Array, high: Array, largest: float
) -> tuple[Array, Array]:
    """Places (M, 3) m and owners (M,) of all images across the periodic sides, near a region.

    The region is [`low`, `high`] (3,) m, widened by `largest` m; `position` (N, 3) m.
    """
    margin = _margin(network, low, high, largest)
    images = make_images(
        position,
        network.box,
        periodic=network.periodic,
        margin=np.where(network.periodic, margin, np.nan),
        tolerance=0.0,
    )
    return images.position, images.owner


def mirrored_images(
    network: Network, position: Array, low: Array, high: Array, largest: float
) -> tuple[Array, Array]:
    """Places (M, 3) m and owners (M,) of all images, periodic or mirrored, near a region.

    The region is [`low`, `high`] (3,) m, widened by `largest` m. A centre (`position`, (N, 3) m)
    on or beyond a face that is not periodic has no mirror image there.
    """
    margin = _margin(network, low, high, largest)
    images = make_images(
        position, network.box, periodic=network.periodic, margin=margin, tolerance=0.0
    )
    return images.position, images.owner


def _margin(network: Network, low: Array, high: Array, largest: float) -> Array:
    """How far (3,) m the region [`low`, `high`], widened by `largest`, leaves the box."""
    beyond = np.maximum(network.box[:, 0] - low, high - network.box[:, 1])
    return np.maximum(beyond, 0.0) + largest
