"""Whole periods between a thing and its image: as single tuples, and coded as numbers."""

import numpy as np

from fdnet.errors import NetworkError
from fdnet.spheres.snapshot import Array

BASE = 16
"""Shifts from -8 to 7 periods have a code of their own."""
Shift = tuple[int, int, int]
HERE: Shift = (0, 0, 0)


def shift_of(values: Array) -> Shift:
    """Three whole numbers."""
    x, y, z = map(int, values)
    return x, y, z


def both(one: Shift, other: Shift) -> Shift:
    """One shift after the other."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def between(one: Shift, other: Shift) -> Shift:
    """The shift that leads from `other` to `one`."""
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


def keys_of(*parts: Array, shift: Array, size: int) -> Array:
    """One number (N,) for each row of `parts` (N,), all below `size`, and `shift` (N, 3).

    Raises NetworkError where a shift has no code.
    """
    if len(shift) and np.abs(shift).max() >= BASE // 2:
        raise NetworkError(
            f"upscaled: the box is so narrow that pores next to each other lie "
            f"{int(np.abs(shift).max())} periods apart, at most {BASE // 2 - 1} are possible; "
            "take a wider box, or analysis.damage_law = 'all-spheres'"
        )
    number = np.zeros(len(shift), np.int64)
    for part in parts:
        number = number * size + part
    for axis in range(3):
        number = number * BASE + (shift[:, axis] + BASE // 2)
    return number


def looked_up(sorted_keys: Array, keys: Array) -> tuple[Array, Array]:
    """Places (N,) of `keys` among `sorted_keys`, and whether they are there (N,)."""
    place = np.searchsorted(sorted_keys, keys)
    there = place < len(sorted_keys)
    there[there] = sorted_keys[place[there]] == keys[there]
    return np.where(there, place, 0), there


def members_of(first: Array, which: Array) -> tuple[Array, Array]:
    """All members of the lists `which` (N,), of lists that begin at `first` (L+1,).

    Returns:
        The position in `which` (M,) and the place of the member (M,).
    """
    length = first[which + 1] - first[which]
    row = np.repeat(np.arange(len(which)), length)
    start = np.repeat(first[which] - np.cumsum(length) + length, length)
    return row, np.arange(len(row)) + start
