"""Wall nodes on their grid: what they bear, what the flow does there, and their neighbours."""

import numpy as np

from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.spheres.snapshot import Array


def neighbours_of(node: Array, shape: tuple[int, int, int], first: int, none: int) -> Array:
    """The six neighbours of each node (M,), as rows (M, 6) counted from `first`; `none` for none.

    Args:
        node: flat indices of the nodes on the grid.
        shape: of the grid, which repeats along all axes.
        first: row of the first node.
        none: number of rows of all components.
    """
    row = np.full(shape, none, np.int32)
    row.reshape(-1)[node] = np.arange(first, first + len(node), dtype=np.int32)
    near = np.empty((len(node), 6), np.int32)
    for axis in range(3):
        for side, step in enumerate((1, -1)):
            near[:, 2 * axis + side] = np.roll(row, step, axis).reshape(-1)[node]
    return near


@compiled
def differences(value: Array, near: Array, weight: float) -> Array:
    """value + weight (6 value - sum over the neighbours), (M,); one that is missing counts 0."""
    result, known = np.empty_like(value), np.append(value, 0.0)
    for one in range(len(value)):
        total = 6.0 * value[one]
        for side in range(6):
            total -= known[near[one, side]]
        result[one] = value[one] + weight * total
    return result


@compiled_in_place
def advance(solution: Array, residual: Array, length: float, along: Array, moved: Array) -> None:
    """Adds `length` times `along` to the solution, and takes as much of `moved` off the residual.

    All are (M,).
    """
    for one in range(len(solution)):
        solution[one] += length * along[one]
        residual[one] -= length * moved[one]


@compiled_in_place
def turn(along: Array, share: float, residual: Array) -> None:
    """`share` of the direction `along` (M,), plus the `residual` (M,), in place of the former."""
    for one in range(len(along)):
        along[one] = share * along[one] + residual[one]


@compiled_in_place
def put(grid: Array, node: Array, force: Array) -> None:
    """Sets a flat `grid` to the `force` (M,) at the nodes."""
    for one in range(len(node)):
        grid[node[one]] = force[one]


@compiled
def moved_at(flow: Array, node: Array, slack: Array, weight: Array, scaled: Array) -> Array:
    """weight (flow + slack weight scaled), (M,), with a flat grid `flow` at the nodes."""
    result = np.empty_like(scaled)
    for one in range(len(node)):
        own = slack[one] * weight[one] * scaled[one]
        result[one] = weight[one] * (flow[node[one]] + own)
    return result
