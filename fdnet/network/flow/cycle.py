"""One level of a multigrid cycle: both Gauss-Seidel sweeps, and the way to the next level.

The operations are those of pyamg and scipy, in the same order, so the numbers are the same to the
last digit. Called one by one from Python they took most of the time of a cycle, for the levels of
a pack hold a few thousand pores at most.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fdnet.network.compiled import compiled_in_place
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

Rows = tuple[Array, Array, Array]
"""Where the rows of a matrix begin, the columns of its entries, and their values."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Level:
    """A level of n nodes above one of m nodes.

    Attributes:
        matrix: of the level, (n, n).
        prolongation: (n, m), from the nodes of the next level to those of this one.
        count: m.
    """

    matrix: Rows
    prolongation: Rows
    count: int

    __repr__ = one_line

    def down(self, source: Array) -> tuple[Array, Array]:
        """The solution (n,) after a forward sweep from 0, and what is left for the next level."""
        solution, coarse = np.zeros(len(source)), np.zeros(self.count)
        _down(self.matrix, self.prolongation, (solution, source), coarse)
        return solution, coarse

    def up(self, solution: Array, source: Array, coarse: Array) -> None:
        """Adds what the next level gives, `coarse` (m,), and sweeps backward; in place."""
        _up(self.matrix, self.prolongation, (solution, source), coarse)


def level_of(matrix: sparse.csr_matrix, prolongation: sparse.csr_matrix) -> Level:
    """The level of a `matrix` (n, n) and the `prolongation` (n, m) to it."""
    return Level(
        matrix=_rows(matrix), prolongation=_rows(prolongation), count=prolongation.shape[1]
    )


def _rows(matrix: sparse.csr_matrix) -> Rows:
    return matrix.indptr, matrix.indices, matrix.data


@compiled_in_place
def _relax(matrix: Rows, row: int, solution: Array, source: Array) -> None:
    """Sets the solution of one row to what balances it; a row without a diagonal stays."""
    first, column, value = matrix
    total, diagonal = 0.0, 0.0
    for entry in range(first[row], first[row + 1]):
        if column[entry] == row:
            diagonal = value[entry]
        else:
            total += value[entry] * solution[column[entry]]
    if diagonal != 0.0:
        solution[row] = (source[row] - total) / diagonal


@compiled_in_place
def _down(matrix: Rows, prolongation: Rows, state: tuple[Array, Array], coarse: Array) -> None:
    first, column, value = matrix
    upward, to, weight = prolongation
    solution, source = state
    for row in range(len(source)):
        _relax(matrix, row, solution, source)
    for row in range(len(source)):
        total = 0.0
        for entry in range(first[row], first[row + 1]):
            total += value[entry] * solution[column[entry]]
        missing = source[row] - total
        for entry in range(upward[row], upward[row + 1]):
            coarse[to[entry]] += weight[entry] * missing


@compiled_in_place
def _up(matrix: Rows, prolongation: Rows, state: tuple[Array, Array], coarse: Array) -> None:
    upward, to, weight = prolongation
    solution, source = state
    for row in range(len(solution)):
        total = 0.0
        for entry in range(upward[row], upward[row + 1]):
            total += weight[entry] * coarse[to[entry]]
        solution[row] += total
    for row in range(len(solution) - 1, -1, -1):
        _relax(matrix, row, solution, source)
