"""Tetrahedra, triangles and spheres in closed form: a second way to what a network measures.

Lengths are in m; arrays may have any leading shape, written "...". Sources: solid angle, van
Oosterom and Strackee 1983 (IEEE Trans. Biomed. Eng. 30, 125, eq. 8); touching circle and sphere,
Apollonius' problem by subtracting the sphere equations; lens of two spheres, the sum of two caps.
"""

import numpy as np

from fdnet.spheres.snapshot import Array


def signed_volume(corner: Array) -> Array:
    """Volume (...) m3 of tetrahedra (..., 4, 3), positive where the corners turn to the right."""
    return np.linalg.det(corner[..., 1:, :] - corner[..., :1, :]) / 6.0


def triangle_area(triangle: Array) -> Array:
    """Area (...) m2 of triangles (..., 3, 3)."""
    side = triangle[..., 1:, :] - triangle[..., :1, :]
    return 0.5 * np.linalg.norm(np.cross(side[..., 0, :], side[..., 1, :]), axis=-1)


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
