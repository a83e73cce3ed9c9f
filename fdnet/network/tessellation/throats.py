"""Throats: the open sections of the facets two pores share."""

import numpy as np

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import Tetrahedra
from fdnet.network.tessellation.facets import Facets, Polyhedra, facet_vertices
from fdnet.spheres.snapshot import Array

LENGTH_FLOOR = 1e-3
TOUCHING = 1e-6


def without_end_faces(facets: Facets, polyhedra: Polyhedra) -> tuple[Facets, Array]:
    """Facets that do not lie across an x face (they join two pores of its pressure), and which (T,) were kept."""
    wall = polyhedra.wall[facets.pore, 0]
    kept = (wall[:, 0] != wall[:, 1]) | (wall[:, 0] == 0)
    return facets.where(kept), kept


def throat_shares(facets: Facets, polyhedra: Polyhedra) -> Array:
    """Part (T,) of each section inside the box: half for each side wall that holds both pores, for it cuts the
    section in mirrored halves."""
    wall = polyhedra.wall[facets.pore]
    return 0.5 ** np.sum((wall[:, 0] == wall[:, 1]) & (wall[:, 0] != 0), axis=1)


def throat_sections(tetrahedra: Tetrahedra, facets: Facets) -> tuple[Array, Array, dict[str, int]]:
    """Inscribed radius (T,) m and open area (T,) m2, both 0 where grains close the facet, and counts.

    `throats_closed`: no circle fits between the three grains. `throats_overlapping`: open, two of the grains overlap
    (the lens counts once). `throat_area_negative`: a circle fits but three grains overlap in one place; area 0.
    """
    radius, area = np.empty(len(facets.pore)), np.empty(len(facets.pore))
    overlapping = np.empty(len(facets.pore), bool)
    for part in geometry.slices(len(radius)):
        vertex = facet_vertices(tetrahedra, facets, part)
        corner, grain = tetrahedra.images.position[vertex], tetrahedra.image_radius[vertex]
        radius[part] = geometry.touching_circle(corner, grain)
        area[part] = geometry.open_area(corner, grain)
        apart = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
        overlapping[part] = np.any(
            apart < (1.0 - TOUCHING) * (grain + np.roll(grain, 1, axis=1)), axis=1
        )
    closed = ~(radius > 0)
    counts = {
        "throats_closed": int(np.sum(closed)),
        "throats_overlapping": int(np.sum(overlapping & ~closed)),
        "throat_area_negative": int(np.sum(area[~closed] < 0)),
    }
    return np.where(closed, 0.0, radius), np.where(closed, 0.0, np.maximum(area, 0.0)), counts


def throat_lengths(position: Array, pores: Array, turn: Array) -> Array:
    """Distance (T,) m between the positions (P, 3) of `pores` (T, 2), the second moved by `turn` (T, 3) m."""
    found = np.empty(len(pores))
    for part in geometry.slices(len(found)):
        found[part] = np.linalg.norm(
            position[pores[part, 1]] + turn[part] - position[pores[part, 0]], axis=1
        )
    return found
