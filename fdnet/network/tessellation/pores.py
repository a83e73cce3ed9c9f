"""Pores and throats, measured on the tessellation.

Pores: where they lie, and what void and grain surface they hold.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import Points, Tetrahedra, solids, touching_spheres
from fdnet.network.tessellation.facets import (
    Facets,
    Polyhedra,
    Tessellation,
    pierced_facets,
    sections,
)
from fdnet.spheres.snapshot import Array, one_line

INSIDE_TOLERANCE = 1e-5
"""A centre this far outside its tetrahedron, in barycentric coordinates, counts as inside."""
VOID_ROUNDING = 1e-9
"""A void more negative than this, in mean grain radii cubed, is counted as negative."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pores:
    """P pores, one in each tetrahedron.

    Attributes:
        vertex: (P, 4) points at the corners.
        position: (P, 3) m, in the box; on the mirrored face for what such a face cuts.
        wrap: (P, 3) whole periods by which the tetrahedron lies beyond the position.
        radius: (P,) m, of the sphere that touches the four grains; 0 where there is none.
        power_centre: (P, 3) m, power centre of the polyhedron, moved with the position.
        volume: (P,) m3, of the tetrahedron.
        void: (P,) m3, volume of the tetrahedron outside the grains.
        wall_surface: (P,) m2, grain surface in the tetrahedron.
        group: (P,) number of the polyhedron that the tetrahedron is part of.
        share: (P,) part of the tetrahedron inside the box, 1/2 for each face that cuts it.
        counts: how many pores are closed, flat, at faces, or placed at a centroid.
    """

    vertex: Array
    position: Array
    wrap: Array
    radius: Array
    power_centre: Array
    volume: Array
    void: Array
    wall_surface: Array
    group: Array
    share: Array
    counts: dict[str, int]

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Spheres:
    """The touching sphere of each tetrahedron (P) alone, whatever polyhedron it is part of.

    Attributes:
        position: (P, 3) m, centre where that lies inside the tetrahedron, else the centroid.
        radius: (P,) m, NaN where no sphere touches the four grains.
        centred: (P,) whether the position is the centre of the sphere.
    """

    position: Array
    radius: Array
    centred: Array


def measure_pores(tessellation: Tessellation, polyhedra: Polyhedra) -> Pores:
    """Places, voids and grain surfaces of all pores.

    A pore lies at the centre of the sphere that touches its four grains, or else at the centroid
    (Shi 2011, section 3.1.2). All parts of a polyhedron have one place. What a mirrored face cuts
    lies on that face.
    """
    tetrahedra = tessellation.tetrahedra
    spheres, void, surface = _measured(tetrahedra)
    placed, wrap = _placed(tessellation, polyhedra, spheres)
    cut = polyhedra.wall != 0
    radius = np.nan_to_num(np.maximum(placed.radius, 0.0), nan=0.0)
    rounding = VOID_ROUNDING * float(tetrahedra.points.radius.mean()) ** 3
    counts = {
        "centre_is_centroid": int(np.sum(~placed.centred)),
        "pores_closed": int(np.sum(radius == 0)),
        "slivers": int(np.sum(tetrahedra.flat)),
        "cospherical_groups": int(np.sum(np.bincount(polyhedra.group) > 1)),
        "pores_at_end_faces": int(np.sum(cut[:, 0])),
        "pores_at_side_walls": int(np.sum(cut[:, 1:].any(axis=1))),
        "void_negative": int(np.sum(void < -rounding)),
    }
    return Pores(
        vertex=tetrahedra.vertex,
        position=placed.position,
        wrap=wrap,
        radius=radius,
        power_centre=polyhedra.centre - wrap * tessellation.size,
        volume=tetrahedra.volume,
        void=void,
        wall_surface=surface,
        group=polyhedra.group,
        share=0.5 ** cut.sum(axis=1),
        counts=counts,
    )


def _measured(tetrahedra: Tetrahedra) -> tuple[_Spheres, Array, Array]:
    """Touching spheres, void (P,) m3 and grain surface (P,) m2 of the tetrahedra."""
    points, vertex = tetrahedra.points, tetrahedra.vertex
    centre, radius, within = touching_spheres(
        points.position, points.radius, vertex, INSIDE_TOLERANCE
    )
    centred = within & ~tetrahedra.flat & np.isfinite(radius)
    outside = np.flatnonzero(~centred)
    centre[outside] = points.position[vertex[outside]].mean(axis=1)
    solid, surface = solids(points.position, points.radius, vertex)
    # its diagonals are counted by the polyhedra on either side, half each
    between = tetrahedra.flat & (solid < 0)
    solid[between] = surface[between] = 0.0
    spheres = _Spheres(position=centre, radius=radius, centred=centred)
    return spheres, tetrahedra.volume - solid, surface


def _placed(
    tessellation: Tessellation, polyhedra: Polyhedra, spheres: _Spheres
) -> tuple[_Spheres, Array]:
    """The same with one place for all parts of a polyhedron, in the box, and wraps (P, 3)."""
    box, size, periodic = tessellation.box, tessellation.size, tessellation.periodic
    position, radius, centred = spheres.position, spheres.radius, spheres.centred
    volume = tessellation.tetrahedra.volume
    rank, period = (centred, volume), np.where(periodic, size, np.inf)
    member, first, turns = _members(polyhedra, rank, period)
    alone = ~centred[first]
    if alone.any():
        weight, group = volume[member] + 1e-300, polyhedra.group[member]
        total = np.bincount(group, weights=weight)[group]
        for axis in range(3):
            place = (position[member, axis] - turns[:, axis] * size[axis]) * weight
            mean = np.bincount(group, weights=place)[group] / total
            position[member[alone], axis] = mean[alone] + turns[alone, axis] * size[axis]
    wrap = np.where(periodic, np.floor((position - box[:, 0]) / size + 1e-9), 0).astype(np.int16)
    position -= wrap * size
    position[member], radius[member] = position[first], radius[first]
    centred[member] = centred[first]
    wrap[member] = wrap[first] + turns
    for side, face in ((-1, box[:, 0]), (1, box[:, 1])):
        position = np.where(polyhedra.wall == side, face, position)
    return _Spheres(position=position, radius=radius, centred=centred), wrap


def _members(
    polyhedra: Polyhedra, rank: tuple[Array, Array], period: Array
) -> tuple[Array, Array, Array]:
    """Parts of the polyhedra that have several, and the part that stands for each.

    `rank` tells for each pore (P,) whether a touching sphere is centred in it, and its volume m3:
    a part with such a sphere goes first, then the largest. Returns the parts (K,), the one that
    stands for each (K,), and the whole periods (K, 3) between the two.
    """
    group, (centred, volume) = polyhedra.group, rank
    member = np.flatnonzero(np.bincount(group)[group] > 1)
    order = member[np.lexsort((-volume[member], ~centred[member], group[member]))]
    start = np.ones(len(order), bool)
    start[1:] = group[order][1:] != group[order][:-1]
    first = order[start][np.cumsum(start) - 1]
    turns = np.rint((polyhedra.centre[order] - polyhedra.centre[first]) / period).astype(np.int16)
    return order, first, turns


# ------------------------------------------------------------------------------------------------
# Throats: the open sections of the facets that two pores share.


LENGTH_FLOOR = 1e-3
"""Shortest length of a throat, in mean grain radii."""
TOUCHING = 1e-6
"""Grains nearer than the sum of their radii by more than this share of it overlap."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Throats:
    """T throats, one through each facet that does not lie in an x face.

    Attributes:
        pores: (T, 2) the pores at the ends.
        shift: (T, 3) whole periods from the position of the second pore to its place next to
            the first.
        vertex: (T, 3) points at the corners of the facet.
        heights: (T, 2) m, distance of the power centres from the facet.
        share: (T,) part of the section inside the box.
        radius: (T,) m, of the circle that touches the three grains; 0 where they close it.
        area: (T,) m2, open section; 0 where the grains close it.
        length: (T,) m, between the positions of the pores.
        counts: how many throats are closed, overlapping, pierced, short or left out.
    """

    pores: Array
    shift: Array
    vertex: Array
    heights: Array
    share: Array
    radius: Array
    area: Array
    length: Array
    counts: dict[str, int]

    __repr__ = one_line


def measure_throats(tessellation: Tessellation, polyhedra: Polyhedra, pores: Pores) -> Throats:
    """Sections and lengths of all throats.

    Facets that lie in an x face are left out: they join two pores of the pressure of that face.
    """
    points, scale = tessellation.tetrahedra.points, tessellation.scale
    facets, kept = _without_end_faces(tessellation.facets, polyhedra)
    share = _shares(facets, polyhedra)
    one, two = facets.pore.T
    shift = (pores.wrap[two] + facets.shift - pores.wrap[one]).astype(np.int16)
    length = _lengths(pores.position, facets.pore, shift * tessellation.size)
    radius, area, counts = _sections(points, facets)
    pierced = pierced_facets(tessellation, facets, radius > 0)
    return Throats(
        pores=facets.pore,
        shift=shift,
        vertex=facets.vertex,
        heights=polyhedra.heights[kept],
        share=share,
        radius=radius,
        area=area,
        length=np.maximum(length, LENGTH_FLOOR * scale),
        counts={
            "throats_unmatched": facets.unmatched,
            **counts,
            "throats_pierced": int(np.sum(pierced)),
            "throats_short": int(np.sum(length < LENGTH_FLOOR * scale)),
            "throats_in_polyhedra": int(np.sum(polyhedra.group[one] == polyhedra.group[two])),
            "throats_in_end_faces_dropped": int(np.sum(~kept)),
        },
    )


def _without_end_faces(facets: Facets, polyhedra: Polyhedra) -> tuple[Facets, Array]:
    """Facets that do not lie in an x face, and which of all they are (a mask)."""
    wall = polyhedra.wall[facets.pore, 0]
    kept = (wall[:, 0] != wall[:, 1]) | (wall[:, 0] == 0)
    return facets.where(kept), kept


def _shares(facets: Facets, polyhedra: Polyhedra) -> Array:
    """Part (T,) of each section inside the box.

    It is one half for each side wall that holds both pores, because that wall cuts the section
    into mirrored halves.
    """
    wall = polyhedra.wall[facets.pore]
    return 0.5 ** np.sum((wall[:, 0] == wall[:, 1]) & (wall[:, 0] != 0), axis=1)


def _sections(points: Points, facets: Facets) -> tuple[Array, Array, dict[str, int]]:
    """Inscribed radius (T,) m and open area (T,) m2, both 0 where grains close the facet, counts.

    `throats_closed`: no circle fits between the three grains. `throats_overlapping`: the throat is
    open and two of its grains overlap (the lens counts once). `throat_area_negative`: a circle
    fits but three grains overlap in one place; the area is then 0.
    """
    radius, area, overlapping = sections(points.position, points.radius, facets.vertex, TOUCHING)
    closed = ~(radius > 0)
    counts = {
        "throats_closed": int(np.sum(closed)),
        "throats_overlapping": int(np.sum(overlapping & ~closed)),
        "throat_area_negative": int(np.sum(area[~closed] < 0)),
    }
    return np.where(closed, 0.0, radius), np.where(closed, 0.0, np.maximum(area, 0.0)), counts


def _lengths(position: Array, pores: Array, offset: Array) -> Array:
    """Distance (T,) m between positions (P, 3) m of `pores` (T, 2).

    The second pore of each pair is moved by `offset` (T, 3) m.
    """
    length = np.empty(len(pores))
    for part in geometry.slices(len(length)):
        length[part] = np.linalg.norm(
            position[pores[part, 1]] + offset[part] - position[pores[part, 0]], axis=1
        )
    return length
