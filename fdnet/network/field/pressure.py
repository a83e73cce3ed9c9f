"""The pressure gradient between the nodes of a staggered grid."""

from dataclasses import dataclass
from math import floor

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.field.lattice import Lattice
from fdnet.network.field.response import Response
from fdnet.network.field.solved import Solved
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Gradient:
    """The pressure gradient on the faces of the cells.

    Attributes:
        lattice: the grid.
        parts: for each component (n0, n1, n2) difference across the face over its spacing, over
            viscosity and superficial velocity, 1/m2. Faces in the solid carry the mean of their
            neighbours in the fluid, from the surface inwards.
    """

    lattice: Lattice
    parts: tuple[Array, Array, Array]

    __repr__ = one_line

    def at(self, points: Array) -> Array:
        """Gradient (N, 3) 1/m2 at points (N, 3) m, linear between the faces.

        It is 0 before and beyond a grid that does not repeat along x.
        """
        result, inside = np.zeros(points.shape), np.ones(len(points), bool)
        if not self.lattice.repeats:
            inside = points[:, 0] >= self.lattice.low[0]
            inside &= points[:, 0] < self.lattice.high[0]
        place = np.ascontiguousarray((points[inside] - self.lattice.low) / self.lattice.spacing)
        sampled = np.zeros(place.shape)
        _sample(place, np.array(self.lattice.walled), self.parts, sampled)
        result[inside] = sampled
        return result


def find_gradient(
    lattice: Lattice, response: Response, solved: Solved, gradient: float
) -> Gradient:
    """The pressure gradient of a flow whose mean is `gradient` 1/m2 along x."""
    pressure = response.pressure(list(solved.force))
    parts = []
    for axis in range(3):
        step = pressure - np.roll(pressure, 1, axis=axis)
        if lattice.walled[axis]:
            np.moveaxis(step, axis, 0)[0] = 0.0
        part = step / (lattice.spacing[axis] * lattice.unit)
        if axis == 0:
            part += gradient
        parts.append(_inwards(part.astype(np.float32), ~solved.solid[axis]))
    return Gradient(lattice=lattice, parts=(parts[0], parts[1], parts[2]))


def _inwards(part: Array, known: Array) -> Array:
    """Fills nodes that are not `known` with the mean of those next to them, layer by layer."""
    known = known.copy()
    while True:
        count = _fill_layer(part, known)
        if count == 0:
            return part


@compiled
def _fill_layer(part: Array, known: Array) -> int:
    """Fills the unknown nodes next to known ones; returns how many."""
    shape, filled = part.shape, []
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                if known[i, j, k]:
                    continue
                total, count = 0.0, 0
                for a in (i - 1, i, i + 1):
                    for b in (j - 1, j, j + 1):
                        for c in (k - 1, k, k + 1):
                            at = (a % shape[0], b % shape[1], c % shape[2])
                            if known[at]:
                                total += part[at]
                                count += 1
                if count > 0:
                    part[i, j, k] = total / count
                    filled.append((i, j, k))
    for node in filled:
        known[node] = True
    return len(filled)


@compiled
def _sample(place: Array, walled: Array, parts: tuple[Array, Array, Array], result: Array) -> None:
    """Writes the linear interpolation at each `place` (N, 3), in cells, to `result`."""
    base, rest, at = np.zeros(3, np.int64), np.zeros(3), np.zeros(3, np.int64)
    for s in range(len(place)):
        for component in range(3):
            part = parts[component]
            for axis in range(3):
                x = place[s, axis] - (0.0 if axis == component else 0.5)
                base[axis] = floor(x)
                rest[axis] = x - base[axis]
            total = 0.0
            for corner in range(8):
                weight = 1.0
                for axis in range(3):
                    up = (corner >> axis) & 1
                    weight *= rest[axis] if up else 1.0 - rest[axis]
                    node = base[axis] + up
                    if walled[axis]:
                        if axis == component and (node <= 0 or node >= part.shape[axis]):
                            weight = 0.0
                        at[axis] = max(0, min(node, part.shape[axis] - 1))
                    else:
                        at[axis] = node % part.shape[axis]
                if weight != 0.0:
                    total += weight * part[at[0], at[1], at[2]]
            result[s, component] = total
