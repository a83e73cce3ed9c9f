"""Tetrahedra, triangles and spheres in closed form: a second way to what a network measures.

Lengths are in m; arrays may have any leading shape, written "...". Sources: solid angle, van
Oosterom and Strackee 1983 (IEEE Trans. Biomed. Eng. 30, 125, eq. 8); touching circle and sphere,
Apollonius' problem by subtracting the sphere equations; lens of two spheres, the sum of two caps.
"""

from itertools import combinations

import numpy as np

from fdnet.spheres.snapshot import Array


def signed_volume(corner: Array) -> Array:
    """Volume (...) m3 of tetrahedra (..., 4, 3), positive where the corners turn to the right."""
    return np.linalg.det(corner[..., 1:, :] - corner[..., :1, :]) / 6.0


def triangle_area(triangle: Array) -> Array:
    """Area (...) m2 of triangles (..., 3, 3)."""
    side = triangle[..., 1:, :] - triangle[..., :1, :]
    return 0.5 * np.linalg.norm(np.cross(side[..., 0, :], side[..., 1, :]), axis=-1)


def solid_angles(corner: Array) -> Array:
    """Solid angle (..., 4) sr at each corner of tetrahedra (..., 4, 3)."""
    angles = []
    for k in range(4):
        side = np.delete(corner, k, axis=-2) - corner[..., k : k + 1, :]
        la, lb, lc = np.moveaxis(np.linalg.norm(side, axis=-1), -1, 0)
        gram = side @ np.swapaxes(side, -1, -2)
        below = la * lb * lc + gram[..., 0, 1] * lc + gram[..., 0, 2] * lb + gram[..., 1, 2] * la
        angles.append(2.0 * np.arctan2(np.abs(np.linalg.det(side)), below))
    return np.stack(angles, axis=-1)


def dihedral_angle(corner: Array, i: int, j: int) -> Array:
    """Angle (...) rad between the two faces at the edge from corner `i` to `j`."""
    axis = corner[..., j, :] - corner[..., i, :]
    left, right = (
        np.cross(axis, corner[..., k, :] - corner[..., i, :]) for k in {0, 1, 2, 3} - {i, j}
    )
    along = np.linalg.norm(np.cross(left, right), axis=-1)
    return np.arctan2(along, np.sum(left * right, axis=-1))


def touching(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Centre (..., n) and radius (...) of the ball that touches n + 1 balls from outside.

    Subtracting |x - p_i|^2 = (s + r_i)^2 pairwise leaves x = A + B s for the centre x and the
    radius s, then one quadratic equation for s. NaN where there is no such ball.
    """
    side, first = corner[..., 1:, :] - corner[..., :1, :], radius[..., 0]
    constant = 0.5 * (np.sum(side**2, axis=-1) + first[..., None] ** 2 - radius[..., 1:] ** 2)
    right = np.stack([constant, first[..., None] - radius[..., 1:]], axis=-1)
    a, b = np.moveaxis(np.linalg.solve(side, right), -1, 0)
    square, half = np.sum(b**2, axis=-1) - 1.0, first - np.sum(a * b, axis=-1)
    rest = np.sum(a**2, axis=-1) - first**2
    with np.errstate(invalid="ignore", divide="ignore"):
        # root of square s^2 - 2 half s + rest = 0, in the form that is finite where square is 0
        size = rest / (half + np.sqrt(half**2 - square * rest))
        size = np.where(size > -np.min(radius, axis=-1), size, np.nan)
    return corner[..., 0, :] + a + b * size[..., None], size


def touching_circle(triangle: Array, radius: Array) -> Array:
    """Radius (...) m of the circle in the plane of triangles (..., 3, 3) that touches discs."""
    side = triangle[..., 1:, :] - triangle[..., :1, :]
    length = np.linalg.norm(side, axis=-1)
    along = np.sum(side[..., 0, :] * side[..., 1, :], axis=-1) / length[..., 0]
    across = 2.0 * triangle_area(triangle) / length[..., 0]
    none = 0.0 * along
    flat = np.stack([none, none, length[..., 0], none, along, across], axis=-1)
    return touching(flat.reshape(*along.shape, 3, 2), radius)[1]


def power_centre(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Point (..., n) of equal power |x - p|^2 - r^2 to n + 1 spheres, and that power (...) m2.

    A vertex of the power tessellation; Aurenhammer 1987 (SIAM J. Comput. 16, 78).
    """
    side, first = corner[..., 1:, :] - corner[..., :1, :], radius[..., :1]
    half = 0.5 * (np.sum(side**2, axis=-1) + first**2 - radius[..., 1:] ** 2)
    offset = np.linalg.solve(side, half[..., None])[..., 0]
    return corner[..., 0, :] + offset, np.sum(offset**2, axis=-1) - first[..., 0] ** 2


def disc_lens_area(first: Array, second: Array, apart: Array) -> Array:
    """Area (...) m2 common to discs of radius `first` and `second`, centres `apart` (...) m."""
    a, b, d = np.broadcast_arrays(first, second, np.maximum(apart, 1e-100))
    to_chord = (d**2 + a**2 - b**2) / (2.0 * d)
    chord = np.sqrt(np.maximum(a**2 - to_chord**2, 0.0))
    area = a**2 * np.arctan2(chord, to_chord) - to_chord * chord
    area = area + b**2 * np.arctan2(chord, d - to_chord) - (d - to_chord) * chord
    whole = np.pi * np.minimum(a, b) ** 2
    return np.where(d >= a + b, 0.0, np.where(d <= np.abs(a - b), whole, area))


def open_area(triangle: Array, radius: Array) -> Array:
    """Area (...) m2 of triangles (..., 3, 3) outside discs of `radius` (..., 3) on the corners.

    Triangle less the sectors, plus half the lens of each overlapping pair, which is so counted
    once (Shi 2011, section 3.1.2). It is negative where discs cover more than the triangle.
    """
    area = triangle_area(triangle)
    for k in range(3):
        left, right = (triangle[..., (k + n) % 3, :] - triangle[..., k, :] for n in (1, 2))
        across = np.linalg.norm(np.cross(left, right), axis=-1)
        angle = np.arctan2(across, np.sum(left * right, axis=-1))
        apart, other = np.linalg.norm(left, axis=-1), radius[..., (k + 1) % 3]
        area = area - 0.5 * angle * radius[..., k] ** 2
        area = area + 0.5 * disc_lens_area(radius[..., k], other, apart)
    return area


def cap_volume(radius: Array, height: Array) -> Array:
    """Volume (...) m3 of caps of spheres."""
    return np.pi * height**2 * (3.0 * radius - height) / 3.0


def solid_in_tetrahedra(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the spheres on the corners within each tetrahedron.

    Sphere wedges by solid angle, less the overlap of each pair by dihedral angle: exact over a
    whole tessellation, and in one tetrahedron as long as no sphere reaches through the opposite
    face and no three overlap.
    """
    angle = solid_angles(corner)
    volume, surface = np.sum(angle * radius**3, axis=1) / 3.0, np.sum(angle * radius**2, axis=1)
    for i, j in combinations(range(4), 2):
        first, second = radius[:, i], radius[:, j]
        apart = np.linalg.norm(corner[:, j] - corner[:, i], axis=-1)
        to_plane = (apart**2 + first**2 - second**2) / (2.0 * apart)
        overlap = apart < first + second
        one = np.where(overlap, np.clip(first - to_plane, 0.0, 2.0 * first), 0.0)
        other = np.where(overlap, np.clip(second - apart + to_plane, 0.0, 2.0 * second), 0.0)
        turn = dihedral_angle(corner, i, j) / (2.0 * np.pi)
        volume -= turn * (cap_volume(first, one) + cap_volume(second, other))
        surface -= turn * 2.0 * np.pi * (first * one + second * other)
    return volume, surface
