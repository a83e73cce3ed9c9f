"""The axes x, y, z, given by letters or as three truth values."""

from collections.abc import Iterable, Sequence

import numpy as np

from fdnet.errors import CaseError

Directions = str | Sequence[bool]
"""Some of the three axes: letters such as "yz", or three truth values (x, y, z)."""


def periodic_axes(periodic: Directions) -> tuple[bool, bool, bool]:
    """Which of x, y, z are periodic, from letters ("yz", "" for none) or three truth values.

    Raises CaseError on other letters, on a repeated letter and on another number of values.
    """
    if isinstance(periodic, str):
        if not set(periodic) <= set("xyz") or len(set(periodic)) != len(periodic):
            raise CaseError(
                f"periodic: {periodic!r}, expected any of x, y, z together, for example 'yz'"
            )
        return "x" in periodic, "y" in periodic, "z" in periodic
    values = tuple(periodic) if isinstance(periodic, Iterable) else ()
    if len(values) != 3 or not all(isinstance(value, bool | np.bool_) for value in values):
        raise CaseError(
            f"periodic: {periodic!r}, expected letters such as 'yz', or three truth values for x, "
            "y, z"
        )
    return bool(values[0]), bool(values[1]), bool(values[2])


def axis_number(axis: str) -> int:
    """0, 1 or 2 for "x", "y" or "z". Raises CaseError on anything else."""
    if axis not in ("x", "y", "z"):
        raise CaseError(f"axis: {axis!r}, expected x, y or z")
    return "xyz".index(axis)
