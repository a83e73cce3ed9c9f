"""Random places for fines of a wide range of sizes: class by class, from the largest.

A large sphere finds no place among small ones that are there already. So every class of sizes is
placed to the last sphere before the next one begins, in the whole slab at once: a batch that is
filled before its neighbour would leave no place for large ones at their boundary.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fdnet.spheres.snapshot import Array

CLEARANCE = 1.02
"""Fines start at least this many radius sums apart."""
ROUNDS = 400
"""Times that a sphere without a place is drawn again."""
_CLASS, _MOST = 2**0.25, 50_000
"""Largest ratio of radii in a class, and most spheres that are drawn at once."""

Indices = NDArray[np.int64]
NOBODY = (np.empty((0, 3)), np.empty(0))
"""Places and radii of no sphere."""


def places_by_size(
    radius: Array,
    low: Array,
    high: Array,
    size: Array,
    *,
    rng: np.random.Generator,
    others: tuple[Array, Array] = NOBODY,
) -> tuple[Array, int]:
    """Random places that touch nothing, by random sequential addition of whole classes.

    Args:
        radius: (N,) m.
        low: (N, 3) m, smallest coordinates of each centre.
        high: (N, 3) m, largest ones.
        size: (3,) m, period along each axis, 0 where there is none.
        rng: gives the places.
        others: places (M, 3) m and radii (M,) m of spheres that are there already.

    Returns:
        Places (N, 3) m, and how many spheres got none; those places mean nothing then.
    """
    count = len(radius)
    place = np.concatenate([np.empty((count, 3)), others[0]])
    done = np.arange(len(place)) >= count
    radius = np.concatenate([radius, others[1]])
    for members in _classes(radius[:count]):
        waiting = members
        for _ in range(ROUNDS):
            if not len(waiting):
                break
            place[waiting] = low[waiting] + rng.random((len(waiting), 3)) * (high - low)[waiting]
            clear = _clear(place, radius, waiting, np.flatnonzero(done), size)
            done[waiting[clear]] = True
            waiting = waiting[~clear]
        if len(waiting):
            return place[:count], int(np.sum(~done))
    return place[:count], 0


def _classes(radius: Array) -> Iterator[Indices]:
    """Indices of the spheres of each class, from the largest."""
    order = np.argsort(-radius, kind="stable")
    start = 0
    while start < len(order):
        alike = radius[order[start:]] > radius[order[start]] / _CLASS
        end = min(start + int(np.sum(alike)), start + _MOST)
        yield order[start:end]
        start = end


def _clear(
    place: Array, radius: Array, drawn: Indices, others: Indices, size: Array
) -> NDArray[np.bool_]:
    """Whether each drawn sphere clears the others and the drawn ones before it."""
    from scipy.spatial import cKDTree

    clear = np.ones(len(drawn), bool)
    tree, reach = cKDTree(place[drawn], boxsize=size), CLEARANCE * radius[drawn].max()
    if len(others):
        near = tree.sparse_distance_matrix(
            cKDTree(place[others], boxsize=size),
            reach + CLEARANCE * radius[others].max(),
            output_type="ndarray",
        )
        least = CLEARANCE * (radius[drawn[near["i"]]] + radius[others[near["j"]]])
        clear[near["i"][near["v"] < least]] = False
    near = tree.sparse_distance_matrix(tree, 2 * reach, output_type="ndarray")
    near = near[near["i"] < near["j"]]
    least = CLEARANCE * (radius[drawn[near["i"]]] + radius[drawn[near["j"]]])
    clear[near["j"][near["v"] < least]] = False
    return clear
