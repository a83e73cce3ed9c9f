"""Flow along the axis through the section of a throat that a side wall cuts, where the wall holds the fluid.

The throat's facet holds a grain i, its mirror image across the wall, and a grain j or its image: the plane is normal to
the wall, and inside the box every section parallel to it is the trapezoid between the centres of two discs and their
feet on the wall. Discs and wall share the fluid as in `section`: the line midway between the rims of i and j is a
hyperbola, the one midway between the rim of i (radius rho, H above the wall) and the wall a parabola: on the ray at
angle t from the wall's normal at the distance (H + rho) / (1 + cos t), and (x^2 + H^2 - rho^2) / (2 (H + rho)) above
the wall at the distance x from the foot of i. They meet in the centre of the circle that touches discs and wall. The
wall's own share is a plane film, flux y^3 / 3 per length. Where that centre lies outside the trapezoid, every ray still
ends at the nearest of these lines or of the trapezoid's sides, so no share is negative and none is missing.
"""

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.laws.cross_section import (
    FINE_POINTS,
    FINE_WEIGHTS,
    POINTS,
    WEIGHTS,
    midway,
    ray,
)
from fdnet.network.laws.wedge import shear_ratio
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

NARROWED = 0.25
HAIR = 1e-9


def wall_cuts(network: Network) -> tuple[Array, Array, Array]:
    """How walls that hold the fluid cut each throat: `order` (T, 2) which corners are i and j, -1 where no wall or not
    one alone does; `place` (T, 3) m, heights of i and j above the wall and their distance along it; `part` (T,) by
    which the half-section (order >= 0) or the slipping section counts as the flux of the whole throat.

    A trapezoid is two triangles, each with share 1/2, so each carries the half-section; a triangle with j on the wall
    is alone and carries two. What two walls cut carries a quarter of the slipping flux: so does a narrow gap.
    """
    count = len(network.throat_share)
    order, place, part = np.full((count, 2), -1), np.zeros((count, 3)), np.ones(count)
    cut = np.flatnonzero(network.throat_share < 1.0)
    if network.walls == "slip" or not len(cut):
        return order, place, part
    part[cut] = NARROWED
    single = cut[network.throat_share[cut] == 0.5]
    corner, hair = network.throat_corner[single], HAIR * network.grain_radius
    own = network.throat_grains[single]
    sides = [axis for axis in (1, 2) if not network.periodic[axis]]
    for i, image, j in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        apart = corner[:, image] - corner[:, i]
        for axis in sides:
            rest = np.delete(apart, axis, axis=1)
            pair = (
                (own[:, i] == own[:, image])
                & np.all(np.abs(rest) <= hair, axis=1)
                & (np.abs(apart[:, axis]) > hair)
            )
            t = single[pair]
            across = corner[pair, j] - 0.5 * (corner[pair, i] + corner[pair, image])
            height = np.abs(across[:, axis])
            order[t] = i, j
            place[t, 0], place[t, 1] = 0.5 * np.abs(apart[pair, axis]), height
            place[t, 2] = np.linalg.norm(np.delete(across, axis, axis=1), axis=1)
            part[t] = np.where(height <= hair, 2.0, 1.0)
    return order, place, part


@compiled
def wall_flux(place: Array, first: float, second: float, table: Array) -> float:
    """Flux (m4) of laplacian(w) = -1 between the wall and discs of radius `first` and `second`; `place` (3,) m their
    heights above the wall and distance along it."""
    along, above = _meeting(place, first, second)
    total = 0.0
    for i in range(2):
        height, other, x = place[0], place[1], along
        disc, next_disc = first, second
        if i == 1:
            height, other, x = place[1], place[0], place[2] - along
            disc, next_disc = second, first
        edge = np.arctan2(place[2], height - other)
        split = min(max(np.arctan2(x, height - above), 0.0), edge)
        gap = np.hypot(place[2], height - other) - next_disc + disc
        across = (height, other, place[2])
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
    """Where the two parabolas meet, along the wall from the foot of the first disc and above it: the centre of the
    circle that touches both discs and the wall. Midway along the wall where they do not."""
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
    across: tuple[float, float, float], disc: float, other: float, low: float, high: float
) -> float:
    """What a disc's rays at angles `low` to `high` from the wall's normal see before the nearest line midway or the
    trapezoid's far side; `across` its height, the other's and their distance along the wall."""
    apart = np.hypot(across[2], across[0] - across[1])
    edge = np.arctan2(across[2], across[0] - across[1])
    flux = 0.0
    for point, weight in zip(POINTS, WEIGHTS):  # noqa: B905 - numba knows no strict zip
        turn = low + 0.5 * (high - low) * (1.0 + point)
        reach = min((across[0] + disc) / (1.0 + np.cos(turn)), across[2] / max(np.sin(turn), HAIR))
        reach = min(reach, midway(apart, other - disc, edge - turn))
        flux += weight * 0.5 * (high - low) * ray(reach, disc)
    return flux


@compiled
def _film(place: Array, first: float, second: float, low: float, high: float) -> float:
    """The wall's share between two distances from the foot of the first disc."""
    flux = 0.0
    for point, weight in zip(FINE_POINTS, FINE_WEIGHTS):  # noqa: B905 - numba knows no strict zip
        x = low + 0.5 * (high - low) * (1.0 + point)
        one = (x**2 + place[0] ** 2 - first**2) / (2.0 * (place[0] + first))
        two = ((place[2] - x) ** 2 + place[1] ** 2 - second**2) / (2.0 * (place[1] + second))
        edge = place[0] + (place[1] - place[0]) * x / place[2]
        flux += weight * 0.5 * (high - low) * max(min(one, two, edge), 0.0) ** 3 / 3.0
    return flux
