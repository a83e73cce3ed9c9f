"""Tetrahedra of grains and images: Delaunay's, or for unequal grains of the power tessellation.

Along a periodic axis tetrahedra that differ by whole periods are one.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError

from fdnet.errors import NetworkError
from fdnet.network import geometry
from fdnet.network.tessellation.points import Points, make_points
from fdnet.network.tessellation.tetrahedron import centres
from fdnet.network.tessellation.triangulation import triangulate
from fdnet.spheres.arrays import one_line
from fdnet.spheres.images import INSIDE
from fdnet.spheres.snapshot import Array, Snapshot

FLAT = 1e-5
"""A tetrahedron of less volume, in mean grain radii cubed, is flat."""
SAME_CENTRE = 1e-5
"""Power centres nearer than this, in mean grain radii, are one point."""
EQUAL_SPREAD = 1e-3
"""Radii that spread by at most this share of their mean are treated as equal."""
COMPILED_FROM = 2000
"""Points from which on the compiled tessellation is used; below it Qhull takes less than 0.05 s,
and the compiler is not needed."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Tetrahedra:
    """P unique tetrahedra between M points.

    Attributes:
        points: the M points, images of the grains.
        vertex: (P, 4) points at the corners.
        neighbour: (P, 4) tetrahedron across the facet opposite each corner; -1 where that lies
            across a period or beyond a wall.
        centre: (P, 3) m, power centre: the point of equal power to the four grains.
        volume: (P,) m3.
        flat: (P,) whether the volume is below 1e-5 mean radii cubed; the centre is then arbitrary.
        margin: (3,) m, how far beyond the box the spheres reach that must be empty: those about a
            centre in which the centre of another grain would have changed the tetrahedron.
        hidden: number of grains without any tetrahedron.
    """

    points: Points
    vertex: Array
    neighbour: Array
    centre: Array
    volume: Array
    flat: Array
    margin: Array
    hidden: int

    __repr__ = one_line


def make_tetrahedra(
    grains: Snapshot, *, periodic: tuple[bool, bool, bool], margin: Array
) -> Tetrahedra:
    """Unique tetrahedra of `grains` and of their images within `margin` (3,) m of the box.

    The power tessellation is used where the radii spread by more than 1e-3 of their mean. Raises
    NetworkError on grains in one plane and on grains that coincide with an image.
    """
    scale = float(grains.radius.mean())
    points = make_points(grains, periodic=periodic, margin=margin)
    unequal = float(np.ptp(grains.radius)) > EQUAL_SPREAD * scale
    simplices, neighbours = _tessellated(points, len(grains), scale, unequal=unequal)
    kept = _unique(points, simplices, grains.box, periodic)
    index = np.full(len(simplices) + 1, -1, np.int32)
    index[kept] = np.arange(len(kept))
    vertex = simplices[kept]
    centre, reach, volume, flat = _centres(points, vertex, scale)
    seen = np.zeros(len(grains), bool)
    seen[points.owner[vertex]] = True
    return Tetrahedra(
        points=points,
        vertex=vertex,
        neighbour=index[neighbours[kept]],
        centre=centre,
        volume=volume,
        flat=flat,
        margin=_needed_margin(centre, reach, grains.box),
        hidden=int(np.sum(~seen)),
    )


def _tessellated(
    points: Points, grains: int, scale: float, *, unequal: bool
) -> tuple[Array, Array]:
    """Tetrahedra and neighbours (-1: none), by the compiled tessellation or by Qhull."""
    radius = points.radius / scale if unequal else np.zeros(len(points.radius))
    if len(radius) >= COMPILED_FROM:
        made = triangulate(points.scaled, radius**2)
        if made is not None:
            return made
    try:
        return _power_hull(points.scaled, radius) if unequal else _delaunay(points.scaled)
    except QhullError as error:
        raise NetworkError(
            f"tessellation of {grains} grains failed, they lie in one plane or line: "
            f"{str(error).splitlines()[0]}"
        ) from error


def _delaunay(points: Array) -> tuple[Array, Array]:
    """Tetrahedra and neighbours (-1: none) of Delaunay's tessellation of `points` (M, 3)."""
    mesh = Delaunay(points)
    if len(mesh.coplanar):
        raise NetworkError(
            f"tessellation: {len(mesh.coplanar)} grains coincide with another grain's image "
            "across a side; check the box against the grain positions"
        )
    return mesh.simplices, mesh.neighbors


def _power_hull(points: Array, radius: Array) -> tuple[Array, Array]:
    """Tetrahedra and neighbours (-1: none) of the power tessellation of spheres.

    `points` (M, 3) are the centres and `radius` (M,) the radii. It is the lower side of the convex
    hull of the points lifted to |x|^2 - r^2 (Aurenhammer 1987, SIAM J. Comput. 16, 78).
    """
    about = points - 0.5 * (points.max(axis=0) + points.min(axis=0))
    lifted = np.sum(about**2, axis=1) - radius**2
    hull = ConvexHull(np.column_stack([about, lifted / np.ptp(lifted) * np.ptp(about)]))
    lower = np.flatnonzero(hull.equations[:, 3] < 0)
    index = np.full(len(hull.simplices), -1, np.int32)
    index[lower] = np.arange(len(lower))
    return hull.simplices[lower], index[hull.neighbors[lower]]


def _unique(points: Points, simplices: Array, box: Array, periodic: tuple[bool, ...]) -> Array:
    """Indices of the tetrahedra to keep.

    Their power centre is inside the mirrored faces or on them. Of tetrahedra that differ by
    periods the one is kept whose corner of least key (grain, mirror image, shift) is not shifted.
    """
    plain = np.all((points.mirror == INSIDE) & (points.shift == 0), axis=1)
    kept = np.all(plain[simplices], axis=1)
    # a corner that is not shifted is needed; mirrored axes have no shift
    unshifted = np.all(points.shift == 0, axis=1)
    doubtful = np.flatnonzero(~kept & np.any(unshifted[simplices], axis=1))
    corner = simplices[doubtful]
    least = np.argmin(points.key[corner], axis=1)[:, None]
    good = unshifted[np.take_along_axis(corner, least, axis=1)[:, 0]]
    beyond = np.zeros(len(corner), bool)
    for axis in np.flatnonzero(~np.array(periodic)):
        beyond |= ~np.any(points.mirror[corner, axis] == INSIDE, axis=1)
    # tetrahedra beyond a face belong to the specimen when their centre is on the face:
    # they are then parts of a polyhedron that the face cuts
    check = np.flatnonzero(good & beyond)
    place, radius = points.shaken[corner[check]], points.radius[corner[check]]
    good[check] = _cut_by_face(place, radius, box, periodic)
    kept[doubtful] = good
    return np.flatnonzero(kept)


def _cut_by_face(corner: Array, radius: Array, box: Array, periodic: tuple[bool, ...]) -> Array:
    """True (K,) where a power centre lies within the mirrored faces or on them.

    `corner` (K, 4, 3) m and `radius` (K, 4) m are the grains of the tetrahedra. The centre of a
    flat tetrahedron is arbitrary, so its centroid decides: where it stands across a face it is
    part of what separates two polyhedra; where it lies in the face it has no volume to give.
    """
    tolerance = SAME_CENTRE * float(radius.mean()) if len(radius) else 0.0
    walled = ~np.array(periodic)
    centre, _ = geometry.power_centre(corner, radius)
    flat = np.abs(geometry.signed_volume(corner)) < FLAT * (tolerance / SAME_CENTRE) ** 3
    centre = np.where(flat[:, None], corner.mean(axis=1), centre)
    beyond = np.maximum(box[:, 0] - centre, centre - box[:, 1])
    inside = np.all((beyond <= tolerance) | ~walled, axis=1)
    in_face = [
        np.any(np.all(np.abs(corner - face) <= tolerance, axis=1) & walled, axis=1)
        for face in box.T
    ]
    return inside & ~(in_face[0] | in_face[1])


def _centres(points: Points, vertex: Array, scale: float) -> tuple[Array, Array, Array, Array]:
    """Power centre (P, 3) m, reach (P,) m, volume (P,) m3 and flatness (P,) of tetrahedra.

    The reach is the radius about the centre in which the centre of another grain would have
    changed the tetrahedron. Flat tetrahedra take the centre of their shaken corners.
    """
    given = (FLAT * scale**3, float(points.radius.max()))
    made: tuple[Array, Array, Array, Array] = centres(
        points.position, points.shaken, points.radius, vertex, given
    )
    return made


def _needed_margin(centre: Array, reach: Array, box: Array) -> Array:
    """How far (3,) m spheres of radius `reach` (P,) m about `centre` (P, 3) m leave the box."""
    low = (box[:, 0] - centre + reach[:, None]).max(axis=0, initial=0.0)
    return np.maximum(low, (centre + reach[:, None] - box[:, 1]).max(axis=0, initial=0.0))
