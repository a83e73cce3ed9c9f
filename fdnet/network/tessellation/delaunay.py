"""Grains in their box with images and mirror images, and the tetrahedra between them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, Delaunay, QhullError

from fdnet.errors import NetworkError
from fdnet.network.compiled import compiled
from fdnet.spheres.geometry import (
    INSIDE,
    inside_others,
    label,
    make_images,
    neighbour_tree,
    packed_shift,
)
from fdnet.spheres.snapshot import Array, Snapshot, one_line

LENGTHS = (1e-60, 1e60)
"""Shortest radius and longest length, m; no double number holds the cubes of lengths beyond."""
COARSE = 1e-8
"""Largest rounding of a coordinate, in mean grain radii: a tenth of the shake (`SHAKE`),
which coarser coordinates could not hold."""
COINCIDENT = 1e-3
"""Grains that are placed nearer than this, in radii of the smallest grain, coincide."""
ON_FACE_TOLERANCE = 1e-6
"""A centre within this distance of a mirrored face, in mean grain radii, lies on the face."""
INSET = 1e-4  # Depth inside the box, in mean grain radii, of grains that are placed on an x face
ITERATIONS = 20


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedGrains:
    """The n grains that reach into the box, every centre inside it or on its mirrored faces."""

    grains: Snapshot  # the n grains, their positions and radii as they are tessellated
    # (n,) m, that of a grain centred beyond an x face, for which a half sphere stands; of all
    # others the radius as it is tessellated
    own_radius: Array
    outward: Array  # (n,) m, how far beyond an x face such a grain is centred; 0 for all others
    index: Array  # (n,) which of the given grains they are
    # whether the sides x, y and z are periodic; the other faces are mirror planes
    periodic: tuple[bool, bool, bool]
    scale: float  # m, mean radius of these grains as given
    beyond: int  # number of grains whose given centre lay beyond a mirrored face
    inside: Array  # (n,) whether the centre of a grain lies inside another one, as in clumps
    # number of grains that were left out, because they lie wholly inside another one or are placed
    # where a larger one is
    dropped: int

    __repr__ = one_line


def place_grains(grains: Snapshot, *, periodic: tuple[bool, bool, bool]) -> PlacedGrains:
    """The grains that reach into the box and add to the solid, ready for the tessellation.

    Raises NetworkError on impossible lengths (`check_lengths`) and on fewer than four such grains.
    """
    if len(grains):
        check_lengths(grains, periodic)
    reaches = (_beyond(grains) < grains.radius[:, None]) | np.array(periodic)
    reaching = np.flatnonzero(reaches.all(axis=1))
    wholly, centred = inside_others(grains.where(reaching), periodic)
    index, centred = reaching[~wholly], centred[~wholly]
    placed, beyond = onto_walls(grains.where(index), periodic)
    if len(index):
        tree = neighbour_tree(placed.position, placed.box, periodic=periodic)
        close = tree.query_pairs(COINCIDENT * float(placed.radius.min()), output_type="ndarray")
        first, second = close.T
        if len(close):  # the smaller of two grains that coincide
            double = np.unique(np.where(placed.radius[first] < placed.radius[second], *close.T))
            index, centred = np.delete(index, double), np.delete(centred, double)
            placed, beyond = onto_walls(grains.where(index), periodic)
    if len(index) < 4:
        dropped = f", {len(reaching)} with those inside others" * (len(index) < len(reaching))
        raise NetworkError(
            f"tessellation: {len(index)} of {len(grains)} grains reach into the box{dropped}; a "
            "tetrahedron needs at least 4, give more grains, repeat a periodic cell, or mend the "
            "box"
        )
    given = grains.where(index)
    out, scale = _beyond(given), float(given.radius.mean())
    past = (out > ON_FACE_TOLERANCE * scale) & ~np.array(periodic)
    outward = np.where(past[:, 0] & ~past[:, 1:].any(axis=1), out[:, 0], 0.0)
    return PlacedGrains(
        grains=placed,
        own_radius=np.where(outward > 0.0, given.radius, placed.radius),
        outward=outward,
        index=index,
        periodic=periodic,
        scale=scale,
        beyond=beyond,
        inside=centred,
        dropped=len(reaching) - len(index),
    )


def _beyond(grains: Snapshot) -> Array:
    """How far (n, 3) m the grains are centred beyond the nearer face along each axis."""
    return np.maximum(grains.box[:, 0] - grains.position, grains.position - grains.box[:, 1])


def check_lengths(spheres: Snapshot, periodic: tuple[bool, ...]) -> None:
    """Raise NetworkError on lengths that no tessellation can work with.

    These are radii or box sides that are not positive, lengths whose cubes no double number holds,
    and coordinates so far from the origin that they are rounded by more than 1e-8 mean radii.
    """
    box, radius = spheres.box, spheres.radius
    if np.any(radius <= 0):
        raise NetworkError("tessellation: a grain radius is not positive; check the input lengths")
    largest = max(float(np.max(np.abs(one))) for one in (box, radius, spheres.position))
    if radius.min() < LENGTHS[0] or largest > LENGTHS[1]:
        raise NetworkError(
            f"tessellation: lengths from {radius.min():.3g} m (radius) to {largest:.3g} m, "
            f"expected between {LENGTHS[0]:g} and {LENGTHS[1]:g} m; check the units"
        )
    around = spheres.position[:, np.array(periodic, bool)]
    scale = float(radius.mean())
    farthest = max(float(np.max(np.abs(box))), float(np.max(np.abs(around), initial=0.0)))
    if np.spacing(farthest) > COARSE * scale:
        raise NetworkError(
            f"tessellation: coordinates up to {farthest:.3g} m are rounded by "
            f"{np.spacing(farthest):.1g} m, more than {COARSE:g} of a radius of {scale:.3g} m; "
            "move the specimen to the origin, check units and box"
        )
    if np.any(box[:, 1] <= box[:, 0]):
        raise NetworkError("tessellation: a box side is not positive; check the input lengths")


def onto_walls(grains: Snapshot, periodic: tuple[bool, ...]) -> tuple[Snapshot, int]:
    """Grains with every centre inside or on the mirrored faces, and how many were centred beyond.

    A half sphere of the volume of the cap inside, centred on the face, takes the place of a grain
    centred beyond it: the specimen stays its own mirror image and keeps its void. A centre within
    `ON_FACE_TOLERANCE` of a face is put on the face; at the x faces 1e-4 mean radii inside, so
    that the facets between three such grains are throats which end in pores on the face.
    """
    scale = float(grains.radius.mean()) if len(grains) else 0.0
    tolerance = ON_FACE_TOLERANCE * scale
    position, radius = grains.position.copy(), grains.radius.copy()
    moved = np.zeros(len(grains), bool)
    for axis in np.flatnonzero(~np.array(periodic)):
        low, high = grains.box[axis]
        beyond = np.maximum(low - position[:, axis], position[:, axis] - high)
        outside = beyond > tolerance
        height = np.where(outside, radius - beyond, radius)
        depth = INSET * scale if axis == 0 else 0.0
        # the sphere centred `depth` inside whose part in the box has the volume of the cap:
        # half sphere 2 pi r^3 / 3 against cap pi h^2 (3 R - h) / 3
        cap = 0.5 * height**2 * (3.0 * radius - height)
        same = _radius_of_cap(cap, depth)
        radius = np.where(outside, np.maximum(same, depth), radius)
        near = beyond > -max(tolerance, depth)
        middle = 0.5 * (low + high)
        position[near, axis] = np.where(position[near, axis] < middle, low + depth, high - depth)
        moved |= outside
    return replace(grains, position=position, radius=radius), int(moved.sum())


def _radius_of_cap(cap: Array, depth: float) -> Array:
    """The root r (N,) m of r^3 + 3/2 depth r^2 - depth^3 / 2 = cap (N,) m3, by Newton's steps.

    They add, multiply and divide alone, which every processor rounds alike. Cube roots differ in
    the last digit, which decides on flat throats at the face.
    """
    target = cap + 0.5 * depth**3
    root = np.ldexp(1.0, -(-np.frexp(target)[1] // 3))
    for _ in range(ITERATIONS):
        square = root * root
        slope = 3.0 * (square + depth * root)
        root = root - (root * square + 1.5 * depth * square - target) / slope
    return np.asarray(root)


# ------------------------------------------------------------------------------------------------
# The points that are tessellated: the centres of the grains and of their images near the box.
#
# Along a periodic axis a grain has images shifted by whole periods. A face that is not periodic is
# a mirror plane: it separates every grain from its own mirror image, so the power centres of what
# lies inside the box are inside too, and those of what the face cuts lie on the face. A shake of
# 1e-7 mean grain radii, for the tessellation alone and the same for all periodic images of a
# grain, splits cospherical sets of grains (lattices, prisms cut by a face) alike everywhere.


SHAKE = 1e-7  # Largest displacement of a point along an axis, in mean grain radii
SHAKE_SEED = 3_141_592


class ImagePoints(NamedTuple):
    """M images of n grains, the grains themselves among them."""

    owner: Array  # (M,) index of the grain
    position: Array  # (M, 3) m, centre of the image
    shift: Array  # (M, 3) whole periods by which the image is moved along each axis
    mirror: Array  # (M, 3) one of INSIDE, MIRROR_LOW, MIRROR_HIGH, ON_FACE of `spheres.geometry`
    radius: Array  # (M,) m
    shaken: Array  # (M, 3) m, centre after the shake
    scaled: Array  # (M, 3) shaken centre from the low corner of the box, in mean grain radii
    name: Array  # (M,) integer of grain and mirror image; images that differ by periods share it
    key: Array  # (M,) integer that orders the images by name, then by shift


def make_points(grains: Snapshot, *, periodic: tuple[bool, ...], margin: Array) -> ImagePoints:
    """All images of `grains` within `margin` (3,) m of the box."""
    scale = float(grains.radius.mean())
    images = make_images(
        grains.position,
        grains.box,
        periodic=periodic,
        margin=margin,
        tolerance=ON_FACE_TOLERANCE * scale,
    )
    name = label(images)
    key = name.astype(np.int64) * 2**30 + packed_shift(images.shift)
    # the shake is drawn by the rank of the grain in the order of x, y, z, so that another
    # numbering of the grains changes nothing
    rank = np.empty(len(grains), int)
    rank[np.lexsort(grains.position.T[::-1])] = np.arange(len(grains))
    mirrors, code = np.unique(name % 27, return_inverse=True)
    noise = np.random.default_rng(SHAKE_SEED).uniform(
        -SHAKE, SHAKE, (len(mirrors), len(grains), 3)
    )
    scaled = (images.position - grains.box[:, 0]) / scale + noise[code, rank[images.owner]]
    return ImagePoints(
        owner=images.owner,
        position=images.position,
        shift=images.shift,
        mirror=images.mirror,
        radius=grains.radius[images.owner],
        shaken=scaled * scale + grains.box[:, 0],
        scaled=scaled,
        name=name,
        key=key,
    )


# ------------------------------------------------------------------------------------------------
# What is measured on one tetrahedron after the other, in one compiled pass, so that a whole pack
# needs no arrays in between.


Vector = tuple[float, float, float]


@compiled
def less(points: Array, a: int, b: int) -> Vector:
    """Row `a` of `points` (M, 3) less row `b`."""
    return points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]


@compiled
def times(left: Vector, right: Vector) -> Vector:
    """Vector product."""
    return (
        left[1] * right[2] - left[2] * right[1],
        left[2] * right[0] - left[0] * right[2],
        left[0] * right[1] - left[1] * right[0],
    )


@compiled
def along(left: Vector, right: Vector) -> float:
    """Scalar product."""
    return left[0] * right[0] + left[1] * right[1] + left[2] * right[2]


@compiled
def centres(
    position: Array, shaken: Array, radius: Array, vertex: Array, flattest: float, largest: float
) -> tuple[Array, Array, Array, Array]:
    """Power centre (P, 3) m, reach (P,) m, volume (P,) m3 and flatness (P,) of tetrahedra.

    The power of a point x to a sphere of centre p and radius r is |x - p|^2 - r^2; the centre has
    equal power to the four corners (Aurenhammer 1987, SIAM J. Comput. 16, 78). `vertex` (P, 4) are
    the corners among the points `position` and `shaken` (M, 3) m. A tetrahedron of less volume
    than `flattest` m3 is flat and takes the centre of its shaken corners. The reach is the radius
    about the centre in which the centre of a sphere of radius `largest` m would have less power.
    """
    count = len(vertex)
    centre, reach = np.empty((count, 3)), np.empty(count)
    volume, flat = np.empty(count), np.empty(count, np.bool_)
    for t in range(count):
        a, b, c, d = vertex[t, 0], vertex[t, 1], vertex[t, 2], vertex[t, 3]
        one, two, three = less(position, b, a), less(position, c, a), less(position, d, a)
        volume[t] = abs(along(one, times(two, three))) / 6.0
        flat[t] = volume[t] < flattest
        base = shaken if flat[t] else position
        if flat[t]:
            one, two, three = less(base, b, a), less(base, c, a), less(base, d, a)
        first = radius[a]
        half = (
            0.5 * (along(one, one) + (first - radius[b]) * (first + radius[b])),
            0.5 * (along(two, two) + (first - radius[c]) * (first + radius[c])),
            0.5 * (along(three, three) + (first - radius[d]) * (first + radius[d])),
        )
        offset = _solved(one, two, three, half)
        for k in range(3):
            centre[t, k] = base[a, k] + offset[k]
        power = along(offset, offset) - first * first
        reach[t] = np.sqrt(max(power + largest * largest, 0.0))
    return centre, reach, volume, flat


@compiled
def _solved(one: Vector, two: Vector, three: Vector, right: Vector) -> Vector:
    """The vector of these scalar products with three others (Cramer); NaN if they are flat."""
    first, second, third = times(two, three), times(three, one), times(one, two)
    determinant = along(one, first)
    scale = 1.0 / determinant if determinant != 0.0 else np.nan
    x, y, z = right[0] * scale, right[1] * scale, right[2] * scale
    return (
        x * first[0] + y * second[0] + z * third[0],
        x * first[1] + y * second[1] + z * third[1],
        x * first[2] + y * second[2] + z * third[2],
    )


@compiled
def touching_spheres(
    points: Array, radius: Array, vertex: Array, tolerance: float
) -> tuple[Array, Array, Array]:
    """Sphere that touches the four on the corners: centre (P, 3) m, radius (P,) m, and if within.

    The radius is NaN where there is none. The last (P,) is true where the centre lies in the
    tetrahedron; a barycentric coordinate may be negative by `tolerance`. Subtracting
    |x - p_i|^2 = (s + r_i)^2 pairwise leaves x = u + v s for the centre x and the radius s
    (Apollonius' problem), then one quadratic equation for s.
    """
    count = len(vertex)
    centre, touching = np.empty((count, 3)), np.empty(count)
    within = np.zeros(count, np.bool_)
    for t in range(count):
        a, b, c, d = vertex[t, 0], vertex[t, 1], vertex[t, 2], vertex[t, 3]
        one, two, three = less(points, b, a), less(points, c, a), less(points, d, a)
        first = radius[a]
        constant = (
            0.5 * (along(one, one) + first**2 - radius[b] ** 2),
            0.5 * (along(two, two) + first**2 - radius[c] ** 2),
            0.5 * (along(three, three) + first**2 - radius[d] ** 2),
        )
        apart = (first - radius[b], first - radius[c], first - radius[d])
        u, v = _solved(one, two, three, constant), _solved(one, two, three, apart)
        half, rest = first - along(u, v), along(u, u) - first**2
        under = half**2 - (along(v, v) - 1.0) * rest
        below = half + np.sqrt(under) if under >= 0.0 else np.nan
        touching[t] = rest / below if below != 0.0 else np.nan
        if not touching[t] > -min(first, radius[b], radius[c], radius[d]):
            touching[t] = np.nan
        s = touching[t]
        offset = u[0] + v[0] * s, u[1] + v[1] * s, u[2] + v[2] * s
        for k in range(3):
            centre[t, k] = points[a, k] + offset[k]
        within[t] = _within(one, two, three, offset, tolerance)
    return centre, touching, within


@compiled
def _within(one: Vector, two: Vector, three: Vector, offset: Vector, tolerance: float) -> bool:
    """Whether `offset` from a corner lies in the tetrahedron of three sides at that corner."""
    first = times(two, three)
    determinant = along(one, first)
    if determinant == 0.0:
        return False
    x = along(offset, first) / determinant
    y = along(offset, times(three, one)) / determinant
    z = along(offset, times(one, two)) / determinant
    return min(x, y, z) >= -tolerance and x + y + z <= 1.0 + tolerance


@compiled
def solids(points: Array, radius: Array, vertex: Array) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the spheres on the corners in each tetrahedron.

    Sphere wedges by solid angle, less the overlap of each pair by dihedral angle: exact over a
    whole tessellation, and in one tetrahedron as long as no sphere reaches through the opposite
    face and no three overlap.
    """
    count = len(vertex)
    volume, surface = np.zeros(count), np.zeros(count)
    for t in range(count):
        a = vertex[t, 0]
        one, two = less(points, vertex[t, 1], a), less(points, vertex[t, 2], a)
        triple = abs(along(one, times(two, less(points, vertex[t, 3], a))))
        for i in range(4):
            own = vertex[t, i]
            r = radius[own]
            angle = _corner_angle(points, vertex[t], i, triple)
            volume[t] += angle * r**3 / 3.0
            surface[t] += angle * r**2
            for j in range(i + 1, 4):
                side = less(points, vertex[t, j], own)
                apart, other = np.sqrt(along(side, side)), radius[vertex[t, j]]
                if apart < r + other:
                    turn = _edge_angle(points, vertex[t], i, j, triple) / (2.0 * np.pi)
                    shared, hidden = _lens(r, other, apart)
                    volume[t] -= turn * shared
                    surface[t] -= turn * hidden
    return volume, surface


@compiled
def _corner_angle(points: Array, corner: Array, i: int, triple: float) -> float:
    """Solid angle sr at corner `i` (van Oosterom and Strackee 1983); `triple`: 6 volumes."""
    a = less(points, corner[(i + 1) % 4], corner[i])
    b = less(points, corner[(i + 2) % 4], corner[i])
    c = less(points, corner[(i + 3) % 4], corner[i])
    la, lb, lc = np.sqrt(along(a, a)), np.sqrt(along(b, b)), np.sqrt(along(c, c))
    below = la * lb * lc + along(a, b) * lc + along(a, c) * lb + along(b, c) * la
    return 2.0 * np.arctan2(triple, below)


@compiled
def _edge_angle(points: Array, corner: Array, i: int, j: int, triple: float) -> float:
    """Angle rad between the faces at the edge from corner `i` to `j`."""
    k = 0
    while k in (i, j):
        k += 1
    m = 6 - i - j - k
    axis = less(points, corner[j], corner[i])
    left = times(axis, less(points, corner[k], corner[i]))
    right = times(axis, less(points, corner[m], corner[i]))
    # (axis x u) x (axis x v) = axis (axis . (u x v))
    return np.arctan2(np.sqrt(along(axis, axis)) * triple, along(left, right))


@compiled
def _lens(first: float, second: float, apart: float) -> tuple[float, float]:
    """Volume m3 and surface m2 of the lens of two spheres that overlap."""
    to_plane = (apart**2 + first**2 - second**2) / (2.0 * apart)
    one = min(max(first - to_plane, 0.0), 2.0 * first)
    other = min(max(second - apart + to_plane, 0.0), 2.0 * second)
    volume = np.pi * (one**2 * (3.0 * first - one) + other**2 * (3.0 * second - other)) / 3.0
    return volume, 2.0 * np.pi * (first * one + second * other)


# ------------------------------------------------------------------------------------------------
# Tetrahedra of grains and images: Delaunay's, or for unequal grains of the power tessellation.
# Along a periodic axis tetrahedra that differ by whole periods are one.


FLAT = 1e-5  # A tetrahedron of less volume, in mean grain radii cubed, is flat
SAME_CENTRE = 1e-5  # Power centres nearer than this, in mean grain radii, are one point
EQUAL_SPREAD = 1e-3  # Radii that spread by at most this share of their mean are treated as equal


class Tetrahedra(NamedTuple):
    """P unique tetrahedra between M points."""

    points: ImagePoints  # the M points, images of the grains
    vertex: Array  # (P, 4) points at the corners
    neighbour: Array
    """(P, 4) tetrahedron across the facet opposite each corner; -1 where that lies across a period
    or beyond a wall."""
    centre: Array  # (P, 3) m, power centre: the point of equal power to the four grains
    volume: Array  # (P,) m3
    flat: Array
    """(P,) whether the volume is below 1e-5 mean radii cubed; the centre is then arbitrary."""
    margin: Array
    """(3,) m, how far beyond the box the spheres reach that must be empty: those about a centre in
    which the centre of another grain would have changed the tetrahedron."""
    hidden: int  # number of grains without any tetrahedron


def make_tetrahedra(
    grains: Snapshot, *, periodic: tuple[bool, bool, bool], margin: Array
) -> Tetrahedra:
    """Unique tetrahedra of `grains` and of their images within `margin` (3,) m of the box.

    The power tessellation is used where the radii spread by more than 1e-3 of their mean. Raises
    NetworkError on grains in one plane and on grains that coincide with an image.
    """
    scale, box = float(grains.radius.mean()), grains.box
    points = make_points(grains, periodic=periodic, margin=margin)
    unequal = float(np.ptp(grains.radius)) > EQUAL_SPREAD * scale
    simplices, neighbours = _tessellated(points, len(grains), scale, unequal=unequal)
    kept = _unique(points, simplices, box, periodic)
    index = np.full(len(simplices) + 1, -1, np.int32)
    index[kept] = np.arange(len(kept))
    vertex = simplices[kept]
    flattest, largest = FLAT * scale**3, float(points.radius.max())
    centre, reach, volume, flat = centres(
        points.position, points.shaken, points.radius, vertex, flattest, largest
    )
    low = (box[:, 0] - centre + reach[:, None]).max(axis=0, initial=0.0)
    seen = np.zeros(len(grains), bool)
    seen[points.owner[vertex]] = True
    return Tetrahedra(
        points=points,
        vertex=vertex,
        neighbour=index[neighbours[kept]],
        centre=centre,
        volume=volume,
        flat=flat,
        margin=np.maximum(low, (centre + reach[:, None] - box[:, 1]).max(axis=0, initial=0.0)),
        hidden=int(np.sum(~seen)),
    )


def _tessellated(
    points: ImagePoints, grains: int, scale: float, *, unequal: bool
) -> tuple[Array, Array]:
    """Tetrahedra and neighbours (-1: none), by Qhull."""
    try:
        if unequal:
            return _power_hull(points.scaled, points.radius / scale)
        mesh = Delaunay(points.scaled)
    except QhullError as error:
        raise NetworkError(
            f"tessellation of {grains} grains failed, they lie in one plane or line: "
            f"{str(error).splitlines()[0]}"
        ) from error
    if len(mesh.coplanar):
        raise NetworkError(
            f"tessellation: {len(mesh.coplanar)} grains coincide with another grain's image "
            "across a side; check the box against the grain positions"
        )
    return mesh.simplices, mesh.neighbors


def _power_hull(points: Array, radius: Array) -> tuple[Array, Array]:
    """Tetrahedra and neighbours (-1: none) of the power tessellation of spheres.

    It is the lower side of the convex hull of the centres `points` (M, 3) lifted to |x|^2 - r^2
    (Aurenhammer 1987, SIAM J. Comput. 16, 78).
    """
    about = points - 0.5 * (points.max(axis=0) + points.min(axis=0))
    lifted = np.sum(about**2, axis=1) - radius**2
    hull = ConvexHull(np.column_stack([about, lifted / np.ptp(lifted) * np.ptp(about)]))
    lower = np.flatnonzero(hull.equations[:, 3] < 0)
    index = np.full(len(hull.simplices), -1, np.int32)
    index[lower] = np.arange(len(lower))
    return hull.simplices[lower], index[hull.neighbors[lower]]


def _unique(
    points: ImagePoints, simplices: Array, box: Array, periodic: tuple[bool, ...]
) -> Array:
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
    beyond, walled = np.zeros(len(corner), bool), ~np.array(periodic)
    for axis in np.flatnonzero(walled):
        beyond |= ~np.any(points.mirror[corner, axis] == INSIDE, axis=1)
    # beyond a face those belong to the specimen whose polyhedron the face cuts
    check = np.flatnonzero(good & beyond)
    vertex = corner[check]
    place = points.shaken[vertex]
    scale = float(points.radius[vertex].mean()) if len(check) else 0.0
    tolerance, flattest = SAME_CENTRE * scale, FLAT * scale**3
    centre, _, _, flat = centres(
        points.shaken, points.shaken, points.radius, vertex, flattest, 0.0
    )
    # The centre of a flat tetrahedron is arbitrary, so its centroid decides: where it stands
    # across a face it separates two polyhedra; where it lies in it, it has no volume to give.
    centre = np.where(flat[:, None], place.mean(axis=1), centre)
    away = np.maximum(box[:, 0] - centre, centre - box[:, 1])
    good[check] = np.all((away <= tolerance) | ~walled, axis=1)
    for face in box.T:
        in_face = np.all(np.abs(place - face) <= tolerance, axis=1) & walled
        good[check] &= ~np.any(in_face, axis=1)
    kept[doubtful] = good
    return np.flatnonzero(kept)
