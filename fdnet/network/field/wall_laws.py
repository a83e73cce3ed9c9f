"""The velocity at a point between the nodes of a staggered grid, by the laws that hold at a wall.

Fluid that cannot slip and keeps its volume approaches a wall like the square of the distance d.
Nearer than PROBE to a sphere, velocity / phi is therefore taken at the distance PROBE on the same
normal; between two spheres nearer than that the probe stays on this side of the middle. The part
of the velocity across the wall is replaced by what keeps the volume of the part along it,

    - (divergence along the sphere) (integral of phi from 0 to d) / phi(d),

which is d (R - d / 3) / (2 R - d) times the divergence for the profile phi = d (2 R - d) / R^2 of
one wall. The divergence is that of the velocity along the sphere at the distance d, by central
differences. Any share of the velocity across as sampled would make sources and sinks here, which
gather what the fluid carries at the walls.
"""

from math import cos, floor, sin, sqrt

from fdnet.network.compiled import compiled
from fdnet.network.field.nearby import REACH, Place, wall_profile
from fdnet.spheres.snapshot import Array

PROBE = 0.8
"""Distance from a sphere, in spacings, within which the flow follows the laws at a wall."""
STEP = 0.5
"""Length, in spacings, over which the velocity along a sphere is differentiated."""

Near = tuple[float, float, float, int]
Frame = tuple[Array, Array, Array]
Walls = tuple[Array, Array, Array]
Parts = tuple[Array, Array, Array]


@compiled
def linear(part: Array, x: float, y: float, z: float) -> float:
    """Linear interpolation at (x, y, z), in nodes of the padded grid."""
    i, j, k = int(x), int(y), int(z)
    a, b, c = x - i, y - j, z - k
    low = (1.0 - b) * ((1.0 - c) * part[i, j, k] + c * part[i, j, k + 1]) + b * (
        (1.0 - c) * part[i, j + 1, k] + c * part[i, j + 1, k + 1]
    )
    i += 1
    high = (1.0 - b) * ((1.0 - c) * part[i, j, k] + c * part[i, j, k + 1]) + b * (
        (1.0 - c) * part[i, j + 1, k] + c * part[i, j + 1, k + 1]
    )
    return float((1.0 - a) * low + a * high)


@compiled
def _off_the_wall(point: Place, near: Near, place: Array) -> tuple[Place, Place, float]:
    """Where to sample, the normal of the nearest sphere, and d / probe (1 away from spheres)."""
    x, y, z = point
    _, least, second, row = near
    probe = min(PROBE, 0.5 * (least + second))
    if row < 0 or least >= probe:
        return point, (0.0, 0.0, 0.0), 1.0
    p, q, r = x - place[row, 0], y - place[row, 1], z - place[row, 2]
    length = sqrt(p * p + q * q + r * r)
    p, q, r = p / length, q / length, r / length
    more = probe - least
    return (x + more * p, y + more * q, z + more * r), (p, q, r), least / probe


@compiled
def _place_on(point: Place, grid: Frame) -> tuple[Place, int]:
    """The point within the grid, and its cell; -1 - axis for a point outside along an axis."""
    shape, step, wraps = grid
    number, out = 0, 0
    x, y, z = point
    for axis in range(3):
        length = shape[axis] * step[axis]
        at = x if axis == 0 else (y if axis == 1 else z)
        if wraps[axis]:
            at -= floor(at / length) * length
        elif at < 0.0 or at >= length:
            out = -1 - axis
        if axis == 0:
            x = at
        elif axis == 1:
            y = at
        else:
            z = at
        number = number * shape[axis] + max(0, min(int(at / step[axis]), shape[axis] - 1))
    return (x, y, z), out if out < 0 else number


@compiled
def _unbalanced(
    point: Place, cell: int, grid: Frame, nearby: Walls, smooth: Parts
) -> tuple[Place, Place, float, Near]:
    """Velocity with its part across a near wall as sampled; normal, d / probe and walls near."""
    step = grid[1]
    first, place, sides = nearby
    near = wall_profile(point, (first[cell], first[cell + 1]), place, sides)
    if near[0] <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, near
    there, normal, share = _off_the_wall(point, near, place)
    x, y, z = there[0] / step[0], there[1] / step[1], there[2] / step[2]
    u = near[0] * linear(smooth[0], x + 2.0, y + 1.5, z + 1.5)
    v = near[0] * linear(smooth[1], x + 1.5, y + 2.0, z + 1.5)
    w = near[0] * linear(smooth[2], x + 1.5, y + 1.5, z + 2.0)
    return (u, v, w), normal, share, near


@compiled
def _spreading(
    point: Place, around: tuple[Place, float, float], grid: Frame, nearby: Walls, smooth: Parts
) -> float:
    """Divergence along a sphere of the velocity along it, at one distance from it.

    `around` are the normal, the radius from the centre, and the length of the steps.
    """
    normal, radius, step = around
    p, q, r = normal
    # two tangents: the normal crossed with the axis that it is farthest from, and with that
    if abs(p) <= abs(q) and abs(p) <= abs(r):
        a, b, c = 0.0, r, -q
    elif abs(q) <= abs(r):
        a, b, c = -r, 0.0, p
    else:
        a, b, c = q, -p, 0.0
    length = sqrt(a * a + b * b + c * c)
    a, b, c = a / length, b / length, c / length
    turn = step / radius
    cosine, sine = cos(turn), sin(turn)
    total = 0.0
    for tangent in range(2):
        if tangent == 1:
            a, b, c = q * c - r * b, r * a - p * c, p * b - q * a
        for sign in (-1.0, 1.0):
            along, up = radius * sine * sign, radius * (cosine - 1.0)
            beside = (
                point[0] + along * a + up * p,
                point[1] + along * b + up * q,
                point[2] + along * c + up * r,
            )
            inside, cell = _place_on(beside, grid)
            if cell < 0:
                continue
            flow = _unbalanced(inside, cell, grid, nearby, smooth)[0]
            # the tangent, carried along the great circle
            across = -sine * sign
            total += sign * (
                flow[0] * (cosine * a + across * p)
                + flow[1] * (cosine * b + across * q)
                + flow[2] * (cosine * c + across * r)
            )
    return total / (2.0 * step)


@compiled
def sample_points(point: Array, grid: Frame, nearby: Walls, smooth: Parts, result: Array) -> None:
    """Writes the velocity at each `point` (N, 3), in spacings, to `result`."""
    place = nearby[1]
    for s in range(len(point)):
        inside, cell = _place_on((point[s, 0], point[s, 1], point[s, 2]), grid)
        if cell < 0:
            result[s, 0] = 1.0 if cell == -1 else 0.0
            continue
        (u, v, w), normal, share, near = _unbalanced(inside, cell, grid, nearby, smooth)
        if share < 1.0:
            p, q, r = normal
            sampled = u * p + v * q + w * r
            radius = near[1] + place[near[3], 3]
            spread = _spreading(inside, (normal, radius, STEP), grid, nearby, smooth)
            depth = near[1] * (REACH - near[1] / 3.0) / (2.0 * REACH - near[1])
            across = -depth * spread - sampled
            u, v, w = u + across * p, v + across * q, w + across * r
        result[s, 0], result[s, 1], result[s, 2] = u, v, w
