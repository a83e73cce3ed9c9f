"""Numbers at the nodes of a grid that feel a wall, 0 at all others: sums and steps over them.

They lie on whole grids of single precision, three components one after the other. Some half of all
nodes feel a wall, so whole rows are passed over faster than a list of those nodes and of their
neighbours is. Sums are of double precision, by columns first, so that the processor works on
several at once.
"""

import numpy as np

from fdnet.network.compiled import loops_in_place
from fdnet.spheres.snapshot import Array


def dot(one: Array, other: Array) -> float:
    """Sum of the products of two grids, each of the same shape (..., n)."""
    columns = np.zeros(one.shape[-1])
    _add_products(_rows(one), _rows(other), columns)
    return float(columns.sum())


def differences(value: Array, weight: Array, share: float) -> Array:
    """value + share (6 value - sum over the neighbours) where there is a weight, else 0.

    All are grids (3, n0, n1, n2), which repeat along all axes.
    """
    result = np.empty_like(value)
    for component in range(3):
        _differ(value[component], weight[component], share, result[component])
    return result


def advance(solution: Array, residual: Array, length: float, move: tuple[Array, Array]) -> float:
    """Adds `length` times a direction to the solution and takes what it moves off the residual.

    `move` are the direction and what it moves. Returns the square of the residual.
    """
    columns = np.zeros(residual.shape[-1])
    along, moved = move
    _advance(
        (_rows(solution), _rows(residual)), np.float32(length), _rows(along), _rows(moved), columns
    )
    return float(columns.sum())


def _rows(grid: Array) -> Array:
    return grid.reshape(-1, grid.shape[-1])


@loops_in_place
def _add_products(one: Array, other: Array, columns: Array) -> None:
    for row in range(one.shape[0]):
        a, b = one[row], other[row]
        for k in range(len(columns)):
            columns[k] += np.float64(a[k]) * np.float64(b[k])


@loops_in_place
def _advance(
    state: tuple[Array, Array], length: float, along: Array, moved: Array, columns: Array
) -> None:
    solution, residual = state
    for row in range(along.shape[0]):
        x, r, a, m = solution[row], residual[row], along[row], moved[row]
        for k in range(len(columns)):
            x[k] += length * a[k]
            r[k] -= length * m[k]
        for k in range(len(columns)):
            columns[k] += np.float64(r[k]) * np.float64(r[k])


def turn(along: Array, share: float, residual: Array, force: tuple[Array, Array]) -> None:
    """`share` of the direction `along` plus the `residual`, in place.

    `force` are the weight, and what is set to it times the direction.
    """
    weight, result = force
    flat = (part.reshape(-1) for part in (along, residual, weight, result))
    _turn(np.float32(share), *flat)


@loops_in_place
def _turn(share: float, along: Array, residual: Array, weight: Array, force: Array) -> None:
    for one in range(len(along)):
        along[one] = share * along[one] + residual[one]
        force[one] = weight[one] * along[one]


@loops_in_place
def moved_at(flow: Array, weight: Array, own: Array, scaled: Array, moved: Array) -> None:
    """Sets `moved` to weight times `flow` plus `own` times `scaled`; all are flat."""
    for one in range(len(flow)):
        moved[one] = weight[one] * flow[one] + own[one] * scaled[one]


@loops_in_place
def _differ(value: Array, weight: Array, share: float, result: Array) -> None:
    """`differences` of one component."""
    shape, zero = value.shape, np.float32(0.0)
    beside, middle = np.float32(share), np.float32(1.0 + 6.0 * share)
    last = shape[2] - 1
    for i in range(shape[0]):
        low, high = value[i - 1 if i else shape[0] - 1], value[i + 1 if i + 1 < shape[0] else 0]
        for j in range(shape[1]):
            own, some, done = value[i, j], weight[i, j], result[i, j]
            near = value[i, j - 1 if j else shape[1] - 1]
            far = value[i, j + 1 if j + 1 < shape[1] else 0]
            left, right, after, inner = low[j], high[j], own[1:], done[1:]
            for k in range(shape[2]):
                done[k] = middle * own[k] - beside * (left[k] + right[k] + near[k] + far[k])
            for k in range(last):
                done[k] -= beside * after[k]
            for k in range(last):
                inner[k] -= beside * own[k]
            done[0] -= beside * own[last]
            done[last] -= beside * own[0]
            for k in range(shape[2]):
                done[k] = done[k] if some[k] > zero else zero
