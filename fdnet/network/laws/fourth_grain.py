"""How much of the flow through a section a fourth grain leaves that reaches into it.

The section of a throat has three grains on its corners. It may also be entered by the fourth grain
of the tetrahedron on that side: by a large grain behind a small one, or by the mirror image of a
grain near a face. Among equal grains this does not happen.

The section is shared as in `cross_section`: each disc keeps what its rays see before a line midway
to another rim or the far side of the triangle. The rays of the fourth disc run from where they
enter the triangle to where they leave it or meet a line midway. Adding a solid never adds flow, so
the share is at most 1.
"""

import numpy as np

from fdnet.network.compiled import compiled_for_loops, loops_in_place
from fdnet.network.laws.corner_rays import (
    CornerRoom,
    corner_flux,
    corner_reaches,
    fourth_reaches,
)
from fdnet.network.laws.section_rays import (
    SWALLOWED,
    UNTOUCHED,
    flux_on_rays,
    inwards,
    narrow,
)
from fdnet.network.network import Network
from fdnet.network.tessellation.tetrahedron import along as inner
from fdnet.network.tessellation.tetrahedron import less, times
from fdnet.spheres.snapshot import Array


def fourth_grains(network: Network, part: slice) -> tuple[Array, Array]:
    """The fourth grain of the tetrahedra on both sides of the throats `part` (K).

    Returns:
        image: (K, 2) index of its image in the network.
        place: (K, 2, 3) m, along the first edge of the facet, across it towards the third corner,
            and its height above the facet, of the centre of that image from the first corner.
    """
    pores = network.throat_pores[part]
    image, place = np.empty(pores.shape, int), np.empty((*pores.shape, 3))
    _find_fourth(
        (network.image_position, np.ptp(network.box, axis=1)),
        (network.throat_images[part], pores, network.throat_shift[part]),
        (network.pore_images, network.pore_wrap),
        (image, place),
    )
    return image, place


@compiled_for_loops
def _find_fourth(
    points: tuple[Array, Array],
    throats: tuple[Array, Array, Array],
    tetrahedra: tuple[Array, Array],
    out: tuple[Array, Array],
) -> None:
    """Sets the images and places of `fourth_grains`; the arguments are parts of the network.

    The fourth corner of a tetrahedron is the one farthest from the nearest corner of the facet.
    """
    position, size = points
    facets, pores, shift = throats
    vertex, wrap = tetrahedra
    image, place = out
    facet, apex, best = np.empty((3, 3)), np.empty(3), np.empty(3)
    for t in range(len(facets)):
        for k in range(3):
            for axis in range(3):
                turn = wrap[pores[t, 0], axis] * size[axis]
                facet[k, axis] = position[facets[t, k], axis] - turn
        for side in range(2):
            pore, farthest = pores[t, side], -1.0
            for corner in range(4):
                for axis in range(3):
                    turn = shift[t, axis] * side - wrap[pore, axis]
                    apex[axis] = position[vertex[pore, corner], axis] + turn * size[axis]
                nearest = np.inf
                for k in range(3):
                    square = 0.0
                    for axis in range(3):
                        square += (apex[axis] - facet[k, axis]) ** 2
                    nearest = min(nearest, square)
                if nearest > farthest:
                    farthest, image[t, side] = nearest, vertex[pore, corner]
                    best[:] = apex
            _set_place(facet, best, place[t, side])


@loops_in_place
def _set_place(facet: Array, apex: Array, place: Array) -> None:
    """Sets the `place` (3,) m of an apex (3,) m as `fourth_grains` gives it."""
    along, up = less(facet, 1, 0), less(facet, 2, 0)
    away = (apex[0] - facet[0, 0], apex[1] - facet[0, 1], apex[2] - facet[0, 2])
    long = np.sqrt(inner(along, along))
    normal = times(along, up)
    across = times(normal, along)
    wide = np.sqrt(inner(normal, normal))
    place[0] = inner(away, along) / long
    place[1] = inner(away, across) / (wide * long)
    place[2] = abs(inner(away, normal)) / wide


@loops_in_place
def share_left(
    disc: Array,
    fourth: tuple[float, float, float],
    corners: CornerRoom,
    rays: tuple[Array, int],
    more: tuple[Array, Array, Array],
) -> float:
    """Share of the flux through a triangle with discs that a fourth disc leaves, 0 to 1.

    Args:
        disc: (3,) m, the radii of the discs on the corners.
        fourth: the centre x, y and the radius m of the fourth disc.
        corners: the rays of the corners, aimed at the fourth disc (`aim_at_fourth`).
        rays: the rays (6, 36) of the fourth disc, and their number (`section_rays.aim`).
        more: the corners (3, 2) m, room for 36 numbers, and the table of `shear_ratio`.
    """
    own, count = rays
    base, room, table = more
    corner_reaches(corners, disc)
    clear = corner_flux(corners, disc, table)
    if not clear > 0.0:
        return 1.0
    fourth_reaches(corners, disc, fourth[2])
    left = corner_flux(corners, disc, table)
    end, reach = own[2], own[5]
    for p in range(count):
        reach[p] = end[p]
    done = UNTOUCHED
    for i in range(3):
        if done != SWALLOWED:
            done = narrow(own, count, fourth, (base[i, 0], base[i, 1], disc[i]))
    if done != SWALLOWED:
        left += flux_on_rays(own, count, fourth[2], (room, table))
    return min(left / clear, 1.0)


@loops_in_place
def depth_within(base: Array, side: Array, x: float, y: float) -> float:
    """How far m a place lies within a triangle, from the nearest side line; negative outside.

    A disc that is no larger than its place is far outside does not reach in.
    """
    return min(
        inwards(base, side, 0, x, y), inwards(base, side, 1, x, y), inwards(base, side, 2, x, y)
    )
