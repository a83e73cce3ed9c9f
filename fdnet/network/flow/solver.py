"""Mass balances of a network of links: a direct solver, and multigrid for larger networks.

The systems are symmetric and positive definite.
"""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyamg
import pymetis
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from fdnet.errors import FlowError
from fdnet.network.flow.cycle import level_of
from fdnet.spheres.snapshot import Array

DIRECT, MULTIGRID = "splu, METIS nested dissection", "CG, Ruge-Stuben AMG"
DIRECT_UP_TO = 3_000
"""Number of nodes up to which the direct solver is used."""
DIRECT_BYTES, DIRECT_GROWTH = 55.0, 1.41
"""Factor and exponent of the memory of the direct solver, see `direct_memory`."""
MEMORY_CAP = 8e9
"""Most memory, bytes, that a direct solve may take."""
MEMORY_SHARE = 0.8
"""Most memory that a direct solve may take, as a share of what is free."""
CG_TOLERANCE, CG_STEPS = 1e-7, 100
"""Sum of the residuals over that of the sources, and number of steps, of conjugate gradients."""
STRENGTH = 0.5
"""Strength of connection in the coarsening of multigrid."""

Solve = Callable[[Array, float], Array]


class Balances:
    """The system sum_j g_ij (p_i - p_j) + tied_i p_i = source_i, kept for many sources.

    Up to 3,000 nodes (`direct_up_to`) it is solved directly. Larger systems are solved by
    conjugate gradients with Ruge-Stuben multigrid (Ruge and Stuben 1987; second pass, strength
    0.5). Multigrid works on the system as it stands, whose near-kernel is the constant that the
    interpolation assumes; scaled to a unit diagonal it needs several times the steps. Where it
    does not converge, the direct solver is used as long as its estimated memory fits. The study
    linear-solver shows what these choices cost.

    Args:
        pair: (K, 2) nodes that the links join.
        conductance: (K,) above 0.
        tied: (n,) conductance to nodes of pressure 0.
        direct_up_to: number of nodes up to which the direct solver is used; None for 3,000.
    """

    def __init__(
        self, pair: Array, conductance: Array, tied: Array, *, direct_up_to: int | None = None
    ) -> None:
        self._unit = float(np.median(conductance)) if len(conductance) else 1.0
        self._matrix = laplacian(pair, conductance / self._unit, tied / self._unit)
        self._direct = len(tied) <= (DIRECT_UP_TO if direct_up_to is None else direct_up_to)
        self._solve: Solve | None = None

    @property
    def method(self) -> str:
        """How the system is solved."""
        return DIRECT if self._direct else MULTIGRID

    def solve(self, source: Array, *, imbalance: float | None = None) -> Array:
        """Pressures (n,) for `source` (n,).

        Multigrid iterates until the imbalances add up to no more than `imbalance`, or without it
        to 1e-7 of the sum of the sources. Both sums are of absolute values. Raises FlowError when
        the system is singular or too large to be solved.
        """
        if not len(source):
            return np.zeros(0)
        if self._solve is None:
            self._solve = (direct if self._direct else multigrid)(self._matrix)
        source = source / self._unit
        within = CG_TOLERANCE * total(source) if imbalance is None else imbalance / self._unit
        pressure = self._solve(source, within)
        if not self._direct and not np.all(np.isfinite(pressure)):
            _check_memory(len(source))
            self._direct, self._solve = True, direct(self._matrix)
            pressure = self._solve(source, within)
        return pressure


def laplacian(pair: Array, conductance: Array, tied: Array) -> sparse.csr_matrix:
    """The matrix (n, n) of `Balances`.

    Links between the same nodes add up; a link from a node to itself has no effect.
    """
    count = len(tied)
    other = pair[:, 0] != pair[:, 1]
    first, second = pair[other].T
    upper = sparse.coo_matrix((conductance[other], (first, second)), shape=(count, count))
    links = (upper + upper.T).tocsr()
    diagonal = tied + np.asarray(links.sum(axis=1)).ravel()
    return (sparse.diags(diagonal) - links).tocsr()


def direct(matrix: sparse.csr_matrix) -> Solve:
    """Direct solver of the system `matrix` (n, n).

    The matrix is scaled to a unit diagonal, ordered by METIS nested dissection (Karypis and Kumar
    1998) and factored by SuperLU in symmetric mode; a solution takes one step of iterative
    refinement. Raises FlowError when the system is singular.
    """
    count = matrix.shape[0]
    diagonal = matrix.diagonal()
    if np.any(diagonal <= 0):
        raise FlowError(
            f"solve of {count} pores failed: {np.sum(diagonal <= 0)} pores have no way out"
        )
    scale = 1.0 / np.sqrt(diagonal)
    scaled = (sparse.diags(scale) @ matrix @ sparse.diags(scale)).tocsr()
    order = _order(scaled)
    try:
        factor = splu(
            scaled[order][:, order].tocsc(),
            permc_spec="NATURAL",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise FlowError(
            f"solve of {count} pores failed: {error}; a group of pores has no way out"
        ) from error

    def solve(source: Array, _: float) -> Array:
        scaled_pressure = np.zeros(count)
        for _ in range(2):
            missing = source * scale - scaled @ scaled_pressure
            scaled_pressure[order] += factor.solve(missing[order])
        return scaled_pressure * scale

    return solve


def _order(matrix: sparse.csr_matrix) -> Array:
    """Order (n,) of the nodes by nested dissection."""
    links = matrix.copy()
    links.setdiag(0.0)
    links.eliminate_zeros()
    if links.nnz == 0:
        return np.arange(links.shape[0])
    adjacency = pymetis.CSRAdjacency(links.indptr, links.indices)
    return np.asarray(pymetis.nested_dissection(adjacency=adjacency)[0])


def multigrid(matrix: sparse.csr_matrix) -> Solve:
    """Conjugate gradients with a symmetric Ruge-Stuben V-cycle as the preconditioner.

    Nodes that are linked are brought close together in memory (Cuthill and McKee 1969, reversed),
    which makes a cycle a sixth faster. The solution is NaN where 100 steps do not suffice.
    Thousands of pores without a link (in a thin slab, or a clogged pack) stay on the coarsest
    level, which is therefore solved as a sparse system.
    """
    order = reverse_cuthill_mckee(matrix, symmetric_mode=True)
    matrix = matrix[order][:, order]
    matrix.sort_indices()
    cycle = ruge_stuben(matrix)

    def solve(source: Array, within: float) -> Array:
        pressure = np.empty(len(source))
        pressure[order] = conjugate_gradients(matrix, source[order], cycle, within=within)
        return pressure

    return solve


def ruge_stuben(matrix: sparse.csr_matrix) -> Callable[[Array], Array]:
    """One symmetric V-cycle of classical multigrid (Ruge and Stuben 1987) as a preconditioner.

    The levels are pyamg's, and the numbers of a cycle are those of its own, which takes several
    times as long (`cycle`) and also computes two norms that conjugate gradients do not need.
    """
    hierarchy = pyamg.ruge_stuben_solver(
        matrix,
        strength=("classical", {"theta": STRENGTH}),
        CF=("RS", {"second_pass": True}),
        presmoother=("gauss_seidel", {"sweep": "forward"}),
        postsmoother=("gauss_seidel", {"sweep": "backward"}),
        max_coarse=10,
        coarse_solver="splu",
    )
    levels = [level_of(level.A, level.P) for level in hierarchy.levels[:-1]]
    last = hierarchy.levels[-1].A

    def cycle(source: Array) -> Array:
        passed = []
        for level in levels:
            solution, missing = level.down(source)
            passed.append((level, solution, source))
            source = missing
        below = np.asarray(hierarchy.coarse_solver(last, source))
        for level, solution, own in reversed(passed):
            level.up(solution, own, below)
            below = solution
        return below

    return cycle


def total(values: Array) -> float:
    """Sum of the absolute values."""
    return float(np.abs(values).sum())


def conjugate_gradients(
    matrix: sparse.csr_matrix,
    source: Array,
    precondition: Callable[[Array], Array],
    *,
    within: float,
    size: Callable[[Array], float] = total,
    steps: int | None = None,
) -> Array:
    """Solution (n,) whose residual is at most `within` (Hestenes and Stiefel 1952).

    The residual is measured by `size`, the sum of its absolute values or a norm. The solution is
    NaN when `steps` steps (None: 100) do not suffice. Dot products are taken without BLAS, whose
    threads would change the last digits and wait for each other.
    """
    solution, missing = np.zeros(len(source)), source.copy()
    along, before = np.zeros(len(source)), 1.0
    for _ in range(steps or CG_STEPS):
        if size(missing) <= within:
            return solution
        better = precondition(missing)
        gain = _dot(missing, better)
        along = better + (gain / before) * along
        turned = matrix @ along
        step = gain / _dot(along, turned)
        solution += step * along
        missing -= step * turned
        before = gain
    return np.full(len(source), np.nan)


def _dot(one: Array, other: Array) -> float:
    return float(np.einsum("i,i", one, other))


def direct_memory(count: int) -> float:
    """Bytes that a direct solve of n = `count` pores takes: 55 n^1.41.

    Measured on packs of 1e4 to 3e5 pores.
    """
    return DIRECT_BYTES * count**DIRECT_GROWTH


def _check_memory(count: int) -> None:
    """Raise FlowError when a direct solve of `count` pores would not fit into memory."""
    wanted, limit = direct_memory(count), min(MEMORY_CAP, MEMORY_SHARE * _free_memory())
    if wanted > limit:
        raise FlowError(
            f"solve of {count} pores: multigrid did not converge in {CG_STEPS} steps and a direct "
            f"solve would take some {wanted / 1e9:.1f} GB of {limit / 1e9:.1f} GB; analyse a "
            "shorter specimen"
        )


def _free_memory() -> float:
    """Bytes that are free now; infinite where the system does not report it."""
    report = Path("/proc/meminfo")
    if report.exists():
        rows = dict(row.split(":") for row in report.read_text().splitlines())
        return 1024.0 * float(rows["MemAvailable"].split()[0])
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return np.inf
