"""Read-only arrays, and how a class that owns arrays prints itself."""

from dataclasses import fields
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

MOST_SHOWN = 60
"""Longest text of one field in `one_line`, characters."""


def frozen(values: Any, dtype: Any = None) -> Array:
    """A read-only copy of `values` as an array."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def one_line(owner: Any) -> str:
    """The data class `owner` on one line: numbers as they are, arrays by their shape alone."""
    shown = (f"{field.name}={_short(getattr(owner, field.name))}" for field in fields(owner))
    return f"{type(owner).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape}"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple | list | dict) and len(repr(value)) > MOST_SHOWN:
        return f"{len(value)} items"
    text = " ".join(repr(value).split())
    return text if len(text) <= MOST_SHOWN else f"{type(value).__name__}(...)"
