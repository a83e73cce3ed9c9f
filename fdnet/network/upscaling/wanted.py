"""Which crossings of facets each region has to know."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.upscaling.overlay import Overlay
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Wanted:
    """Crossings (N) of facets, as the region around a cell at the facet sees them.

    Attributes:
        first: (C+1,) where those of each cell begin.
        facet: (N,) the facet.
        link: (N,) the link.
        share: (N,) of its flux, from the first to the second node of the facet.
        image: (N, 3) shift of the first end of the link in this region.
        ends: (N, 2, 3) shifts of the two nodes of the facet in this region.
    """

    first: Array
    facet: Array
    link: Array
    share: Array
    image: Array
    ends: Array

    __repr__ = one_line

    def seeing(self, asked: Array) -> Array:
        """The cells that see a facet which is `asked` for (E,)."""
        sees = np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))
        return np.unique(sees[asked[self.facet]])


def wanted_of(overlay: Overlay) -> Wanted:
    """What the region around each cell has to know: the crossings of the facets at the cell.

    Those from plane to plane are seen from the cell of a pore of their link, each once.
    """
    crossings, facets = overlay.crossings, overlay.facets
    ends, shift = facets.ends[crossings.facet], facets.shift[crossings.facet]
    seen = []
    for end in (0, 1):
        own = np.flatnonzero(ends[:, end] < facets.cells)
        turn = -end * shift[own]
        places = np.stack([turn, turn + shift[own]], axis=1)
        seen.append((ends[own, end], own, crossings.image[own] + turn, places))
    across = np.flatnonzero((ends >= facets.cells).all(axis=1))
    first, second = overlay.whole.ends[crossings.link[across]].T
    pore = np.where(first < len(overlay.whole.node), first, second)
    cell = np.append(overlay.owners.cell, [0, 0])[pore]  # any, for a link from plane to plane
    nowhere = np.zeros((len(across), 2, 3), np.intp)
    seen.append((cell, across, crossings.image[across], nowhere))
    centre, which, image, places = (np.concatenate(column) for column in zip(*seen, strict=True))
    order = np.argsort(centre, kind="stable")
    which = which[order]
    return Wanted(
        first=np.searchsorted(centre[order], np.arange(facets.cells + 1)),
        facet=crossings.facet[which],
        link=crossings.link[which],
        share=crossings.share[which],
        image=image[order],
        ends=places[order],
    )
