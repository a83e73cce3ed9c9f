"""Sizes of pores and throats in the tessellation of the first section's grains alone.

The thesis tessellates these grains: "a network of pores and pore throats are built from this
section" (Shi 2011, section 3.3.1).
"""

import numpy as np
from scipy.spatial import Delaunay

from fdnet.network import geometry
from fdnet.network.tessellation.delaunay import solids, touching_spheres
from fdnet.network.tessellation.facets import sections
from fdnet.spheres.snapshot import Array
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.pore_sizes import PoreSizes
from validation.thesis.numbers.values import thesis_values


def sizes_of_grains_alone(examined: Examined) -> PoreSizes:
    """Sizes in the Delaunay tessellation of the grains centred in the first section.

    The tessellation ends at the outermost grains, in many flat tetrahedra; faces and periodic
    sides play no part. The centre of a pore is that of the sphere that touches its four grains.
    Where that centre lies outside the tetrahedron, the centroid takes its place (Shi 2011,
    section 3.1.2), the sphere belongs to another pore, and this pore has no radius here.
    """
    grains = examined.state.damaged.grains()
    end = grains.box[0, 0] + 1e-3 * thesis_values().first_section_mm
    section = grains.where(grains.position[:, 0] < end)
    tessellation = delaunay_of(section.position)
    vertex, neighbour = (
        tessellation
        if tessellation is not None
        else (np.zeros((0, 4), int), np.zeros((0, 4), int))
    )
    corner = section.position[vertex]
    centre, sphere, _ = touching_spheres(section.position, section.radius, vertex, 0.0)
    own = _lies_inside(corner, centre) & (sphere > 0)
    centre = np.where(own[:, None], centre, corner.mean(axis=1))
    # Each facet counts once: it is taken from the tetrahedron with the higher number.
    pore, opposite = np.nonzero((neighbour >= 0) & (neighbour < np.arange(len(vertex))[:, None]))
    facet = np.take_along_axis(vertex[pore], geometry.FACETS[opposite], axis=1)
    inscribed = sections(section.position, section.radius, facet, 0.0)[0]
    return PoreSizes(
        pore_radius=np.where(own, sphere, 0.0),
        pore_volume=np.abs(geometry.signed_volume(corner))
        - solids(section.position, section.radius, vertex)[0],
        throat_radius=np.nan_to_num(np.maximum(inscribed, 0.0)),
        throat_length=np.linalg.norm(centre[pore] - centre[neighbour[pore, opposite]], axis=1),
        pore_weight=np.ones(len(vertex)),
        sphere_weight=own.astype(float),
        throat_weight=np.ones(len(pore)),
    )


def delaunay_of(position: Array) -> tuple[Array, Array] | None:
    """Delaunay tetrahedra of points.

    The coordinates are divided by their spread, for Qhull's tolerances suit lengths near 1.

    Args:
        position: (N, 3) m, the points.

    Returns:
        Corners (P, 4) of the tetrahedra as indices of points, and their neighbours (P, 4)
        opposite each corner, -1 for none. None for fewer than four points.
    """
    if len(position) < 4:
        return None
    centred = position - position.mean(axis=0)
    triangulation = Delaunay(centred / np.ptp(centred, axis=0).max())
    return triangulation.simplices, triangulation.neighbors


def _lies_inside(corner: Array, point: Array) -> Array:
    """Whether each point (P, 3) lies within its tetrahedron (P, 4, 3); false when it is nan."""
    whole = geometry.signed_volume(corner)
    inside = whole != 0
    for k in range(4):
        part = corner.copy()
        part[:, k] = point
        inside &= geometry.signed_volume(part) * np.sign(whole) >= 0
    return inside
