"""Flow along the axis through one plane section of a throat.

The section is a triangle with a disc of each grain on its corners. Every disc slows the fluid
between its rim and the line midway to the next rim; these shares are cut into wedges (`wedge`).

Equal discs: six right-angled wedges about the circumcentre, in closed form.

Unequal discs: the line midway between two rims is a hyperbola. From the centre of a disc it lies
at the distance d(t) = (a^2 - e^2) / (2 (a cos t + e)) on the ray at the angle t from the line
between the centres, with the difference e of the radii and the distance a of the centres. The
shares meet in the centre of the inscribed circle. The flux on rays is summed by Gauss points, and
the shear between rays is that of the wedge of the same angle and half gap. Where no circle touches
all three discs (one disc lies in the shadow of the others), each disc keeps what its rays see of
the triangle before a line midway or the opposite side.
"""

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.laws.wedge import (
    ratio_in_row,
    ray_flux,
    ray_parts,
    shear_ratio,
    table_row,
)
from fdnet.spheres.snapshot import Array

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(6)
FINE_POINTS, FINE_WEIGHTS = np.polynomial.legendre.leggauss(12)


@compiled
def wedges(base: Array) -> Array:
    """The six wedges of a triangle `base` (3, 2) m with equal discs, for `even_flux`.

    There are two of each row of the result (3, 7): half edge m, tangent and angle rad, both
    negative where the circumcentre lies beyond that edge; what of `ray_flux` depends on these
    alone, and the row of the table of `shear_ratio`.
    """
    rows = np.empty((3, 7))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        fx, fy = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        gx, gy = base[k, 0] - base[j, 0], base[k, 1] - base[j, 1]
        # the angle at the far corner is that at the centre over half the edge
        slope = (fx * gx + fy * gy) / abs(ex * fy - ey * fx)
        half, angle = 0.5 * np.hypot(ex, ey), np.arctan(slope)
        constant, of_log = ray_parts(abs(angle), abs(slope))
        rows[i] = half, slope, angle, constant, of_log, np.log(half), table_row(abs(angle))
    return rows


@compiled
def even_flux(wedge: Array, disc: float, table: Array) -> float:
    """Flux m4 of laplacian(w) = -1 through the section of `wedges` with discs of radius `disc` m.

    It is not positive where the sum of the signed wedges fails.
    """
    total, log_disc = 0.0, np.log(disc)
    for i in range(3):
        half, slope, angle = wedge[i, 0], abs(wedge[i, 1]), abs(wedge[i, 2])
        x = disc / half
        if x <= 1.0:
            rays = wedge[i, 3] - wedge[i, 4] * (log_disc - wedge[i, 5])
            rays += x * x * (4.0 * slope - x * x * angle) / 16.0
        else:
            rays = ray_flux(angle, slope, x)
        flux = half**4 * rays * ratio_in_row(wedge[i, 6], x, table)
        total += 2.0 * flux if wedge[i, 1] > 0.0 else -2.0 * flux
    return total


@compiled
def uneven_flux(base: Array, disc: Array, table: Array) -> float:
    """Flux m4 of laplacian(w) = -1 through a triangle `base` (3, 2) m with unequal discs.

    The first corner is the origin, the second lies on the x axis; `disc` (3,) m are the radii. The
    flux is 0 where the discs close the triangle.
    """
    flux = _uneven(base, disc, table)
    if not flux > 0.0:
        flux = _shadowed(base, disc, table)
    return flux


@compiled
def _inscribed(base: Array, disc: Array) -> tuple[float, float, float]:
    """Centre and radius m of the circle that touches three discs; NaN where there is none."""
    a, px, py = base[1, 0], base[2, 0], base[2, 1]
    r0, r1, r2 = disc[0], disc[1], disc[2]
    ax = 0.5 * (a * a + r0 * r0 - r1 * r1) / a
    bx = -(r1 - r0) / a
    ay = (0.5 * (px * px + py * py + r0 * r0 - r2 * r2) - px * ax) / py
    by = (-(r2 - r0) - px * bx) / py
    square = bx * bx + by * by - 1.0
    half = r0 - ax * bx - ay * by
    rest = ax * ax + ay * ay - r0 * r0
    under = half * half - square * rest
    if under < 0.0:
        return 0.0, 0.0, np.nan
    below = half + np.sqrt(under)
    if below == 0.0:
        return 0.0, 0.0, np.nan
    radius = rest / below
    if radius <= -min(r0, r1, r2):
        return 0.0, 0.0, np.nan
    return ax + bx * radius, ay + by * radius, radius


@compiled
def ray(reach: float, disc: float) -> float:
    """Flux m4 per angle on a ray from the rim of a disc to the distance `reach` m from its centre.

    Shear between neighbouring rays is neglected; `disc` m is the radius of the disc.
    """
    if reach <= disc:
        return 0.0
    d2, r2 = reach * reach, disc * disc
    return (4.0 * d2 * d2 * np.log(reach / disc) - 3.0 * d2 * d2 + 4.0 * d2 * r2 - r2 * r2) / 16.0


@compiled
def midway(apart: float, wider: float, turn: float) -> float:
    """Distance m from the centre of a disc to the line midway between its rim and that of another.

    The ray has the angle `turn` rad from the line between the centres, which are `apart` m; the
    radius of the other disc is larger by `wider` m. Infinite where the ray never meets the line.
    """
    below = apart * np.cos(turn) + wider
    return max(0.5 * (apart * apart - wider * wider) / below, 0.0) if below > 0.0 else np.inf


@compiled
def _uneven(base: Array, disc: Array, table: Array) -> float:
    """The flux where a circle touches all three discs, else 0."""
    cx, cy, radius = _inscribed(base, disc)
    if np.isnan(radius):
        return 0.0
    total = 0.0
    for i in range(3):
        for step in (1, 2):
            j, k = (i + step) % 3, (i + 3 - step) % 3
            ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
            vx, vy = cx - base[i, 0], cy - base[i, 1]
            a = np.hypot(ex, ey)
            side = (
                1.0
                if ex * (base[k, 1] - base[i, 1]) - ey * (base[k, 0] - base[i, 0]) > 0.0
                else -1.0
            )
            angle = np.arctan2(side * (ex * vy - ey * vx) / a, (ex * vx + ey * vy) / a)
            apart = disc[j] - disc[i]
            half = 0.5 * (a - apart)
            if half <= 0.0 or a * np.cos(angle) + apart <= 0.0:
                return 0.0
            flux = 0.0
            # numba knows no strict zip
            for point, weight in zip(POINTS, WEIGHTS):  # noqa: B905
                turn = 0.5 * angle * (1.0 + point)
                flux += weight * 0.5 * angle * ray(midway(a, apart, turn), disc[i])
            total += flux * shear_ratio(abs(angle), disc[i] / half, table)
    return total


@compiled
def _shadowed(base: Array, disc: Array, table: Array) -> float:
    """The flux where one disc lies in the shadow of the others."""
    total = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        jx, jy = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
        kx, ky = base[k, 0] - base[i, 0], base[k, 1] - base[i, 1]
        aj, ak = np.hypot(jx, jy), np.hypot(kx, ky)
        twice = abs(jx * ky - jy * kx)
        opening = np.arctan2(twice, jx * kx + jy * ky)
        across = np.hypot(kx - jx, ky - jy)
        height = twice / across
        foot = np.arctan2(-(jx * (kx - jx) + jy * (ky - jy)) / across, height)
        flux, nearest = 0.0, np.inf
        # numba knows no strict zip
        for point, weight in zip(FINE_POINTS, FINE_WEIGHTS):  # noqa: B905
            turn = 0.5 * opening * (1.0 + point)
            reach = height / max(np.cos(turn - foot), 1e-3)
            reach = min(
                reach,
                midway(aj, disc[j] - disc[i], turn),
                midway(ak, disc[k] - disc[i], opening - turn),
            )
            flux += weight * 0.5 * opening * ray(reach, disc[i])
            nearest = min(nearest, reach)
        if flux > 0.0:
            total += flux * shear_ratio(0.5 * opening, disc[i] / nearest, table)
    return total
