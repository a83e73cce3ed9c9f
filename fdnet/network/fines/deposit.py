"""What the fines fill of each pore and of each side of a throat, exact for every fine."""

import numpy as np
from scipy.spatial import cKDTree

from fdnet.network.fines.ball import fill_pieces
from fdnet.network.fines.cells import points_in_boxes
from fdnet.network.network import Network
from fdnet.spheres.images import make_images, wrapped
from fdnet.spheres.snapshot import Array, Snapshot

THIN_SIDE = 1e-6


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array, Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the fines inside each tetrahedron; of these, by volume, the mean volume
    (P,) m3 of a whole fine and the thickness (P,) m of the layer they make on the grains (0 without).

    Thickness: with y the distance of a fine's centre from the nearest grain, mean(y) + sqrt(5 variance(y) + r^2). That
    is 2 r for fines on the grains and 0.86 a for an even filling of a round tube of radius a.

    Counts the fines centred in the box, with their images across periodic sides and mirrored across the other faces
    (a pore cut by such a face is the whole mirrored tetrahedron); what fines hide of each other or of grains is not
    subtracted.
    """
    fines = fines.where(centred_inside(network, fines.position))
    distance = wall_distance(network, fines.position)
    value = np.stack(
        [4.0 / 3.0 * np.pi * fines.radius**3, distance, 5.0 * distance**2 + fines.radius**2],
        axis=1,
    )
    volume, surface, *sums = _filled(network, network.pore_corner, fines, value).T
    whole, mean, square = (total / np.where(volume > 0, volume, 1.0) for total in sums)
    return volume, surface, whole, mean + np.sqrt(np.maximum(square - 5.0 * mean**2, 0.0))


def deposit_on_sides(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """Volume (T, 2) m3 and surface (T, 2) m2 of the same fines inside the pyramids from each throat's facet to the
    power centres on either side; 0 for a centre on or behind the facet."""
    found = np.zeros((len(network.throat_pores), 2, 2))
    facet = network.throat_corner
    fines = fines.where(centred_inside(network, fines.position))
    for side in (0, 1):
        real = np.flatnonzero(network.throat_heights[:, side] > THIN_SIDE * network.grain_radius)
        apex = network.pore_power_centre[network.throat_pores[real, side]]
        if side == 1:
            apex = apex + network.throat_shift[real] * np.ptp(network.box, axis=1)
        corner = np.concatenate([apex[:, None], facet[real]], axis=1)
        found[real, side] = _filled(network, corner, fines, np.zeros((len(fines), 0)))
    return found[..., 0], found[..., 1]


def _filled(network: Network, corner: Array, fines: Snapshot, value: Array) -> Array:
    found = np.zeros((len(corner), 2 + value.shape[1]))
    if not len(fines) or not len(corner):
        return found
    corner = np.ascontiguousarray(corner)
    low, high = corner.min(axis=1), corner.max(axis=1)
    for fine in size_classes(fines.radius):
        radius, largest = fines.radius[fine], float(fines.radius[fine].max())
        place = fines.position[fine]
        position, owner = mirrored_images(
            network, place, low.min(axis=0), high.max(axis=0), largest
        )
        pairs = points_in_boxes(position, low - largest, high + largest)
        fill_pieces(
            corner,
            pairs,
            (position, radius[owner], np.ascontiguousarray(value[fine][owner])),
            found,
        )
    return found


def size_classes(radius: Array) -> list[Array]:
    """Indices of `radius` (N,) in classes within a factor of two, so that a few large fines do not widen the search
    for all."""
    step = np.floor(np.log2(radius / radius.min())).astype(int)
    return [np.flatnonzero(step == one) for one in np.unique(step)]


def wall_distance(network: Network, position: Array) -> Array:
    """Distance (N,) m of `position` (N, 3) from the nearest grain, negative inside it: more and more of the nearest
    centres are looked at, until no centre further away can have the nearer surface."""
    radius, count = network.image_radius, len(network.image_radius)
    tree, place = cKDTree(network.image_position), wrapped(position, network.box, network.periodic)
    found, left, near = np.empty(len(place)), np.arange(len(place)), 1
    while len(left):
        apart, grain = tree.query(place[left], k=np.arange(1, near + 1))
        found[left] = np.min(apart - radius[grain], axis=1)
        left = left[(apart[:, -1] - radius.max() < found[left]) & (near < count)]
        near = min(4 * near, count)
    return found


def centred_inside(network: Network, position: Array) -> Array:
    """True (N,) for `position` (N, 3) within the box along the axes that are not periodic."""
    low, high = network.box.T
    return np.all(((position >= low) & (position < high)) | np.array(network.periodic), axis=1)


def mirrored_images(
    network: Network, position: Array, low: Array, high: Array, largest: float
) -> tuple[Array, Array]:
    """Places (M, 3) and owners (M,) of all images, periodic or mirrored, within `largest` of [`low`, `high`] (3,) m.

    A centre on or beyond a face that is not periodic has no mirror image there.
    """
    margin = (
        np.maximum(np.maximum(network.box[:, 0] - low, high - network.box[:, 1]), 0.0) + largest
    )
    images = make_images(position, network.box, periodic=network.periodic, margin=margin, hair=0.0)
    return images.position, images.owner
