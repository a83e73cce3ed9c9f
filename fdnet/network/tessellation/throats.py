"""Throats: the open sections of the facets that two pores share."""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.tessellation.facets import Facets
from fdnet.network.tessellation.pierced import pierced_facets
from fdnet.network.tessellation.points import Points
from fdnet.network.tessellation.polyhedra import Polyhedra
from fdnet.network.tessellation.pores import Pores
from fdnet.network.tessellation.section import sections
from fdnet.network.tessellation.tessellation import Tessellation
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

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
