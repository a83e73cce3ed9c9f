"""The network of pores and throats of a grain pack: one pore per Delaunay tetrahedron, one throat per shared facet."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from fdnet.errors import NetworkError
from fdnet.network import geometry
from fdnet.network.delaunay import Facets, Tetrahedra, cut_axes, share_facets, tessellate, without_side_walls
from fdnet.network.images import MIRROR_LOW, neighbour_tree
from fdnet.snapshot import Array, Snapshot, frozen

LENGTH_FLOOR = 1e-3
SAME_CENTRE = 1e-5


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Network:
    """Pores (P) and throats (T) of a pack of grains; lengths m, areas m2, volumes m3. x is the flow axis.

    `box` (3, 2); `periodic` (3,); `grain_radius` mean; `area` cross-section of what the pores fill (the box's when
    both sides are periodic, else without the layer at the side walls). A pore cut by an x face that is not periodic
    lies on that face and describes the whole mirrored tetrahedron; `pore_share` (P,) is the part inside (1/2, else
    1). `pore_grains` (P, 4) index; `pore_corner` (P, 4, 3), images included; `pore_corner_radius` (P, 4);
    `pore_position` (P, 3) centre of the sphere touching the four grains, the centroid where that is outside (Shi
    2011, section 3.1.2); `pore_radius` of that sphere (0 where grains close it); `pore_circumcentre` (P, 3);
    `pore_tetra_volume`, `pore_volume` (void), `pore_wall_surface` (P,); `pore_group` (P,) equal for pores of one
    circumcentre, which are parts of one polyhedron (a lattice's cell, a prism cut by a face) split at will.
    `throat_pores` (T, 2); `throat_shift` (T, 3) periods from the second pore's position to its place beside the
    first; `throat_ends` (T, 2, 3) the two places; `throat_grains` (T, 3); `throat_corner` (T, 3, 3);
    `throat_corner_radius` (T, 3); `throat_heights` (T, 2) distances of the circumcentres from the facet, positive on
    their own side; `throat_radius` inscribed; `throat_area` open; `throat_radius_effective` = sqrt(area / pi);
    `throat_length` between the pore positions (T,). `counts`: what was closed, floored, dropped or replaced.
    """

    box: Array
    periodic: tuple[bool, bool, bool]
    grain_radius: float
    area: float
    pore_grains: Array
    pore_corner: Array
    pore_corner_radius: Array
    pore_position: Array
    pore_radius: Array
    pore_circumcentre: Array
    pore_tetra_volume: Array
    pore_volume: Array
    pore_wall_surface: Array
    pore_group: Array
    pore_share: Array
    throat_pores: Array
    throat_shift: Array
    throat_ends: Array
    throat_grains: Array
    throat_corner: Array
    throat_corner_radius: Array
    throat_heights: Array
    throat_radius: Array
    throat_radius_effective: Array
    throat_area: Array
    throat_length: Array
    counts: Mapping[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Centres:
    position: Array
    wrap: Array
    radius: Array
    centroids: int


def build_network(grains: Snapshot, *, periodic: tuple[bool, bool, bool]) -> Network:
    """Network of `grains` alone (radii may differ; the tessellation is of the centres, Shi 2011, section 3.2.1).

    Periodic sides join. Across the others the grains are mirrored before tessellating; pores cut by a side wall are
    left out, pores cut by an x face stay and lie on it. Grains that do not reach into the box are left out and
    counted. Raises NetworkError on fewer than four grains, coincident grains, grains in one plane, facets without
    partner, no throat at all, or an x face without pores.
    """
    periodic = (bool(periodic[0]), bool(periodic[1]), bool(periodic[2]))
    kept = _reaching(grains, periodic)
    outside, grains = len(grains) - len(kept), grains.where(kept)
    tetrahedra = tessellate(grains, periodic=periodic)
    tetrahedra, facets = without_side_walls(tetrahedra, share_facets(tetrahedra, periodic=periodic), periodic=periodic)
    if not len(facets.pore):
        raise NetworkError(
            f"tessellation: no throat joins two pores of these {len(grains)} grains; the box is too "
            "narrow for its side walls, give more grains or periodic sides"
        )
    centres = _pore_centres(grains, tetrahedra, periodic)
    if not periodic[0]:
        _check_ends(grains.box, centres.position[:, 0])
    pores, pore_counts = _pores(grains, tetrahedra, centres, periodic)
    throats, throat_counts = _throats(grains, tetrahedra, facets, centres)
    counts = {
        "grains_outside_box": outside,
        "centre_is_centroid": centres.centroids,
        **pore_counts,
        **throat_counts,
        **facets.counts,
    }
    # indices count all grains given
    pores["pore_grains"], throats["throat_grains"] = kept[pores["pore_grains"]], kept[throats["throat_grains"]]
    area = float(np.sum(pores["pore_share"] * pores["pore_tetra_volume"]) / (grains.box[0, 1] - grains.box[0, 0]))
    return Network(
        box=frozen(grains.box),
        periodic=periodic,
        grain_radius=float(grains.radius.mean()),
        area=area,
        counts=counts,
        **{name: frozen(value) for name, value in {**pores, **throats}.items()},
    )


def _check_ends(box: Array, x: Array) -> None:
    for name, face in (("inlet", box[0, 0]), ("outlet", box[0, 1])):
        if not np.any(x == face):
            raise NetworkError(
                f"tessellation: no pore lies on the {name} face x = {face:g} m, a whole layer of grains "
                "is centred on it; shift the box by part of a radius or make x periodic"
            )


def _reaching(grains: Snapshot, periodic: tuple[bool, ...]) -> Array:
    """Indices of the grains whose sphere reaches into the box."""
    beyond = np.maximum(grains.box[:, 0] - grains.position, grains.position - grains.box[:, 1])
    return np.flatnonzero(np.all((beyond < grains.radius[:, None]) | np.array(periodic), axis=1))


def _pore_centres(grains: Snapshot, tetrahedra: Tetrahedra, periodic: tuple[bool, ...]) -> _Centres:
    """Pore positions brought into the box, and the periods `wrap` (P, 3) taken off to bring them there."""
    low, high = grains.box.T
    centre, radius = geometry.touching_sphere(tetrahedra.shaken, grains.radius[tetrahedra.grain])
    centroid = tetrahedra.corner.mean(axis=1)
    cut = cut_axes(tetrahedra.mirror)
    inside = geometry.contains(tetrahedra.shaken, centre, hair=1e-5)
    with np.errstate(invalid="ignore"):
        in_box = np.all(((centre >= low) & (centre <= high)) | cut | np.array(periodic), axis=1)
    centred = np.where(cut.any(axis=1), in_box, inside)
    position = np.where(centred[:, None], centre, centroid)
    face = np.where(np.any(tetrahedra.mirror == MIRROR_LOW, axis=1), low, high)
    position = np.where(cut, face, position)
    size = high - low
    wrap = np.where(periodic, np.floor((position - low) / size + 1e-9), 0).astype(int)
    position = position - wrap * size
    return _Centres(
        position=position, wrap=wrap, radius=np.nan_to_num(radius, nan=0.0), centroids=int(np.sum(~centred))
    )


def _pores(
    grains: Snapshot, tetrahedra: Tetrahedra, centres: _Centres, periodic: tuple[bool, ...]
) -> tuple[dict[str, Array], dict[str, int]]:
    offset = centres.wrap * (grains.box[:, 1] - grains.box[:, 0])
    corner = tetrahedra.corner - offset[:, None]
    radius = grains.radius[tetrahedra.grain]
    volume = np.abs(geometry.signed_volume(corner))
    solid, surface = solid_in_tetrahedra(corner, radius)
    cut = cut_axes(tetrahedra.mirror)[:, 0]
    found = {
        "pore_grains": tetrahedra.grain,
        "pore_corner": corner,
        "pore_corner_radius": radius,
        "pore_position": centres.position,
        "pore_radius": np.maximum(centres.radius, 0.0),
        "pore_circumcentre": tetrahedra.centre - offset,
        "pore_tetra_volume": volume,
        "pore_volume": volume - solid,
        "pore_wall_surface": surface,
        "pore_group": _groups(tetrahedra.centre, grains, periodic),
        "pore_share": np.where(cut, 0.5, 1.0),
    }
    speck = 1e-9 * float(grains.radius.mean()) ** 3
    counts = {
        "pores_closed": int(np.sum(centres.radius <= 0)),
        "pores_at_end_faces": int(np.sum(cut)),
        "void_negative": int(np.sum(found["pore_volume"] < -speck)),
    }
    return found, counts


def _groups(centre: Array, grains: Snapshot, periodic: tuple[bool, ...]) -> Array:
    # the centres of the parts of one polyhedron differ by the shake, some 1e-7 radii
    tree = neighbour_tree(centre, grains.box, periodic=periodic)
    near = tree.query_pairs(SAME_CENTRE * float(grains.radius.mean()), output_type="ndarray")
    graph = coo_matrix((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(centre), len(centre)))
    return connected_components(graph, directed=False)[1]


def solid_in_tetrahedra(corner: Array, radius: Array) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the spheres on the corners (P, 4, 3) within each tetrahedron.

    Sphere wedges by solid angle, less the overlap of each pair by dihedral angle: exact over a whole tessellation, and
    in one tetrahedron as long as no sphere reaches through the opposite face and no three overlap.
    """
    angle = np.abs(geometry.solid_angles(corner))
    first, second = radius[:, geometry.EDGES[:, 0]], radius[:, geometry.EDGES[:, 1]]
    apart = np.linalg.norm(corner[:, geometry.EDGES[:, 1]] - corner[:, geometry.EDGES[:, 0]], axis=-1)
    caps = geometry.cap_heights(first, second, apart)
    turn = geometry.dihedral_angles(corner) / (2.0 * np.pi)
    lens = geometry.cap_volume(first, caps[0]) + geometry.cap_volume(second, caps[1])
    hidden = 2.0 * np.pi * (first * caps[0] + second * caps[1])
    volume = np.sum(angle * radius**3, axis=1) / 3.0 - np.sum(turn * lens, axis=1)
    return volume, np.sum(angle * radius**2, axis=1) - np.sum(turn * hidden, axis=1)


def _throats(
    grains: Snapshot, tetrahedra: Tetrahedra, facets: Facets, centres: _Centres
) -> tuple[dict[str, Array], dict[str, int]]:
    size = grains.box[:, 1] - grains.box[:, 0]
    one, two = facets.pore.T
    corners = geometry.FACETS[facets.opposite[:, 0]]
    grain = np.take_along_axis(tetrahedra.grain[one], corners, axis=1)
    corner = np.take_along_axis(tetrahedra.corner[one], corners[..., None], axis=1)
    radius = grains.radius[grain]
    shift = centres.wrap[two] + facets.shift - centres.wrap[one]
    ends = np.stack([centres.position[one], centres.position[two] + shift * size], axis=1)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    floor = LENGTH_FLOOR * float(grains.radius.mean())
    inscribed = np.nan_to_num(geometry.touching_circle(corner, radius), nan=0.0)
    area = np.where(inscribed > 0, geometry.open_area(corner, radius), 0.0)
    found = {
        "throat_pores": facets.pore,
        "throat_shift": shift,
        "throat_ends": ends,
        "throat_grains": grain,
        "throat_corner": corner - (centres.wrap[one] * size)[:, None],
        "throat_corner_radius": radius,
        "throat_heights": _heights(tetrahedra, facets, size),
        "throat_radius": np.maximum(inscribed, 0.0),
        "throat_area": np.maximum(area, 0.0),
        "throat_radius_effective": np.sqrt(np.maximum(area, 0.0) / np.pi),
        "throat_length": np.maximum(length, floor),
    }
    counts = {
        "throats_closed": int(np.sum(inscribed <= 0)),
        "throats_short": int(np.sum(length < floor)),
        "throat_area_negative": int(np.sum(area < 0)),
    }
    return found, counts


def _heights(tetrahedra: Tetrahedra, facets: Facets, size: Array) -> Array:
    """Signed distances (T, 2) of the two circumcentres from the facet, positive on their own side of it."""
    one, two = facets.pore.T
    corners = geometry.FACETS[facets.opposite[:, 0]]
    facet = np.take_along_axis(tetrahedra.shaken[one], corners[..., None], axis=1)
    normal = np.cross(facet[:, 1] - facet[:, 0], facet[:, 2] - facet[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    apex = np.take_along_axis(tetrahedra.shaken[one], facets.opposite[:, 0, None, None], axis=1)[:, 0]
    normal *= np.where(np.sum((apex - facet[:, 0]) * normal, axis=1) > 0, -1.0, 1.0)[:, None]
    other = tetrahedra.centre[two] + facets.shift * size
    return np.stack(
        [
            np.sum((facet[:, 0] - tetrahedra.centre[one]) * normal, axis=1),
            np.sum((other - facet[:, 0]) * normal, axis=1),
        ],
        axis=1,
    )
