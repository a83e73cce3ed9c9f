"""Delaunay tetrahedra of grains and their images, one of each, and the facets they share.

Along a periodic axis tetrahedra that differ by whole periods are one. Across the other faces mirror images close the
space without the hull's slivers; the sphere through the corners of a tetrahedron cut by such a face is centred on the
face, because it passes through a grain and its own image. A shake of 1e-7 grain radii, for the tessellation only and
the same for all periodic images of a grain, makes cospherical sets (lattices, and always the prisms cut by a face)
split in the same way everywhere.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from scipy.spatial import Delaunay, QhullError

from fdnet.errors import NetworkError
from fdnet.network import geometry
from fdnet.network.images import INSIDE, ON_FACE, Images, label, make_images, neighbour_tree, packed_shift
from fdnet.snapshot import Array, Snapshot

SHAKE = 1e-7
SHAKE_SEED = 3_141_592
ON_FACE_HAIR = 1e-6
COINCIDENT = 1e-3
UNMATCHED_SHARE = 1e-3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tetrahedra:
    """P unique tetrahedra, corners in order of label and shift.

    `grain` (P, 4) index, `corner` (P, 4, 3) m, `shift` (P, 4, 3) periods, `mirror` (P, 4, 3) codes of `images`,
    `label` (P, 4) integers; `shaken` (P, 4, 3) m the corners as tessellated, `centre` (P, 3) m and `reach` (P,) m of
    the sphere through them.
    """

    grain: Array
    corner: Array
    shift: Array
    mirror: Array
    label: Array
    shaken: Array
    centre: Array
    reach: Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Facets:
    """T facets shared by two tetrahedra.

    `pore` (T, 2), `opposite` (T, 2) the corner that is not on the facet, `shift` (T, 3) periods that bring the second
    tetrahedron beside the first; counts of facets left single at mirrored faces and elsewhere.
    """

    pore: Array
    opposite: Array
    shift: Array
    counts: Mapping[str, int]


def tessellate(grains: Snapshot, *, periodic: tuple[bool, bool, bool]) -> Tetrahedra:
    """Unique tetrahedra of `grains` in their box. Raises NetworkError on too few or coincident grains."""
    _check(grains, periodic)
    largest = float(grains.radius.max())
    size = grains.box[:, 1] - grains.box[:, 0]
    margin = np.full(3, 4.0 * largest)
    for _ in range(8):
        margin = np.where(periodic, margin, np.minimum(margin, size))
        found = _tessellate_once(grains, periodic, margin)
        needed = 2.02 * float(found.reach.max(initial=0.0))
        if len(found.grain) and np.all((margin >= needed) | (~np.array(periodic) & (margin >= size))):
            return found
        margin = np.maximum(margin * 1.25, min(needed, 4.0 * float(margin.max())))
    raise NetworkError(
        f"tessellation of {len(grains)} grains: voids reach {needed:.3g} m, wider than the images "
        f"around the box of {size.tolist()} m; give more grains or a smaller box"
    )


def _check(grains: Snapshot, periodic: tuple[bool, ...]) -> None:
    if len(grains) < 4:
        raise NetworkError(f"tessellation: {len(grains)} grains; a tetrahedron needs at least 4, give more grains")
    if np.any(grains.radius <= 0) or np.any(grains.box[:, 1] <= grains.box[:, 0]):
        raise NetworkError("tessellation: a grain radius or a box side is not positive; check the input lengths")
    tree = neighbour_tree(grains.position, grains.box, periodic=periodic)
    close = tree.query_pairs(COINCIDENT * float(grains.radius.min()), output_type="ndarray")
    if len(close):
        first, second = grains.id[close[0]]
        raise NetworkError(
            f"tessellation: grains {first} and {second} coincide at {grains.position[close[0, 0]]} m "
            f"({len(close)} such pairs); remove the doubles"
        )


def _shake(grains: Snapshot, images: Images) -> Array:
    """Displacement (M, 3) of the images, same for those that differ by whole periods; drawn by the grain's rank in
    order of x, y, z, so renumbering the grains changes nothing."""
    rank = np.empty(len(grains), int)
    rank[np.lexsort(grains.position.T[::-1])] = np.arange(len(grains))
    noise = np.random.default_rng(SHAKE_SEED).uniform(-SHAKE, SHAKE, (len(grains) * 27, 3))
    return noise[rank[images.owner] * 27 + label(images) % 27]


def _tessellate_once(grains: Snapshot, periodic: tuple[bool, ...], margin: Array) -> Tetrahedra:
    hair = ON_FACE_HAIR * float(grains.radius.mean())
    images = make_images(grains.position, grains.box, periodic=periodic, margin=margin, hair=hair)
    scale = float(grains.radius.mean())
    points = (images.position - grains.box[:, 0]) / scale + _shake(grains, images)
    try:
        found = Delaunay(points)
    except QhullError as error:
        raise NetworkError(
            f"tessellation of {len(grains)} grains failed, they lie in one plane or line: {str(error).splitlines()[0]}"
        ) from error
    if len(found.coplanar):
        raise NetworkError(
            f"tessellation: {len(found.coplanar)} grains coincide with another grain's image "
            "across a side; check the box against the grain positions"
        )
    corner = _unique(images, found.simplices, periodic)
    shaken = points[corner]
    centre, reach = geometry.circumcentre(shaken)
    return Tetrahedra(
        grain=images.owner[corner],
        corner=images.position[corner],
        shift=images.shift[corner],
        mirror=images.mirror[corner],
        label=label(images)[corner],
        reach=reach * scale,
        shaken=shaken * scale + grains.box[:, 0],
        centre=centre * scale + grains.box[:, 0],
    )


def _unique(images: Images, corner: Array, periodic: tuple[bool, ...]) -> Array:
    """Tetrahedra (P, 4), corners in order of key, that reach into the box and whose first corner is unshifted."""
    mirrored = [axis for axis in range(3) if not periodic[axis]]
    inside = np.all(np.any(images.mirror[corner] == INSIDE, axis=1)[:, mirrored], axis=1)
    corner = corner[inside]
    order = np.lexsort((packed_shift(images.shift)[corner], label(images)[corner]), axis=1)
    corner = np.take_along_axis(corner, order, axis=1)
    return corner[np.all(images.shift[corner[:, 0]] == 0, axis=1)]


def share_facets(tetrahedra: Tetrahedra, *, periodic: tuple[bool, bool, bool]) -> Facets:
    """Pairs of tetrahedra with a common facet, found by the facet's grains and relative shifts.

    Raises NetworkError when more than a hair of them (1e-3) find no partner away from the mirrored faces.
    """
    count = len(tetrahedra.grain)
    labels = tetrahedra.label[:, geometry.FACETS].reshape(-1, 3)
    shifts = tetrahedra.shift[:, geometry.FACETS].reshape(-1, 3, 3)
    relative = packed_shift(shifts - shifts[:, :1])
    columns = [labels[:, 0], labels[:, 1], labels[:, 2], relative[:, 1], relative[:, 2]]
    order = np.lexsort(columns)
    same = np.all([column[order][1:] == column[order][:-1] for column in columns], axis=0)
    first = order[:-1][same]
    second = order[1:][same]
    single = np.setdiff1d(np.arange(4 * count), np.concatenate([first, second]))
    unmatched = int(np.sum(~_beyond(tetrahedra, single, periodic)))
    if unmatched > max(4, UNMATCHED_SHARE * len(first)):
        raise NetworkError(
            f"tessellation: {unmatched} of {len(first)} facets have no partner; the grains do not tile "
            "the box, check the box and the periodic sides"
        )
    base = shifts[:, 0]
    return Facets(
        pore=np.stack([first // 4, second // 4], axis=1),
        opposite=np.stack([first % 4, second % 4], axis=1),
        shift=base[first] - base[second],
        counts={"throats_unmatched": unmatched},
    )


def without_side_walls(
    tetrahedra: Tetrahedra, facets: Facets, *, periodic: tuple[bool, bool, bool]
) -> tuple[Tetrahedra, Facets]:
    """Without the tetrahedra cut by a side wall, their facets, and the facets cut by the x faces themselves.

    What lies between a wall and the outermost facets is no part of the packing: its wide channels would carry most
    of the flow of a small specimen. Facets cut by x = 0 or x = L join pores of the same pressure.
    """
    keep = ~np.any(cut_axes(tetrahedra.mirror)[:, 1:], axis=1)
    kept_ends = keep[facets.pore].sum(axis=1)
    corners = geometry.FACETS[facets.opposite[:, 0]]
    mirror = np.take_along_axis(tetrahedra.mirror[facets.pore[:, 0]], corners[..., None], axis=1)
    in_face = cut_axes(mirror)[:, 0]
    use = (kept_ends == 2) & ~in_face
    counts = {
        **facets.counts,
        "throats_at_side_walls_dropped": int(np.sum(kept_ends == 1)),
        "throats_in_end_faces_dropped": int(np.sum((kept_ends == 2) & in_face)),
    }
    index = np.cumsum(keep) - 1
    thinned = {field.name: getattr(tetrahedra, field.name)[keep] for field in fields(tetrahedra)}
    return Tetrahedra(**thinned), Facets(
        pore=index[facets.pore[use]], opposite=facets.opposite[use], shift=facets.shift[use], counts=counts
    )


def _beyond(tetrahedra: Tetrahedra, facet: Array, periodic: tuple[bool, ...]) -> Array:
    """True where all corners of a facet lie on or beyond one mirrored face: there symmetry closes the space."""
    mirror = tetrahedra.mirror[facet[:, None] // 4, geometry.FACETS[facet % 4]]
    return np.any(np.all(mirror != INSIDE, axis=1) & ~np.array(periodic), axis=1)


def cut_axes(mirror: Array) -> Array:
    """True (K, 3) per axis where corners with `mirror` codes (K, n, 3) lie on both sides of a mirrored face."""
    beyond = np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1)
    return beyond & np.any(mirror == INSIDE, axis=1)
