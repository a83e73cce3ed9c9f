"""Direct solution of the mass balances of a network of links (symmetric, positive definite)."""

import numpy as np
import pymetis
from scipy import sparse
from scipy.sparse.linalg import splu

from fdnet.errors import FlowError
from fdnet.snapshot import Array

METHOD = "splu, METIS nested dissection"


def solve_balances(pair: Array, conductance: Array, tied: Array, source: Array) -> Array:
    """Pressures (n,) with sum of g (p_i - p_j) + tied_i p_i = source_i at every node i.

    `pair` (K, 2) nodes, `conductance` (K,) > 0, `tied` (n,) conductance to nodes of known pressure, `source` (n,).
    Scaled to a unit diagonal, ordered by METIS nested dissection (Karypis and Kumar 1998), factorised by SuperLU in
    symmetric mode, one step of iterative refinement. Raises FlowError when the system is singular.
    """
    count = len(tied)
    if count == 0:
        return np.zeros(0)
    diagonal = tied.astype(float).copy()
    for side in (0, 1):
        diagonal += np.bincount(pair[:, side], weights=conductance, minlength=count)
    scale = 1.0 / np.sqrt(diagonal)
    value = -conductance * scale[pair[:, 0]] * scale[pair[:, 1]]
    upper = sparse.coo_matrix((value, (pair[:, 0], pair[:, 1])), shape=(count, count))
    beside = (upper + upper.T).tocsr()
    beside.setdiag(0.0)
    own = diagonal.copy()
    np.subtract.at(own, pair[pair[:, 0] == pair[:, 1], 0], 2.0 * conductance[pair[:, 0] == pair[:, 1]])
    matrix = (beside + sparse.diags(own / diagonal)).tocsr()
    order = _order(beside)
    try:
        factor = splu(
            matrix[order][:, order].tocsc(),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise FlowError(f"solve of {count} pores failed: {error}; a group of pores has no way out") from error
    wanted = source * scale
    found = np.zeros(count)
    for _ in range(2):
        missing = (wanted - matrix @ found)[order]
        found[order] += factor.solve(missing)
    return found * scale


def _order(beside: sparse.csr_matrix) -> Array:
    beside.eliminate_zeros()
    if beside.nnz == 0:
        return np.arange(beside.shape[0])
    adjacency = pymetis.CSRAdjacency(beside.indptr, beside.indices)
    return np.asarray(pymetis.nested_dissection(adjacency=adjacency)[0])
