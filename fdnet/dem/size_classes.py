"""Random places for fines of a wide range of sizes: class by class, from the largest.

A large sphere finds no place among small ones that are there already. So every class of sizes is
placed to the last sphere before the next one begins, in the whole slab at once: a batch that is
filled before its neighbour would leave no place for large ones at their boundary.

Rounds in which every sphere without a place is drawn again leave the last ones over by chance. So
each of these is drawn many more times (`last_places`) before it counts as one without a place.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from fdnet.spheres.snapshot import Array

CLEARANCE = 1.02
"""Fines start at least this many radius sums apart."""
ROUNDS = 400
"""Times that a sphere without a place is drawn again, together with the others."""
LAST_TRIES, LAST_SHARE = 100_000, 0.05
"""Times that each of the last spheres is drawn, and the share of all that may be the last ones."""
_CLASS, _MOST, _BLOCK = 2**0.25, 50_000, 1_000
"""Largest ratio of radii in a class, most spheres that are drawn at once, and how many places for
one of the last spheres are drawn at once."""

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
    patient: bool = True,
) -> tuple[Array, int]:
    """Random places that touch nothing, by random sequential addition of whole classes.

    Args:
        radius: (N,) m.
        low: (N, 3) m, smallest coordinates of each centre.
        high: (N, 3) m, largest ones.
        size: (3,) m, period along each axis, 0 where there is none.
        rng: gives the places.
        others: places (M, 3) m and radii (M,) m of spheres that are there already.
        patient: whether the last spheres of a class are drawn `LAST_TRIES` times.

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
        if patient and few(len(waiting), count):
            last = last_places(
                radius[waiting],
                (low[waiting], high[waiting]),
                size,
                rng=rng,
                others=(place[done], radius[done]),
            )
            place[waiting[: len(last)]], done[waiting[: len(last)]] = last, True
            waiting = waiting[len(last) :]
        if len(waiting):
            return place[:count], int(np.sum(~done))
    return place[:count], 0


def few(waiting: int, count: int) -> bool:
    """Whether the `waiting` ones of `count` spheres are the last ones."""
    return 0 < waiting <= max(1.0, LAST_SHARE * count)


def last_places(
    radius: Array,
    span: tuple[Array, Array],
    size: Array,
    *,
    rng: np.random.Generator,
    others: tuple[Array, Array],
) -> Array:
    """Places (K, 3) m of the first K spheres, each clear of the ones before it and of `others`.

    K is N, or as many as there are before the first one that `LAST_TRIES` draws give no place.

    Args:
        radius: (N,) m.
        span: smallest and largest coordinates (N, 3) m of each centre.
        size: (3,) m, period along each axis, 0 where there is none.
        rng: gives the places.
        others: places (M, 3) m and radii (M,) m of spheres that are there already.
    """
    place, there = others
    for one, low, high in zip(radius, *span, strict=True):
        free = _place_of_one(one, (low, high), size, rng=rng, others=(place, there))
        if free is None:
            break
        place, there = np.vstack([place, free]), np.append(there, one)
    return place[len(others[0]) :]


def _place_of_one(
    radius: float,
    span: tuple[Array, Array],
    size: Array,
    *,
    rng: np.random.Generator,
    others: tuple[Array, Array],
) -> Array | None:
    """The first of `LAST_TRIES` random places (3,) m that is clear of the `others`, or None."""
    from scipy.spatial import cKDTree

    low, high = span
    place, there = others
    tree = cKDTree(place, boxsize=size)
    reach = CLEARANCE * (radius + float(there.max(initial=0.0)))
    for _ in range(LAST_TRIES // _BLOCK):
        drawn = low + rng.random((_BLOCK, 3)) * (high - low)
        near = cKDTree(drawn, boxsize=size).sparse_distance_matrix(
            tree, reach, output_type="ndarray"
        )
        clear = np.ones(_BLOCK, bool)
        clear[near["i"][near["v"] < CLEARANCE * (radius + there[near["j"]])]] = False
        if clear.any():
            return np.asarray(drawn[np.argmax(clear)])
    return None


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
