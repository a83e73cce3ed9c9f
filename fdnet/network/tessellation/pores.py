"""Pores: where they lie, and what void and grain surface they hold."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.tessellation.delaunay import Tetrahedra
from fdnet.network.tessellation.polyhedra import Polyhedra
from fdnet.network.tessellation.tessellation import Tessellation
from fdnet.network.tessellation.tetrahedron import solids, touching_spheres
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

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
