"""A flow between grains and fines by one scalar equation, and other fields a fine might feel.

In place of Stokes's equation the local Darcy law u = -w grad p holds on a grid, with the mobility
w = (d1 d2)^(3/4) by the distances d1 and d2 to the two nearest spheres. Between plates Stokes's is
d1 d2 / 2; the exponent was chosen on the deposits that the study does not put aside. The
conductance of a face is that of its parts in series and side by side, at half the spacing.
"""

from collections.abc import Sequence
from math import ceil, floor, sqrt
from typing import NamedTuple

import numba
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from fdnet.network.field.field import DOWNSTREAM, UPSTREAM, build_lattice
from fdnet.network.field.sampled import Sampled, find_nearby, sample_velocity
from fdnet.network.stokes import Lattice
from fdnet.spheres.snapshot import Array, Snapshot

SIDES = (False, True, True)
PARTS = 2
"""Parts of the edge of a cell in which the mobility is taken; even."""
FARTHEST = 0.24
"""Distance from which a wall no longer counts, over the diameter of a grain."""
TOLERANCE = 1e-3
"""Relative residual of the conjugate gradients."""


class Local(NamedTuple):
    """A grid, the conductance of its faces, and the flow through them (three arrays each)."""

    lattice: Lattice
    conductance: list[Array]
    flow: list[Array]


def local_flow(
    spheres: Snapshot,
    diameter: float,
    cells: float,
    kept: "Local | None" = None,
    carried: Sequence[Array] | None = None,
) -> Local:
    """The flow of mean 1 along x around `spheres`, on a grid of `cells` across a `diameter` m.

    With a flow `carried` through the faces, what it lacks to keep the volume is made up by the
    local law; `kept` gives the conductances then.
    """
    lattice = (
        kept.lattice
        if kept
        else build_lattice(
            spheres.box,
            SIDES,
            spacing=diameter / cells,
            upstream=UPSTREAM * diameter,
            downstream=DOWNSTREAM * diameter,
        )
    )
    open_ = kept.conductance if kept else _conductances(spheres, lattice, FARTHEST * diameter)
    step = lattice.spacing / lattice.unit
    matrix, cell = _matrix(open_, step)
    driven = _balanced(matrix, cell, open_, [open_[0], 0 * open_[1], 0 * open_[2]], step)
    mean = driven[0].mean()
    driven = [part / mean for part in driven]
    if carried is not None:
        moved = _balanced(matrix, cell, open_, carried, step)
        rest = 1.0 - moved[0].mean()
        driven = [a + rest * b for a, b in zip(moved, driven, strict=True)]
    return Local(lattice, open_, driven)


def sampled(local: Local, spheres: Snapshot) -> Sampled:
    """The flow down to the walls, as that of `fdnet.velocity_field`."""
    near = find_nearby(local.lattice, spheres.position, spheres.radius)
    return sample_velocity(local.lattice, near, [one.astype(np.float32) for one in local.flow])


def faces(lattice: Lattice, component: int) -> Array:
    """Middles (cells, 3) m of the faces across an axis."""
    place = np.indices(lattice.shape).reshape(3, -1).T + 0.5
    place[:, component] -= 0.5
    return np.asarray(lattice.low + place * lattice.spacing)


def _conductances(spheres: Snapshot, lattice: Lattice, farthest: float) -> list[Array]:
    step = lattice.spacing / PARTS
    near = np.full((*np.multiply(lattice.shape, PARTS), 2), farthest, np.float32)
    _mark(spheres.position - lattice.low - 0.5 * step, spheres.radius, step, farthest, near)
    mobility = np.maximum(near / farthest, 0.0).prod(axis=3) ** 0.75
    result = []
    for axis in range(3):
        part = np.moveaxis(np.roll(mobility, PARTS // 2, axis), axis, 0)
        n, *across = part.shape
        with np.errstate(divide="ignore"):
            row = 1.0 / np.mean(1.0 / part.reshape(n // PARTS, PARTS, *across), axis=1)
        b, c = (size // PARTS for size in across)
        face = row.reshape(n // PARTS, b, PARTS, c, PARTS).mean(axis=(2, 4))
        result.append(np.ascontiguousarray(np.moveaxis(face, 0, axis)))
    return result


@numba.njit(cache=True)
def _mark(centre: Array, radius: Array, step: Array, farthest: float, near: Array) -> None:
    """Sets the two least distances to a sphere, at most `farthest`; y and z are periodic."""
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for s in range(len(radius)):
        reach = radius[s] + farthest
        for axis in range(3):
            low[axis] = ceil((centre[s, axis] - reach) / step[axis])
            high[axis] = floor((centre[s, axis] + reach) / step[axis])
        for i in range(max(low[0], 0), min(high[0] + 1, near.shape[0])):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    x, y = i * step[0] - centre[s, 0], j * step[1] - centre[s, 1]
                    z = k * step[2] - centre[s, 2]
                    away = sqrt(x * x + y * y + z * z) - radius[s]
                    two = near[i, j % near.shape[1], k % near.shape[2]]
                    if away < two[0]:
                        two[0], two[1] = away, two[0]
                    elif away < two[1]:
                        two[1] = away


def _matrix(open_: list[Array], step: Array) -> tuple[sparse.csr_array, Array]:
    """The scaled matrix of the pressures, and the scale of each cell; 0 in the solid."""
    index = np.arange(open_[0].size).reshape(open_[0].shape)
    own, links = np.zeros(index.size), []
    for axis, part in enumerate(open_):
        rows = np.flatnonzero(part)
        a, b = index.ravel()[rows], np.roll(index, 1, axis).ravel()[rows]
        weight = part.ravel()[rows] / step[axis] ** 2
        own += np.bincount(a, weight, index.size) + np.bincount(b, weight, index.size)
        links += [(a, b, weight), (b, a, weight)]
    scale = np.divide(1.0, np.sqrt(own), out=np.zeros_like(own), where=own > 0)
    a, b, weight = (np.concatenate(part) for part in zip(*links, strict=True))
    matrix = sparse.coo_array((-weight * scale[a] * scale[b], (a, b)), shape=(index.size,) * 2)
    return (matrix + sparse.eye_array(index.size)).tocsr(), scale


def _balanced(
    matrix: sparse.csr_array,
    scale: Array,
    open_: list[Array],
    flow: Sequence[Array],
    step: Array,
) -> list[Array]:
    """A `flow` through the open faces less what the pressures take to keep the volume."""
    parts = [part * (one > 0) for one, part in zip(open_, flow, strict=True)]
    gain = sum((np.roll(part, -1, axis) - part) / step[axis] for axis, part in enumerate(parts))
    pressure = scale * cg(matrix, -scale * np.ravel(gain), rtol=TOLERANCE, maxiter=2000)[0]
    field = pressure.reshape(open_[0].shape)
    return [
        part - one * (field - np.roll(field, 1, axis)) / step[axis]
        for axis, (part, one) in enumerate(zip(parts, open_, strict=True))
    ]
