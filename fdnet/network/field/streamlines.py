"""Streamlines of a velocity field: the ways that fluid takes through a specimen."""

from typing import TYPE_CHECKING

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.snapshot import Array

if TYPE_CHECKING:
    from fdnet.network.field.field import VelocityField

SLOWEST = 1e-6
"""Speed over the superficial one below which a streamline ends, as at a wall."""
SHORTER = (1.0, 0.25, 0.0625)
"""Shares of a step that are tried in turn, where a longer one would end in the solid."""


def streamlines(
    field: "VelocityField", start: Array, *, step: float, until: float, longest: float = 10.0
) -> list[Array]:
    """The streamlines of a field from given points on.

    Each goes on in steps of equal length by the midpoint rule until its x exceeds `until`, the
    fluid stands still, or it is `longest` times as long as the way along x. A line that leaves
    through a periodic side goes on beyond it and is not brought back into the box.

    Args:
        field: the velocity.
        start: (N, 3) m, first points.
        step: length of a step, m; near walls it is shorter.
        until: x at which a line ends, m.
        longest: length of a line over `until` less the least x of the first points.

    Returns:
        N arrays (M, 3) m, the points of each line; one point where the fluid stands still at once.

    Raises:
        CaseError: the step is not positive, or the first points are not upstream of `until`.
    """
    way = until - float(np.min(start[:, 0], initial=until))
    if not (step > 0.0 and way > 0.0):
        raise CaseError(
            f"streamlines: a step of {step:g} m and a way of {way:g} m along x, expected both to "
            "be positive"
        )
    place = np.array(start, float)
    points, moving = [place.copy()], np.ones(len(place), bool)
    kept = [moving.copy()]
    for _ in range(int(np.ceil(longest * way / step))):
        if not moving.any():
            break
        rows = np.flatnonzero(moving)
        place[rows], held = _stepped(field, place[rows], step)
        moving[rows[held]] = False
        points.append(place.copy())
        kept.append(moving.copy())
        moving &= place[:, 0] < until
    way_points, use = np.stack(points), np.stack(kept)
    return [way_points[use[:, line], line] for line in range(len(place))]


def _stepped(field: "VelocityField", place: Array, step: float) -> tuple[Array, Array]:
    """Points (N, 3) one step on, a shorter one near walls, and where (N,) there is no way on."""
    result, held = place.copy(), np.ones(len(place), bool)
    for share in SHORTER:
        rows = np.flatnonzero(held)
        here, length = place[rows], share * step
        ahead, _ = _directions(field, here)
        along, still = _directions(field, here + 0.5 * length * ahead)
        there = here + length * along
        free = ~(still | _directions(field, there)[1])
        result[rows[free]] = there[free]
        held[rows[free]] = False
    return result, held


def _directions(field: "VelocityField", points: Array) -> tuple[Array, Array]:
    """Unit vectors (N, 3) of the velocity at the points, and where (N,) there is none."""
    velocity = field.at(points)
    speed = np.linalg.norm(velocity, axis=1)
    held = speed < SLOWEST
    return velocity / np.where(held, 1.0, speed)[:, None], held
