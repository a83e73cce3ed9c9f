"""Sticky tracers in a velocity field, against interception in Happel's cell."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fdnet.spheres.snapshot import Array, Snapshot

NEAR, SHORTEST, LONGEST = 0.3, 0.002, 0.03
"""Length of a step: a share of the distance from the nearest grain, between two shares of a
grain's diameter."""
MOST_STEPS = 20_000
SLOWEST = 15.0
"""A velocity that tracers at the start do not exceed, over the superficial one."""


def happel(porosity: float, ratio: float) -> float:
    """Share of the flow through a grain's cross-section that it intercepts, 1.5 A_s ratio^2.

    `ratio` is the diameter of the tracer over that of the grain. A_s = 2 (1 - g^5) / w with
    g = (1 - porosity)^(1/3) and w = 2 - 3 g + 3 g^5 - 2 g^6 (Happel 1958, AIChE J. 4, 197; Yao,
    Habibian and O'Melia 1971, Environ. Sci. Technol. 5, 1105).
    """
    g = (1.0 - porosity) ** (1.0 / 3.0)
    shape = 2.0 * (1.0 - g**5) / (2.0 - 3.0 * g + 3.0 * g**5 - 2.0 * g**6)
    return 1.5 * shape * ratio**2


@dataclass(frozen=True, slots=True, kw_only=True)
class Caught:
    """What a grain intercepts.

    Attributes:
        efficiency: share of the flow through a grain's cross-section, from
            passed = exp(-1.5 (1 - porosity) efficiency length / diameter).
        caught: number of tracers.
        unfinished: number of tracers that neither stuck nor passed.
    """

    efficiency: float
    caught: int
    unfinished: int


def intercepted(
    velocity: Callable[[Array], Array],
    pack: Snapshot,
    ratio: float,
    *,
    tracers: int,
    seed: int = 0,
) -> Caught:
    """Tracers of `ratio` grain diameters carried through a periodic cube of equal grains.

    They start on the face x = 0 in proportion to the flux, move by the midpoint rule, and stick
    where their surface touches a grain.

    Args:
        velocity: of the fluid (N, 3) at points (N, 3) m.
        pack: equal grains, m, in a periodic cube.
        ratio: diameter of a tracer over that of a grain.
        tracers: their number.
        seed: of their places.
    """
    low, edge = pack.box[:, 0], float(np.ptp(pack.box[0]))
    radius = float(pack.radius.mean())
    tree = cKDTree((pack.position - low) % edge, boxsize=edge)

    def gap(points: Array) -> Array:
        return np.asarray(tree.query((points - low) % edge)[0]) - radius

    touch = ratio * radius
    place = _started(velocity, gap, touch, (tracers, seed, low, edge))
    start = place[:, 0].copy()
    moving, stuck = np.arange(tracers), 0
    for _ in range(MOST_STEPS):
        if not len(moving):
            break
        here = place[moving]
        length = np.clip(NEAR * gap(here), 2.0 * radius * SHORTEST, 2.0 * radius * LONGEST)
        middle = here + 0.5 * length[:, None] * _direction(velocity(here))
        place[moving] = here + length[:, None] * _direction(velocity(middle))
        caught = gap(place[moving]) < touch
        stuck += int(caught.sum())
        moving = moving[~caught & (place[moving, 0] - start[moving] < edge)]
    solid = float(np.sum(4.0 / 3.0 * np.pi * pack.radius**3)) / edge**3
    per_layer = 2.0 * radius / (1.5 * solid * edge)
    return Caught(
        efficiency=-np.log(1.0 - stuck / tracers) * per_layer,
        caught=stuck,
        unfinished=len(moving),
    )


def _direction(velocity: Array) -> Array:
    speed = np.linalg.norm(velocity, axis=1)
    return velocity / np.maximum(speed, np.finfo(float).tiny)[:, None]


def _started(
    velocity: Callable[[Array], Array],
    gap: Callable[[Array], Array],
    touch: float,
    wanted: tuple[int, int, Array, float],
) -> Array:
    """Places (N, 3) on the face x = 0, off the grains, in proportion to the flux through it."""
    tracers, seed, low, edge = wanted
    rng, places = np.random.default_rng(seed), np.zeros((0, 3))
    while len(places) < tracers:
        tried = low + edge * rng.random((tracers, 3)) * [0.0, 1.0, 1.0]
        flux = velocity(tried)[:, 0]
        free = (gap(tried) > touch) & (SLOWEST * rng.random(tracers) < flux)
        places = np.concatenate([places, tried[free]])[:tracers]
    return places
