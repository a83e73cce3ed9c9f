"""Sorted spheres dealt out to batches so that each batch has the curve of all."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fdnet.sizes.laws import Array


def dealt(counts: Sequence[int], rng: np.random.Generator) -> list[NDArray[np.int64]]:
    """For each batch the indices, into spheres sorted by size, that it gets.

    Every batch divides the sorted spheres into as many parts as it has spheres and takes one of
    each, at a random place (a Latin hypercube), so that each sphere goes to one batch.

    Args:
        counts: number of spheres in each batch.
        rng: gives the places.
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.concatenate([(np.arange(n) + rng.random(n)) / n for n in counts])
    order = owner[np.argsort(place, kind="stable")]
    return [np.flatnonzero(order == batch) for batch in range(len(counts))]


def volume_quantiles(diameter: Array, shares: Sequence[float]) -> list[float]:
    """Diameters, m, that the `shares` by volume of some spheres (N,) m are finer than.

    Each sphere's volume is spread half below and half above its diameter.
    """
    rising = np.sort(diameter)
    volume = rising**3
    middle = (np.cumsum(volume) - 0.5 * volume) / np.sum(volume)
    return [float(one) for one in np.exp(np.interp(shares, middle, np.log(rising)))]
