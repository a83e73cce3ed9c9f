"""The grains that are tessellated: checked, and placed with their centres in the box."""

from dataclasses import dataclass, replace

import numpy as np

from fdnet.errors import NetworkError
from fdnet.spheres.arrays import one_line
from fdnet.spheres.contacts import inside_others
from fdnet.spheres.images import neighbour_tree
from fdnet.spheres.snapshot import Array, Snapshot

LENGTHS = (1e-60, 1e60)
"""Shortest radius and longest length, m; no double number holds the cubes of lengths beyond."""
COARSE = 1e-8
"""Largest rounding of a coordinate, in mean grain radii: a tenth of the shake (`points.SHAKE`),
which coarser coordinates could not hold."""
COINCIDENT = 1e-3
"""Grains that are placed nearer than this, in radii of the smallest grain, coincide."""
ON_FACE_TOLERANCE = 1e-6
"""A centre within this distance of a mirrored face, in mean grain radii, lies on the face."""
INSET = 1e-4
"""Depth inside the box, in mean grain radii, of grains that are placed on an x face."""
ITERATIONS = 20


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlacedGrains:
    """The n grains that reach into the box, every centre inside it or on its mirrored faces.

    Attributes:
        grains: the n grains, their positions and radii as they are tessellated.
        height: (n,) m, how far what stands for each grain reaches from its centre along x: less
            than the radius for the flat cap of a grain centred beyond an x face.
        index: (n,) which of the given grains they are.
        periodic: whether the sides x, y and z are periodic; the other faces are mirror planes.
        scale: m, mean radius of these grains as given.
        beyond: number of grains whose given centre lay beyond a mirrored face.
        inside: (n,) whether more than half of the surface of a grain lies inside another one.
        dropped: number of grains that were left out, because they lie wholly inside another one or
            are placed where a larger one is.
    """

    grains: Snapshot
    height: Array
    outward: Array
    index: Array
    periodic: tuple[bool, bool, bool]
    scale: float
    beyond: int
    inside: Array
    dropped: int

    __repr__ = one_line


def place_grains(grains: Snapshot, *, periodic: tuple[bool, bool, bool]) -> PlacedGrains:
    """The grains that reach into the box, ready for the tessellation.

    Grains that add nothing to the solid are left out. Raises NetworkError on impossible lengths
    (`check_lengths`) and on fewer than four grains in the box.
    """
    if len(grains):
        check_lengths(grains, periodic)
    reaching = _reaching(grains, periodic) if len(grains) else np.zeros(0, int)
    wholly, mostly, _ = inside_others(grains.where(reaching), periodic)
    index, mostly = reaching[~wholly], mostly[~wholly]
    placed, beyond = onto_walls(grains.where(index), periodic)
    if len(double := _coinciding(placed, periodic)):
        index, mostly = np.delete(index, double), np.delete(mostly, double)
        placed, beyond = onto_walls(grains.where(index), periodic)
    if len(index) < 4:
        dropped = f", {len(reaching)} with those inside others" * (len(index) < len(reaching))
        raise NetworkError(
            f"tessellation: {len(index)} of {len(grains)} grains reach into the box{dropped}; a "
            "tetrahedron needs at least 4, give more grains, repeat a periodic cell, or mend the "
            "box"
        )
    inside = grains.where(index)
    outward = _outward(inside, periodic)
    return PlacedGrains(
        grains=placed,
        height=_heights_along_x(inside, placed, outward),
        outward=outward,
        index=index,
        periodic=periodic,
        scale=float(inside.radius.mean()),
        beyond=beyond,
        inside=mostly,
        dropped=len(reaching) - len(index),
    )


def check_lengths(spheres: Snapshot, periodic: tuple[bool, ...]) -> None:
    """Raise NetworkError on lengths that no tessellation can work with.

    These are radii or box sides that are not positive, lengths whose cubes no double number holds,
    and a box, or centres along its periodic sides, so far from the origin that their coordinates
    are rounded by more than 1e-8 mean radii.
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


def _reaching(grains: Snapshot, periodic: tuple[bool, ...]) -> Array:
    """Indices (n,) of the grains whose sphere reaches into the box."""
    beyond = np.maximum(grains.box[:, 0] - grains.position, grains.position - grains.box[:, 1])
    return np.flatnonzero(np.all((beyond < grains.radius[:, None]) | np.array(periodic), axis=1))


def onto_walls(grains: Snapshot, periodic: tuple[bool, ...]) -> tuple[Snapshot, int]:
    """Grains with every centre inside or on the mirrored faces, and how many were centred beyond.

    Of a grain centred beyond a face only a cap is inside the box. A half sphere of the volume of
    that cap, centred on the face, takes its place: the specimen stays its own mirror image and
    keeps its void. A centre within `ON_FACE_TOLERANCE` of a face is put on the face. At the x
    faces it is put 1e-4 mean radii inside instead, so that the facets between three such grains
    are throats which end in pores on the face, where the pressure is held.
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
        # half sphere 2 pi r^3 / 3 against cap pi h^2 (3 R - h) / 3
        depth = INSET * scale if axis == 0 else 0.0
        radius = np.where(outside, _same_cap(radius, height, depth), radius)
        near = beyond > -max(tolerance, depth)
        middle = 0.5 * (low + high)
        position[near, axis] = np.where(position[near, axis] < middle, low + depth, high - depth)
        moved |= outside
    return replace(grains, position=position, radius=radius), int(moved.sum())


def _same_cap(radius: Array, height: Array, depth: float) -> Array:
    """Radius (n,) m of the sphere whose part inside a face has the volume of a given cap.

    The sphere is centred `depth` m inside the face; the cap has `height` (n,) m and belongs to a
    sphere of `radius` (n,) m.
    """
    cap = 0.5 * height**2 * (3.0 * radius - height)
    same = np.cbrt(cap)
    for _ in range(ITERATIONS):
        same = np.cbrt(np.maximum(cap - 1.5 * depth * same**2 + 0.5 * depth**3, 0.0))
    return np.maximum(same, depth)


def _outward(given: Snapshot, periodic: tuple[bool, ...]) -> Array:
    """How far beyond an x face (n,) m the grains are centred that show the box a flat cap.

    It is 0 for all other grains, those that lie beyond a side wall as well among them.
    """
    beyond = np.maximum(given.box[:, 0] - given.position, given.position - given.box[:, 1])
    outside = (beyond > ON_FACE_TOLERANCE * float(given.radius.mean())) & ~np.array(periodic)
    return np.where(outside[:, 0] & ~outside[:, 1:].any(axis=1), beyond[:, 0], 0.0)


def _heights_along_x(given: Snapshot, placed: Snapshot, outward: Array) -> Array:
    """Semi-axis along x (n,) m of the half ellipsoids that stand for caps at the x faces.

    Of a grain centred beyond an x face, by `outward` (n,) m, a cap of height h on a disc of radius
    a is in the box. The half ellipsoid on that disc with the volume of the cap has the height
    h (3 a^2 + h^2) / (4 a^2); `placed` has the radius of the half sphere of that volume. All other
    grains are spheres: their height is their radius.
    """
    tall = given.radius - outward
    base = tall * (2.0 * given.radius - tall)
    return np.where(outward > 0.0, tall * (3.0 * base + tall**2) / (4.0 * base), placed.radius)


def _coinciding(grains: Snapshot, periodic: tuple[bool, ...]) -> Array:
    """Indices of placed grains that coincide with one that is not smaller."""
    if not len(grains):
        return np.zeros(0, int)
    tree = neighbour_tree(grains.position, grains.box, periodic=periodic)
    close = tree.query_pairs(COINCIDENT * float(grains.radius.min()), output_type="ndarray")
    first, second = close.T
    return np.unique(np.where(grains.radius[first] < grains.radius[second], first, second))
