"""Tetrahedra, triangles and the spheres on their corners.

Lengths are in m. Arrays may have any leading shape, written "...". What is measured on every
tetrahedron or facet of a pack is compiled, in `tessellation`.
"""

from collections.abc import Iterator

import numpy as np

from fdnet.spheres.snapshot import Array

FACETS = np.array([(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)])
"""(4, 3) corners of the facet opposite each corner of a tetrahedron."""


def slices(count: int, size: int = 100_000) -> Iterator[slice]:
    """Consecutive slices of at most `size` that cover range(count).

    Arrays of a whole pack are worked off slice by slice, which bounds the memory.
    """
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def cross(left: Array, right: Array) -> Array:
    """Vector product (..., 3) of vectors (..., 3)."""
    (a, b, c), (d, e, f) = ((one[..., 0], one[..., 1], one[..., 2]) for one in (left, right))
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)


def dot(left: Array, right: Array) -> Array:
    """Scalar product (...) of vectors (..., n)."""
    return np.asarray(np.einsum("...i,...i->...", left, right))


def signed_volume(corner: Array) -> Array:
    """Volume (...) m3 of tetrahedra (..., 4, 3).

    It is positive when corners 0, 1, 2 turn clockwise as seen from corner 3.
    """
    side = corner[..., 1:, :] - corner[..., :1, :]
    return dot(side[..., 0, :], cross(side[..., 1, :], side[..., 2, :])) / 6.0


def flat(triangle: Array) -> Array:
    """Corners (..., 3, 2) of triangles (..., 3, 3) in their own plane, the first at the origin."""
    ab, ac = triangle[..., 1, :] - triangle[..., 0, :], triangle[..., 2, :] - triangle[..., 0, :]
    base = np.linalg.norm(ab, axis=-1)
    placed = np.zeros((*triangle.shape[:-1], 2))
    placed[..., 1, 0] = base
    placed[..., 2, 0] = dot(ab, ac) / base
    placed[..., 2, 1] = np.linalg.norm(cross(ab, ac), axis=-1) / base
    return placed


def cap_volume(radius: Array, height: Array) -> Array:
    """Volume (...) m3 of a spherical cap of `height` m, which is clipped to [0, 2 radius]."""
    height = np.clip(height, 0.0, 2.0 * radius)
    return np.pi * height**2 * (3.0 * radius - height) / 3.0
