"""Volume and surface of fines within each pore's tetrahedron, exact for every fine."""

import numpy as np
from overlap import Sphere, Tetrahedron, overlap_area, overlap_volume
from scipy.spatial import cKDTree

from fdnet.network import geometry
from fdnet.network.images import make_images
from fdnet.network.tessellation import Network
from fdnet.snapshot import Array, Snapshot

SPECK = 1e-9


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of the fines inside each tetrahedron.

    Counts the fines centred in the box, with their images across periodic sides and mirrored across the other faces
    (a pore on such a face is the whole mirrored tetrahedron). Exact: whole spheres, caps where one facet
    cuts, the `overlap` package (Strobl et al. 2016, J. Comput. Phys. 311, 158) where more do.
    """
    low, high = network.box[0]
    fines = fines.where((fines.position[:, 0] >= low) & (fines.position[:, 0] < high))
    volume, surface = np.zeros(len(network.pore_share)), np.zeros(len(network.pore_share))
    if not len(fines):
        return volume, surface
    position, radius = _with_images(network, fines)
    corner = _oriented(network.pore_corner)
    real = np.flatnonzero(geometry.signed_volume(corner) > SPECK * network.grain_radius**3)
    corner = corner[real]
    pore, fine = _near(corner, position, radius)
    depth = _facet_depths(corner, pore, position[fine])
    touched = np.all(depth > -radius[fine, None], axis=1)
    pore, fine, depth = pore[touched], fine[touched], depth[touched]
    inside, area = _pieces(corner, pore, (position[fine], radius[fine]), depth)
    np.add.at(volume, real[pore], inside)
    np.add.at(surface, real[pore], area)
    return volume, surface


def _oriented(corner: Array) -> Array:
    """Corners (P, 4, 3) swapped where needed for a positive volume."""
    turned = geometry.signed_volume(corner) < 0
    return np.where(turned[:, None, None], corner[:, [1, 0, 2, 3]], corner)


def _with_images(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    reach = np.maximum(
        network.box[:, 0] - network.pore_corner.min(axis=(0, 1)),
        network.pore_corner.max(axis=(0, 1)) - network.box[:, 1],
    )
    margin = np.maximum(reach, 0.0) + float(fines.radius.max())
    images = make_images(fines.position, network.box, periodic=network.periodic, margin=margin, hair=0.0)
    return images.position, fines.radius[images.owner]


def _near(corner: Array, position: Array, radius: Array) -> tuple[Array, Array]:
    """Pore and fine (K,) of the pairs whose bounding balls touch."""
    middle = corner.mean(axis=1)
    reach = np.linalg.norm(corner - middle[:, None], axis=2).max(axis=1)
    return neighbours(cKDTree(position), middle, reach + float(radius.max()))


def neighbours(tree: cKDTree, centre: Array, reach: Array) -> tuple[Array, Array]:
    """Index of the ball and of the point (K,) for all points of `tree` within `reach` (M,) of `centre` (M, 3)."""
    found = tree.query_ball_point(centre, reach, return_sorted=False)
    count = np.fromiter((len(one) for one in found), int, len(found))
    flat = np.concatenate([np.asarray(one, int) for one in found]) if count.sum() else np.zeros(0, int)
    return np.repeat(np.arange(len(centre)), count), flat


def _facet_depths(corner: Array, pore: Array, point: Array) -> Array:
    """Distance (K, 4) of `point` (K, 3) from the facets of `corner[pore]`, positive inside."""
    facet = corner[:, geometry.FACETS]
    normal = np.cross(facet[:, :, 1] - facet[:, :, 0], facet[:, :, 2] - facet[:, :, 0])
    normal /= np.linalg.norm(normal, axis=2)[..., None]
    apex = np.einsum("pfi,pfi->pf", corner - facet[:, :, 0], normal)
    normal *= np.sign(apex)[..., None]
    level = np.einsum("pfi,pfi->pf", facet[:, :, 0], normal)
    return np.stack([np.einsum("ki,ki->k", normal[pore, f], point) - level[pore, f] for f in range(4)], axis=1)


def _pieces(corner: Array, pore: Array, balls: tuple[Array, Array], depth: Array) -> tuple[Array, Array]:
    """Volume and surface (K,) of each ball within its tetrahedron."""
    radius = balls[1]
    nearest = depth.min(axis=1)
    height = np.clip(radius + nearest, 0.0, 2.0 * radius)
    volume, surface = geometry.cap_volume(radius, height), 2.0 * np.pi * radius * height
    several = np.flatnonzero(np.sum(depth < radius[:, None], axis=1) > 1)
    cut = [_cut(corner[pore[k]], balls[0][k], radius[k]) for k in several]
    if cut:
        volume[several], surface[several] = np.array(cut).T
    return volume, surface


def _cut(corner: Array, centre: Array, radius: float) -> tuple[float, float]:
    # in units of the ball's radius about its centre, for the package's absolute tolerances
    tetrahedron, ball = Tetrahedron((corner - centre) / radius), Sphere(np.zeros(3), 1.0)
    return overlap_volume(ball, tetrahedron) * radius**3, overlap_area(ball, tetrahedron)[0] * radius**2
