"""Flow along the axis through one plane section of a throat.

The section is a triangle with a disc of each grain on its corners. Every disc slows the fluid
between its rim and the line midway to the next rim; these shares are cut into wedges (`wedge`).

Equal discs in a triangle that holds its circumcentre: six right-angled wedges about it, in closed
form.

Unequal discs: the line midway between two rims is a hyperbola. From the centre of a disc it lies
at the distance d(t) = (a^2 - e^2) / (2 (a cos t + e)) on the ray at the angle t from the line
between the centres, with the difference e of the radii and the distance a of the centres. The
shares meet in the centre of the circle that touches all three discs. The flux on rays is summed by
Gauss points, and the shear between rays is that of the wedge of the same angle and half gap.

Where that circle lies beyond an edge, as in every obtuse triangle with equal discs, the shares
there are negative, and they take away too much: all of the flux between touching discs at an angle
of 98 degrees. Where no circle touches all three discs (one disc lies in the shadow of the others),
there is no such sum. In both cases each disc keeps what its rays see of the triangle before a line
midway or the opposite side, if that is more. So that the flux does not jump, the rays take over
while the centre moves beyond the edge by `TURN`, as seen from the centre of a disc.
"""

import numpy as np

from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.laws.corner_rays import (
    CornerRoom,
    aim_corners,
    corner_flux,
    corner_reaches,
)
from fdnet.network.laws.elementary import QUARTER, angle_of, log_of, sine_of
from fdnet.network.laws.rays import POINTS, WEIGHTS, flux_on_ray
from fdnet.network.laws.wedge import (
    DISCS,
    ray_flux,
    ray_parts,
    shear_ratio,
    table_row,
)
from fdnet.spheres.snapshot import Array

TURN = 0.05
"""Angle, rad, seen from the centre of a disc: where the centre of the circle lies so far beyond an
edge, the rays have taken over. Finite elements agree with them there (test_section_flux.py)."""


@loops_in_place
def set_wedges(base: Array, rows: Array) -> None:
    """Sets the six wedges of a triangle `base` (3, 2) m with equal discs, for `even_fluxes`.

    There are two of each of the `rows` (3, 7): half edge m, tangent and angle rad, both negative
    where the circumcentre lies beyond that edge; what of `ray_flux` depends on these alone, and
    the row of the table of `shear_ratio`.
    """
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


@compiled
def even_room(sections: int) -> tuple[Array, Array]:
    """Room for so many sections in `even_fluxes`, and for a row of the table of `shear_ratio`."""
    return np.empty((2, sections)), np.empty(len(DISCS))


@loops_in_place
def even_fluxes(
    wedge: Array, discs: Array, room: tuple[tuple[Array, Array], Array], flux: Array
) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 for the radii `discs` (K,) m of K sections.

    `wedge` is what `set_wedges` sets. In an obtuse triangle the sum of the signed wedges is too
    small, and `uneven_fluxes` does it.

    `room` is what `even_room` gives, and the table of `shear_ratio`.
    """
    (lanes, ratio), table = room
    log_disc, rays = lanes[0], lanes[1]
    for k in range(len(discs)):
        log_disc[k] = log_of(discs[k])
        flux[k] = 0.0
    for i in range(3):
        half, slope, angle = wedge[i, 0], abs(wedge[i, 1]), abs(wedge[i, 2])
        constant, of_log, log_half = wedge[i, 3], wedge[i, 4], wedge[i, 5]
        factor = 2.0 * half**4 if wedge[i, 1] > 0.0 else -2.0 * half**4
        row = min(int(wedge[i, 6]), len(table) - 2)
        part = wedge[i, 6] - row
        low, high = table[row], table[row + 1]
        for j in range(len(ratio)):
            ratio[j] = (1.0 - part) * low[j] + part * high[j]
        for k in range(len(discs)):
            x = discs[k] / half
            square = x * x
            whole = constant - of_log * (log_disc[k] - log_half)
            rays[k] = factor * (whole + square * (4.0 * slope - square * angle) / 16.0)
        for k in range(len(discs)):
            x = discs[k] / half
            if x > 1.0:
                rays[k] = factor * ray_flux(angle, slope, x)
            column = min(x, 1.0) * (len(ratio) - 1)
            j = min(int(column), len(ratio) - 2)
            flux[k] += rays[k] * (ratio[j] + (column - j) * (ratio[j + 1] - ratio[j]))


@compiled
def uneven_room(sections: int) -> tuple[Array, Array]:
    """Room for the wedges of so many sections, and for the edges, in `uneven_fluxes`."""
    return np.empty((7, 6 * sections)), np.empty((6, 4))


@loops_in_place
def uneven_fluxes(
    base: Array,
    discs: Array,
    room: tuple[tuple[Array, Array], CornerRoom, Array],
    flux: Array,
) -> None:
    """Writes the flux (K,) m4 of laplacian(w) = -1 for the radii `discs` (K, 3) m of K sections.

    The first corner of the triangle `base` (3, 2) m is the origin, the second lies on the x axis.
    The flux is 0 where the discs close the triangle.

    `room` is what `uneven_room` and `corner_room` give for this triangle, and the table of
    `shear_ratio`.
    """
    lanes, corners, table = room
    wedge = lanes[0]
    touching_fluxes(base, discs, (lanes, table), flux)
    for k in range(len(discs)):
        beyond = 0.0 if flux[k] > 0.0 else TURN
        for m in range(6 * k, 6 * k + 6):
            beyond = max(beyond, -wedge[4, m])
        if beyond > 0.0:
            aim_corners(base, corners)
            corner_reaches(corners, discs[k])
            more = corner_flux(corners, discs[k], table) - flux[k]
            flux[k] += min(beyond / TURN, 1.0) * max(more, 0.0)


@loops_in_place
def touching_fluxes(
    base: Array, discs: Array, room: tuple[tuple[Array, Array], Array], flux: Array
) -> None:
    """Writes the flux (K,) m4 where a circle touches all three discs, else 0.

    Shares are negative where the circle lies beyond an edge of the triangle.
    """
    (wedge, edges), table = room
    count = 6 * len(discs)
    _set_edges(base, edges)
    for k in range(len(discs)):
        flux[k] = 1.0 if _set_wedges(edges, base, discs[k], wedge[:, 6 * k : 6 * k + 6]) else 0.0
    _sum_wedges(wedge, count)
    total = wedge[6]
    for k in range(len(discs)):
        if flux[k] > 0.0:
            flux[k] = 0.0
            for m in range(6 * k, 6 * k + 6):
                disc_of_gap = wedge[5, m] / (0.5 * (wedge[2, m] - wedge[0, m]))
                flux[k] += total[m] * shear_ratio(abs(wedge[4, m]), disc_of_gap, table)


@loops_in_place
def _set_edges(base: Array, edges: Array) -> None:
    """Sets `edges` (6, 4), from each corner to the two others: unit vector, length m, sense.

    The sense is 1 where the third corner lies to the left, else -1.
    """
    for i in range(3):
        for step in (1, 2):
            j, k = (i + step) % 3, (i + 3 - step) % 3
            ex, ey = base[j, 0] - base[i, 0], base[j, 1] - base[i, 1]
            a = np.sqrt(ex * ex + ey * ey)
            turned = ex * (base[k, 1] - base[i, 1]) - ey * (base[k, 0] - base[i, 0])
            edges[2 * i + step - 1] = ex / a, ey / a, a, 1.0 if turned > 0.0 else -1.0


@loops_in_place
def _set_wedges(edges: Array, base: Array, disc: Array, wedge: Array) -> bool:
    """Writes the six wedges (7, 6) of a section; whether a circle touches its three discs.

    The rows are the excess of the radius of the other disc, half the gap squared, the distance of
    the centres, the place of the circle along their line and across it, and the own radius.
    """
    cx, cy, radius = _inscribed(base, disc)
    touches = not np.isnan(radius)
    if not touches:
        cx, cy = 0.0, 0.0
    for i in range(3):
        vx, vy = cx - base[i, 0], cy - base[i, 1]
        away = np.sqrt(vx * vx + vy * vy)
        for m in (2 * i, 2 * i + 1):
            a, wider = edges[m, 2], disc[(i + 1 + m - 2 * i) % 3] - disc[i]
            along = edges[m, 0] * vx + edges[m, 1] * vy
            wedge[0, m], wedge[1, m], wedge[2, m] = wider, 0.5 * (a * a - wider * wider), a
            wedge[3, m] = along
            wedge[4, m] = edges[m, 3] * (edges[m, 0] * vy - edges[m, 1] * vx)
            wedge[5, m] = disc[i]
            touches = touches and a > wider and a * along + wider * away > 0.0
    return touches


@loops_in_place
def _sum_wedges(wedge: Array, count: int) -> None:
    """Turns the places of the circles into angles rad, and sums the flux m4 on rays up to them."""
    wider, gap, apart, along = wedge[0], wedge[1], wedge[2], wedge[3]
    turn, own, total = wedge[4], wedge[5], wedge[6]
    for m in range(count):
        turn[m] = angle_of(turn[m], along[m])
        total[m] = 0.0
    for p in range(len(POINTS)):
        part, weight = 0.5 * (1.0 + POINTS[p]), 0.5 * WEIGHTS[p]
        for m in range(count):
            cosine = -sine_of(part * abs(turn[m]) - QUARTER)
            reach = gap[m] / (apart[m] * cosine + wider[m])
            total[m] += weight * turn[m] * flux_on_ray(reach, own[m])


@loops_in_place
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
