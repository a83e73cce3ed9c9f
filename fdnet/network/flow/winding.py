"""Which groups of links lead round: from plane to plane, or once around the period.

A link (a, b) carries g (p_a - p_b + jump). Planes are one node of pressure 0; a link from the inlet plane has jump 1.
A group whose jumps can be taken up by the pressures alone carries nothing; one that has a closed way with a jump winds.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components

from fdnet.spheres.snapshot import Array


def groups(ends: Array, count: int) -> Array:
    """Group (n,) of each node, numbered in the order of the nodes, by links `ends` (K, 2)."""
    graph = sparse.coo_matrix(
        (np.ones(len(ends), np.int8), (ends[:, 0], ends[:, 1])), shape=(count, count)
    )
    return connected_components(graph, directed=False)[1]


def heights(ends: Array, jump: Array, group: Array) -> Array:
    """Pressures (n,) that take up the jump of every link of a spanning forest: height_b = height_a + jump.

    The forest is found breadth first in the graph of nodes and links, both as vertices, from the first node of each
    `group` (n,), so that parallel links stay apart.
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
    """Group (n,) of each node, and whether its group winds (n,)."""
    group = groups(ends, count)
    height = heights(ends, jump, group)
    left = jump + height[ends[:, 0]] - height[ends[:, 1]]
    winds = np.zeros(count, bool)
    winds[group[ends[left != 0, 0]]] = True
    return group, winds[group]
