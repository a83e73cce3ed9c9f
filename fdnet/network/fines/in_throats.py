"""What fines fill of the throats; a throat here is a cylinder between the places of its pores."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fdnet.network.fines.cylinder import OVERLAPS, Pairs, covers_section, place_by_axis
from fdnet.network.fines.fine_images import mirrored_images, reaching_inside
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FinesInThroats:
    """Pairs (K) of a throat and a fine, or an image of it, that share volume.

    Attributes:
        throat: (K,) index of the throat.
        fine: (K,) index of the fine.
        pairs: place and size of the fine relative to the cylinder.
        volume: (K,) m3 of the fine in the cylinder.
        blocked: (T,) whether one fine covers a whole cross-section of the throat.
    """

    throat: Array
    fine: Array
    pairs: Pairs
    volume: Array
    blocked: Array

    __repr__ = one_line


def fines_in_throats(
    network: Network, fines: Snapshot, overlap: str | Callable[[Pairs], Array]
) -> FinesInThroats:
    """Fines in the cylinder of each throat's inscribed radius (Shi 2011, section 3.2.2).

    `overlap` is a key of `OVERLAPS`, or a function that gives the common volumes (K,) m3 of pairs.
    Throats see the fines whose sphere reaches into the box, and their images.
    """
    throat, fine, pairs = _touching_pairs(network, fines)
    volume = OVERLAPS[overlap](pairs) if isinstance(overlap, str) else overlap(pairs)
    blocked = np.zeros(len(network.throat_radius), bool)
    blocked[throat[covers_section(pairs)]] = True
    use = volume > 0
    return FinesInThroats(
        throat=throat[use],
        fine=fine[use],
        pairs=pairs.where(use),
        volume=volume[use],
        blocked=blocked,
    )


def _touching_pairs(network: Network, fines: Snapshot) -> tuple[Array, Array, Pairs]:
    """Throat and fine (K,) of the pairs that touch, with their relative places."""
    index = np.flatnonzero(reaching_inside(network, fines))
    throat = np.flatnonzero(network.throat_radius > 0)
    ends = network.throat_ends[throat]
    if not len(index) or not len(throat):
        none = np.zeros(0)
        pairs = Pairs(sphere=none, offset=none, depth=none, tube=none, length=none)
        return throat[:0], index[:0], pairs
    low, high = ends.min(axis=1), ends.max(axis=1)
    largest = float(fines.radius[index].max())
    # a throat shorter than the shortest allowed reaches beyond its ends
    beyond = network.throat_length[throat] - np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    reach = (network.throat_radius[throat] + np.maximum(beyond, 0.0) + largest)[:, None]
    low, high = low - reach, high + reach
    position, owner = mirrored_images(
        network, fines.position[index], low.min(axis=0), high.max(axis=0), 0.0
    )
    row, image = points_in_boxes(position, low, high)
    offset, depth = place_by_axis(ends[:, 0], ends[:, 1], row, position, image)
    throat, fine = throat[row], index[owner[image]]
    sphere = fines.radius[fine]
    tube, length = network.throat_radius[throat], network.throat_length[throat]
    use = (offset < sphere + tube) & (depth > -sphere) & (depth < length + sphere)
    pairs = Pairs(sphere=sphere, offset=offset, depth=depth, tube=tube, length=length)
    return throat[use], fine[use], pairs.where(use)
