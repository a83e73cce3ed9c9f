"""The spheres of the page's 3-D view, as JSON that its script reads."""

import base64
from collections.abc import Mapping
from typing import Any

import numpy as np

from fdnet.spheres.snapshot import Array, Snapshot

MM, MICRON = 1e3, 1e6
MOST_SPHERES = 40_000
"""Spheres up to which a page has a 3-D view: half a megabyte."""
UPSTREAM_SHOWN = 0.12
"""Share of the length upstream of the face up to which fines are shown."""
STEPS = 65535


def view_of(spheres: Snapshot) -> Mapping[str, Any] | None:
    """Grains and fines for the view; None where there are more than `MOST_SPHERES`, or none.

    `data` is base64 of (N, 4) unsigned 16-bit numbers, little endian, grains first: x, y and z
    from `low` to `high` (mm), and the radius from 0 to `radius` (mm). `grains` is their number.
    """
    length = float(np.ptp(spheres.box[0]))
    shown = spheres.position[:, 0] > spheres.box[0, 0] - UPSTREAM_SHOWN * length
    grains, fines = spheres.grains(), spheres.where(shown).fines()
    if not 0 < len(grains) + len(fines) <= MOST_SPHERES:
        return None
    position = np.concatenate([grains.position, fines.position]) * MM
    radius = np.concatenate([grains.radius, fines.radius]) * MM
    low, high = position.min(axis=0), position.max(axis=0)
    table = np.column_stack([_steps(position, low, high), _steps(radius, 0.0, radius.max())])
    sizes = np.unique(np.round(fines.radius * MICRON, 6)) if len(fines) else np.zeros(0)
    return {
        "grains": len(grains),
        "spheres": len(radius),
        "low": low.tolist(),
        "high": high.tolist(),
        "radius": float(radius.max()),
        "box": (np.asarray(spheres.box) * MM).tolist(),
        "one_size": len(sizes) <= 1,
        "data": base64.b64encode(table.astype("<u2").tobytes()).decode("ascii"),
    }


def _steps(value: Array, low: Any, high: Any) -> Array:
    """`value` as whole steps of 0 to `STEPS` between `low` and `high`."""
    span = np.where(np.asarray(high) > low, np.asarray(high) - low, 1.0)
    return np.rint((value - low) / span * STEPS)
