"""Facets that two tetrahedra share, and polyhedra: tetrahedra of one power centre, split at will."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fdnet.errors import NetworkError
from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import (
    SAME_CENTRE,
    Tetrahedra,
    check_grains,
    cut_axes,
    needed_margin,
    tessellate_within,
)
from fdnet.spheres.images import INSIDE, MIRROR_LOW, ON_FACE, label, packed_shift
from fdnet.spheres.snapshot import Array, Snapshot

UNMATCHED_SHARE = 1e-3
UNMATCHED_FEW = 1e-5
ADOPTION_ROUNDS = 8
FIRST_MARGIN = 3.5
ROUNDS = 8
MOST_PERIODS, MOST_IMAGES, IMAGES_A_GRAIN = 64, 50_000, 30
"""Beyond these grains or voids are far larger than the periodic sides; Qhull then takes hours (dense packs: 1 to 2
periods, a unit cell 125 images)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Facets:
    """T facets shared by two tetrahedra.

    `pore` (T, 2); `opposite` (T, 2) the corner of each tetrahedron that is not on the facet; `shift` (T, 3) periods
    that bring the second tetrahedron beside the first; `unmatched` facets left single away from the mirrored faces.
    """

    pore: Array
    opposite: Array
    shift: Array
    unmatched: int

    def where(self, mask: Array) -> "Facets":
        """The facets for which `mask` (T,) is true."""
        return Facets(
            pore=self.pore[mask],
            opposite=self.opposite[mask],
            shift=self.shift[mask],
            unmatched=self.unmatched,
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Polyhedra:
    """`centre` (P, 3) m power centres, those of flat tetrahedra taken from a neighbour; `heights` (T, 2) m of the
    centres over the facets, positive on their own side; `group` (P,) equal for parts of one polyhedron;
    `wall` (P, 3) -1 or 1 where the polyhedron is cut by the low or high mirrored face, else 0."""

    centre: Array
    heights: Array
    group: Array
    wall: Array


def facet_vertices(tetrahedra: Tetrahedra, facets: Facets, part: slice | Array) -> Array:
    """Images (K, 3) at the corners of the facets of `part`."""
    corners = geometry.FACETS[facets.opposite[part, 0]]
    return np.take_along_axis(tetrahedra.vertex[facets.pore[part, 0]], corners, axis=1)


def tessellate(
    grains: Snapshot, *, periodic: tuple[bool, bool, bool]
) -> tuple[Tetrahedra, Facets]:
    """Unique tetrahedra of `grains` in their box, and the facets they share.

    Images are added until every sphere that must be empty lies within them and every facet has its partner; both
    together mean that no tetrahedron is wrong or missing. A few facets of flat tetrahedra may stay without, split
    otherwise on either side of a period by rounding; more images do not help them, they are counted. Raises
    NetworkError on coincident or coplanar grains, and when more than a hair of the facets (1e-3) stay without partner
    away from the mirrored faces.
    """
    check_grains(grains, periodic)
    size = grains.box[:, 1] - grains.box[:, 0]
    margin = np.full(3, FIRST_MARGIN * float(grains.radius.max()))
    for _ in range(ROUNDS):
        margin = np.where(periodic, margin, np.minimum(margin, size))
        _refuse_crowd(len(grains), np.where(periodic, margin, 0.0), size)
        widest = ~np.array(periodic) & (margin >= size)
        tetrahedra = tessellate_within(grains, periodic, margin)
        needed = needed_margin(tetrahedra, grains.box)
        empty = len(tetrahedra.vertex) > 0 and bool(np.all((margin >= needed) | widest))
        facets = share_facets(tetrahedra, grains.box, periodic=periodic) if empty else None
        if facets is not None and (
            facets.unmatched <= UNMATCHED_FEW * len(facets.pore) or widest.all()
        ):
            break
        margin = np.maximum(1.5 * margin, np.minimum(1.02 * needed, 4.0 * margin))
    if facets is None:
        raise NetworkError(
            f"tessellation of {len(grains)} grains: voids reach {needed.max():.3g} m beyond the box of "
            f"{size.tolist()} m, further than the images around it; give more grains or a smaller box"
        )
    if facets.unmatched > max(4, UNMATCHED_SHARE * len(facets.pore)):
        raise NetworkError(
            f"tessellation: {facets.unmatched} of {len(facets.pore)} facets have no partner; the grains do not tile "
            "the box, check the box and the periodic sides"
        )
    return tetrahedra, facets


def _refuse_crowd(count: int, margin: Array, size: Array) -> None:
    """Raise NetworkError when the images of `count` grains within `margin` (3,) m of periodic sides are too many."""
    images, axis = count * float(np.prod(1.0 + 2.0 * margin / size)), int(np.argmax(margin / size))
    most = MOST_IMAGES + IMAGES_A_GRAIN * count
    if images > most or margin[axis] > MOST_PERIODS * size[axis]:
        raise NetworkError(
            f"tessellation of {count} grains: {images:.3g} images up to {margin[axis]:.3g} m beyond the periodic side "
            f"{'xyz'[axis]} of {size[axis]:.3g} m are needed, expected at most {most} and {MOST_PERIODS} periods; "
            "grains or voids are far larger than the box, check units and box"
        )


def share_facets(
    tetrahedra: Tetrahedra, box: Array, *, periodic: tuple[bool, bool, bool]
) -> Facets:
    """Pairs of tetrahedra with a common facet: neighbours, and across periods those of the same grains."""
    beside = tetrahedra.beside
    one, opposite = np.nonzero(beside > np.arange(len(beside))[:, None])
    two = beside[one, opposite]
    back = np.argmax(beside[two] == one[:, None], axis=1)
    first, second, shift, unmatched = _across_periods(tetrahedra, box, periodic)
    pore = np.concatenate(
        [np.stack([one, two], axis=1), np.stack([first // 4, second // 4], axis=1)]
    )
    ends = np.concatenate(
        [np.stack([opposite, back], axis=1), np.stack([first % 4, second % 4], axis=1)]
    )
    return Facets(
        pore=pore.astype(np.int32),
        opposite=ends.astype(np.int8),
        shift=np.concatenate([np.zeros((len(one), 3), np.int16), shift]),
        unmatched=unmatched,
    )


def _across_periods(
    tetrahedra: Tetrahedra, box: Array, periodic: tuple[bool, ...]
) -> tuple[Array, Array, Array, int]:
    """Facets without neighbour (index of tetrahedron times 4 + corner) paired by the names of their grains and
    relative shifts, the shift of the second, and how many stay single away from the mirrored faces."""
    images = tetrahedra.images
    single = np.flatnonzero(tetrahedra.beside.ravel() < 0)
    corner = np.take_along_axis(
        tetrahedra.vertex[single // 4], geometry.FACETS[single % 4], axis=1
    )
    key = label(images).astype(np.int64) * 2**30 + packed_shift(images.shift)
    corner = np.take_along_axis(corner, np.argsort(key[corner], axis=1), axis=1)
    names, shifts = label(images)[corner], images.shift[corner]
    relative = packed_shift(shifts - shifts[:, :1])
    columns = [names[:, 0], names[:, 1], names[:, 2], relative[:, 1], relative[:, 2]]
    order = np.lexsort(columns)
    same = np.all([column[order][1:] == column[order][:-1] for column in columns], axis=0)
    first, second = order[:-1][same], order[1:][same]
    alone = np.ones(len(single), bool)
    alone[first] = alone[second] = False
    # on or beyond one mirrored face symmetry closes the space
    place, hair = (
        images.position[corner[alone]],
        SAME_CENTRE * float(tetrahedra.image_radius.mean()),
    )
    below, above = (
        np.all(place <= box[:, 0] + hair, axis=1),
        np.all(place >= box[:, 1] - hair, axis=1),
    )
    beyond = np.any((below | above) & ~np.array(periodic), axis=1)
    return (
        single[first],
        single[second],
        shifts[first, 0] - shifts[second, 0],
        int(np.sum(~beyond)),
    )


def make_polyhedra(tetrahedra: Tetrahedra, facets: Facets, box: Array, scale: float) -> Polyhedra:
    """Power centres, heights over the facets, groups, and the walls they lie on; `scale` m the mean grain radius."""
    centre = _adopted_centres(tetrahedra, facets, box[:, 1] - box[:, 0])
    heights = _heights(tetrahedra, facets, centre, box[:, 1] - box[:, 0])
    joined = np.abs(heights.sum(axis=1)) < SAME_CENTRE * scale
    count = len(centre)
    graph = coo_matrix(
        (np.ones(int(joined.sum()), np.int8), facets.pore[joined].T), shape=(count, count)
    )
    group = connected_components(graph, directed=False)[1]
    return Polyhedra(
        centre=centre,
        heights=heights,
        group=group,
        wall=_walls(tetrahedra, centre, group, box, scale),
    )


def _adopted_centres(tetrahedra: Tetrahedra, facets: Facets, size: Array) -> Array:
    """Centres (P, 3); a flat tetrahedron, four corners of one face of two polyhedra, has that of a neighbour.

    Its own depends on the shake alone; either neighbour leaves the same flow (both splits of a face count the same).
    """
    centre, known = tetrahedra.centre.copy(), ~tetrahedra.flat
    near = facets.where(np.any(tetrahedra.flat[facets.pore], axis=1))
    for _ in range(ADOPTION_ROUNDS):
        for own, other, sign in ((0, 1, 1.0), (1, 0, -1.0)):
            lender, taker = near.pore[:, other], near.pore[:, own]
            use = np.flatnonzero(known[lender] & ~known[taker])
            taken, rows = np.unique(taker[use], return_index=True)
            centre[taken] = centre[lender[use[rows]]] + sign * near.shift[use[rows]] * size
            known[taken] = True
    return centre


def _heights(tetrahedra: Tetrahedra, facets: Facets, centre: Array, size: Array) -> Array:
    """Signed distances (T, 2) of the two power centres from the facet, positive on their own side of it."""
    found = np.empty((len(facets.pore), 2))
    for part in geometry.slices(len(found)):
        one, two = facets.pore[part].T
        corner = tetrahedra.shaken[facet_vertices(tetrahedra, facets, part)]
        normal = geometry.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        apex = tetrahedra.shaken[tetrahedra.vertex[one, facets.opposite[part, 0]]]
        normal *= (
            np.where(geometry.dot(apex - corner[:, 0], normal) > 0, -1.0, 1.0)
            / np.linalg.norm(normal, axis=1)
        )[:, None]
        other = centre[two] + facets.shift[part] * size
        found[part, 0] = geometry.dot(corner[:, 0] - centre[one], normal)
        found[part, 1] = geometry.dot(other - corner[:, 0], normal)
    return found


def _walls(tetrahedra: Tetrahedra, centre: Array, group: Array, box: Array, scale: float) -> Array:
    images = tetrahedra.images
    wall = np.zeros((len(centre), 3), np.int8)
    mirrored = np.any((images.mirror != INSIDE) & (images.mirror != ON_FACE), axis=1)
    doubtful = np.flatnonzero(np.any(mirrored[tetrahedra.vertex], axis=1))
    vertex = tetrahedra.vertex[doubtful]
    near = np.stack(
        [np.abs(centre[doubtful] - face) < SAME_CENTRE * scale for face in box.T], axis=2
    ).any(axis=2)
    mirror = images.mirror[vertex]
    beyond = np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1)
    low = np.any(mirror == MIRROR_LOW, axis=1)
    cut = cut_axes(images, vertex) | (near & beyond)
    wall[doubtful] = np.where(cut, np.where(low, -1, 1), 0)
    for axis in range(3):
        for side in (-1, 1):
            groups = np.zeros(int(group.max(initial=-1)) + 1, bool)
            groups[group[wall[:, axis] == side]] = True
            wall[groups[group], axis] = side
    return wall
