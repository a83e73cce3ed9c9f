"""Pores: where they lie and what void and wall they hold."""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import Tetrahedra
from fdnet.network.tessellation.facets import Polyhedra
from fdnet.spheres.snapshot import Array

INSIDE_HAIR = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class Centres:
    """`position` (P, 3) m in the box; `wrap` (P, 3) periods taken off to bring it there; `radius` (P,) m of the
    touching sphere, NaN without; how many are `centroids`."""

    position: Array
    wrap: Array
    radius: Array
    centroids: int


def pore_centres(
    tetrahedra: Tetrahedra, polyhedra: Polyhedra, box: Array, periodic: tuple[bool, ...]
) -> Centres:
    """Centre of the sphere touching the four grains, else the centroid; one for all parts of a polyhedron.

    What a mirrored face cuts lies on that face.
    """
    position, radius, centred, volume = _touching_spheres(tetrahedra)
    size = box[:, 1] - box[:, 0]
    member, first, turns = _members(polyhedra, (centred, volume), np.where(periodic, size, np.inf))
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
    position[member], radius[member], centred[member] = (
        position[first],
        radius[first],
        centred[first],
    )
    wrap[member] = wrap[first] + turns
    for side, face in ((-1, box[:, 0]), (1, box[:, 1])):
        position = np.where(polyhedra.wall == side, face, position)
    return Centres(position=position, wrap=wrap, radius=radius, centroids=int(np.sum(~centred)))


def _touching_spheres(tetrahedra: Tetrahedra) -> tuple[Array, Array, Array, Array]:
    """Position (P, 3) m and radius (P,) m, whether (P,) the sphere's centre is inside, volume (P,) m3."""
    count = len(tetrahedra.vertex)
    position, radius = np.empty((count, 3)), np.empty(count)
    centred, volume = np.empty(count, bool), np.empty(count)
    for part in geometry.slices(count):
        vertex = tetrahedra.vertex[part]
        corner = tetrahedra.images.position[vertex]
        centre, radius[part] = geometry.touching_sphere(corner, tetrahedra.image_radius[vertex])
        within = geometry.contains(corner, centre, hair=INSIDE_HAIR)
        centred[part] = within & ~tetrahedra.flat[part] & np.isfinite(radius[part])
        position[part] = np.where(centred[part][:, None], centre, corner.mean(axis=1))
        volume[part] = np.abs(geometry.signed_volume(corner))
    return position, radius, centred, volume


def _members(
    polyhedra: Polyhedra, rank: tuple[Array, Array], period: Array
) -> tuple[Array, Array, Array]:
    """Pores of polyhedra with several parts, the part that stands for each (one with a touching sphere inside, then
    the largest), and the periods between the two."""
    group, (centred, volume) = polyhedra.group, rank
    member = np.flatnonzero(np.bincount(group)[group] > 1)
    order = member[np.lexsort((-volume[member], ~centred[member], group[member]))]
    start = np.ones(len(order), bool)
    start[1:] = group[order][1:] != group[order][:-1]
    first = order[start][np.cumsum(start) - 1]
    turns = np.rint((polyhedra.centre[order] - polyhedra.centre[first]) / period).astype(np.int16)
    return order, first, turns


def pore_solids(tetrahedra: Tetrahedra) -> tuple[Array, Array, Array]:
    """Volume of the tetrahedra (P,) m3, void (P,) m3 and grain surface (P,) m2 in them."""
    count = len(tetrahedra.vertex)
    volume, void, surface = np.empty(count), np.empty(count), np.empty(count)
    for part in geometry.slices(count):
        vertex = tetrahedra.vertex[part]
        corner = tetrahedra.images.position[vertex]
        volume[part] = np.abs(geometry.signed_volume(corner))
        solid, surface[part] = solid_in_tetrahedra(corner, tetrahedra.image_radius[vertex])
        void[part] = volume[part] - solid
    return volume, void, surface


def solid_in_tetrahedra(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the spheres on the corners (P, 4, 3) within each tetrahedron.

    Sphere wedges by solid angle, less the overlap of each pair by dihedral angle: exact over a whole tessellation, and
    in one tetrahedron as long as no sphere reaches through the opposite face and no three overlap.
    """
    angle = np.abs(geometry.solid_angles(corner))
    first, second = radius[:, geometry.EDGES[:, 0]], radius[:, geometry.EDGES[:, 1]]
    apart = np.linalg.norm(
        corner[:, geometry.EDGES[:, 1]] - corner[:, geometry.EDGES[:, 0]], axis=-1
    )
    turn = geometry.dihedral_angles(corner) / (2.0 * np.pi)
    lens, hidden = geometry.lens(first, second, apart)
    volume = np.sum(angle * radius**3, axis=1) / 3.0 - np.sum(turn * lens, axis=1)
    return volume, np.sum(angle * radius**2, axis=1) - np.sum(turn * hidden, axis=1)
