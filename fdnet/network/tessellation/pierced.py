"""Open sections that a fourth grain reaches into."""

import numpy as np

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import Tetrahedra
from fdnet.network.tessellation.facets import Facets
from fdnet.network.tessellation.tessellation import Tessellation
from fdnet.spheres.snapshot import Array

GRID = 12
STEPS = (
    np.array([(i, j, GRID - i - j) for i in range(GRID + 1) for j in range(GRID + 1 - i)]) / GRID
)
"""(91, 3) barycentric coordinates of the points at which a section is examined."""


def pierced_facets(tessellation: Tessellation, facets: Facets, open_facet: Array) -> Array:
    """True (T,) where a grain near the facet covers part of its open section.

    `open_facet` (T,) is true where the section is open. The grains that are examined are the
    apexes of the two tetrahedra of the facet and of those across their other facets. The section
    is examined on a triangular grid of 91 points.
    """
    tetrahedra = tessellation.tetrahedra
    position, grain = tetrahedra.points.position, tetrahedra.points.radius
    pierced = np.zeros(len(facets.pore), bool)
    apexes = _apexes_beyond(tetrahedra, facets)
    for part in geometry.slices(len(pierced)):
        corner = position[facets.vertex[part]]
        normal = geometry.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        place, radius = _grains_near(tetrahedra, facets, part, (*apexes, tessellation.size))
        away = np.einsum("tci,ti->tc", place - corner[:, :1], normal)
        row, which = np.nonzero((np.abs(away) < radius) & open_facet[part, None])
        disc = np.sqrt(radius[row, which] ** 2 - away[row, which] ** 2)
        near = _reaches(corner[row], normal[row], place[row, which], disc)
        row, which = row[near], which[near]
        start = part.start or 0
        own = grain[facets.vertex[row + start]]
        hit = _covers_open_part(corner[row], own, place[row, which], radius[row, which])
        pierced[start + row[hit]] = True
    return pierced


def _apexes_beyond(tetrahedra: Tetrahedra, facets: Facets) -> tuple[Array, Array]:
    """Point (P, 4) opposite each facet on its other side, -1 beyond a wall; periods (P, 4, 3)."""
    beyond = np.full(tetrahedra.vertex.shape, -1, np.int32)
    turn = np.zeros((*beyond.shape, 3), np.int8)
    one, two = facets.pore.T
    first, second = facets.opposite.T
    beyond[one, first] = tetrahedra.vertex[two, second]
    beyond[two, second] = tetrahedra.vertex[one, first]
    across = np.flatnonzero(np.any(facets.shift != 0, axis=1))
    turn[one[across], first[across]] = facets.shift[across]
    turn[two[across], second[across]] = -facets.shift[across]
    return beyond, turn


def _grains_near(
    tetrahedra: Tetrahedra, facets: Facets, part: slice, table: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Places (K, 8, 3) m and radii (K, 8) m of the grains near facets; radius 0 where none is.

    `table` holds the apexes beyond (P, 4), their periods (P, 4, 3) and the period (3,) m.
    """
    beyond, turn, size = table
    places, radii = [], []
    for side in (0, 1):
        pore, apex = facets.pore[part, side], facets.opposite[part, side]
        others = np.concatenate([tetrahedra.vertex[pore, apex][:, None], beyond[pore]], axis=1)
        shift = np.concatenate([np.zeros((len(pore), 1, 3), np.int8), turn[pore]], axis=1)
        if side:
            shift = shift + facets.shift[part, None]
        place = tetrahedra.points.position[others] + shift * size
        radius = np.where(others < 0, 0.0, tetrahedra.points.radius[others])
        # across the facet itself lies the other apex, which its own side examines
        radius[np.arange(len(pore)), 1 + apex.astype(int)] = 0.0
        places.append(place)
        radii.append(radius)
    return np.concatenate(places, axis=1), np.concatenate(radii, axis=1)


def _reaches(corner: Array, normal: Array, place: Array, disc: Array) -> Array:
    """True (K,) where a disc reaches the inside of a triangle, side line by side line.

    The disc has the centre `place` (K, 3) m and the radius `disc` (K,) m.
    """
    near = np.ones(len(disc), bool)
    for first, second in geometry.SIDES:
        outward = geometry.cross(corner[:, second] - corner[:, first], normal)
        outward /= np.linalg.norm(outward, axis=1)[:, None]
        near &= geometry.dot(place - corner[:, first], outward) < disc
    return near


def _covers_open_part(corner: Array, own: Array, place: Array, radius: Array) -> Array:
    """True (K,) where a ball covers a grid point of the triangle outside its three grains.

    The triangle has the corners `corner` (K, 3, 3) m, on which grains of radius `own` (K, 3) m
    sit; the ball has the centre `place` (K, 3) m and the radius `radius` (K,) m.
    """
    covered = np.zeros(len(corner), bool)
    for part in geometry.slices(len(covered), 20_000):
        point = np.einsum("gc,kci->kgi", STEPS, corner[part])
        inside = np.sum((point - place[part, None]) ** 2, axis=2) < radius[part, None] ** 2
        for k in range(3):
            inside &= (
                np.sum((point - corner[part, k, None]) ** 2, axis=2) > own[part, k, None] ** 2
            )
        covered[part] = inside.any(axis=1)
    return covered
