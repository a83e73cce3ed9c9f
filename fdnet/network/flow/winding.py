"""Which groups of links carry flow: from plane to plane, or once around the period.

A link between the nodes a and b carries the flux g (p_a - p_b + jump), with its conductance g and
the pressures p. The two planes are one node of pressure 0, and a link from the inlet plane has the
jump 1. Where x is periodic, a link across the period has a jump. A group of links is said to wind
when it has a closed loop whose jumps do not add up to 0. A group that does not wind carries
nothing: pressures can be chosen that cancel all its jumps.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from fdnet.network.compiled import compiled
from fdnet.spheres.snapshot import Array


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
