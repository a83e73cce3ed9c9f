"""Which fines reach into the sections of a throat, and where they lie as seen from its facet."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.fines.deposit import size_classes
from fdnet.network.fines.fine_images import mirrored_images
from fdnet.network.fines.point_search import points_in_boxes
from fdnet.network.geometry import dot, flat
from fdnet.network.laws.facet_axes import facet_axes
from fdnet.network.laws.section_rays import inwards, set_sides
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FinesBeside:
    """Fines that reach into the prisms of K throats, from node to node.

    Attributes:
        first: (K+1,) the first fine of each throat, and their number N at the end.
        place: (N, 5) m, along the first edge of the facet, across it towards the third corner,
            and height above the facet towards the second pore, of its centre from the first
            corner; its radius m, and 1 (a sphere is not flat).
    """

    first: Array
    place: Array

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prisms:
    """The prisms of K throats, from node to node.

    Attributes:
        origin: (K, 3) m, the first corner of each facet.
        axes: unit vectors (K, 3) of `facet_axes`.
        base: (K, 3, 2) m, corners of the facets in their own planes.
        height: (K, 2) m above the facets, of the lower and the upper end.
        low: (K, 3) m, lower corners of the boxes around them.
        high: (K, 3) m, their upper corners.
    """

    origin: Array
    axes: tuple[Array, Array, Array]
    base: Array
    height: Array
    low: Array
    high: Array

    __repr__ = one_line


def prisms_of(network: Network, part: slice, heights: Array) -> Prisms:
    """The prisms of the throats `part` (K), whose nodes are `heights` (K, 2) m above the facet."""
    facet = network.image_position[network.throat_images[part]]
    axes = facet_axes(network, np.arange(part.start, part.stop), facet)
    height = heights * (-1.0, 1.0)
    ends = (facet[:, None] + (height[:, :, None] * axes[2][:, None])[:, :, None]).reshape(
        len(facet), 6, 3
    )
    return Prisms(
        origin=facet[:, 0].copy(),
        axes=axes,
        base=flat(facet),
        height=np.sort(height, axis=1),
        low=ends.min(axis=1),
        high=ends.max(axis=1),
    )


class FineImages:
    """Spheres at `position` (N, 3) m of `radius` (N,) m, with their images near all throats.

    The images are shifted or mirrored. A fine that is centred on or beyond a face that is not
    periodic has no mirror image there: its body inside the box is that of the sphere itself.
    """

    def __init__(self, network: Network, position: Array, radius: Array) -> None:
        used = np.zeros(len(network.image_position), bool)
        used[network.throat_images] = True
        corner = network.image_position[used]
        low, high = corner.min(axis=0), corner.max(axis=0)
        self._classes: list[tuple[Array, Array]] = []
        for some in size_classes(radius) if len(radius) else []:
            own = radius[some]
            place, owner = mirrored_images(network, position[some], low, high, float(own.max()))
            self._classes.append((place, own[owner]))

    def beside(self, prisms: Prisms, rows: Array | None = None) -> FinesBeside:
        """The fines that reach into the prisms (K), or into those of some `rows` alone."""
        throats, places = [np.zeros(0, np.intp)], [np.zeros((0, 5))]
        for throat, place in self._reaching(prisms, rows):
            throats.append(throat)
            places.append(place)
        throat, place = np.concatenate(throats), np.concatenate(places)
        order = np.lexsort((*place[:, 2::-1].T, throat))  # whatever order the search has
        first = np.searchsorted(throat[order], np.arange(len(prisms.low) + 1))
        return FinesBeside(first=frozen(first), place=frozen(place[order]))

    def reached(self, prisms: Prisms) -> Array:
        """Whether a fine reaches into each of the prisms (K,)."""
        some = np.zeros(len(prisms.low), bool)
        for throat, _ in self._reaching(prisms, None):
            some[throat] = True
        return some

    def _reaching(self, prisms: Prisms, rows: Array | None) -> Iterator[tuple[Array, Array]]:
        """The throat (N,) and `place` (N, 5) of fines of one size after the other, not sorted."""
        low, high = prisms.low, prisms.high
        if rows is not None:
            low, high = low[rows], high[rows]
        for position, radius in self._classes:
            widest = float(radius.max())
            row, image = points_in_boxes(position, low - widest, high + widest)
            reach = radius[image, None]  # its own, whatever other fines are in the class
            near = (position[image] >= low[row] - reach) & (position[image] <= high[row] + reach)
            row, image = (one[near.all(axis=1)] for one in (row, image))
            throat = row if rows is None else rows[row]
            away = position[image] - prisms.origin[throat]
            place = np.ones((len(throat), 5))
            for k, axis in enumerate(prisms.axes):
                place[:, k] = dot(away, axis[throat])
            place[:, 3] = radius[image]
            real = _reaching(prisms.base, prisms.height, throat, place)
            yield throat[real], place[real]


@compiled
def _reaching(base: Array, height: Array, throat: Array, place: Array) -> Array:
    """Whether spheres (N) reach between two heights (K, 2) m and within the lines of a triangle.

    The triangles are `base` (K, 3, 2) m, `throat` (N,) says which, and `place` (N, 5) is that of
    `FinesBeside`.
    """
    real, side = np.empty(len(throat), np.bool_), np.empty((3, 3))
    for n in range(len(throat)):
        t, x, y, z, r = throat[n], place[n, 0], place[n, 1], place[n, 2], place[n, 3]
        real[n] = height[t, 0] - r < z < height[t, 1] + r
        if real[n]:
            set_sides(base[t], side)
            for i in range(3):
                real[n] = real[n] and inwards(base[t], side, i, x, y) > -r
    return real
