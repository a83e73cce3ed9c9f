"""Volume and surface of fines within each pore's tetrahedron, exact for every fine."""

import numpy as np

from fdnet.network.ball import fill_pieces
from fdnet.network.cells import points_in_boxes
from fdnet.network.images import make_images
from fdnet.network.tessellation import Network
from fdnet.snapshot import Array, Snapshot


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the fines inside each tetrahedron.

    Counts the fines centred in the box, with their images across periodic sides and mirrored across the other faces
    (a pore cut by such a face is the whole mirrored tetrahedron); what fines hide of each other or of grains is not
    subtracted.
    """
    volume, surface = np.zeros(len(network.pore_share)), np.zeros(len(network.pore_share))
    fines = fines.where(centred_inside(network, fines.position))
    if len(fines):
        corner = np.ascontiguousarray(network.pore_corner)
        low, high = corner.min(axis=1), corner.max(axis=1)
        largest = float(fines.radius.max())
        position, owner = mirrored_images(network, fines.position, low.min(axis=0), high.max(axis=0), largest)
        pore, ball = points_in_boxes(position, low - largest, high + largest)
        fill_pieces(corner, pore, ball, position, fines.radius[owner], volume, surface)
    return volume, surface


def centred_inside(network: Network, position: Array) -> Array:
    """True (N,) for `position` (N, 3) within the box along the axes that are not periodic."""
    low, high = network.box.T
    return np.all(((position >= low) & (position < high)) | np.array(network.periodic), axis=1)


def mirrored_images(network: Network, position: Array, low: Array, high: Array, largest: float) -> tuple[Array, Array]:
    """Places (M, 3) and owners (M,) of all images, periodic or mirrored, within `largest` of [`low`, `high`] (3,) m.

    A centre on or beyond a face that is not periodic has no mirror image there.
    """
    margin = np.maximum(np.maximum(network.box[:, 0] - low, high - network.box[:, 1]), 0.0) + largest
    images = make_images(position, network.box, periodic=network.periodic, margin=margin, hair=0.0)
    return images.position, images.owner
