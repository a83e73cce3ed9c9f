"""The porosity of the crowd around each fine: fines near it, in the space that grains leave.

The neighbourhood of a fine is a ball about its centre. Grains and walls take space from it, fines
fill that space in part. A fine far from all others has porosity 1, also next to a grain.
"""

from typing import NamedTuple

import numpy as np

from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.fines.deposit import Grid, cells_between, grid_of
from fdnet.spheres.geometry import make_images, wrapped
from fdnet.spheres.snapshot import Array, Snapshot

REACH = 4.0
"""Radius of the neighbourhood over that of the fine (or over the Sauter mean of all, if that is
larger). In a random bed of solid fraction 0.6251 the fractions are 0.6245 +- 0.0108."""
DENSEST = float(np.pi / np.sqrt(18.0))  # Solid fraction of the densest packing of equal spheres
_NODE, _WEIGHT = np.polynomial.legendre.leggauss(4)
"""Gauss and Legendre's rule, exact for the polynomials of degree 7 that are integrated here."""


class Neighbourhood(NamedTuple):
    """What surrounds each fine (N,)."""

    porosity: Array  # (N,) of the fines around it, in the space outside of grains and walls
    size_ratio: Array
    """(N,) its diameter over the Sauter mean diameter of these fines, itself among them."""
    capped: int
    """Number of fines around which the fraction came out above `DENSEST` (the overlaps of contacts
    are counted twice); their porosity is 1 - `DENSEST`."""


def local_porosity(spheres: Snapshot, periodic: tuple[bool, bool, bool]) -> Neighbourhood:
    """The porosity around each fine of `spheres`, in their order.

    Volumes count by the weight (1 - (a/R)^2)^2 at the distance a from the centre of the fine, up
    to R = `REACH` radii. With W the weighted volume of the ball less what grains and walls take of
    it, S that of the fines in it and V that of the fine itself, the solid fraction is

        s = (S - V S0(s')) / W,  s' = (S - V) / (W - V),  S0(s) = (1 - s)^4 / (1 + 2 s)^2.

    About a fine a crowd of fraction s holds S0 fines more than about a place anywhere. S0 is the
    compressibility of hard spheres: 1 for a lone one, nearly 0 in a dense bed (Wertheim 1963, from
    the equation of Percus and Yevick 1958). So s is 0 for a lone fine, and the bed's own in a bed.

    Spheres have images across the sides of `spheres.box` that are `periodic`; y and z have walls
    where they are not.
    """
    fines = spheres.fines()
    if not len(fines):
        return Neighbourhood(np.ones(0), np.ones(0), 0)
    radius = fines.radius
    ball = REACH * np.maximum(radius, float(np.sum(radius**3) / np.sum(radius**2)))
    space = _of_ball(ball, ball) - _behind_walls(fines, ball, periodic)
    if len(grains := spheres.grains()):
        space -= _taken(fines, grains, ball, periodic)[:, 0]
    solid, surface = _taken(fines, fines, ball, periodic).T
    fraction = _fraction(solid, np.maximum(space, solid), _of_ball(radius, ball))
    dense = fraction > DENSEST
    porosity = 1.0 - np.where(dense, DENSEST, fraction)
    return Neighbourhood(porosity, radius * surface / solid, int(np.sum(dense)))


def _fraction(solid: Array, space: Array, own: Array) -> Array:
    """Solid fraction around each fine (N,); see `local_porosity`."""
    others, room = np.maximum(solid - own, 0.0), space - own  # a lone one's difference rounds
    near = np.divide(others, room, out=np.zeros_like(others), where=room > 0)
    near = np.minimum(near, 1.0)
    excess = (1.0 - near) ** 4 / (1.0 + 2.0 * near) ** 2
    return (others + own * (1.0 - excess)) / space


def _taken(
    fines: Snapshot, others: Snapshot, ball: Array, periodic: tuple[bool, bool, bool]
) -> Array:
    """What `others` take of the balls: weighted volume m3, and this over their radius, (N, 2)."""
    reach = float(ball.max() + others.radius.max())
    images = make_images(
        others.position,
        others.box,
        periodic=periodic,
        margin=np.where(periodic, reach, np.nan),
        tolerance=0.0,
    )
    room = float(np.prod(np.ptp(images.position, axis=0) + reach)) / len(images.owner)
    grid, order = grid_of(images.position, max(0.5 * reach, room ** (1.0 / 3.0)))
    radius = others.radius[images.owner[order]]
    centre = np.ascontiguousarray(wrapped(fines.position, fines.box, periodic))
    total = np.zeros((len(centre), 2))
    _gather(grid, images.position[order], radius, radius.max(), centre, ball, total)
    return total


@loops_in_place
def _gather(
    grid: Grid, place: Array, radius: Array, most: float, centre: Array, ball: Array, total: Array
) -> None:
    """Adds to sums (N, 2) over the spheres at `place` (M, 3) m, in the order of the grid."""
    start, edge, shape, first = grid.start, grid.edge, grid.shape, grid.first
    for one in range(len(centre)):
        x, y, z, far = centre[one, 0], centre[one, 1], centre[one, 2], ball[one]
        i0, i1 = cells_between(x - far - most, x + far + most, start[0], edge, shape[0])
        j0, j1 = cells_between(y - far - most, y + far + most, start[1], edge, shape[1])
        k0, k1 = cells_between(z - far - most, z + far + most, start[2], edge, shape[2])
        for i in range(i0, i1):
            for j in range(j0, j1):
                row = (i * shape[1] + j) * shape[2]
                for k in range(first[row + k0], first[row + max(k1, k0)]):
                    dx, dy, dz = place[k, 0] - x, place[k, 1] - y, place[k, 2] - z
                    square = dx**2 + dy**2 + dz**2
                    if square < (far + radius[k]) ** 2:
                        part = weighted_volume(radius[k], np.sqrt(square), far)
                        total[one, 0] += part
                        total[one, 1] += part / radius[k]


@compiled
def weighted_volume(radius: float, distance: float, ball: float) -> float:
    """Volume, m3, of a sphere at a `distance` from the centre of a ball of radius `ball`, m.

    It counts by the weight (1 - (a/R)^2)^2 at the distance a from the centre, R = `ball`. A sphere
    of radius r whose centre lies at D cuts pi a / D (r^2 - (D - a)^2) out of the surface of radius
    a, for |D - r| < a < D + r, and all of it for a < r - D.
    """
    around = min(max(radius - distance, 0.0), ball)
    square = (around / ball) ** 2
    total = 4.0 * np.pi * around**3 * (1.0 / 3.0 - 2.0 * square / 5.0 + square**2 / 7.0)
    low, high = min(abs(distance - radius), ball), min(distance + radius, ball)
    if distance > 1e-9 * radius:
        for node in range(4):
            a = 0.5 * (high + low) + 0.5 * (high - low) * _NODE[node]
            area = np.pi * a / distance * (radius**2 - (distance - a) ** 2)
            total += 0.5 * (high - low) * _WEIGHT[node] * (1.0 - (a / ball) ** 2) ** 2 * area
    return total


def _behind_walls(fines: Snapshot, ball: Array, periodic: tuple[bool, bool, bool]) -> Array:
    """Weighted volume (N,) m3 of each ball beyond the walls of y and z.

    A wall at the distance h cuts the share (1 - h/a) / 2 off the sphere of radius a > |h|, and the
    whole one from a fine whose centre lies beyond it.
    """
    beyond = np.zeros(len(ball))
    for axis in (1, 2):
        if not periodic[axis]:
            for side, sign in zip(fines.box[axis], (1.0, -1.0), strict=True):
                height = np.clip(sign * (fines.position[:, axis] - side), -ball, ball)
                # Gauss's nodes between the wall and the surface of the ball
                width = 0.5 * (ball - np.abs(height))
                shell = (np.abs(height) + width)[:, None] + width[:, None] * _NODE
                share = 0.5 * (1.0 - height[:, None] / shell)
                weight = (1.0 - (shell / ball[:, None]) ** 2) ** 2
                beyond += ((weight * 4.0 * np.pi * shell**2 * share) @ _WEIGHT) * width
                beyond += np.where(height < 0, _of_ball(np.abs(height), ball), 0.0)
    return beyond


def _of_ball(radius: Array, ball: Array) -> Array:
    """Weighted volume m3 of a concentric ball: 4 pi (r^3/3 - 2 r^5/(5 R^2) + r^7/(7 R^4))."""
    share = (radius / ball) ** 2
    return 4.0 * np.pi * radius**3 * (1.0 / 3.0 - 2.0 * share / 5.0 + share**2 / 7.0)
