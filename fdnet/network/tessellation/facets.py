"""Facets that two tetrahedra share."""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import SAME_CENTRE, Tetrahedra
from fdnet.spheres.arrays import one_line
from fdnet.spheres.images import packed_shift
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Facets:
    """T facets, each shared by two tetrahedra.

    Attributes:
        pore: (T, 2) the two tetrahedra.
        opposite: (T, 2) corner 0 to 3 of either tetrahedron that is not on the facet.
        shift: (T, 3) whole periods that bring the second tetrahedron next to the first.
        vertex: (T, 3) points at the corners of the facet, those of the first tetrahedron.
        unmatched: number of facets away from the mirrored faces that have no partner.
    """

    pore: Array
    opposite: Array
    shift: Array
    vertex: Array
    unmatched: int

    __repr__ = one_line

    def where(self, mask: Array) -> "Facets":
        """The facets for which `mask` (T,) is true."""
        return Facets(
            pore=self.pore[mask],
            opposite=self.opposite[mask],
            shift=self.shift[mask],
            vertex=self.vertex[mask],
            unmatched=self.unmatched,
        )


def share_facets(tetrahedra: Tetrahedra, box: Array, *, periodic: tuple[bool, ...]) -> Facets:
    """Pairs of tetrahedra with a common facet.

    These are neighbours, and across periods tetrahedra whose facets have the same grains.
    """
    neighbour = tetrahedra.neighbour
    one, opposite = np.nonzero(neighbour > np.arange(len(neighbour))[:, None])
    two = neighbour[one, opposite]
    back = np.argmax(neighbour[two] == one[:, None], axis=1)
    first, second, shift, unmatched = _across_periods(tetrahedra, box, periodic)
    pore = np.concatenate(
        [np.stack([one, two], axis=1), np.stack([first // 4, second // 4], axis=1)]
    ).astype(np.int32)
    ends = np.concatenate(
        [np.stack([opposite, back], axis=1), np.stack([first % 4, second % 4], axis=1)]
    ).astype(np.int8)
    corners = geometry.FACETS[ends[:, 0]]
    return Facets(
        pore=pore,
        opposite=ends,
        shift=np.concatenate([np.zeros((len(one), 3), np.int16), shift]),
        vertex=np.take_along_axis(tetrahedra.vertex[pore[:, 0]], corners, axis=1),
        unmatched=unmatched,
    )


def _across_periods(
    tetrahedra: Tetrahedra, box: Array, periodic: tuple[bool, ...]
) -> tuple[Array, Array, Array, int]:
    """Pairs of facets without neighbour that have the same grains and relative shifts.

    Returns the first and second facet (K,), each the index of its tetrahedron times 4 plus the
    corner opposite, the shift (K, 3) of the second, and how many facets away from the mirrored
    faces stay without partner.
    """
    points = tetrahedra.points
    single = np.flatnonzero(tetrahedra.neighbour.ravel() < 0)
    corner = np.take_along_axis(
        tetrahedra.vertex[single // 4], geometry.FACETS[single % 4], axis=1
    )
    corner = np.take_along_axis(corner, np.argsort(points.key[corner], axis=1), axis=1)
    names, shifts = points.name[corner], points.shift[corner]
    relative = packed_shift(shifts - shifts[:, :1])
    columns = [names[:, 0], names[:, 1], names[:, 2], relative[:, 1], relative[:, 2]]
    order = np.lexsort(columns)
    same = np.all([column[order][1:] == column[order][:-1] for column in columns], axis=0)
    first, second = order[:-1][same], order[1:][same]
    alone = np.ones(len(single), bool)
    alone[first] = alone[second] = False
    # a facet on or beyond one mirrored face needs no partner: symmetry closes the space
    place = points.position[corner[alone]]
    tolerance = SAME_CENTRE * float(points.radius.mean())
    below = np.all(place <= box[:, 0] + tolerance, axis=1)
    above = np.all(place >= box[:, 1] - tolerance, axis=1)
    beyond = np.any((below | above) & ~np.array(periodic), axis=1)
    shift = shifts[first, 0] - shifts[second, 0]
    return single[first], single[second], shift, int(np.sum(~beyond))
