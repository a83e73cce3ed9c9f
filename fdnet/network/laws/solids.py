"""The spheres themselves around the throats of a network, and which of them come near a place.

A network stands on images, and at an x face on half ellipsoids in place of caps. The sections of
throats with fines (`fine_sections`) need the bodies that hold the fluid: every sphere once, where
it is, with its images across periodic sides and its mirror images beyond the other faces.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.compiled import compiled_in_place
from fdnet.network.fines.deposit import size_classes
from fdnet.network.fines.fine_images import mirrored_images
from fdnet.network.fines.point_search import cells_between, grid_of
from fdnet.network.laws.cut_grains import own_radius
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

Cells = tuple[Array, Array, Array, Array, Array]
"""Of each size of spheres (S): low corner (S, 3) m of its cells, their edge (S,) m, their number
(S, 4) along each axis and where the first of them stands in the next array; for each cell its
first sphere, and after the last cell of a size the end; and the largest radius (S,) m."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solids:
    """N spheres, sorted into cells by size and place.

    Attributes:
        body: (N, 4) centre and radius, m.
        cells: of the sizes.
    """

    body: Array
    cells: Cells

    __repr__ = one_line


def solids_of(network: Network, place: Array, reach: Array) -> Solids:
    """The spheres of a network and all images within `reach` (K,) m of places (K, 3) m."""
    position, radius = _spheres(network)
    low, high = (place - reach[:, None]).min(axis=0), (place + reach[:, None]).max(axis=0)
    parts, corner, edge, shape, first, largest = [], [], [], [], [], []
    before = sphere = 0
    for some in size_classes(radius):
        widest = float(radius[some].max())
        centre, owner = mirrored_images(network, position[some], low, high, widest)
        across = float(np.ptp(centre, axis=0).max())
        # as many cells as spheres along a side, none of them narrower than a sphere
        wide = max(2.0 * widest, across / len(centre) ** (1.0 / 3.0))
        (start, width, number, begin), order = grid_of(centre, wide)
        parts.append(np.column_stack([centre, radius[some][owner]])[order])
        corner.append(start)
        edge.append(width)
        shape.append([*number, before])
        first.append(begin + sphere)
        largest.append(widest)
        before, sphere = before + len(begin), sphere + len(centre)
    return Solids(
        body=frozen(np.concatenate(parts)),
        cells=(
            np.array(corner),
            np.array(edge),
            np.array(shape, np.int64),
            np.concatenate(first).astype(np.int64),
            np.array(largest),
        ),
    )


def _spheres(network: Network) -> tuple[Array, Array]:
    """Centres (n, 3) m, in the box but along x, and radii (n,) m of the spheres of a network."""
    image = np.unique(network.image_grain, return_index=True)[1]
    position, outward = network.image_position[image].copy(), network.image_outward[image]
    for axis in np.flatnonzero(~np.array(network.periodic)):
        low, high = network.box[axis]
        x = position[:, axis]
        beyond = np.sign((x > high).astype(float) - (x < low))
        position[:, axis] = np.where(
            beyond > 0, 2 * high - x, np.where(beyond < 0, 2 * low - x, x)
        )
        if axis == 0:
            outward = np.where(beyond == 0, outward, -outward)
    position[:, 0] += outward
    return position, own_radius(network, image)


@compiled_in_place
def set_near(
    place: tuple[float, float, float], reach: float, solids: tuple[Array, Cells], near: Array
) -> int:
    """Sets the spheres whose bodies come nearer than `reach` m to a place, and gives their number.

    `near` are indices of the bodies (N, 4) of `solids`; those beyond its length are not written.
    """
    body, (corner, edge, shape, first, largest) = solids
    x, y, z = place
    count = 0
    for s in range(len(edge)):
        far = reach + largest[s]
        i0, i1 = cells_between(x - far, x + far, corner[s, 0], edge[s], shape[s, 0])
        j0, j1 = cells_between(y - far, y + far, corner[s, 1], edge[s], shape[s, 1])
        k0, k1 = cells_between(z - far, z + far, corner[s, 2], edge[s], shape[s, 2])
        for i in range(i0, i1):
            for j in range(j0, j1):
                row = shape[s, 3] + (i * shape[s, 1] + j) * shape[s, 2]
                for b in range(first[row + k0], first[row + max(k1, k0)]):
                    dx, dy, dz = body[b, 0] - x, body[b, 1] - y, body[b, 2] - z
                    away = reach + body[b, 3]
                    if dx * dx + dy * dy + dz * dz < away * away:
                        if count < len(near):
                            near[count] = b
                        count += 1
    return count
