"""Pressures and fluxes of a network of links: mass balances, direct or by multigrid.

Systems are symmetric and positive definite.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pyamg
import pymetis
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from fdnet.errors import FlowError
from fdnet.network.compiled import compiled
from fdnet.spheres.snapshot import Array, frozen

DIRECT, MULTIGRID = "splu, METIS nested dissection", "CG, Ruge-Stuben AMG"
DIRECT_UP_TO = 3_000  # Number of nodes up to which the direct solver is used
MOST_DIRECT = 600_000
"""Nodes beyond which a direct solve takes more than 8 GB: some 55 n^1.41 bytes, measured on packs
of 1e4 to 3e5 pores."""
CG_TOLERANCE, CG_STEPS = 1e-7, 100
"""Sum of the residuals over that of the sources, and number of steps, of conjugate gradients."""
STRENGTH = 0.5  # Strength of connection in the coarsening of multigrid

Solve = Callable[[Array, float], Array]


class Balances:
    """The system sum_j g_ij (p_i - p_j) + tied_i p_i = source_i, kept for many sources.

    Up to 3,000 nodes it is solved directly, larger systems by conjugate gradients with Ruge-Stuben
    multigrid (Ruge and Stuben 1987; second pass, strength 0.5). Multigrid works on the system as
    it stands, whose near-kernel is the constant that the interpolation assumes; scaled to a unit
    diagonal it needs several times the steps. Where it does not converge, the direct solver takes
    up to `MOST_DIRECT` nodes. The study linear-solver shows what these choices cost.

    Args:
        pair: (K, 2) nodes that the links join.
        conductance: (K,) above 0.
        tied: (n,) conductance to nodes of pressure 0.
    """

    def __init__(self, pair: Array, conductance: Array, tied: Array) -> None:
        self._unit = float(np.median(conductance)) if len(conductance) else 1.0
        self._matrix = laplacian(pair, conductance / self._unit, tied / self._unit)
        self._direct = len(tied) <= DIRECT_UP_TO
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
        source = source / self._unit
        within = CG_TOLERANCE * _total(source) if imbalance is None else imbalance / self._unit
        try:
            if self._solve is None:
                self._solve = (direct if self._direct else multigrid)(self._matrix)
            pressure = self._solve(source, within)
            if not (self._direct or np.all(np.isfinite(pressure))):
                if len(source) > MOST_DIRECT:
                    raise FlowError(
                        f"solve of {len(source)} pores: multigrid did not converge in {CG_STEPS} "
                        f"steps, and a direct solve takes at most {MOST_DIRECT} pores; analyse a "
                        "shorter specimen"
                    )
                self._direct, self._solve = True, direct(self._matrix)
                pressure = self._solve(source, within)
        except (RuntimeError, ZeroDivisionError) as error:  # of multigrid, which has no check
            raise FlowError(
                f"solve of {len(source)} pores failed: {error}; a group of pores has no way out"
            ) from error
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
    """Direct solver of the system `matrix` (n, n), scaled to a unit diagonal (`factored`).

    Raises RuntimeError when the system is singular.
    """
    diagonal = matrix.diagonal()
    if np.any(diagonal <= 0):
        raise RuntimeError(f"{np.sum(diagonal <= 0)} pores have no link")
    scale = 1.0 / np.sqrt(diagonal)
    scaled = (sparse.diags(scale) @ matrix @ sparse.diags(scale)).tocsr()
    solve = factored(scaled, dissected(scaled.copy()))
    return lambda source, _: solve(source * scale) * scale


def factored(matrix: sparse.csr_matrix, order: Array) -> Callable[[Array], Array]:
    """Solves systems with `matrix` (n, n) by SuperLU in symmetric mode, eliminated in `order`.

    With one step of iterative refinement. Raises RuntimeError where the matrix is singular.
    """
    factor = splu(
        matrix[order][:, order].tocsc(),
        permc_spec="NATURAL",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )

    def solve(source: Array) -> Array:
        solution = np.zeros_like(source)
        for _ in range(2):
            solution[order] += factor.solve((source - matrix @ solution)[order])
        return solution

    return solve


def dissected(links: sparse.csr_matrix) -> Array:
    """Order (n,) of the nodes of `links` (n, n) by METIS dissection (Karypis and Kumar 1998)."""
    links.setdiag(0.0)
    links.eliminate_zeros()
    return _dissection(links.indptr.tobytes(), links.indices.tobytes(), links.indices.dtype.str)


@lru_cache(maxsize=1)
def _dissection(first: bytes, other: bytes, kind: str) -> Array:
    """That of the last links is kept: a flow is solved again and again on the same ones."""
    first_of, nodes = np.frombuffer(first, kind), np.frombuffer(other, kind)
    if not len(nodes):
        return np.arange(len(first_of) - 1)
    adjacency = pymetis.CSRAdjacency(first_of, nodes)
    return frozen(np.asarray(pymetis.nested_dissection(adjacency=adjacency)[0]))


def multigrid(matrix: sparse.csr_matrix) -> Solve:
    """Conjugate gradients with a symmetric Ruge-Stuben V-cycle as the preconditioner.

    Linked nodes stand close together in memory (Cuthill and McKee 1969, reversed): a sixth faster.
    The solution is NaN where 100 steps do not suffice.
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

    That of pyamg itself takes norms beside, by BLAS on all cores, which nobody reads.
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

    def cycle(source: Array, level: int = 0) -> Array:
        here, solution = hierarchy.levels[level], np.zeros_like(source)
        if level == len(hierarchy.levels) - 1:
            return np.asarray(hierarchy.coarse_solver(here.A, source))
        here.presmoother(here.A, solution, source)
        solution += here.P @ cycle(here.R @ (source - here.A @ solution), level + 1)
        here.postsmoother(here.A, solution, source)
        return solution

    return cycle


def _total(values: Array) -> float:
    """Sum of the absolute values."""
    return float(np.abs(values).sum())


def conjugate_gradients(
    matrix: sparse.csr_matrix,
    source: Array,
    precondition: Callable[[Array], Array],
    *,
    within: float,
    size: Callable[[Array], float] = _total,
    steps: int | None = None,
) -> Array:
    """Solution (n,) whose residual is at most `within` (Hestenes and Stiefel 1952).

    The residual is measured by `size`. The solution is NaN when `steps` steps (None: 100) do not
    suffice. Dot products go without BLAS, whose threads would change the last digits.
    """
    solution, missing = np.zeros(len(source)), source.copy()
    along, before = np.zeros(len(source)), 1.0
    for _ in range(steps or CG_STEPS):
        if size(missing) <= within:
            return solution
        better = precondition(missing)
        gain = float(np.einsum("i,i", missing, better))
        along = better + (gain / before) * along
        turned = matrix @ along
        step = gain / float(np.einsum("i,i", along, turned))
        solution += step * along
        missing -= step * turned
        before = gain
    return np.full(len(source), np.nan)


# ------------------------------------------------------------------------------------------------
# Which groups of links carry flow: from plane to plane, or once around the period.
#
# A link between the nodes a and b carries the flux g (p_a - p_b + jump), with its conductance g
# and the pressures p. The two planes are one node of pressure 0, and a link from the inlet plane
# has the jump 1. Where x is periodic, a link across the period has a jump. A group of links is
# said to wind when it has a closed loop whose jumps do not add up to 0. A group that does not wind
# carries nothing: pressures can be chosen that cancel all its jumps.


def groups(ends: Array, count: int) -> Array:
    """Connected group (n,) of each of `count` nodes that links between `ends` (K, 2) join."""
    return winding_groups(ends, np.zeros(len(ends)), count)[0]


def winding_groups(ends: Array, jump: Array, count: int) -> tuple[Array, Array]:
    """Connected group (n,) of each of `count` nodes, and whether that group winds (n,)."""
    group, winds = _joined(
        np.ascontiguousarray(ends, np.int64), np.ascontiguousarray(jump, float), count
    )
    return group, winds[group]


@compiled
def _joined(ends: Array, jump: Array, count: int) -> tuple[Array, Array]:
    """Group (n,) of each node, and whether each group (G,) winds.

    Every node knows another of its group and the pressure over it; links join two trees of such
    nodes or close a loop (Tarjan 1975, J. ACM 22, 215). The root of a tree is its first node.
    """
    parent, rise, winding = np.arange(count), np.zeros(count), np.zeros(count, np.bool_)
    for k in range(len(ends)):
        one, other = ends[k, 0], ends[k, 1]
        first, second = _root(parent, rise, one), _root(parent, rise, other)
        over = rise[one] + jump[k] - rise[other]
        if first == second:
            winding[first] = winding[first] or over != 0.0
            continue
        if first > second:
            first, second, over = second, first, -over
        parent[second], rise[second] = first, over
        winding[first] = winding[first] or winding[second]
    group, winds, roots = np.empty(count, np.int64), np.zeros(count, np.bool_), 0
    for node in range(count):
        root = _root(parent, rise, node)
        if root == node:
            group[node], winds[roots] = roots, winding[node]
            roots += 1
        else:
            group[node] = group[root]
    return group, winds


@compiled
def _root(parent: Array, rise: Array, node: int) -> int:
    """The root of a node, which afterwards knows it directly, as do all on the way."""
    root, total = node, 0.0
    while parent[root] != root:
        total += rise[root]
        root = parent[root]
    while node != root:
        step, after = rise[node], parent[node]
        parent[node], rise[node] = root, total
        total, node = total - step, after
    return root


# ------------------------------------------------------------------------------------------------
# Pressures and fluxes of links whose conductances differ by any number of decades.
#
# A link between the nodes a and b carries the flux g (p_a - p_b + jump); jumps are whole numbers.
# Node 0 and the first node of every further group have the pressure 0.
#
# The critical conductance of a node is that of the weakest link in the best closed loop with a
# jump through it. A link that is far more conductive takes next to none of the drive, and its
# pressure difference is smaller than a number can hold. So it is taken as `CONTRAST` times the
# critical conductance. The throughput changes by some 1 / CONTRAST; where such links lie side by
# side, the share of each in their flux follows the conductance that they are taken as.


CONTRAST = 1e14  # Largest conductance of a link over the critical one of its nodes
STEP = 10.0  # Factor within which the critical conductance is determined
SETTLED = 1e-9  # A balance of less defect is accepted
MOST_SWEEPS = 30


class Balance(NamedTuple):
    """Pressures of n nodes and fluxes of K links."""

    pressure: Array  # (n,) over the unit of the jumps
    flux: Array  # (K,) from the first to the second end, in units of conductance times jump
    drop: Array  # (K,) of the pressure along the links, in units of the jumps
    defect: float
    """Sum of the imbalances of the nodes over the throughput; it bounds its relative error."""
    method: str  # how the system was solved


def balance_links(
    ends: Array, conductance: Array, jump: Array, count: int, *, near: Balance | None = None
) -> Balance:
    """Balance of `count` nodes, every one of which must be in a group that winds.

    Links have the `ends` (K, 2), the `conductance` (K,) above 0 and the `jump` (K,). What the
    fluxes lack in balance is solved for again, until the defect is `SETTLED`. Fluxes add up by
    increments, never as differences of nearly equal pressures. The caller judges the defect.
    The solve starts from `near`, the balance of the same links with other conductances.
    """
    conductance = held_conductance(ends, conductance, jump, count)
    free = np.ones(count, bool)
    free[np.unique(groups(ends, count), return_index=True)[1]] = False
    index, tied = np.cumsum(free) - 1, np.zeros(int(free.sum()))
    for side in (0, 1):
        held = free[ends[:, side]] & ~free[ends[:, 1 - side]]
        tied += np.bincount(index[ends[held, side]], conductance[held], len(tied))
    inner = np.all(free[ends], axis=1)
    balances = Balances(index[ends[inner]], conductance[inner], tied)
    pressure, flux, defect, allowed = np.zeros(count), conductance * jump, np.inf, None
    if near is not None:
        pressure, flux = near.pressure, conductance * near.drop
        allowed = 0.3 * SETTLED * abs(float(flux @ jump))
    for _ in range(MOST_SWEEPS):
        step, before = np.zeros(count), defect
        step[free] = balances.solve(-_net(ends, flux, count)[free], imbalance=allowed)
        pressure = pressure + step
        flux = flux + conductance * (step[ends[:, 0]] - step[ends[:, 1]])
        throughput = float(flux @ jump)
        defect = _total(_net(ends, flux, count)) / throughput if throughput > 0 else np.inf
        allowed = 0.3 * SETTLED * abs(throughput)
        if defect <= SETTLED or not defect < 0.7 * before:
            break
    return Balance(pressure, flux, flux / conductance, defect, balances.method)


def held_conductance(ends: Array, conductance: Array, jump: Array, count: int) -> Array:
    """The conductance (K,) of links, at most `CONTRAST` times the critical one of their nodes.

    The critical conductance of a node is the greatest at which the links that are as good or
    better still join it to a closed loop with a jump (Ambegaokar, Halperin and Langer 1971); it is
    determined within a factor of 10.
    """
    lowest, highest = float(conductance.min()), float(conductance.max())
    if highest <= CONTRAST * lowest:
        return conductance
    critical, bound = np.zeros(count), highest / CONTRAST
    while True:
        strong = conductance >= bound
        winds = winding_groups(ends[strong], jump[strong], count)[1]
        critical[winds & (critical == 0)] = bound
        if bound <= lowest or np.all(critical > 0):
            break
        bound = max(min(bound / STEP, float(conductance[~strong].max())), lowest)
    return np.minimum(conductance, CONTRAST * critical[ends].max(axis=1))


def _net(ends: Array, flux: Array, count: int) -> Array:
    """Net flux (n,) out of each node."""
    return np.bincount(ends[:, 0], weights=flux, minlength=count) - np.bincount(
        ends[:, 1], weights=flux, minlength=count
    )
