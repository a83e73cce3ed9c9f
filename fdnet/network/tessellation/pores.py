"""Pores and throats, measured on the tessellation: the arrays of a `Network`."""

from typing import Any

import numpy as np

from fdnet.network.tessellation.delaunay import solids, touching_spheres
from fdnet.network.tessellation.facets import Polyhedra, Tessellation, sections
from fdnet.spheres.snapshot import Array

INSIDE_TOLERANCE = 1e-5
"""A centre this far outside its tetrahedron, in barycentric coordinates, counts as inside."""
VOID_ROUNDING = 1e-9
"""A void more negative than this, in mean grain radii cubed, is counted as negative."""


def measure_pores(
    tessellation: Tessellation, polyhedra: Polyhedra
) -> tuple[dict[str, Any], dict[str, int]]:
    """The arrays pore_... of the network, and counts of what is out of the ordinary.

    A pore lies at the centre of the sphere that touches its four grains, else at the centroid (Shi
    2011, section 3.1.2), all parts of a polyhedron at one place, on a mirrored face that cuts it.
    """
    tetrahedra, box = tessellation.tetrahedra, tessellation.box
    points, vertex, volume = tetrahedra.points, tetrahedra.vertex, tetrahedra.volume
    position, sphere, within = touching_spheres(
        points.position, points.radius, vertex, INSIDE_TOLERANCE
    )
    centred = within & ~tetrahedra.flat & np.isfinite(sphere)
    outside = np.flatnonzero(~centred)
    position[outside] = points.position[vertex[outside]].mean(axis=1)
    solid, surface = solids(points.position, points.radius, vertex)
    # the diagonals of a flat one are counted by the polyhedra on either side, half each
    between = tetrahedra.flat & (solid < 0)
    solid[between] = surface[between] = 0.0
    void = volume - solid
    # one place for all parts of a polyhedron
    size, periodic = tessellation.size, tessellation.periodic
    period = np.where(periodic, size, np.inf)
    member, first, turns = _members(polyhedra, centred, volume, period)
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
    position[member], sphere[member] = position[first], sphere[first]
    centred[member] = centred[first]
    wrap[member] = wrap[first] + turns
    for side, face in ((-1, box[:, 0]), (1, box[:, 1])):
        position = np.where(polyhedra.wall == side, face, position)
    cut = polyhedra.wall != 0
    radius = np.nan_to_num(np.maximum(sphere, 0.0), nan=0.0)
    counts = {
        "centre_is_centroid": int(np.sum(~centred)),
        "pores_closed": int(np.sum(radius == 0)),
        "slivers": int(np.sum(tetrahedra.flat)),
        "cospherical_groups": int(np.sum(np.bincount(polyhedra.group) > 1)),
        "pores_at_end_faces": int(np.sum(cut[:, 0])),
        "pores_at_side_walls": int(np.sum(cut[:, 1:].any(axis=1))),
        "void_negative": int(np.sum(void < -VOID_ROUNDING * float(points.radius.mean()) ** 3)),
    }
    pores = {
        "pore_images": vertex,
        "pore_wrap": wrap,
        "pore_position": position,
        "pore_radius": radius,
        "pore_power_centre": polyhedra.centre - wrap * size,
        "pore_tetra_volume": volume,
        "pore_volume": void,
        "pore_wall_surface": surface,
        "pore_group": polyhedra.group,
        "pore_share": 0.5 ** cut.sum(axis=1),
    }
    return pores, counts


def _members(
    polyhedra: Polyhedra, centred: Array, volume: Array, period: Array
) -> tuple[Array, Array, Array]:
    """Parts (K,) of the polyhedra that have several, what stands for each, periods between them.

    A part in which its touching sphere is `centred` (P,) goes first, then the largest one.
    """
    group = polyhedra.group
    member = np.flatnonzero(np.bincount(group)[group] > 1)
    order = member[np.lexsort((-volume[member], ~centred[member], group[member]))]
    start = np.ones(len(order), bool)
    start[1:] = group[order][1:] != group[order][:-1]
    first = order[start][np.cumsum(start) - 1]
    turns = np.rint((polyhedra.centre[order] - polyhedra.centre[first]) / period).astype(np.int16)
    return order, first, turns


# ---- Throats: the open sections of the facets that two pores share.
LENGTH_FLOOR = 1e-3  # Shortest length of a throat, in mean grain radii
TOUCHING = 1e-6  # Grains nearer than the sum of their radii by more than this share of it overlap


def measure_throats(
    tessellation: Tessellation, polyhedra: Polyhedra, pores: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, int]]:
    """The arrays throat_... of the network, and counts of what is out of the ordinary.

    Facets that lie in an x face are left out: they join two pores of the pressure of that face.
    `throats_closed` counts where no circle fits between the three grains, `throats_overlapping`
    open throats of which two grains overlap, and `throat_area_negative` those where a circle fits
    but three grains overlap in one place; their area is 0.
    """
    points, floor = tessellation.tetrahedra.points, LENGTH_FLOOR * tessellation.scale
    wall = polyhedra.wall[tessellation.facets.pore]
    kept = (wall[:, 0, 0] != wall[:, 1, 0]) | (wall[:, 0, 0] == 0)
    facets, wall = tessellation.facets.where(kept), wall[kept]
    one, two = facets.pore.T
    shift = (pores["pore_wrap"][two] + facets.shift - pores["pore_wrap"][one]).astype(np.int16)
    position = pores["pore_position"]
    there = position[two] + shift * tessellation.size
    length = np.linalg.norm(there - position[one], axis=1)
    inscribed, opened, overlapping = sections(
        points.position, points.radius, facets.vertex, TOUCHING
    )
    closed = ~(inscribed > 0)
    radius = np.where(closed, 0.0, inscribed)
    area = np.where(closed, 0.0, np.maximum(opened, 0.0))
    throats = {
        "throat_pores": facets.pore,
        "throat_shift": shift,
        "throat_images": facets.vertex,
        # a side wall that holds both pores cuts the section into mirrored halves
        "throat_share": 0.5 ** np.sum((wall[:, 0] == wall[:, 1]) & (wall[:, 0] != 0), axis=1),
        "throat_heights": polyhedra.heights[kept],
        "throat_radius": radius,
        "throat_radius_effective": np.sqrt(area / np.pi),
        "throat_area": area,
        "throat_length": np.maximum(length, floor),
    }
    counts = {
        "throats_unmatched": facets.unmatched,
        "throats_closed": int(np.sum(closed)),
        "throats_overlapping": int(np.sum(overlapping & ~closed)),
        "throat_area_negative": int(np.sum(opened[~closed] < 0)),
        "throats_short": int(np.sum(length < floor)),
        "throats_in_polyhedra": int(np.sum(polyhedra.group[one] == polyhedra.group[two])),
        "throats_in_end_faces_dropped": int(np.sum(~kept)),
    }
    return throats, counts
