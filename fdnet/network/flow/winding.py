"""Which groups of links carry flow: from plane to plane, or once around the period.

A link between the nodes a and b carries the flux g (p_a - p_b + jump), with its conductance g and
the pressures p. The two planes are one node of pressure 0, and a link from the inlet plane has the
jump 1. Where x is periodic, a link across the period has a jump. A group of links is said to wind
when it has a closed loop whose jumps do not add up to 0. A group that does not wind carries
nothing: pressures can be chosen that cancel all its jumps.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components

from fdnet.spheres.snapshot import Array


def groups(ends: Array, count: int) -> Array:
    """Number (n,) of the connected group of each of `count` nodes, in the order of the nodes.

    `ends` (K, 2) are the nodes that the links join.
    """
    graph = sparse.coo_matrix(
        (np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count)
    )
    return connected_components(graph, directed=False)[1]


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
    group = groups(ends, count)
    height = heights(ends, jump, group)
    left = jump + height[ends[:, 0]] - height[ends[:, 1]]
    winds = np.zeros(count, bool)
    winds[group[ends[left != 0, 0]]] = True
    return group, winds[group]
