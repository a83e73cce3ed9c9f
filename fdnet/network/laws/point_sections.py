"""The flow through a triangle among discs, summed over points.

A point belongs to the nearest rim, at the distance s from it. On the ray from the centre of that
disc, of radius rho, through the point the speed is largest midway to the next rim, at the distance
d from the centre, whichever disc that is and wherever it stands. The speed is the geometric mean
of those in an annulus without shear at d (Happel 1959, AIChE J. 5, 174) and between two plates,

    w0 = d^2 / 2 ln(r / rho) - (r^2 - rho^2) / 4,  w1 = s (2 (d - rho) - s) / 2,  r = rho + s.

Against finite elements the first is too large, most of all where a small disc stands among large
ones, and the second too small, most of all around small discs (docs/physics_network.md, section
8).
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.network.laws.elementary import log_of
from fdnet.spheres.snapshot import Array


def parts_of_triangle(divisions: int) -> Array:
    """Weights (2, n) of the second and third corner at the centroids of equal parts of a triangle.

    They are the same seen from each of its corners.
    """
    rows = range(divisions)
    up = [((i + 1 / 3), (j + 1 / 3)) for i in rows for j in range(divisions - i)]
    down = [((i + 2 / 3), (j + 2 / 3)) for i in rows for j in range(divisions - i - 1)]
    return np.ascontiguousarray(np.transpose(up + down)) / divisions


@loops_in_place
def points_flux(
    base: Array,
    solid: tuple[Array, int],
    walls: tuple[Array, int],
    points: Array,
    lanes: Array,
) -> float:
    """Flux m4 of laplacian(w) = -1 through a triangle among the first discs of `solid`.

    Where a ray meets no line midway to another disc, the longest side is taken as the way to it.
    A wall that cuts the triangle is the mirror of what lies beyond it.

    Args:
        base: (3, 2) m, its corners.
        solid: (n, 4) m, centres, radii, and how far the rims at least are from the triangle; and
            how many of them count.
        walls: (n, 3) unit normal into the box and distance m from the origin, of the lines in
            which walls cut the section; and how many of them count.
        points: (2, p) of `parts_of_triangle`.
        lanes: (7, p) room.
    """
    discs, many = solid
    ex, ey = base[1, 0] - base[0, 0], base[1, 1] - base[0, 1]
    fx, fy = base[2, 0] - base[0, 0], base[2, 1] - base[0, 1]
    gx, gy = ex - fx, ey - fy
    longest = np.sqrt(max(ex * ex + ey * ey, fx * fx + fy * fy, gx * gx + gy * gy))
    x, y, least = lanes[0], lanes[1], lanes[2]
    number = len(x)
    for p in range(number):
        x[p] = base[0, 0] + points[0, p] * ex + points[1, p] * fx
        y[p] = base[0, 1] + points[0, p] * ey + points[1, p] * fy
        least[p] = np.inf
    for w in range(walls[1]):
        nx, ny, gap = walls[0][w, 0], walls[0][w, 1], walls[0][w, 2]
        for p in range(number):
            beyond = 2.0 * min(gap + nx * x[p] + ny * y[p], 0.0)
            x[p] -= beyond * nx
            y[p] -= beyond * ny
    _set_nearest_rims(discs, many, lanes)
    _set_midways(discs, many, longest, lanes)
    rho, way = lanes[5], lanes[6]
    total = 0.0
    for p in range(number):
        s = max(least[p], 0.0)
        r = rho[p] + s
        d = max(rho[p] + way[p], r)
        annulus = 0.5 * d * d * log_of(r / rho[p]) - 0.25 * (r * r - rho[p] * rho[p])
        plates = 0.5 * s * (2.0 * (d - rho[p]) - s)
        total += np.sqrt(max(annulus * plates, 0.0))
    return total * 0.5 * abs(ex * fy - ey * fx) / number


@loops_in_place
def _set_nearest_rims(discs: Array, many: int, lanes: Array) -> None:
    """Sets the distance of the nearest rim, and centre and radius of its disc, for each point."""
    x, y, least, nearest = lanes[0], lanes[1], lanes[2], lanes[6]
    farthest = np.inf
    for q in range(many):
        if discs[q, 3] >= farthest:
            continue
        qx, qy, radius, number = discs[q, 0], discs[q, 1], discs[q, 2], float(q)
        for p in range(len(x)):
            dx, dy = qx - x[p], qy - y[p]
            away = np.sqrt(dx * dx + dy * dy) - radius
            nearest[p] = number if away < least[p] else nearest[p]
            least[p] = min(away, least[p])
        farthest = 0.0
        for p in range(len(x)):
            farthest = max(farthest, least[p])
    for p in range(len(x)):
        q = int(nearest[p])
        lanes[3, p], lanes[4, p], lanes[5, p] = discs[q, 0], discs[q, 1], discs[q, 2]


@loops_in_place
def _set_midways(discs: Array, many: int, longest: float, lanes: Array) -> None:
    """Sets the way from the rim of a point's disc to the line midway to the next rim, d - rho.

    It is measured on the ray through the point. The directions of the rays take the place of the
    points. A disc whose rim is farther than twice this way from a point cannot end its ray.
    """
    ux, uy, least = lanes[0], lanes[1], lanes[2]
    own_x, own_y, rho, way = lanes[3], lanes[4], lanes[5], lanes[6]
    for p in range(len(ux)):
        r = rho[p] + least[p]
        ux[p] = (ux[p] - own_x[p]) / r
        uy[p] = (uy[p] - own_y[p]) / r
        way[p] = longest
    most = longest
    for q in range(many):
        if discs[q, 3] >= 2.0 * most:
            continue
        x, y, radius = discs[q, 0], discs[q, 1], discs[q, 2]
        for p in range(len(ux)):
            qx, qy, wider = x - own_x[p], y - own_y[p], radius - rho[p]
            below = qx * ux[p] + qy * uy[p] + wider
            half = 0.5 * (qx * qx + qy * qy - wider * wider)
            one = half / below - rho[p]
            way[p] = min(way[p], one if half > 0.0 and below > 0.0 else np.inf)
        most = 0.0
        for p in range(len(ux)):
            most = max(most, way[p])
