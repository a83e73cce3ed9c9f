"""Tetrahedra of grains and their images: Delaunay's, or for unequal grains those of the power tessellation.

Along a periodic axis tetrahedra that differ by whole periods are one. A face that is not periodic is a mirror plane: it
parts every grain from its own image, so the power centres of what lies inside are inside, and those of what the face
cuts lie on it. A shake of 1e-7 grain radii, for the tessellation only and the same for all periodic images of a grain,
splits cospherical sets (lattices, and always the prisms cut by a face) in the same way everywhere.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError

from fdnet.errors import NetworkError
from fdnet.network import geometry
from fdnet.spheres.images import (
    INSIDE,
    ON_FACE,
    Images,
    label,
    make_images,
    neighbour_tree,
    packed_shift,
)
from fdnet.spheres.snapshot import Array, Snapshot

SHAKE = 1e-7
SHAKE_SEED = 3_141_592
COINCIDENT = 1e-3
COARSE = 1e-8
"""A tenth of the shake: coordinates rounded more than this, in grain radii, cannot hold it."""
ON_FACE_HAIR = 1e-6
LENGTHS = (1e-60, 1e60)
FLAT = 1e-5
SAME_CENTRE = 1e-5
EQUAL_SPREAD = 1e-3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tetrahedra:
    """P unique tetrahedra over M images of the grains.

    `images`; `image_radius` (M,) m; `shaken` (M, 3) m positions as tessellated; `vertex` (P, 4) images at the corners;
    `beside` (P, 4) the tetrahedron across the facet opposite each corner, -1 where it lies across a period or a wall;
    `centre` (P, 3) m power centre, `reach` (P,) m radius round it within which another grain's centre would have
    changed the tetrahedron; `flat` (P,) volume below 1e-5 mean radii cubed, whose centre is arbitrary; `hidden`
    grains without any tetrahedron; `power` whether radii took part.
    """

    images: Images
    image_radius: Array
    shaken: Array
    vertex: Array
    beside: Array
    centre: Array
    reach: Array
    flat: Array
    hidden: int
    power: bool


def needed_margin(found: Tetrahedra, box: Array) -> Array:
    """How far (3,) m the empty spheres reach beyond the box."""
    reach = found.reach[:, None]
    low = (box[:, 0] - found.centre + reach).max(axis=0, initial=0.0)
    return np.maximum(low, (found.centre + reach - box[:, 1]).max(axis=0, initial=0.0))


def check_lengths(spheres: Snapshot, periodic: tuple[bool, ...]) -> None:
    """Raise NetworkError on radii or box sides that are not positive, lengths whose cubes no double holds, and where
    the box, or centres along its periodic sides, are so far from the origin that they are rounded by 1e-8 radii."""
    box, radius = spheres.box, spheres.radius
    if np.any(radius <= 0):
        raise NetworkError("tessellation: a grain radius is not positive; check the input lengths")
    largest = max(float(np.max(np.abs(one))) for one in (box, radius, spheres.position))
    if radius.min() < LENGTHS[0] or largest > LENGTHS[1]:
        raise NetworkError(
            f"tessellation: lengths from {radius.min():.3g} m (radius) to {largest:.3g} m, expected between "
            f"{LENGTHS[0]:g} and {LENGTHS[1]:g} m; check the units"
        )
    around = spheres.position[:, np.array(periodic, bool)]
    scale, farthest = (
        float(radius.mean()),
        max(float(np.max(np.abs(box))), float(np.max(np.abs(around), initial=0.0))),
    )
    if np.spacing(farthest) > COARSE * scale:
        raise NetworkError(
            f"tessellation: coordinates up to {farthest:.3g} m are rounded by {np.spacing(farthest):.1g} m, more than "
            f"{COARSE:g} of a radius of {scale:.3g} m; move the specimen to the origin, check units and box"
        )
    if np.any(box[:, 1] <= box[:, 0]):
        raise NetworkError("tessellation: a box side is not positive; check the input lengths")


def check_grains(grains: Snapshot, periodic: tuple[bool, ...]) -> None:
    """Raises NetworkError on coincident grains."""
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
    mirrors, code = np.unique(label(images) % 27, return_inverse=True)
    noise = np.random.default_rng(SHAKE_SEED).uniform(
        -SHAKE, SHAKE, (len(mirrors), len(grains), 3)
    )
    return noise[code, rank[images.owner]]


def tessellate_within(
    grains: Snapshot, periodic: tuple[bool, bool, bool], margin: Array
) -> Tetrahedra:
    """Unique tetrahedra of `grains` and their images within `margin` (3,) m of the box.

    The power tessellation is used when the radii spread by more than 1e-3 of their mean. Raises NetworkError on
    grains in one plane or coincident with an image.
    """
    scale = float(grains.radius.mean())
    images = make_images(
        grains.position, grains.box, periodic=periodic, margin=margin, hair=ON_FACE_HAIR * scale
    )
    points = (images.position - grains.box[:, 0]) / scale + _shake(grains, images)
    radius = grains.radius[images.owner]
    power = float(np.ptp(grains.radius)) > EQUAL_SPREAD * scale
    try:
        simplices, neighbours = _power_hull(points, radius / scale) if power else _delaunay(points)
    except QhullError as error:
        raise NetworkError(
            f"tessellation of {len(grains)} grains failed, they lie in one plane or line: {str(error).splitlines()[0]}"
        ) from error
    shaken = points * scale + grains.box[:, 0]
    kept = _unique(images, simplices, (periodic, grains.box, shaken, radius))
    index = np.full(len(simplices) + 1, -1, np.int32)
    index[kept] = np.arange(len(kept))
    vertex = simplices[kept]
    centre, reach, flat = _centres((images.position, shaken), radius, vertex, scale)
    found = np.zeros(len(grains), bool)
    found[images.owner[vertex]] = True
    return Tetrahedra(
        images=images,
        image_radius=radius,
        shaken=shaken,
        vertex=vertex,
        beside=index[neighbours[kept]],
        centre=centre,
        reach=reach,
        flat=flat,
        hidden=int(np.sum(~found)),
        power=power,
    )


def _delaunay(points: Array) -> tuple[Array, Array]:
    found = Delaunay(points)
    if len(found.coplanar):
        raise NetworkError(
            f"tessellation: {len(found.coplanar)} grains coincide with another grain's image "
            "across a side; check the box against the grain positions"
        )
    return found.simplices, found.neighbors


def _power_hull(points: Array, radius: Array) -> tuple[Array, Array]:
    """Tetrahedra and neighbours (-1: none) of the power tessellation of `points` (M, 3) with `radius` (M,).

    The lower side of the convex hull of the points lifted to |x|^2 - r^2 (Aurenhammer 1987, SIAM J. Comput. 16, 78).
    """
    about = points - 0.5 * (points.max(axis=0) + points.min(axis=0))
    lifted = np.sum(about**2, axis=1) - radius**2
    found = ConvexHull(np.column_stack([about, lifted / np.ptp(lifted) * np.ptp(about)]))
    lower = np.flatnonzero(found.equations[:, 3] < 0)
    index = np.full(len(found.simplices), -1, np.int32)
    index[lower] = np.arange(len(lower))
    return found.simplices[lower], index[found.neighbors[lower]]


def _unique(
    images: Images, simplices: Array, place: tuple[tuple[bool, ...], Array, Array, Array]
) -> Array:
    """Indices of the tetrahedra to keep: power centre inside or on the mirrored faces, and of those that differ by
    periods the one whose corner of least key (grain, mirror, shift) is unshifted."""
    periodic, box, shaken, radius = place
    plain = np.all((images.mirror == INSIDE) & (images.shift == 0), axis=1)
    within = plain[simplices]
    kept = np.all(within, axis=1)
    # an unshifted corner is needed; mirrored axes have no shift
    unshifted = np.all(images.shift == 0, axis=1)
    doubtful = np.flatnonzero(~kept & np.any(unshifted[simplices], axis=1))
    corner = simplices[doubtful]
    key = label(images).astype(np.int64) * 2**30 + packed_shift(images.shift)
    first = np.take_along_axis(corner, np.argmin(key[corner], axis=1)[:, None], axis=1)[:, 0]
    good = unshifted[first]
    beyond = np.zeros(len(corner), bool)
    for axis in np.flatnonzero(~np.array(periodic)):
        beyond |= ~np.any(images.mirror[corner, axis] == INSIDE, axis=1)
    # sets beyond a face belong to the specimen when their centre is on it: parts of a polyhedron cut by the face
    check = np.flatnonzero(good & beyond)
    good[check] = _cut_by_face(shaken[corner[check]], radius[corner[check]], box, periodic)
    kept[doubtful] = good
    return np.flatnonzero(kept)


def _cut_by_face(corner: Array, radius: Array, box: Array, periodic: tuple[bool, ...]) -> Array:
    """True (K,) where the power centre of `corner` (K, 4, 3) lies within the faces that are not periodic, or on them.

    The centre of a flat one is arbitrary, its centroid decides: standing across a face it is part of what parts two
    polyhedra; lying in the face it has no room.
    """
    hair = SAME_CENTRE * float(radius.mean()) if len(radius) else 0.0
    walled = ~np.array(periodic)
    centre, _ = geometry.power_centre(corner, radius)
    flat = np.abs(geometry.signed_volume(corner)) < FLAT * (hair / SAME_CENTRE) ** 3
    centre = np.where(flat[:, None], corner.mean(axis=1), centre)
    inside = np.all((np.maximum(box[:, 0] - centre, centre - box[:, 1]) <= hair) | ~walled, axis=1)
    in_face = [
        np.any(np.all(np.abs(corner - face) <= hair, axis=1) & walled, axis=1) for face in box.T
    ]
    return inside & ~(in_face[0] | in_face[1])


def _centres(
    place: tuple[Array, Array], radius: Array, vertex: Array, scale: float
) -> tuple[Array, Array, Array]:
    """Power centre (P, 3) and reach (P,) of true positions, flatness (P,); of shaken positions where flat."""
    centre, reach, flat = (
        np.empty((len(vertex), 3)),
        np.empty(len(vertex)),
        np.empty(len(vertex), bool),
    )
    largest = float(radius.max())
    for part in geometry.slices(len(vertex)):
        true, corner_radius = place[0][vertex[part]], radius[vertex[part]]
        flat[part] = np.abs(geometry.signed_volume(true)) < FLAT * scale**3
        corner = np.where(flat[part][:, None, None], place[1][vertex[part]], true)
        centre[part], power = geometry.power_centre(corner, corner_radius)
        reach[part] = np.sqrt(np.maximum(power + largest**2, 0.0))
    return centre, reach, flat


def cut_axes(images: Images, corner: Array) -> Array:
    """True (K, 3) per axis where `corner` (K, n) images lie on both sides of a mirrored face."""
    mirror = images.mirror[corner]
    beyond = np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1)
    return beyond & np.any(mirror == INSIDE, axis=1)
