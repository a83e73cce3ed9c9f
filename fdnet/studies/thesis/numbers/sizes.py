"""Sizes of pores and throats of a section: of our network, or of the section's grains alone as the thesis has them."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay

from fdnet.network import geometry
from fdnet.network.geometry import solid_in_tetrahedra
from fdnet.spheres.snapshot import Array
from fdnet.studies.thesis.numbers.examine import Examined
from fdnet.studies.thesis.numbers.values import thesis_values


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sizes:
    """Pores (P) with `pore_radius` m of the inscribed sphere and `pore_volume` m3 of void, throats (T) with inscribed
    `throat_radius` and `throat_length` m; `pore_weight`, `throat_weight` of each, and `sphere_weight` (P,) likewise,
    0 also for pores without an inscribed sphere of their own."""

    pore_radius: Array
    pore_volume: Array
    throat_radius: Array
    throat_length: Array
    pore_weight: Array
    sphere_weight: Array
    throat_weight: Array


def sizes_of_grains_alone(examined: Examined) -> Sizes:
    """Sizes in the Delaunay tessellation of just the grains centred in the first section: "a network of pores and pore
    throats are built from this section" (Shi 2011, section 3.3.1).

    It ends at the outermost grains, in many flat tetrahedra; faces and periodic sides play no part. The centre of a
    pore is that of the sphere touching its four grains, the centroid where that lies outside (section 3.1.2); then
    the sphere is not the pore's, and the pore has no radius here.
    """
    grains = examined.state.damaged.grains()
    section = grains.where(
        grains.position[:, 0] < grains.box[0, 0] + 1e-3 * thesis_values().first_section_mm
    )
    tessellation = tessellated(section.position)
    vertex, neighbour = (
        tessellation
        if tessellation is not None
        else (np.zeros((0, 4), int), np.zeros((0, 4), int))
    )
    corner, radius = section.position[vertex], section.radius[vertex]
    centre, sphere = geometry.touching_sphere(corner, radius)
    own = _lies_inside(corner, centre) & (sphere > 0)
    centre = np.where(own[:, None], centre, corner.mean(axis=1))
    # each facet once, seen from the tetrahedron with the higher number
    pore, opposite = np.nonzero((neighbour >= 0) & (neighbour < np.arange(len(vertex))[:, None]))
    facet = np.take_along_axis(vertex[pore], geometry.FACETS[opposite], axis=1)
    inscribed = geometry.touching_circle(section.position[facet], section.radius[facet])
    return Sizes(
        pore_radius=np.where(own, sphere, 0.0),
        pore_volume=np.abs(geometry.signed_volume(corner))
        - solid_in_tetrahedra(corner, radius)[0],
        throat_radius=np.nan_to_num(np.maximum(inscribed, 0.0)),
        throat_length=np.linalg.norm(centre[pore] - centre[neighbour[pore, opposite]], axis=1),
        pore_weight=np.ones(len(vertex)),
        sphere_weight=own.astype(float),
        throat_weight=np.ones(len(pore)),
    )


def tessellated(position: Array) -> tuple[Array, Array] | None:
    """Corners (P, 4) of the Delaunay tetrahedra of points (N, 3) m and their neighbours (P, 4) opposite each, -1 for
    none; None for fewer than four points. Lengths go over their spread, for Qhull's tolerances are of lengths near 1.
    """
    if len(position) < 4:
        return None
    centred = position - position.mean(axis=0)
    found = Delaunay(centred / np.ptp(centred, axis=0).max())
    return found.simplices, found.neighbors


def _lies_inside(corner: Array, point: Array) -> Array:
    """True (P,) where `point` (P, 3) lies within the tetrahedron `corner` (P, 4, 3), false when it is nan."""
    whole = geometry.signed_volume(corner)
    inside = whole != 0
    for k in range(4):
        part = corner.copy()
        part[:, k] = point
        inside &= geometry.signed_volume(part) * np.sign(whole) >= 0
    return inside
