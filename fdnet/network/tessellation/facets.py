"""Facets that two tetrahedra share, and the polyhedra that tetrahedra make."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fdnet.errors import NetworkError
from fdnet.network import geometry
from fdnet.network.compiled import compiled
from fdnet.network.tessellation.delaunay import (
    SAME_CENTRE,
    PlacedGrains,
    Tetrahedra,
    along,
    less,
    make_tetrahedra,
    place_grains,
    times,
)
from fdnet.spheres.geometry import INSIDE, MIRROR_LOW, ON_FACE, packed_shift, repeated
from fdnet.spheres.snapshot import Array, Snapshot


class Facets(NamedTuple):
    """T facets, each shared by two tetrahedra."""

    pore: Array  # (T, 2) the two tetrahedra
    opposite: Array  # (T, 2) corner 0 to 3 of either tetrahedron that is not on the facet
    shift: Array  # (T, 3) whole periods that bring the second tetrahedron next to the first
    vertex: Array  # (T, 3) points at the corners of the facet, those of the first tetrahedron
    unmatched: int  # number of facets away from the mirrored faces that have no partner

    def where(self, mask: Array) -> "Facets":
        """The facets for which `mask` (T,) is true."""
        pore, opposite, shift, vertex = (column[mask] for column in self[:4])
        return Facets(pore, opposite, shift, vertex, self.unmatched)


def share_facets(tetrahedra: Tetrahedra, box: Array, *, periodic: tuple[bool, ...]) -> Facets:
    """Pairs of tetrahedra with a common facet: neighbours, and across periods those whose facets
    have the same grains at the same relative shifts."""
    neighbour, points = tetrahedra.neighbour, tetrahedra.points
    one, opposite = np.nonzero(neighbour > np.arange(len(neighbour))[:, None])
    two = neighbour[one, opposite]
    back = np.argmax(neighbour[two] == one[:, None], axis=1)
    # a facet is the index of its tetrahedron times 4 plus the corner opposite
    single = np.flatnonzero(neighbour.ravel() < 0)
    corner = np.take_along_axis(
        tetrahedra.vertex[single // 4], geometry.FACETS[single % 4], axis=1
    )
    corner = np.take_along_axis(corner, np.argsort(points.key[corner], axis=1), axis=1)
    names, shifts = points.name[corner], points.shift[corner]
    relative = packed_shift(shifts - shifts[:, :1])
    columns = [*names.T, *relative[:, 1:].T]
    order = np.lexsort(columns)
    same = np.all([column[order][1:] == column[order][:-1] for column in columns], axis=0)
    at, to = order[:-1][same], order[1:][same]
    alone = np.ones(len(single), bool)
    alone[at] = alone[to] = False
    # a facet on or beyond one mirrored face needs no partner: symmetry closes the space
    place = points.position[corner[alone]]
    tolerance = SAME_CENTRE * float(points.radius.mean())
    below = np.all(place <= box[:, 0] + tolerance, axis=1)
    above = np.all(place >= box[:, 1] - tolerance, axis=1)
    beyond = np.any((below | above) & ~np.array(periodic), axis=1)
    first, second = single[at], single[to]
    pore = np.hstack([[one, two], [first // 4, second // 4]]).T.astype(np.int32, "C")
    ends = np.hstack([[opposite, back], [first % 4, second % 4]]).T.astype(np.int8, "C")
    corners = geometry.FACETS[ends[:, 0]]
    return Facets(
        pore=pore,
        opposite=ends,
        shift=np.concatenate([np.zeros((len(one), 3), np.int16), shifts[at, 0] - shifts[to, 0]]),
        vertex=np.take_along_axis(tetrahedra.vertex[pore[:, 0]], corners, axis=1),
        unmatched=int(np.sum(~beyond)),
    )


# ---- The tessellation of placed grains: tetrahedra that fill the box, and the facets they share.
FIRST_MARGIN = 3.5
"""Images of grains are first made within this many radii of the largest grain of the box."""
ROUNDS = 8
UNMATCHED_FEW = 1e-5  # Share of facets without partner that more images are not expected to help
UNMATCHED_SHARE = 1e-3  # Share of facets without partner above which the tessellation is refused
LARGE_CELL = 200  # Grains from which on a periodic cell is taken as it is
SIDES_OF_CELLS = (0.0, 3.0, 4.0, 5.0, 6.0)
"""Least sides of the cells that are tried, in sides of the cube that one grain has to itself."""
GRAINS_A_FLAW = 27  # A repeated cell may have one facet without partner for so many grains
MOST_PERIODS, MOST_IMAGES, IMAGES_A_GRAIN = 64, 50_000, 30
"""Beyond these numbers grains or voids are far larger than the periodic sides, and Qhull would
take hours. (Dense packs need 1 to 2 periods, a unit cell 125 images.)"""


class Tessellation(NamedTuple):
    """Tetrahedra (P) of placed grains and the facets (T) between them."""

    tetrahedra: Tetrahedra  # the P unique tetrahedra
    facets: Facets  # the T facets that two tetrahedra share
    box: Array  # (3, 2) m, lower and upper bound of the specimen
    size: Array  # (3,) m, sides of the box
    periodic: tuple[bool, bool, bool]
    """Whether the sides x, y and z are periodic; the other faces are mirror planes."""
    scale: float  # m, mean radius of the grains


def tessellate(placed: PlacedGrains) -> Tessellation:
    """Unique tetrahedra of the grains in their box, and the facets they share.

    Images of grains are added until every sphere that must be empty lies within them and every
    facet has its partner: then no tetrahedron is wrong or missing. A few facets of flat tetrahedra
    may keep no partner, because rounding splits them otherwise on the two sides of a period; they
    are counted. Raises NetworkError on coplanar grains, on voids larger than the images reach, on
    more than 1e-3 of the facets without partner, and when no facet is shared.
    """
    grains, periodic = placed.grains, placed.periodic
    count, size = len(grains), grains.box[:, 1] - grains.box[:, 0]
    margin = np.full(3, FIRST_MARGIN * float(grains.radius.max()))
    for _ in range(ROUNDS):
        margin = np.where(periodic, margin, np.minimum(margin, size))
        beyond = np.where(periodic, margin, 0.0)
        images = count * float(np.prod(1.0 + 2.0 * beyond / size))
        most, axis = MOST_IMAGES + IMAGES_A_GRAIN * count, int(np.argmax(beyond / size))
        if images > most or beyond[axis] > MOST_PERIODS * size[axis]:
            raise NetworkError(
                f"tessellation of {count} grains: {images:.3g} images up to {beyond[axis]:.3g} m "
                f"beyond the periodic side {'xyz'[axis]} of {size[axis]:.3g} m are needed, "
                f"expected at most {most} and {MOST_PERIODS} periods; grains or voids are far "
                "larger than the box (check it and the units), or repeat a cell of few grains"
            )
        widest = ~np.array(periodic) & (margin >= size)
        tetrahedra = make_tetrahedra(grains, periodic=periodic, margin=margin)
        needed = tetrahedra.margin
        empty = len(tetrahedra.vertex) > 0 and bool(np.all((margin >= needed) | widest))
        facets = share_facets(tetrahedra, grains.box, periodic=periodic) if empty else None
        if facets is not None and (
            facets.unmatched <= UNMATCHED_FEW * len(facets.pore) or widest.all()
        ):
            break
        margin = np.maximum(1.5 * margin, np.minimum(1.02 * needed, 4.0 * margin))
    if facets is None:
        raise NetworkError(
            f"tessellation of {count} grains: voids reach {needed.max():.3g} m beyond the box of "
            f"{size.tolist()} m, further than the images; give more grains or a smaller box"
        )
    if facets.unmatched > max(4, UNMATCHED_SHARE * len(facets.pore)):
        raise NetworkError(
            f"tessellation: {facets.unmatched} of {len(facets.pore)} facets have no partner; the "
            "grains do not tile the box, check the box and the periodic sides"
        )
    if not len(facets.pore):
        raise NetworkError(
            f"tessellation: no throat joins two pores of these {count} grains; the box is too "
            "narrow for its side walls, give more grains or periodic sides"
        )
    box, scale = grains.box, placed.scale
    return Tessellation(tetrahedra, facets, box, size, periodic, scale)


def copies_of_cell(
    packs: Sequence[Snapshot], periodic: tuple[bool, bool, bool]
) -> tuple[int, int, int]:
    """How often a periodic cell is repeated along each axis, so that it can be tessellated.

    In a cell of a few grains images of one grain lie on one sphere, and a tessellation splits them
    in another way on the two sides of a period. The first of `packs` are the grains; the others
    share their cell and are repeated with them. One copy where a larger cell does not help.
    """
    count = len(packs[0])
    if not any(periodic) or not 0 < count < LARGE_CELL:
        return 1, 1, 1
    side = np.ptp(packs[0].box, axis=1)
    spacing = np.cbrt(np.prod(side) / count)
    for least in SIDES_OF_CELLS:
        wanted = np.where(periodic, np.maximum(np.ceil(least * spacing / side), 1.0), 1.0)
        if np.prod(wanted) * count > MOST_IMAGES / IMAGES_A_GRAIN:
            break
        times = int(wanted[0]), int(wanted[1]), int(wanted[2])
        try:
            for pack in (repeated(pack, times) for pack in packs):
                facets = tessellate(place_grains(pack, periodic=periodic)).facets
                if facets.unmatched > len(pack) // GRAINS_A_FLAW:
                    break
            else:
                return times
        except NetworkError:
            continue
    return 1, 1, 1


# ---- What is measured on one facet after the other, in one compiled pass.
SIDE_ENDS = (1, 2, 0)  # The corner that follows each corner of a triangle


@compiled
def sections(
    points: Array, radius: Array, vertex: Array, touching: float
) -> tuple[Array, Array, Array]:
    """Inscribed radius (T,) m, open area (T,) m2, and whether two of the three spheres overlap.

    `vertex` (T, 3) are the corners among `points` (M, 3) m with spheres of `radius` (M,) m. The
    radius is NaN where no circle touches the three discs. The area is the triangle less the
    sectors, plus half the lens of each overlapping pair (Shi 2011, section 3.1.2); it is negative
    where discs cover more than the triangle. Spheres overlap that are nearer than the sum of their
    radii by more than the share `touching` of it.
    """
    count = len(vertex)
    inscribed, area, overlap = np.empty(count), np.empty(count), np.zeros(count, np.bool_)
    for t in range(count):
        a, b, c = vertex[t, 0], vertex[t, 1], vertex[t, 2]
        one, two = less(points, b, a), less(points, c, a)
        product = times(one, two)
        twice, base = np.sqrt(along(product, product)), np.sqrt(along(one, one))
        inscribed[t] = _inscribed(
            base, along(one, two) / base, twice / base, radius[a], radius[b], radius[c]
        )
        open_part = 0.5 * twice
        for i in range(3):
            own, after = vertex[t, i], vertex[t, SIDE_ENDS[i]]
            left = less(points, after, own)
            right = less(points, vertex[t, SIDE_ENDS[SIDE_ENDS[i]]], own)
            open_part -= 0.5 * np.arctan2(twice, along(left, right)) * radius[own] ** 2
            apart, both = np.sqrt(along(left, left)), radius[own] + radius[after]
            open_part += 0.5 * _lens_area(radius[own], radius[after], apart)
            overlap[t] = overlap[t] or apart < (1.0 - touching) * both
        area[t] = open_part
    return inscribed, area, overlap


@compiled
def _inscribed(a: float, x: float, y: float, r: float, second: float, third: float) -> float:
    """Radius m of the circle that touches discs at (0, 0), (a, 0) and (x, y) from outside, or NaN.

    The discs have the radii r, `second` and `third` m. Solved as `touching_spheres`.
    """
    ux = 0.5 * (a * a + r * r - second**2) / a
    vx = (r - second) / a
    uy = (0.5 * (x * x + y * y + r * r - third**2) - x * ux) / y
    vy = (r - third - x * vx) / y
    half, rest = r - ux * vx - uy * vy, ux * ux + uy * uy - r * r
    under = half * half - (vx * vx + vy * vy - 1.0) * rest
    if not under >= 0.0:
        return np.nan
    below = half + np.sqrt(under)
    touching = rest / below if below != 0.0 else np.nan
    return touching if touching > -min(r, second, third) else np.nan


@compiled
def _lens_area(first: float, second: float, apart: float) -> float:
    """Area m2 common to two discs whose centres are `apart` m."""
    if apart >= first + second:
        return 0.0
    if apart <= abs(first - second):
        return np.pi * min(first, second) ** 2
    to_chord = (apart**2 + first**2 - second**2) / (2.0 * apart)
    chord = np.sqrt(max(first**2 - to_chord**2, 0.0))
    return (
        first**2 * np.arctan2(chord, to_chord)
        - to_chord * chord
        + second**2 * np.arctan2(chord, apart - to_chord)
        - (apart - to_chord) * chord
    )


@compiled
def heights(
    points: Array,
    shaken: Array,
    vertex: Array,
    apex: Array,
    centre: Array,
    pore: Array,
    shift: Array,
) -> Array:
    """Distances (T, 2) m of two power centres from each facet, positive on their own side.

    Which side is whose follows from the `shaken` places (M, 3) m of the `points`, for a flat
    tetrahedron has none without. `vertex` (T, 3) are the corners, `apex` (T,) is the point on the
    side of the first tetrahedron of the pair `pore` (T, 2), whose centres are among `centre`
    (P, 3) m; `shift` (T, 3) m moves the second next to the first.
    """
    height = np.empty((len(vertex), 2))
    for t in range(len(vertex)):
        a, b, c = vertex[t, 0], vertex[t, 1], vertex[t, 2]
        outward = times(less(shaken, b, a), less(shaken, c, a))
        normal = times(less(points, b, a), less(points, c, a))
        size = np.sqrt(along(normal, normal))
        if size == 0.0:  # the corners lie on one line: no facet, whose height is 0 on both sides
            size = 1.0
        if along(less(shaken, apex[t], a), outward) > 0.0:
            size = -size
        one, two = pore[t, 0], pore[t, 1]
        height[t] = 0.0
        for k in range(3):
            height[t, 0] += (points[a, k] - centre[one, k]) * normal[k] / size
            height[t, 1] += (centre[two, k] + shift[t, k] - points[a, k]) * normal[k] / size
    return height


# ---- Polyhedra: tetrahedra of one power centre, which the tessellation splits arbitrarily.
ADOPTION_ROUNDS = 8


class Polyhedra(NamedTuple):
    """Power centres of the tetrahedra (P), and which tetrahedra share one."""

    centre: Array  # (P, 3) m, power centres; a flat tetrahedron has that of a neighbour
    heights: Array
    """(T, 2) m, distance of the two centres from their facet, positive on their own side."""
    group: Array  # (P,) number of the polyhedron, equal for all parts of one
    wall: Array  # (P, 3) -1 or 1 where the low or high mirrored face cuts the polyhedron, else 0


def join_polyhedra(tessellation: Tessellation) -> Polyhedra:
    """Power centres, heights over the facets, groups, and the walls they lie on."""
    tetrahedra, facets = tessellation.tetrahedra, tessellation.facets
    points, centre = tetrahedra.points, _adopted_centres(tessellation)
    height = heights(
        points.position,
        points.shaken,
        facets.vertex,
        tetrahedra.vertex[facets.pore[:, 0], facets.opposite[:, 0]],
        centre,
        facets.pore,
        facets.shift * tessellation.size,
    )
    joined = np.abs(height.sum(axis=1)) < SAME_CENTRE * tessellation.scale
    pairs, count = facets.pore[joined], len(centre)
    graph = coo_matrix((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    group = connected_components(graph, directed=False)[1]
    return Polyhedra(
        centre=centre, heights=height, group=group, wall=_walls(tessellation, centre, group)
    )


def _adopted_centres(tessellation: Tessellation) -> Array:
    """Centres (P, 3) m, where a flat tetrahedron has the centre of a neighbour.

    Its corners are four corners of the face between two polyhedra, and either neighbour leaves the
    same flow. One that no other mirrored face cuts comes first, so that the flat one keeps its
    share inside the box; of these the one with the nearest centre.
    """
    tetrahedra, size = tessellation.tetrahedra, tessellation.size
    centre, known = tetrahedra.centre.copy(), ~tetrahedra.flat
    near = tessellation.facets.where(np.any(tetrahedra.flat[tessellation.facets.pore], axis=1))
    lender = np.concatenate([near.pore[:, 1], near.pore[:, 0]])
    taker = np.concatenate([near.pore[:, 0], near.pore[:, 1]])
    turn = np.concatenate([near.shift, -near.shift]) * size
    middle = tetrahedra.points.position[tetrahedra.vertex[taker]].mean(axis=1)
    crossed = _crossed(tetrahedra, taker)
    for alike in (True, False):
        for _ in range(ADOPTION_ROUNDS):
            use = np.flatnonzero(known[lender] & ~known[taker])
            if alike:
                cut = _crossed(tetrahedra, lender[use]) | _on_face(
                    tessellation, centre[lender[use]]
                )
                use = use[np.all(cut == crossed[use], axis=1)]
            offered = centre[lender[use]] + turn[use]
            away = np.sum((offered - middle[use]) ** 2, axis=1)
            nearest = np.lexsort((away, taker[use]))
            taken, rows = np.unique(taker[use][nearest], return_index=True)
            centre[taken] = offered[nearest[rows]]
            known[taken] = True
    return centre


def _crossed(tetrahedra: Tetrahedra, which: Array) -> Array:
    """Whether a tetrahedron has corners on both sides of a mirrored face, (K, 3) by axis."""
    mirror = tetrahedra.points.mirror[tetrahedra.vertex[which]]
    inside = np.any(mirror == INSIDE, axis=1)
    return np.asarray(inside & np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1))


def _on_face(tessellation: Tessellation, centre: Array) -> Array:
    """Whether a centre (K, 3) m lies on a mirrored face, (K, 3) by axis."""
    tolerance = SAME_CENTRE * tessellation.scale
    near = [np.abs(centre - face) < tolerance for face in tessellation.box.T]
    return (near[0] | near[1]) & ~np.array(tessellation.periodic)


def _walls(tessellation: Tessellation, centre: Array, group: Array) -> Array:
    """Mirrored faces (P, 3) that cut each polyhedron: -1 the low one, 1 the high one, 0 none.

    A face cuts a tetrahedron with corners on both sides of it, and one with corners beyond it
    whose centre lies on it; if one part of a polyhedron, then all.
    """
    tetrahedra = tessellation.tetrahedra
    mirror = tetrahedra.points.mirror
    mirrored = np.any((mirror != INSIDE) & (mirror != ON_FACE), axis=1)
    doubtful = np.flatnonzero(np.any(mirrored[tetrahedra.vertex], axis=1))
    corner = mirror[tetrahedra.vertex[doubtful]]
    near = _on_face(tessellation, centre[doubtful])
    beyond = np.any((corner != INSIDE) & (corner != ON_FACE), axis=1)
    low = np.any(corner == MIRROR_LOW, axis=1)
    cut = beyond & (np.any(corner == INSIDE, axis=1) | near)
    wall = np.zeros((len(centre), 3), np.int8)
    wall[doubtful] = np.where(cut, np.where(low, -1, 1), 0)
    for axis in range(3):
        for side in (-1, 1):
            groups = np.zeros(int(group.max(initial=-1)) + 1, bool)
            groups[group[wall[:, axis] == side]] = True
            wall[groups[group], axis] = side
    return wall
