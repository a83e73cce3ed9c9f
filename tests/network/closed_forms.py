"""Tetrahedra, triangles and spheres in closed form, for arrays: the check of compiled measures.

Lengths are in m; arrays may have any leading shape, written "...".

Sources: solid angle, van Oosterom and Strackee 1983 (IEEE Trans. Biomed. Eng. 30, 125, eq. 8);
circle and sphere touching given ones, Apollonius' problem solved by subtracting the sphere
equations; lens of two spheres, the sum of two caps pi h^2 (3 r - h) / 3.
"""

import numpy as np

from fdnet.network.geometry import cap_volume, cross, dot, flat, triangle_area
from fdnet.spheres.snapshot import Array

EDGES = np.array([(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)])
"""(6, 2) corners at the ends of the edges of a tetrahedron."""
SIDES = np.array([(0, 1), (1, 2), (2, 0)])
"""(3, 2) corners at the ends of the sides of a triangle."""


def solid_angles(corner: Array) -> Array:
    """Solid angle (..., 4) sr at each corner of tetrahedra (..., 4, 3), signed as the volume.

    Van Oosterom and Strackee 1983, eq. 8.
    """
    return np.stack(
        [_solid_angle(np.roll(corner, -k, axis=-2)) * (-1.0) ** k for k in range(4)], axis=-1
    )


def _solid_angle(corner: Array) -> Array:
    a, b, c = (corner[..., k, :] - corner[..., 0, :] for k in (1, 2, 3))
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    ab, ac, bc = dot(a, b), dot(a, c), dot(b, c)
    triple = dot(a, cross(b, c))
    return 2.0 * np.arctan2(triple, la * lb * lc + ab * lc + ac * lb + bc * la)


def dihedral_angles(corner: Array) -> Array:
    """Angle (..., 6) rad between the two faces at each of EDGES of tetrahedra (..., 4, 3)."""
    angles = []
    for first, second in EDGES:
        other = [k for k in range(4) if k not in (first, second)]
        axis = corner[..., second, :] - corner[..., first, :]
        left, right = (cross(axis, corner[..., k, :] - corner[..., first, :]) for k in other)
        along = np.linalg.norm(cross(left, right), axis=-1)
        angles.append(np.arctan2(along, dot(left, right)))
    return np.stack(angles, axis=-1)


def touching_sphere(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Centre (..., 3) m and radius (...) m of the sphere that touches four spheres from outside.

    `corner` (..., 4, 3) are the centres p_i of the four, `radius` (..., 4) their radii r_i. The
    result is NaN where there is no such sphere. Subtracting |x - p_i|^2 = (s + r_i)^2 pairwise
    leaves x = A + B s for the centre x and the radius s, then one quadratic equation for s.
    """
    return _touching(corner, radius)


def touching_circle(triangle: Array, radius: Array) -> Array:
    """Radius (...) m of the circle that touches three discs from outside; NaN where there is none.

    The discs of `radius` (..., 3) sit on the corners of `triangle` (..., 3, 3), in its plane.
    """
    return _touching(flat(triangle), radius)[1]


def _touching(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Centre (..., n) and radius (...) of the ball that touches n + 1 balls, n = 2 or 3."""
    side = corner[..., 1:, :] - corner[..., :1, :]
    first = radius[..., 0]
    apart = radius[..., 1:] - first[..., None]
    constant = 0.5 * (np.sum(side**2, axis=-1) + first[..., None] ** 2 - radius[..., 1:] ** 2)
    solved = _solve(side, np.stack([constant, -apart], axis=-1))
    a, b = solved[..., 0], solved[..., 1]
    square = np.sum(b**2, axis=-1) - 1.0
    half = first - np.sum(a * b, axis=-1)
    rest = np.sum(a**2, axis=-1) - first**2
    with np.errstate(invalid="ignore", divide="ignore"):
        # root of square s^2 - 2 half s + rest = 0, in the form that is finite where square is 0
        touching = rest / (half + np.sqrt(half**2 - square * rest))
        touching = np.where(touching > -np.min(radius, axis=-1), touching, np.nan)
    return corner[..., 0, :] + a + b * touching[..., None], touching


def _solve(matrix: Array, right: Array) -> Array:
    """Solution (..., n, m) of systems (..., n, n) with right sides (..., n, m), n = 2 or 3.

    Cramer's rule; NaN where a system is singular.
    """
    rows = [matrix[..., k, :] for k in range(matrix.shape[-1])]
    if len(rows) == 2:
        (a, b), (c, d) = ((row[..., 0], row[..., 1]) for row in rows)
        columns = [np.stack([d, -c], axis=-1), np.stack([-b, a], axis=-1)]
        determinant = a * d - b * c
    else:
        columns = [cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])]
        determinant = dot(rows[0], columns[0])
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(determinant == 0.0, np.nan, 1.0 / determinant)
    total = sum(
        column[..., None] * (right[..., k, :] * scale[..., None])[..., None, :]
        for k, column in enumerate(columns)
    )
    return np.asarray(total)


def power_centre(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Point (..., n) of equal power to n + 1 spheres, and that power (...) m2.

    The power of a point x to a sphere of centre p and radius r is |x - p|^2 - r^2. The spheres
    have the centres `corner` (..., n + 1, n) and the radii `radius` (..., n + 1). For n = 3 the
    point is a vertex of the power tessellation, for n = 2 the radical centre of three discs, for
    equal radii the circumcentre. NaN where the corners lie in one plane (line). Aurenhammer 1987
    (SIAM J. Comput. 16, 78).
    """
    side = corner[..., 1:, :] - corner[..., :1, :]
    first = radius[..., :1]
    half = 0.5 * (np.sum(side**2, axis=-1) + (first - radius[..., 1:]) * (first + radius[..., 1:]))
    offset = _solve(side, half[..., None])[..., 0]
    return corner[..., 0, :] + offset, dot(offset, offset) - first[..., 0] ** 2


def triangle_angles(triangle: Array) -> Array:
    """Angle (..., 3) rad at each corner of triangles (..., 3, 3)."""
    angles = []
    for k in range(3):
        left = triangle[..., (k + 1) % 3, :] - triangle[..., k, :]
        right = triangle[..., (k + 2) % 3, :] - triangle[..., k, :]
        across = np.linalg.norm(cross(left, right), axis=-1)
        angles.append(np.arctan2(across, dot(left, right)))
    return np.stack(angles, axis=-1)


def open_area(triangle: Array, radius: Array) -> Array:
    """Area (...) m2 of triangles (..., 3, 3) outside discs of `radius` (..., 3) on the corners.

    Triangle less the sectors, plus half the lens of each overlapping pair, which is so counted
    once (Shi 2011, section 3.1.2). It is negative where discs cover more than the triangle.
    """
    sectors = 0.5 * np.sum(triangle_angles(triangle) * radius**2, axis=-1)
    ends = triangle[..., SIDES, :]
    apart = np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1)
    lens = disc_lens_area(radius[..., SIDES[:, 0]], radius[..., SIDES[:, 1]], apart)
    return triangle_area(triangle) - sectors + 0.5 * lens.sum(axis=-1)


def disc_lens_area(first: Array, second: Array, apart: Array) -> Array:
    """Area (...) m2 common to discs of radius `first` and `second`, centres `apart` (...) m."""
    first, second, apart = np.broadcast_arrays(first, second, apart)
    small = np.pi * np.minimum(first, second) ** 2
    area = np.where(apart <= np.abs(first - second), small, 0.0)
    cross = (apart > np.abs(first - second)) & (apart < first + second)
    a, b, d = first[cross], second[cross], apart[cross]
    to_chord = (d**2 + a**2 - b**2) / (2.0 * d)
    chord = np.sqrt(np.maximum(a**2 - to_chord**2, 0.0))
    area[cross] = (
        a**2 * np.arctan2(chord, to_chord)
        - to_chord * chord
        + b**2 * np.arctan2(chord, d - to_chord)
        - (d - to_chord) * chord
    )
    return area


def cap_heights(first: Array, second: Array, apart: Array) -> tuple[Array, Array]:
    """Heights (...) m of the two caps that make up the lens of two spheres; 0 without overlap.

    `first` and `second` (...) m are the radii, `apart` (...) m is the distance of the centres.
    """
    to_plane = (apart**2 + first**2 - second**2) / (2.0 * apart)
    overlap = apart < first + second
    return (
        np.where(overlap, np.clip(first - to_plane, 0.0, 2.0 * first), 0.0),
        np.where(overlap, np.clip(second - apart + to_plane, 0.0, 2.0 * second), 0.0),
    )


def lens(first: Array, second: Array, apart: Array) -> tuple[Array, Array]:
    """Volume (...) m3 that two spheres share, and the surface (...) m2 of both in it.

    Both are 0 without overlap. `first` and `second` (...) m are the radii, `apart` (...) m is the
    distance of the centres.
    """
    caps = cap_heights(first, second, apart)
    volume = cap_volume(first, caps[0]) + cap_volume(second, caps[1])
    return volume, 2.0 * np.pi * (first * caps[0] + second * caps[1])


def solid_in_tetrahedra(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the spheres on the corners within each tetrahedron.

    `corner` (P, 4, 3) m, `radius` (P, 4) m. Sphere wedges by solid angle, less the overlap of each
    pair by dihedral angle: exact over a whole tessellation, and in one tetrahedron as long as no
    sphere reaches through the opposite face and no three overlap.
    """
    angle = np.abs(solid_angles(corner))
    first, second = radius[:, EDGES[:, 0]], radius[:, EDGES[:, 1]]
    apart = np.linalg.norm(corner[:, EDGES[:, 1]] - corner[:, EDGES[:, 0]], axis=-1)
    turn = dihedral_angles(corner) / (2.0 * np.pi)
    shared, hidden = lens(first, second, apart)
    volume = np.sum(angle * radius**3, axis=1) / 3.0 - np.sum(turn * shared, axis=1)
    return volume, np.sum(angle * radius**2, axis=1) - np.sum(turn * hidden, axis=1)
