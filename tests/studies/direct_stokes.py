"""Stokes flow on a periodic staggered grid by one sparse LU, without Fourier transforms."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from fdnet.spheres.snapshot import Array


def direct_tensor(shape: tuple[int, ...], walls: list[tuple[Array, Array]]) -> Array:
    """K (3, 3), squared spacings; `walls`: flat nodes (M,), slacks (M,) of each component."""
    size = int(np.prod(shape))
    index = np.arange(size).reshape(shape)
    ahead = [np.roll(index, -1, axis=d).ravel() for d in range(3)]
    shift = [
        sparse.csr_matrix((np.ones(size), (index.ravel(), one)), (size, size)) for one in ahead
    ]
    one = sparse.identity(size)
    laplace = sum(2.0 * one - s - s.T for s in shift)
    blocks, right = [], []
    for d, (node, slack) in enumerate(walls):
        drag = np.zeros(size)
        drag[node] = 1.0 / np.maximum(slack, 1e-9)
        blocks.append(
            [laplace + sparse.diags(drag) if e == d else None for e in range(3)]
            + [one - shift[d].T]
        )
        right.append([np.ones(size) if e == d else np.zeros(size) for e in range(3)])
    blocks.append(
        [(one - shift[d].T).T for d in range(3)]
        + [sparse.diags(np.where(np.arange(size), 0.0, 1.0))]
    )
    solver = splu(sparse.bmat(blocks, format="csc"))
    flows = [
        solver.solve(np.concatenate([*(right[d][a] for d in range(3)), np.zeros(size)]))
        for a in range(3)
    ]
    return np.array([flow[: 3 * size].reshape(3, size).mean(axis=1) for flow in flows])
