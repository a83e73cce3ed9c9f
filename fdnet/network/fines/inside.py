"""The parts of tetrahedra inside the box: cut at its mirrored faces into smaller tetrahedra."""

import numpy as np

from fdnet.network import geometry
from fdnet.spheres.snapshot import Array

FLAT = 1e-14
"""Volume over the cube of the longest edge, below which a tetrahedron is flat."""


def clip_to_box(corner: Array, box: Array, periodic: tuple[bool, ...]) -> tuple[Array, Array]:
    """The parts of tetrahedra within the faces of `box` that are not periodic.

    Args:
        corner: (C, 4, 3) m, corners of the tetrahedra.
        box: (3, 2) m, lower and upper bounds.
        periodic: whether the axes x, y and z are periodic; their faces cut nothing.

    Returns:
        Corners (K, 4, 3) m of the tetrahedra that make up the parts, and the index (K,) of the
        tetrahedron that each is a part of.
    """
    owner = np.arange(len(corner))
    for axis in range(3):
        for face, sign in zip(box[axis], (1.0, -1.0), strict=True):
            if not periodic[axis]:
                height = sign * (corner[:, :, axis] - face)
                corner, owner = _above(corner, owner, height)
    solid = _is_solid(corner)
    return corner[solid], owner[solid]


def _is_solid(corner: Array) -> Array:
    """Whether tetrahedra (C, 4, 3) have a volume beyond rounding, against the cube of an edge."""
    edge = np.ptp(corner, axis=1).max(axis=1)
    return np.abs(geometry.signed_volume(corner)) > FLAT * edge**3


def _above(corner: Array, owner: Array, height: Array) -> tuple[Array, Array]:
    """Parts of tetrahedra above the plane over which their corners lie `height` (C, 4) m high."""
    positive = height > 0.0
    count = positive.sum(axis=1)
    whole = count == 4
    corners, owners = [corner[whole]], [owner[whole]]
    for kept, parts in ((1, _cut_one), (2, _cut_two), (3, _cut_three)):
        chosen = np.flatnonzero(count == kept)
        order = np.argsort(~positive[chosen], axis=1, kind="stable")
        sorted_corner = np.take_along_axis(corner[chosen], order[:, :, None], axis=1)
        sorted_height = np.take_along_axis(height[chosen], order, axis=1)
        pieces = parts(sorted_corner, sorted_height)
        corners.append(pieces.reshape(-1, 4, 3))
        owners.append(np.repeat(owner[chosen], pieces.shape[1]))
    return np.concatenate(corners), np.concatenate(owners)


def _crossing(corner: Array, height: Array, first: int, second: int) -> Array:
    """Points (C, 3) where the edges from corner `first` to `second` meet the plane."""
    share = height[:, first] / (height[:, first] - height[:, second])
    return corner[:, first] + share[:, None] * (corner[:, second] - corner[:, first])


def _cut_one(corner: Array, height: Array) -> Array:
    """One corner above the plane: the tetrahedron of this corner and three crossings."""
    points = [corner[:, 0], *(_crossing(corner, height, 0, other) for other in (1, 2, 3))]
    return np.stack(points, axis=1)[:, None]


def _cut_two(corner: Array, height: Array) -> Array:
    """Two corners above: a wedge with the triangles (0, 02, 03) and (1, 12, 13)."""
    near = [corner[:, 0], _crossing(corner, height, 0, 2), _crossing(corner, height, 0, 3)]
    far = [corner[:, 1], _crossing(corner, height, 1, 2), _crossing(corner, height, 1, 3)]
    return _wedge(near, far)


def _cut_three(corner: Array, height: Array) -> Array:
    """Three corners above: a wedge between their facet and the three crossings."""
    near = [corner[:, k] for k in (0, 1, 2)]
    far = [_crossing(corner, height, k, 3) for k in (0, 1, 2)]
    return _wedge(near, far)


def _wedge(near: list[Array], far: list[Array]) -> Array:
    """Three tetrahedra (C, 3, 4, 3) of the wedge between two triangles."""
    a, b, c = near
    d, e, f = far
    pieces = [[a, b, c, d], [b, c, d, e], [c, d, e, f]]
    return np.stack([np.stack(piece, axis=1) for piece in pieces], axis=1)
