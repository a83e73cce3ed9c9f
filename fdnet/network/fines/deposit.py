"""What the fines fill of each pore and of each side of a throat, exact for every fine."""

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network.fines.ball import fill_pieces
from fdnet.network.fines.fine_images import periodic_images
from fdnet.network.fines.inside import clip_to_box
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.network import Network
from fdnet.spheres.images import wrapped
from fdnet.spheres.snapshot import Array, Snapshot

THIN_SIDE = 1e-6
"""A side of a throat of less height, in mean grain radii, holds no fines."""


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array, Array, Array]:
    """What `fines`, each reaching into the box, fill of each tetrahedron.

    Only what lies inside the box counts, with the images across periodic sides. A pore that a
    mirrored face cuts stands for the whole mirrored tetrahedron, so what the part inside holds is
    divided by the share inside (`Network.pore_share`); this is exact for all pores of one
    `pore_group` together. What fines hide of each other or of grains is not subtracted.

    The thickness of the layer is mean(y) + sqrt(5 variance(y) + r^2), with y the distance of the
    centre of a fine from the nearest grain and r its radius. That is 2 r for fines on the grains
    and 0.86 a for an even filling of a round tube of radius a.

    Returns:
        Volume (P,) m3 and surface (P,) m2 of the fines inside; of these fines, weighted by volume,
        the mean volume (P,) m3 of a whole fine, and the thickness (P,) m of the layer that they
        make on the grains, both of the whole `pore_group`. All are 0 without fines.
    """
    distance = wall_distance(network, fines.position)
    value = np.stack(
        [4.0 / 3.0 * np.pi * fines.radius**3, distance, 5.0 * distance**2 + fines.radius**2],
        axis=1,
    )
    inside = _filled(network, network.pore_corner, fines, value)
    return _means_in_pores(network, (inside / network.pore_share[:, None]).T)


def _means_in_pores(network: Network, sums: Array) -> tuple[Array, Array, Array, Array]:
    """What `deposit_in_pores` returns, of the sums (5, P) over the fines in each pore.

    They are the volume and the surface; then volume times that of the whole fine, times its
    distance y from the nearest grain, times 5 y^2 + r^2.
    """
    volume, surface, *others = sums
    held, *others = (
        np.bincount(network.pore_group, one)[network.pore_group] for one in (volume, *others)
    )
    whole, mean, square = (total / np.where(held > 0, held, 1.0) for total in others)
    return volume, surface, whole, mean + np.sqrt(np.maximum(square - 5.0 * mean**2, 0.0))


def deposit_on_sides(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """What `fines`, each reaching into the box, fill of the two sides of each throat.

    A side is the pyramid from the facet to the power centre of a pore. Where that centre lies
    behind the facet, the pyramid is subtracted, as are its void and surface in `side_voids`: with
    the signs, the sides of all facets of a pack fill space once.

    Returns:
        Volume (T, 2) m3 and surface (T, 2) m2 of the fines in the sides of the first and second
        pore; 0 where the power centre lies on the facet, negative where it lies behind.
    """
    filled = np.zeros((len(network.throat_pores), 2, 2))
    for side in (0, 1):
        real, corner = _side_corners(network, side)
        height = network.throat_heights[:, side]
        inside = _filled(network, corner, fines, np.zeros((len(fines), 0)))
        signed_share = np.copysign(network.throat_share[real], height[real])
        filled[real, side] = inside / signed_share[:, None]
    return filled[..., 0], filled[..., 1]


def _side_corners(network: Network, side: int) -> tuple[Array, Array]:
    """Throats (R,) whose side 0 or 1 is no sliver, and the corners (R, 4, 3) m of these sides."""
    height = network.throat_heights[:, side]
    real = np.flatnonzero(np.abs(height) > THIN_SIDE * network.grain_radius)
    apex = network.pore_power_centre[network.throat_pores[real, side]]
    if side == 1:
        apex = apex + network.throat_shift[real] * np.ptp(network.box, axis=1)
    return real, np.concatenate([apex[:, None], network.throat_corner[real]], axis=1)


def _filled(network: Network, corner: Array, fines: Snapshot, value: Array) -> Array:
    """Volume m3, surface m2 and volume times each value of the fines in tetrahedra: (C, 2 + W).

    Only what lies inside the box is counted. The tetrahedra have the corners `corner` (C, 4, 3) m;
    `value` (N, W) belongs to the fines.
    """
    total = np.zeros((len(corner), 2 + value.shape[1]))
    if not len(fines):
        return total
    piece, owner = clip_to_box(corner, network.box, network.periodic)
    if not len(piece):
        return total
    piece = np.ascontiguousarray(piece)
    filled = np.zeros((len(piece), total.shape[1]))
    low, high = piece.min(axis=1), piece.max(axis=1)
    for fine in size_classes(fines.radius):
        radius, largest = fines.radius[fine], float(fines.radius[fine].max())
        position, image = periodic_images(
            network, fines.position[fine], low.min(axis=0), high.max(axis=0), largest
        )
        pairs = points_in_boxes(position, low - largest, high + largest)
        balls = (position, radius[image], np.ascontiguousarray(value[fine][image]))
        fill_pieces(piece, pairs, balls, filled)
    np.add.at(total, owner, filled)
    return total


def size_classes(radius: Array) -> list[Array]:
    """Indices of `radius` (N,) m in classes within a factor of two.

    A few large fines then do not widen the search for all.
    """
    step = np.floor(np.log2(radius / radius.min())).astype(int)
    return [np.flatnonzero(step == one) for one in np.unique(step)]


def wall_distance(network: Network, position: Array) -> Array:
    """Distance (N,) m of `position` (N, 3) m from the nearest grain, negative inside it.

    More and more of the nearest centres are examined, until no centre further away can have the
    nearer surface.
    """
    radius, count = network.image_radius, len(network.image_radius)
    tree, place = cKDTree(network.image_position), wrapped(position, network.box, network.periodic)
    distance, left, near = np.empty(len(place)), np.arange(len(place)), 1
    while len(left):
        apart, grain = tree.query(place[left], k=np.arange(1, near + 1))
        distance[left] = np.min(apart - radius[grain], axis=1)
        left = left[(apart[:, -1] - radius.max() < distance[left]) & (near < count)]
        near = min(4 * near, count)
    return distance
