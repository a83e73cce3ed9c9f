"""Solvers of the pressures of a network.

One level of a multigrid cycle: both Gauss-Seidel sweeps, and the way to the next level.

The operations are those of pyamg and scipy, in the same order, so the numbers are the same to the
last digit. Called one by one from Python they took most of the time of a cycle, for the levels of
a pack hold a few thousand pores at most.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyamg
import pymetis
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from fdnet.errors import FlowError
from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.spheres.snapshot import Array, one_line

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


# ------------------------------------------------------------------------------------------------
# Mass balances of a network of links: a direct solver, and multigrid for larger networks.
#
# The systems are symmetric and positive definite.


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


# ------------------------------------------------------------------------------------------------
# Which groups of links carry flow: from plane to plane, or once around the period.
#
# A link between the nodes a and b carries the flux g (p_a - p_b + jump), with its conductance g
# and the pressures p. The two planes are one node of pressure 0, and a link from the inlet plane
# has the jump 1. Where x is periodic, a link across the period has a jump. A group of links is
# said to wind when it has a closed loop whose jumps do not add up to 0. A group that does not wind
# carries nothing: pressures can be chosen that cancel all its jumps.


def groups(ends: Array, count: int) -> Array:
    """Number (n,) of the connected group of each of `count` nodes, in the order of the nodes.

    `ends` (K, 2) are the nodes that the links join.
    """
    return winding_groups(ends, np.zeros(len(ends)), count)[0]


def heights(ends: Array, jump: Array, group: Array) -> Array:
    """Pressures (n,) that cancel the jump of every link of a spanning forest: p_b = p_a + jump.

    The forest is made breadth first from the first node of each `group` (n,), in a graph whose
    vertices are the nodes and the links, so that parallel links remain distinct.
    """
    count, links = len(group), len(ends)
    root = count + links
    first = np.unique(group, return_index=True)[1]
    vertex = np.arange(count, root)
    rows = np.concatenate([ends[:, 0], vertex, ends[:, 1], vertex, np.full(len(first), root)])
    columns = np.concatenate([vertex, ends[:, 0], vertex, ends[:, 1], first])
    graph = sparse.csr_matrix(
        (np.ones(len(rows), np.int8), (rows, columns)), shape=(root + 1, root + 1)
    )
    _, before = breadth_first_order(graph, root, directed=True)
    link = before[:count] - count
    inner = link < links
    parent = np.arange(count)
    parent[inner] = before[count + link[inner]]
    rise = np.zeros(count)
    reached = link[inner]
    rise[inner] = jump[reached] * np.where(ends[reached, 1] == np.flatnonzero(inner), 1.0, -1.0)
    while np.any(parent != parent[parent]):
        rise += rise[parent]
        parent = parent[parent]
    return rise


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
# jump through it. Links far more conductive than that are stiff: their pressure difference is
# smaller than a number can hold. Their nodes are contracted into one, and their fluxes follow from
# the balance within the contracted group, where the same is done again.


CONTRASTS = (1e8, 1e6, 1e10)
"""Ratios of conductance between levels of stiffness, in the order in which they are tried."""
STEP = 10.0
"""Factor within which the critical conductance is determined."""
SETTLED = 1e-9
"""A balance of less defect is accepted."""
MOST_SWEEPS = 30


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Balance:
    """Pressures of n nodes and fluxes of K links.

    Attributes:
        pressure: (n,) over the unit of the jumps.
        flux: (K,) from the first to the second end, in units of conductance times jump.
        defect: sum of the imbalances of the nodes and of the errors of the links' own equations,
            over the throughput; it bounds the relative error of the throughput.
        method: how the system was solved.
    """

    pressure: Array
    flux: Array
    defect: float
    method: str

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Stage:
    """The links of one level of stiffness; the nodes that higher levels join are one node.

    Attributes:
        links: (L,) indices of the links.
        label: (n,) number of the contracted node of each node.
        free: (m,) whether the pressure of each contracted node is unknown; else it is 0.
        balances: the system of equations of the free nodes.
    """

    links: Array
    label: Array
    free: Array
    balances: Balances


def balance_links(
    ends: Array, conductance: Array, jump: Array, count: int, *, direct_up_to: int | None = None
) -> Balance:
    """Balance of all nodes, every one of which must be in a group that winds.

    The levels of stiffness differ by a contrast of 1e8. Where links of like conductance fall on
    both sides of that border and the sweeps do not settle, another contrast is tried. The best
    balance is returned, and the caller judges its `defect`.

    Args:
        ends: (K, 2) nodes that the links join.
        conductance: (K,) above 0.
        jump: (K,) of the links.
        count: number of nodes.
        direct_up_to: number of nodes up to which a direct solver is used, see `Balances`.
    """
    tried = []
    for contrast in CONTRASTS:
        level = stiffness(ends, conductance, jump, count, contrast=contrast)
        tried.append(_balance(ends, conductance, jump, (level, count), direct_up_to))
        if tried[-1].defect <= SETTLED or not level.any():
            break
    return min(tried, key=lambda one: one.defect)


def _balance(
    ends: Array,
    conductance: Array,
    jump: Array,
    levels: tuple[Array, int],
    direct_up_to: int | None,
) -> Balance:
    """Balance level by level, repeated for what is left over.

    Left over are the imbalances, and the pressure differences within the contracted groups, which
    the links next to them did not see. Fluxes add up by increments, never as differences of nearly
    equal pressures. `levels` holds the level (K,) of each link and the number of nodes.
    """
    level, count = levels
    stiff = level > 0
    height = (
        heights(ends[stiff], jump[stiff], groups(ends[stiff], count))
        if stiff.any()
        else np.zeros(count)
    )
    drive = jump + _difference(height, ends)
    level = _with_inner_links(ends, level, count)
    parts = [_contracted(ends, level, at, count) for at in range(int(level.max(initial=0)) + 1)]
    stages = [_stage(ends, conductance, part, direct_up_to) for part in parts]
    pressure, flux, defect, allowed = height, np.zeros(len(ends)), np.inf, None
    for _ in range(MOST_SWEEPS):
        step, gain, drive = _sweep(
            stages, ends, conductance, drive, (_net(ends, flux, count), allowed)
        )
        pressure, flux = pressure + step, flux + gain
        before, defect = (
            defect,
            _defect(_net(ends, flux, count), conductance * drive, float(flux @ jump)),
        )
        allowed = 0.3 * SETTLED * abs(float(flux @ jump))
        if defect <= SETTLED or not defect < 0.7 * before:
            break
    return Balance(
        pressure=pressure - pressure[0], flux=flux, defect=defect, method=stages[0].balances.method
    )


def stiffness(
    ends: Array, conductance: Array, jump: Array, count: int, *, contrast: float = CONTRASTS[0]
) -> Array:
    """Level (K,) of stiffness of each link.

    It is 0 up to `contrast` times the critical conductance of the nodes, 1 up to its square times
    that, and so on. The critical conductance of a node is the greatest at which the links that are
    as good or better still join it to a closed loop with a jump (Ambegaokar, Halperin and Langer
    1971); it is determined within a factor of 10. No more than a few times that flows through the
    node per unit of drive, so a link of level 1 takes at most some 1 / contrast of the drive.
    """
    level = np.zeros(len(ends), int)
    if not len(ends):
        return level
    lowest, highest = float(conductance.min()), float(conductance.max())
    if highest <= contrast * lowest:
        return level
    critical, bound = np.zeros(count), highest / contrast
    while True:
        strong = conductance >= bound
        winds = winding_groups(ends[strong], jump[strong], count)[1]
        critical[winds & (critical == 0)] = bound
        if bound <= lowest or np.all(critical > 0):
            break
        bound = max(min(bound / STEP, float(conductance[~strong].max())), lowest)
    ratio = conductance / np.maximum(critical[ends[:, 0]], critical[ends[:, 1]])
    return np.maximum(np.ceil(np.log(ratio) / np.log(contrast)).astype(int) - 1, 0)


def _with_inner_links(ends: Array, level: Array, count: int) -> Array:
    """The levels (K,), raised for links between nodes that higher levels contract into one."""
    level = level.copy()
    for at in range(int(level.max(initial=0))):
        label = groups(ends[level > at], count)
        level[(level == at) & (label[ends[:, 0]] == label[ends[:, 1]])] = at + 1
    return level


def _contracted(ends: Array, level: Array, at: int, count: int) -> tuple[Array, Array]:
    """Links of level `at`, and labels (n,) of the nodes with all higher levels contracted."""
    return np.flatnonzero(level == at), groups(ends[level > at], count)


def _stage(
    ends: Array, conductance: Array, contracted: tuple[Array, Array], direct_up_to: int | None
) -> _Stage:
    """The stage of links and labels as `_contracted` gives them."""
    links, label = contracted
    pair, size = label[ends[links]], int(label.max(initial=-1)) + 1
    free = np.ones(size, bool)
    free[np.unique(groups(pair, size), return_index=True)[1]] = False
    index = np.cumsum(free) - 1
    own = conductance[links]
    tied = np.zeros(int(free.sum()))
    for side in (0, 1):
        held = free[pair[:, side]] & ~free[pair[:, 1 - side]]
        tied += np.bincount(index[pair[held, side]], weights=own[held], minlength=len(tied))
    inner = np.all(free[pair], axis=1)
    balances = Balances(index[pair[inner]], own[inner], tied, direct_up_to=direct_up_to)
    return _Stage(links=links, label=label, free=free, balances=balances)


def _sweep(
    stages: list[_Stage],
    ends: Array,
    conductance: Array,
    drive: Array,
    state: tuple[Array, float | None],
) -> tuple[Array, Array, Array]:
    """Increments of pressure (n,) and flux (K,), and the drive (K,) left for the next sweep.

    The increments balance what drives the links, `drive` (K,), and what the nodes lack. The drive
    that is left is what the lower stages have since set up for the stiffer links. `state` holds
    the net flux (n,) out of each node, and the sum of imbalances that may stay.
    """
    net, allowed = state
    flux, late, steps = np.zeros(len(ends)), np.zeros(len(ends)), []
    for stage in stages:
        own, pushed = conductance[stage.links], drive[stage.links]
        net = net + _net(ends[stage.links], own * pushed, len(net))
        lack = np.bincount(stage.label, weights=-net, minlength=len(stage.free))
        pressure = np.zeros(len(stage.free))
        pressure[stage.free] = stage.balances.solve(lack[stage.free], imbalance=allowed)
        steps.append(pressure[stage.label])
        gain = own * _difference(steps[-1], ends[stage.links])
        net = net + _net(ends[stage.links], gain, len(net))
        flux[stage.links] = gain + own * pushed
    for at, stage in enumerate(stages):
        for step in steps[at + 1 :]:
            late[stage.links] += _difference(step, ends[stage.links])
    return np.sum(steps, axis=0), flux, late


def _difference(pressure: Array, ends: Array) -> Array:
    """Pressure difference (K,) along each link."""
    return pressure[ends[:, 0]] - pressure[ends[:, 1]]


def _net(ends: Array, flux: Array, count: int) -> Array:
    """Net flux (n,) out of each node."""
    return np.bincount(ends[:, 0], weights=flux, minlength=count) - np.bincount(
        ends[:, 1], weights=flux, minlength=count
    )


def _defect(net: Array, late: Array, throughput: float) -> float:
    """Imbalances of nodes `net` (n,) and of links `late` (K,) over the throughput."""
    off = float(np.abs(net).sum() + np.abs(late).sum())
    return off / throughput if throughput > 0 else np.inf
