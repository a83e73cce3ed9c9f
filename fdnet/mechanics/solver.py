"""Stiffness matrices of packs: assembled, and solved directly or by conjugate gradients."""

from collections.abc import Callable

import numpy as np
import pymetis
from scipy import sparse
from scipy.sparse.linalg import splu

from fdnet.errors import MechanicsError
from fdnet.spheres.snapshot import Array

LARGEST_DIRECT = 4000
"""Grains up to which the system is factored; larger ones are solved by conjugate gradients."""
WITHIN, MOST_STEPS = 1e-10, 20_000
"""Residual over load that is reached, and the most steps of conjugate gradients."""
_FLOOR = 1e-11
"""Stiffness, over the largest, that keeps motions which no spring resists from growing."""

Solve = Callable[[Array], Array]


def stiffness(of_grains: sparse.csr_matrix, springs: Array) -> sparse.csr_matrix:
    """Stiffness matrix B^T D B (6 N, 6 N), N/m, of joints with the springs (K, 6).

    Motions that nothing resists get 1e-11 of the largest stiffness, so that the system can be
    solved; no load acts on them.
    """
    matrix = (of_grains.T @ sparse.diags(springs.ravel()) @ of_grains).tocsr()
    floor = _FLOOR * float(matrix.diagonal().max(initial=0.0))
    return matrix + floor * sparse.identity(matrix.shape[0], format="csr")


def solver_of(matrix: sparse.csr_matrix) -> Solve:
    """Solves systems with the stiffness matrix (6 N, 6 N) for one load (6 N,) at a time."""
    if matrix.shape[0] > 6 * LARGEST_DIRECT:
        return conjugate_gradients(matrix)
    return direct(matrix)


def direct(matrix: sparse.csr_matrix) -> Solve:
    """By SuperLU in symmetric mode, with the grains ordered by METIS nested dissection."""
    order = (6 * _grain_order(matrix)[:, None] + np.arange(6)).ravel()
    try:
        factor = splu(
            matrix[order][:, order].tocsc(),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise MechanicsError(
            f"stiffness of {matrix.shape[0] // 6} grains cannot be factored ({error}); raise the "
            "stiffness of the contacts or add bonds"
        ) from error

    def solve(load: Array) -> Array:
        moved = np.zeros_like(load)
        for _ in range(2):
            moved[order] += factor.solve((load - matrix @ moved)[order])
        return moved

    return solve


def _grain_order(matrix: sparse.csr_matrix) -> Array:
    """Order (N,) of the grains by nested dissection."""
    count = matrix.shape[0] // 6
    blocks = matrix.tobsr((6, 6))
    links = sparse.csr_matrix(
        (np.ones(len(blocks.indices)), blocks.indices, blocks.indptr), shape=(count, count)
    )
    links.setdiag(0.0)
    links.eliminate_zeros()
    if links.nnz == 0:
        return np.arange(count)
    adjacency = pymetis.CSRAdjacency(links.indptr, links.indices)
    return np.asarray(pymetis.nested_dissection(adjacency=adjacency)[0])


def conjugate_gradients(matrix: sparse.csr_matrix) -> Solve:
    """By conjugate gradients, preconditioned with the inverse 6 x 6 block of each grain.

    The solution raises MechanicsError where it does not reach the residual `WITHIN`.
    """
    inverse = np.linalg.inv(_diagonal_blocks(matrix))

    def better(missing: Array) -> Array:
        return np.einsum("nij,nj->ni", inverse, missing.reshape(-1, 6)).ravel()

    def solve(load: Array) -> Array:
        moved, missing = np.zeros_like(load), load.copy()
        along, before = np.zeros_like(load), 1.0
        target = WITHIN * float(np.linalg.norm(load))
        for _ in range(MOST_STEPS):
            if float(np.linalg.norm(missing)) <= target:
                return moved
            step = better(missing)
            gain = float(np.einsum("i,i", missing, step))
            along = step + (gain / before) * along
            pulled = matrix @ along
            size = gain / float(np.einsum("i,i", along, pulled))
            moved, missing, before = moved + size * along, missing - size * pulled, gain
        raise MechanicsError(
            f"solve of {len(load) // 6} grains: residual {np.linalg.norm(missing):.1e} N after "
            f"{MOST_STEPS} steps, expected {target:.1e} N; take a smaller or a stiffer pack"
        )

    return solve


def _diagonal_blocks(matrix: sparse.csr_matrix) -> Array:
    blocks = matrix.tobsr((6, 6))
    row = np.repeat(np.arange(len(blocks.indptr) - 1), np.diff(blocks.indptr))
    own = row == blocks.indices
    result = np.zeros((matrix.shape[0] // 6, 6, 6))
    result[row[own]] = blocks.data[own]
    return result
