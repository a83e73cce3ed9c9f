"""What the fines fill of each pore, exact for every fine."""

import numpy as np

from fdnet.network.fines.ball import pieces
from fdnet.network.fines.fine_images import periodic_images
from fdnet.network.fines.inside import clip_to_box
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, Snapshot


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """What `fines`, each reaching into the box, fill of each tetrahedron.

    Only what lies inside the box counts, with the images across periodic sides. A pore that a
    mirrored face cuts stands for the whole mirrored tetrahedron, so what the part inside holds is
    divided by the share inside (`Network.pore_share`); this is exact for all pores of one
    `pore_group` together. What fines hide of each other or of grains is not subtracted.

    Returns:
        Volume (P,) m3 and surface (P,) m2 of the fines inside.
    """
    corner = network.pore_corner
    total = np.zeros((len(corner), 2))
    piece, owner = clip_to_box(corner, network.box, network.periodic)
    if len(fines) and len(piece):
        piece = np.ascontiguousarray(piece)
        filled = np.zeros((len(piece), 2))
        low, high = piece.min(axis=1), piece.max(axis=1)
        for fine in size_classes(fines.radius):
            radius, largest = fines.radius[fine], float(fines.radius[fine].max())
            position, image = periodic_images(
                network, fines.position[fine], low.min(axis=0), high.max(axis=0), largest
            )
            pairs = points_in_boxes(position, low - largest, high + largest)
            np.add.at(filled, pairs[0], pieces(piece, pairs, position, radius[image]))
        np.add.at(total, owner, filled)
    volume, surface = (total / network.pore_share[:, None]).T
    return volume, surface


def size_classes(radius: Array) -> list[Array]:
    """Indices of `radius` (N,) m in classes within a factor of two.

    A few large fines then do not widen the search for all.
    """
    step = np.floor(np.log2(radius / radius.min())).astype(int)
    return [np.flatnonzero(step == one) for one in np.unique(step)]
