"""The flow through a section next to side walls that hold the fluid, and to planes of pressure.

A wall is one more disc, of huge radius, and what lies beyond it is the mirror image of what lies
in the box. A plane of constant pressure holds the fluid along it as a wall does. With n the
component of the normal of the section along x, the flux is n^2 M + (1 - n^2) M_held, where M_held
has the planes as more such discs.
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.network.laws.point_sections import points_flux
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

SQUARE = 1e-6
"""Square of the sine of the angle between a section and a plane up to which they do not meet."""
HUGE = 1e3
"""Radius of the disc that stands for a plane, in lengths of the facet."""
MOST_PLANES = 6


def planes_of(network: Network) -> Array:
    """The planes (6, 3) of a box that hold fluid: axis, sense of the normal into the box, place m.

    Those of pressure, across x, come first. The place of a side that holds no fluid is infinite.
    """
    planes = np.empty((MOST_PLANES, 3))
    for axis in range(3):
        open_side = network.periodic[axis] or (axis > 0 and network.walls == "slip")
        for side in range(2):
            sense = 1.0 - 2.0 * side
            place = -sense * np.inf if open_side else network.box[axis, side]
            planes[2 * axis + side] = axis, sense, place
    return planes


def turned_inside(network: Network, facet: Array, axes: Array) -> tuple[Array, Array]:
    """Facets (K, 3, 3) m and their axes (3, K, 3), of which none lies beyond a no-slip wall.

    Those whose centroid does are replaced by their mirror images, which are the same throats.
    """
    facet, axes = facet.copy(), axes.copy()
    for axis, sense, place in planes_of(network)[2:]:
        beyond = sense * (facet[:, :, int(axis)].mean(axis=1) - place) < 0.0
        facet[beyond, :, int(axis)] = 2.0 * place - facet[beyond, :, int(axis)]
        axes[:, beyond, int(axis)] *= -1.0
    return facet, axes


@loops_in_place
def held_flux(
    section: tuple[Array, Array, Array, Array],
    solid: tuple[Array, int],
    where: tuple[Array, Array, Array, float],
) -> float:
    """Flux m4 of laplacian(w) = -1 through a section, among discs, walls and planes of pressure.

    Args:
        section: the corners (3, 2) m of the facet, points and lanes of `points_flux`, and room for
            `MOST_PLANES` lines.
        solid: as of `points_flux`, with room for `MOST_PLANES` more discs.
        where: the planes of `planes_of`, the first corner (3,) m of the facet, its axes (3, 3) as
            rows, and the height m of the section above it.
    """
    base, points, lanes, lines = section
    discs, many = solid
    planes, origin, axes, z = where
    longest = 0.0
    for i in range(3):
        longest = max(longest, abs(base[i, 0]), abs(base[i, 1]))
    held, cutting = many, 0
    for number in range(2, MOST_PLANES):
        line = lines[cutting]
        least = _set_line(line, planes[number], base, (origin, axes, z))
        if least < 2.0 * longest:
            _set_disc(discs[held], line, least, HUGE * longest)
            held += 1
            cutting += least < 0.0
    flux = points_flux(base, (discs, held), (lines, cutting), points, lanes)
    most, walled = 0.0, held
    for p in range(lanes.shape[1]):
        most = max(most, lanes[6, p])
    spare = lines[MOST_PLANES - 1]
    for number in range(2):
        least = _set_line(spare, planes[number], base, (origin, axes, z))
        if least < 2.0 * most:
            _set_disc(discs[held], spare, least, HUGE * longest)
            held += 1
    if held == walled:
        return flux
    across = axes[0, 0] ** 2 + axes[1, 0] ** 2
    more = points_flux(base, (discs, held), (lines, cutting), points, lanes)
    return (1.0 - across) * flux + across * more


@loops_in_place
def _set_line(line: Array, plane: Array, base: Array, where: tuple[Array, Array, float]) -> float:
    """Sets the line (3,), unit normal and distance m, in which a plane cuts a section.

    Returns its least distance m from the corners of the triangle, infinite where there is no line.
    """
    origin, axes, z = where
    axis, sense, place = int(plane[0]), plane[1], plane[2]
    ux, uy, uz = sense * axes[0, axis], sense * axes[1, axis], sense * axes[2, axis]
    square = ux * ux + uy * uy
    if np.isinf(place) or square <= SQUARE:
        return np.inf
    slope = np.sqrt(square)
    line[0], line[1] = ux / slope, uy / slope
    line[2] = (sense * (origin[axis] - place) + z * uz) / slope
    least = np.inf
    for i in range(3):
        least = min(least, line[2] + line[0] * base[i, 0] + line[1] * base[i, 1])
    return least


@loops_in_place
def _set_disc(disc: Array, line: Array, least: float, huge: float) -> None:
    """Sets the disc (4,) m of huge radius that stands beyond a line."""
    away = -(line[2] + huge)
    disc[0], disc[1], disc[2], disc[3] = line[0] * away, line[1] * away, huge, least
