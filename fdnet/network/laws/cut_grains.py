"""Sections of throats at a pressure plane, with the discs of the grains that the plane cuts.

Of a grain centred beyond an x face the pack has a cap. The tessellation has a half sphere or half
ellipsoid on the face in its place, whose section is a disc on the corner of the throat. What the
section really meets is the disc of the grain itself, centred beyond the corner. The flux of the
section with the discs on its corners is multiplied by

    M_cut / M_corner,

both summed over rays (`section_rays`), M_cut with the discs of the grains themselves and M_corner
with those on the corners. Only what lies in the triangle counts, as a ray begins where it enters.
"""

import numpy as np

from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.laws.facet_axes import facet_axes
from fdnet.network.laws.section_rays import (
    RAYS,
    SWALLOWED,
    UNTOUCHED,
    aim,
    flux_on_rays,
    narrow,
    set_sides,
)
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

LEAST = 1e-2
"""Smallest radius of the disc of a cut grain in a section, in radii of the grain."""

CutRoom = tuple[Array, Array, Array]
"""Room for the sides (3, 3) of a facet (`set_sides`), the rays (6, 36) of a disc, and for twice
three discs (2, 3, 3). Whoever uses it sets it first: its numbers do not last from call to call."""


@compiled
def cut_room() -> CutRoom:
    """Room for the discs of cut grains, for a fourth disc, or for discs of fines."""
    return np.empty((3, 3)), np.empty((6, 3 * RAYS)), np.empty((2, 3, 3))


def cut_corners(network: Network, part: slice, facet: Array) -> Array:
    """Where the grains themselves lie whose caps are corners of the throats `part` (K).

    `facet` (K, 3, 3) m are the corners. The result (K, 3, 4) m holds, for each corner, the way
    from it to the centre of the grain: along the first edge of the facet, across it and above it,
    towards the second pore; then the radius of the grain. Grains that no face cuts so have 0.
    """
    images = network.throat_images[part]
    outward = network.image_outward[images]
    cut = np.zeros((*images.shape, 4))
    row = np.flatnonzero(np.any(outward != 0.0, axis=1))
    if len(row):
        axes = facet_axes(network, part.start + row, facet[row])
        for i, axis in enumerate(axes):
            cut[row, :, i] = outward[row] * axis[:, :1]
        cut[row, :, 3] = np.where(outward[row] != 0.0, own_radius(network, images[row]), 0.0)
    return cut


def own_radius(network: Network, images: Array) -> Array:
    """Radius (...) m of the grains themselves that `images` (...) are, those of caps included."""
    radius, outward = network.image_radius[images], network.image_outward[images]
    # a half ellipsoid of semi-axes h and a has the volume of a half sphere of r^3 = a^2 h
    base = radius**3 / network.image_height[images]
    return np.where(outward != 0.0, np.sqrt(base + outward**2), radius)


@loops_in_place
def share_of_cut(
    base: Array, disc: Array, z: float, cut: Array, room: tuple[CutRoom, Array, Array]
) -> float:
    """Flux at the height `z` m with the discs of cut grains, over that with discs on the corners.

    Args:
        base: (3, 2) m, corners of the facet.
        disc: (3,) m, radii of the discs on them at this height.
        z: m above the facet, towards the second pore.
        cut: (3, 4) m of `cut_corners`.
        room: `CutRoom` and 36 numbers, which are written to, and the table of `shear_ratio`.
    """
    (side, _, places), _, _ = room
    own, moved = places[0], places[1]
    set_sides(base, side)
    for i in range(3):
        moved[i] = base[i, 0], base[i, 1], disc[i]
        own[i] = base[i, 0], base[i, 1], disc[i]
        if cut[i, 3] > 0.0:
            square = cut[i, 3] ** 2 - (z - cut[i, 2]) ** 2
            least = LEAST * cut[i, 3]
            if square > least * least:
                own[i] = base[i, 0] + cut[i, 0], base[i, 1] + cut[i, 1], np.sqrt(square)
            else:
                own[i, 2] = least
    corner = _flux_between(base, moved, room)
    return _flux_between(base, own, room) / corner if corner > 0.0 else 1.0


@loops_in_place
def _flux_between(base: Array, discs: Array, room: tuple[CutRoom, Array, Array]) -> float:
    """Flux m4 on the rays of three discs (3, 3), x, y and radius m, within the triangle."""
    (side, rays, _), part, table = room
    total = 0.0
    for i in range(3):
        disc = (discs[i, 0], discs[i, 1], discs[i, 2])
        count, done = aim(base, side, disc[0], disc[1], rays), UNTOUCHED
        for p in range(count):
            rays[5, p] = rays[2, p]
        for j in range(3):
            other = (discs[j, 0], discs[j, 1], discs[j, 2])
            if j != i and done != SWALLOWED:
                done = max(done, narrow(rays, count, disc, other))
        if done != SWALLOWED and count > 0:
            total += flux_on_rays(rays, count, disc[2], (part, table))
    return total
