"""Flow along the axis through a section of a throat that a side wall cuts and holds still.

The facet of the throat has a grain i, its mirror image across the wall, and a grain j or its image
as corners. Its plane is normal to the wall, and inside the box every section parallel to it is the
trapezoid between the centres of two discs and their feet on the wall.

Discs and wall share the fluid as in `cross_section`. The line midway between the rims of i and j
is a hyperbola. The line midway between the rim of i (radius rho, centre H above the wall) and the
wall is a parabola: on the ray at the angle t from the normal of the wall it lies at the distance
(H + rho) / (1 + cos t) from the centre; at the distance x from the foot of i its height above the
wall is (x^2 + H^2 - rho^2) / (2 (H + rho)). The lines meet in the centre of the circle that
touches discs and wall. The share of the wall is a plane film, with the flux y^3 / 3 per length for
a film of thickness y. Where that centre lies outside the trapezoid, every ray still ends at the
nearest of these lines or of the sides of the trapezoid: no share is negative, none is missing.
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.network.laws.elementary import QUARTER, angle_of, cosine_of, sine_of
from fdnet.network.laws.rays import (
    FINE_POINTS,
    FINE_WEIGHTS,
    POINTS,
    WEIGHTS,
    flux_on_ray,
    midway,
)
from fdnet.network.laws.wedge import shear_ratio
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

NARROWED = 0.25
"""Part of the slipping flux that a throat carries which two walls cut between several grains."""
TOLERANCE = 1e-9
"""Lengths up to this many mean grain radii are 0, and sines up to this are taken as this."""
LANES = 6
"""Numbers a section for which `wall_fluxes` needs room."""


def wall_cuts(network: Network) -> tuple[Array, Array, Array]:
    """How walls that hold the fluid cut each throat.

    A trapezoid is two triangles, each with share 1/2, so each carries the half-section; a triangle
    with j on the wall is alone and carries two. The rectangle of an edge (`edge_cross_section`) is
    two triangles, each with share 1/4, so each carries two quarter-sections. Only grains centred
    on walls have other edges; their throats carry `NARROWED` of the slipping flux.

    Returns:
        order: (T, 2) which corners of the facet are i and j. On an edge j is -1, and both are -1
        where no wall cuts the throat. place: (T, 3) m, heights of i and j above the wall, and
        their distance along it; on an edge heights of i above both walls, and 0. part: (T,)
        flux of the whole throat over that of the half-section, quarter-section, or slipping
            section.
    """
    count = len(network.throat_share)
    order, place, part = np.full((count, 2), -1), np.zeros((count, 3)), np.ones(count)
    if network.walls == "slip":
        return order, place, part
    single, double = (np.flatnonzero(network.throat_share == share) for share in (0.5, 0.25))
    corner, tolerance = network.corners_of(single), TOLERANCE * network.grain_radius
    own = network.image_grain[network.throat_images[single]]
    sides = [axis for axis in (1, 2) if not network.periodic[axis]]
    for i, image, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        apart = corner[:, image] - corner[:, i]
        for axis in sides:
            pair = (own[:, i] == own[:, image]) & _mirrored(apart, axis, tolerance)
            t = single[pair]
            across = corner[pair, j] - 0.5 * (corner[pair, i] + corner[pair, image])
            height = np.abs(across[:, axis])
            order[t] = i, j
            place[t, 0], place[t, 1] = 0.5 * np.abs(apart[pair, axis]), height
            place[t, 2] = np.linalg.norm(np.delete(across, axis, axis=1), axis=1)
            part[t] = np.where(height <= tolerance, 2.0, 1.0)
    _set_edges(network, double, (order, place, part))
    return order, place, part


def _mirrored(apart: Array, axis: int, tolerance: float) -> Array:
    """Whether steps (K, 3) m lead across a wall normal to an axis, and along no other one."""
    rest = np.delete(apart, axis, axis=1)
    return np.all(np.abs(rest) <= tolerance, axis=1) & (np.abs(apart[:, axis]) > tolerance)


def _set_edges(network: Network, double: Array, cuts: tuple[Array, Array, Array]) -> None:
    """Sets what `wall_cuts` returns of the throats `double` (K,), which two walls cut."""
    order, place, part = cuts
    part[double] = NARROWED
    corner, tolerance = network.corners_of(double), TOLERANCE * network.grain_radius
    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        one, two = corner[:, j] - corner[:, i], corner[:, k] - corner[:, i]
        right = _mirrored(one, 1, tolerance) & _mirrored(two, 2, tolerance)
        t = double[right]
        order[t, 0], part[t] = i, 2.0
        place[t, 0], place[t, 1] = 0.5 * np.abs(one[right, 1]), 0.5 * np.abs(two[right, 2])


@loops_in_place
def wall_fluxes(
    place: Array, discs: tuple[Array, Array], room: tuple[Array, Array], flux: Array
) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 between the wall and two discs in K sections.

    `place` (3,) m are the heights of their centres above the wall and their distance along it,
    `discs` (K,) m their radii. `room` is that (`LANES`, K) for the sections, and the table of
    `shear_ratio`.
    """
    lanes, table = room
    along, above, split, share = lanes[0], lanes[1], lanes[2], lanes[3]
    first, last = lanes[4], lanes[5]
    apart = np.hypot(place[2], place[0] - place[1])
    _set_meeting(place, discs, lanes)
    for k in range(len(flux)):
        flux[k] = 0.0
    for i in range(2):
        height, other = place[i], place[1 - i]
        disc, next_disc = discs[i], discs[1 - i]
        edge = np.arctan2(place[2], height - other)
        across = (height, place[2], apart, (height - other) / apart)
        for k in range(len(flux)):
            x = along[k] if i == 0 else place[2] - along[k]
            split[k] = min(max(angle_of(x, height - above[k]), 0.0), edge)
            first[k], last[k] = 0.0, edge
        _set_shares(across, (disc, next_disc), (first, split), share)
        for k in range(len(flux)):
            flux[k] += share[k] * shear_ratio(split[k], 2.0 * disc[k] / (height + disc[k]), table)
        _set_shares(across, (disc, next_disc), (split, last), share)
        for k in range(len(flux)):
            gap = max(apart - next_disc[k] + disc[k], disc[k])
            ratio = shear_ratio(edge - split[k], min(2.0 * disc[k] / gap, 1.0), table)
            flux[k] += share[k] * ratio
    for k in range(len(flux)):
        first[k], split[k], last[k] = 0.0, min(max(along[k], 0.0), place[2]), place[2]
    _add_film(place, discs, (first, split), flux)
    _add_film(place, discs, (split, last), flux)


@loops_in_place
def _set_meeting(place: Array, discs: tuple[Array, Array], lanes: Array) -> None:
    """Sets where the two parabolas meet: m along the wall from the first foot, and m above it.

    That is the centre of the circle that touches both discs and the wall. Where the parabolas do
    not meet, it is the place midway along the wall. The two numbers are the first two rows of
    `lanes` (`LANES`, K).
    """
    along, above = lanes[0], lanes[1]
    first, second = discs
    for k in range(len(along)):
        one, two = place[0] + first[k], place[1] + second[k]
        near, far = place[0] ** 2 - first[k] ** 2, place[1] ** 2 - second[k] ** 2
        middle = one * place[2]
        rest = two * near - one * (place[2] ** 2 + far)
        square = middle**2 - (two - one) * rest
        meeting = -rest / (middle + np.sqrt(max(square, 0.0)))
        along[k] = meeting if square >= 0.0 else 0.5 * place[2]
        above[k] = 0.5 * (along[k] ** 2 + near) / one


@loops_in_place
def _set_shares(
    across: tuple[float, float, float, float],
    discs: tuple[Array, Array],
    turns: tuple[Array, Array],
    share: Array,
) -> None:
    """Sets the flux (K,) m4 on the rays of a disc between two angles from the normal of the wall.

    A ray ends at the nearest line midway, or at the far side of the trapezoid. `discs` (K,) m are
    the radii, `turns` (K,) rad the angles. `across` is the height m of the disc, its distance m
    from the other along the wall and in all, and the sine of the slope from the other up to it.
    """
    height, far, apart, upright = across
    disc, other = discs
    low, high = turns
    along = far / apart
    for k in range(len(share)):
        share[k] = 0.0
    for p in range(len(POINTS)):
        part, weight = 0.5 * (1.0 + POINTS[p]), 0.5 * WEIGHTS[p]
        for k in range(len(share)):
            width = max(high[k] - low[k], 0.0)
            turn = low[k] + part * width - QUARTER
            cosine, sine = -sine_of(turn), cosine_of(turn)
            wider = other[k] - disc[k]
            reach = min((height + disc[k]) / (1.0 + cosine), far / max(sine, TOLERANCE))
            # the line midway to the other disc, at the angle between the ray and the two centres
            below = apart * (upright * cosine + along * sine) + wider
            reach = min(reach, midway(0.5 * (apart * apart - wider * wider), below))
            share[k] += weight * width * flux_on_ray(reach, disc[k])


@loops_in_place
def _add_film(
    place: Array, discs: tuple[Array, Array], ends: tuple[Array, Array], flux: Array
) -> None:
    """Adds the share of the wall, m4, between two distances (K,) m from the first foot."""
    first, second = discs
    low, high = ends
    for p in range(len(FINE_POINTS)):
        part, weight = 0.5 * (1.0 + FINE_POINTS[p]), 0.5 * FINE_WEIGHTS[p]
        for k in range(len(flux)):
            width = high[k] - low[k]
            x = low[k] + part * width
            one = (x**2 + place[0] ** 2 - first[k] ** 2) / (2.0 * (place[0] + first[k]))
            rest = place[2] - x
            two = (rest**2 + place[1] ** 2 - second[k] ** 2) / (2.0 * (place[1] + second[k]))
            edge = place[0] + (place[1] - place[0]) * x / place[2]
            flux[k] += weight * width * max(min(one, two, edge), 0.0) ** 3 / 3.0
