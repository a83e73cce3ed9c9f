"""The porosity of the crowd around each fine: fines near it, in the space that grains leave.

The neighbourhood of a fine is a ball about its centre. Grains and walls take space from it, fines
fill that space in part. A fine far from all others has porosity 1, also next to a grain.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fdnet.spheres.arrays import Array
from fdnet.spheres.images import neighbour_tree
from fdnet.spheres.snapshot import Snapshot

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

REACH = 3.0
"""Radius of the neighbourhood over that of the fine (or over the Sauter mean of all, if that is
larger). In a random bed of solid fraction 0.625 it gives 0.6246 +- 0.012."""
DENSEST = float(np.pi / np.sqrt(18.0))
"""Solid fraction of the densest packing of equal spheres."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Neighbourhood:
    """What surrounds each fine (N,).

    Attributes:
        porosity: (N,) of the fines around it, in the space outside of grains and walls.
        size_ratio: (N,) its diameter over the Sauter mean diameter of these fines, itself among
            them.
        capped: number of fines around which the fraction came out above `DENSEST` (the overlaps of
            contacts are counted twice); their porosity is 1 - `DENSEST`.
    """

    porosity: Array
    size_ratio: Array
    capped: int


def local_porosity(
    spheres: Snapshot, periodic: tuple[bool, bool, bool], *, reach: float = REACH
) -> Neighbourhood:
    """The porosity around each fine of `spheres`, in their order.

    With W the volume of a ball of `reach` radii less what grains and walls take of it, S that of
    the fines in the ball and V that of the fine itself, the solid fraction is

        s = (S - V S0(s')) / W,  s' = (S - V) / (W - V),  S0(s) = (1 - s)^4 / (1 + 2 s)^2.

    The ball about a fine holds S0 fines more than a ball anywhere in a crowd of fraction s does.
    S0 is the compressibility of hard spheres: 1 for a lone one, nearly 0 in a dense bed (Wertheim
    1963, from the equation of Percus and Yevick 1958). So s is 0 for a lone fine, and the bed's
    own in a bed.

    Args:
        spheres: grains and fines, m.
        periodic: across which sides of `spheres.box` there are images; y and z have walls where
            they are not periodic.
        reach: radius of the ball in radii.
    """
    fines = spheres.fines()
    if not len(fines):
        return Neighbourhood(porosity=np.ones(0), size_ratio=np.ones(0), capped=0)
    radius, count = fines.radius, len(fines)
    ball = reach * np.maximum(radius, float(np.sum(radius**3) / np.sum(radius**2)))
    tree = neighbour_tree(fines.position, spheres.box, periodic=periodic)
    space = _volume(ball) - _behind_walls(fines, ball, periodic)
    grains = spheres.grains()
    if len(grains):
        others = neighbour_tree(grains.position, spheres.box, periodic=periodic)
        near, grain, cut = _common(tree, others, ball, grains.radius)
        space -= np.bincount(near, cut, count)
    near, fine, part = _common(tree, tree, ball, radius)
    solid = np.bincount(near, part, count)
    surface = np.bincount(near, part / radius[fine], count)
    fraction = _fraction(solid, np.maximum(space, solid), _volume(radius))
    dense = fraction > DENSEST
    return Neighbourhood(
        porosity=1.0 - np.where(dense, DENSEST, fraction),
        size_ratio=radius * surface / solid,
        capped=int(np.sum(dense)),
    )


def _fraction(solid: Array, space: Array, own: Array) -> Array:
    """Solid fraction around each fine (N,); see `local_porosity`."""
    others, room = np.maximum(solid - own, 0.0), space - own  # a lone one's difference rounds
    near = np.divide(others, room, out=np.zeros_like(others), where=room > 0)
    near = np.minimum(near, 1.0)
    excess = (1.0 - near) ** 4 / (1.0 + 2.0 * near) ** 2
    return (others + own * (1.0 - excess)) / space


def _common(
    fines: "cKDTree", others: "cKDTree", ball: Array, radius: Array
) -> tuple[Array, Array, Array]:
    """Fine (K,), other sphere (K,) and the volume (K,) m3 that ball and sphere have in common."""
    most = float(ball.max() + radius.max())
    pairs = fines.sparse_distance_matrix(others, most, output_type="ndarray")
    first, second = pairs["i"], pairs["j"]
    return first, second, lens_volume(ball[first], radius[second], pairs["v"])


def _behind_walls(fines: Snapshot, ball: Array, periodic: tuple[bool, bool, bool]) -> Array:
    """Volume (N,) m3 of each ball beyond the walls: caps pi h^2 (3 R - h) / 3 of height h."""
    beyond = np.zeros(len(ball))
    for axis in (1, 2):
        if not periodic[axis]:
            for side, sign in zip(fines.box[axis], (1.0, -1.0), strict=True):
                height = np.clip(ball - sign * (fines.position[:, axis] - side), 0.0, 2 * ball)
                beyond += np.pi * height**2 * (3 * ball - height) / 3
    return beyond


def _volume(radius: Array) -> Array:
    return 4.0 / 3.0 * np.pi * radius**3


def lens_volume(first: Array, second: Array, distance: Array) -> Array:
    """Common volume, m3, of balls of radius `first` and `second`, m, at a distance, m.

    pi (R + r - d)^2 (d^2 + 2 d (R + r) - 3 (R - r)^2) / (12 d) where they cut each other (two
    caps), the smaller ball where it lies inside the larger one, 0 where they are apart.
    """
    total, gap = first + second, np.abs(first - second)
    apart = np.clip(distance, gap, total)
    cut = (total - apart) ** 2 * (apart**2 + 2 * apart * total - 3 * gap**2)
    inside = _volume(np.minimum(first, second))
    return np.where(
        distance <= gap, inside, np.pi * cut / (12 * np.where(apart > 0, apart, 1.0))
    )
