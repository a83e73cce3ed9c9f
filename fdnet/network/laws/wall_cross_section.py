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

from fdnet.network.compiled import compiled
from fdnet.network.laws.rays import (
    FINE_POINTS,
    FINE_WEIGHTS,
    POINTS,
    WEIGHTS,
    flux_on_ray,
)
from fdnet.network.laws.wedge import shear_ratio
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

NARROWED = 0.25
"""Part of the slipping flux that a throat carries where two walls cut it."""
TOLERANCE = 1e-9
"""Lengths up to this many mean grain radii are 0, and sines up to this are taken as this."""


def wall_cuts(network: Network) -> tuple[Array, Array, Array]:
    """How walls that hold the fluid cut each throat.

    A trapezoid is two triangles, each with share 1/2, so each carries the half-section; a triangle
    with j on the wall is alone and carries two. A throat that two walls cut carries a quarter of
    the slipping flux, as a narrow gap does.

    Returns:
        order: (T, 2) which corners of the facet are i and j; -1 where not exactly one wall cuts
        it. place: (T, 3) m, heights of i and j above the wall, and their distance along it. part:
        (T,) factor from the flux of the half-section (order >= 0), or of the slipping
            section, to the flux of the whole throat.
    """
    count = len(network.throat_share)
    order, place, part = np.full((count, 2), -1), np.zeros((count, 3)), np.ones(count)
    cut = np.flatnonzero(network.throat_share < 1.0)
    if network.walls == "slip" or not len(cut):
        return order, place, part
    part[cut] = NARROWED
    single = cut[network.throat_share[cut] == 0.5]
    corner, tolerance = network.corners_of(single), TOLERANCE * network.grain_radius
    own = network.image_grain[network.throat_images[single]]
    sides = [axis for axis in (1, 2) if not network.periodic[axis]]
    for i, image, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        apart = corner[:, image] - corner[:, i]
        for axis in sides:
            rest = np.delete(apart, axis, axis=1)
            pair = (
                (own[:, i] == own[:, image])
                & np.all(np.abs(rest) <= tolerance, axis=1)
                & (np.abs(apart[:, axis]) > tolerance)
            )
            t = single[pair]
            across = corner[pair, j] - 0.5 * (corner[pair, i] + corner[pair, image])
            height = np.abs(across[:, axis])
            order[t] = i, j
            place[t, 0], place[t, 1] = 0.5 * np.abs(apart[pair, axis]), height
            place[t, 2] = np.linalg.norm(np.delete(across, axis, axis=1), axis=1)
            part[t] = np.where(height <= tolerance, 2.0, 1.0)
    return order, place, part


@compiled
def wall_flux(place: Array, first: float, second: float, table: Array) -> float:
    """Flux m4 of laplacian(w) = -1 between the wall and discs of radius `first` and `second` m.

    `place` (3,) m are the heights of their centres above the wall and their distance along it.
    """
    along, above = _meeting(place, first, second)
    apart, total = np.hypot(place[2], place[0] - place[1]), 0.0
    for i in range(2):
        height, other, x = place[0], place[1], along
        disc, next_disc = first, second
        if i == 1:
            height, other, x = place[1], place[0], place[2] - along
            disc, next_disc = second, first
        edge = np.arctan2(place[2], height - other)
        split = min(max(np.arctan2(x, height - above), 0.0), edge)
        gap = apart - next_disc + disc
        across = (height, place[2], apart, (height - other) / apart)
        total += shear_ratio(split, 2.0 * disc / (height + disc), table) * _share(
            across, disc, next_disc, 0.0, split
        )
        ratio = shear_ratio(edge - split, min(2.0 * disc / max(gap, disc), 1.0), table)
        total += ratio * _share(across, disc, next_disc, split, edge)
    turn = min(max(along, 0.0), place[2])
    return (
        total
        + _film(place, first, second, 0.0, turn)
        + _film(place, first, second, turn, place[2])
    )


@compiled
def _meeting(place: Array, first: float, second: float) -> tuple[float, float]:
    """Where the two parabolas meet: m along the wall from the first foot, and m above the wall.

    That is the centre of the circle that touches both discs and the wall. Where the parabolas do
    not meet, it is the place midway along the wall.
    """
    one, two = place[0] + first, place[1] + second
    near, far = place[0] ** 2 - first**2, place[1] ** 2 - second**2
    middle = one * place[2]
    rest = two * near - one * (place[2] ** 2 + far)
    along = 0.5 * place[2]
    if middle**2 >= (two - one) * rest:
        along = -rest / (middle + np.sqrt(middle**2 - (two - one) * rest))
    return along, 0.5 * (along**2 + near) / one


@compiled
def _share(
    across: tuple[float, float, float, float], disc: float, other: float, low: float, high: float
) -> float:
    """Flux m4 on the rays of a disc at angles `low` to `high` rad from the normal of the wall.

    A ray ends at the nearest line midway, or at the far side of the trapezoid. `disc` and `other`
    m are the radii; `across` m is the height of the disc, its distance from the other along the
    wall and in all, and how much higher it is over the latter.
    """
    flux = 0.0
    if not high > low:
        return flux
    height, far, apart, upright = across
    along = far / apart
    wider = other - disc
    half_gap = 0.5 * (apart * apart - wider * wider)
    # numba knows no strict zip
    for point, weight in zip(POINTS, WEIGHTS):  # noqa: B905
        turn = low + 0.5 * (high - low) * (1.0 + point)
        cosine, sine = np.cos(turn), np.sin(turn)
        reach = min((height + disc) / (1.0 + cosine), far / max(sine, TOLERANCE))
        # the line midway to the other disc, at the angle between the ray and the two centres
        below = apart * (upright * cosine + along * sine) + wider
        if below > 0.0:
            reach = min(reach, max(half_gap / below, 0.0))
        flux += weight * 0.5 * (high - low) * flux_on_ray(reach, disc)
    return flux


@compiled
def _film(place: Array, first: float, second: float, low: float, high: float) -> float:
    """Share of the wall, m4, between the distances `low` and `high` m from the first foot."""
    flux = 0.0
    # numba knows no strict zip
    for point, weight in zip(FINE_POINTS, FINE_WEIGHTS):  # noqa: B905
        x = low + 0.5 * (high - low) * (1.0 + point)
        one = (x**2 + place[0] ** 2 - first**2) / (2.0 * (place[0] + first))
        two = ((place[2] - x) ** 2 + place[1] ** 2 - second**2) / (2.0 * (place[1] + second))
        edge = place[0] + (place[1] - place[0]) * x / place[2]
        flux += weight * 0.5 * (high - low) * max(min(one, two, edge), 0.0) ** 3 / 3.0
    return flux
