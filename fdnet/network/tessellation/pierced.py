"""Open sections that a fourth grain reaches into."""

import numpy as np

from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.network.tessellation.delaunay import Tetrahedra
from fdnet.network.tessellation.facets import Facets
from fdnet.network.tessellation.tessellation import Tessellation
from fdnet.network.tessellation.tetrahedron import Vector, along, less, times
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
    beyond, turn = _apexes_beyond(tetrahedra, facets)
    points = tetrahedra.points
    size = np.asarray(tessellation.size, float)
    result: Array = _pierced(
        (points.position, points.radius),
        (tetrahedra.vertex, beyond, turn),
        (facets.vertex, facets.pore, facets.opposite, facets.shift),
        open_facet,
        size,
    )
    return result


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


@compiled
def _pierced(
    spheres: tuple[Array, Array],
    tetrahedra: tuple[Array, Array, Array],
    facets: tuple[Array, Array, Array, Array],
    open_facet: Array,
    size: Array,
) -> Array:
    """As `pierced_facets`, with the parts of `Tetrahedra`, `_apexes_beyond` and `Facets`."""
    pierced = np.zeros(len(open_facet), np.bool_)
    _set_pierced(spheres, tetrahedra, facets, (open_facet, size), pierced)
    return pierced


@compiled_in_place
def _set_pierced(
    spheres: tuple[Array, Array],
    tetrahedra: tuple[Array, Array, Array],
    facets: tuple[Array, Array, Array, Array],
    more: tuple[Array, Array],
    pierced: Array,
) -> None:
    """Sets which open facets (T,) a grain of their two tetrahedra or of a neighbour pierces."""
    vertex, beyond, turn = tetrahedra
    corner, pore, opposite, shift = facets
    open_facet, size = more
    for t in range(len(corner)):
        if not open_facet[t]:
            continue
        for side in range(2):
            own, apex = pore[t, side], opposite[t, side]
            for k in range(5):
                # the apex of the tetrahedron first, then those across its other facets
                if k == apex + 1:
                    continue
                other = vertex[own, apex] if k == 0 else beyond[own, k - 1]
                if other < 0 or pierced[t]:
                    continue
                x, y, z = side * shift[t, 0], side * shift[t, 1], side * shift[t, 2]
                if k > 0:
                    x, y, z = (
                        x + turn[own, k - 1, 0],
                        y + turn[own, k - 1, 1],
                        z + turn[own, k - 1, 2],
                    )
                moved = (x * size[0], y * size[1], z * size[2])
                pierced[t] = _pierces(spheres, corner[t], other, moved)


@compiled_in_place
def _pierces(spheres: tuple[Array, Array], corner: Array, other: int, moved: Vector) -> bool:
    """Whether the grain `other`, `moved` by a vector m, covers part of an open section."""
    points, grain = spheres
    a, b, c = corner[0], corner[1], corner[2]
    one, two = less(points, b, a), less(points, c, a)
    normal = times(one, two)
    apart = less(points, other, a)
    place = (apart[0] + moved[0], apart[1] + moved[1], apart[2] + moved[2])
    square, radius = along(normal, normal), grain[other]
    away = along(place, normal)
    if not away * away < radius * radius * square:
        return False
    disc = np.sqrt(radius * radius - away * away / square)
    size = np.sqrt(square)
    third = (two[0] - one[0], two[1] - one[1], two[2] - one[2])
    last = (place[0] - one[0], place[1] - one[1], place[2] - one[2])
    if not (
        _outside(one, normal, place, size) < disc
        and _outside(third, normal, last, size) < disc
        and -_outside(two, normal, place, size) < disc
    ):
        return False
    return _covers((one, two, place), (grain[a], grain[b], grain[c], radius))


@compiled_in_place
def _outside(side: Vector, normal: Vector, place: Vector, size: float) -> float:
    """How far m `place` lies to the right of a side of a triangle; `size` m2 is that of normal."""
    return along(place, times(side, normal)) / (size * np.sqrt(along(side, side)))


@compiled_in_place
def _covers(
    places: tuple[Vector, Vector, Vector], radii: tuple[float, float, float, float]
) -> bool:
    """Whether a ball covers a grid point of the triangle outside the three grains.

    `places` m are the second and third corner and the ball, from the first corner; `radii` m are
    those of the three grains and of the ball.
    """
    one, two, place = places
    for step in STEPS:
        x = step[1] * one[0] + step[2] * two[0]
        y = step[1] * one[1] + step[2] * two[1]
        z = step[1] * one[2] + step[2] * two[2]
        if (
            _square(x, y, z, place) < radii[3] ** 2
            and x * x + y * y + z * z > radii[0] ** 2
            and _square(x, y, z, one) > radii[1] ** 2
            and _square(x, y, z, two) > radii[2] ** 2
        ):
            return True
    return False


@compiled
def _square(x: float, y: float, z: float, place: Vector) -> float:
    return (x - place[0]) ** 2 + (y - place[1]) ** 2 + (z - place[2]) ** 2
