"""The order in which points are inserted into a tessellation."""

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.spheres.snapshot import Array

SHARE = 8
"""All points up to a round are this many times those up to the round before."""
ORDER_SEED = 271_828
BITS = 16
"""Bits of a coordinate along Hilbert's curve."""


def insertion_order(points: Array) -> Array:
    """Order (M,) of `points` (M, 3).

    They come in rounds, each of 7 times as many as have come before, drawn at random; within a
    round they follow Hilbert's curve (Amenta, Choi and Rote 2003, Proc. 19th SoCG, 211).
    """
    count = len(points)
    low, size = points.min(axis=0), float(np.max(np.ptp(points, axis=0)))
    cell = np.minimum((points - low) / size * 2**BITS, 2**BITS - 1).astype(np.int64)
    rank = np.random.default_rng(ORDER_SEED).permutation(count)
    late = np.floor(np.log((rank + 1.0) / count) / np.log(SHARE)).astype(np.int64)
    return np.argsort(((late + 2 * BITS) << (3 * BITS)) + _along_curve(cell))


@compiled
def _along_curve(cell: Array) -> Array:
    """Place (M,) on Hilbert's curve of cells (M, 3), integers of BITS bits each.

    Skilling 2004 (AIP Conf. Proc. 707, 381).
    """
    place = np.zeros(len(cell), np.int64)
    part = np.zeros(3, np.int64)
    for k in range(len(cell)):
        for i in range(3):
            part[i] = cell[k, i]
        bit = 1 << (BITS - 1)
        while bit > 1:
            for i in range(3):
                if part[i] & bit:
                    part[0] ^= bit - 1
                else:
                    swap = (part[0] ^ part[i]) & (bit - 1)
                    part[0] ^= swap
                    part[i] ^= swap
            bit >>= 1
        part[1] ^= part[0]
        part[2] ^= part[1]
        swap, bit = 0, 1 << (BITS - 1)
        while bit > 1:
            if part[2] & bit:
                swap ^= bit - 1
            bit >>= 1
        total = 0
        for at in range(BITS - 1, -1, -1):
            for i in range(3):
                total = (total << 1) | (((part[i] ^ swap) >> at) & 1)
        place[k] = total
    return place
