"""Which spheres touch: pairs, overlaps, and the largest of them."""

from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from fdnet.spheres.snapshot import Array, Kind, Snapshot

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_ROUNDING = 1e-6
"""Gap over the smaller diameter below which two spheres may touch, to LIGGGHTS's rounding."""


def touching_pairs(
    spheres: Snapshot, periodic: tuple[bool, bool, bool], *, gap: float = 0.0
) -> tuple[Array, Array]:
    """Pairs (K, 2) of spheres that touch, and their overlaps (K,) m; a negative one is a gap.

    Two spheres touch when they are nearer than `gap` times the smaller diameter. Spheres are
    searched in two classes of size, so that a few large ones do not widen the search of all.
    """
    from scipy.spatial import cKDTree

    radius = spheres.radius
    if len(radius) == 0:
        return np.empty((0, 2), int), np.empty(0)
    period = np.where(periodic, spheres.box[:, 1] - spheres.box[:, 0], 0.0)
    position = spheres.position - spheres.box[:, 0]
    position = np.where(period > 0, np.mod(position, np.where(period > 0, period, 1.0)), position)
    # rounding may leave a wrapped place at the period itself, which the search tree refuses
    position = np.where((period > 0) & (position >= period), 0.0, position)
    small = radius <= 0.5 * radius.max()
    groups = [group for group in (np.flatnonzero(small), np.flatnonzero(~small)) if len(group)]
    trees = [cKDTree(position[group], boxsize=period) for group in groups]
    touching = [
        _pairs((trees[i], trees[j]), (groups[i], groups[j]), radius, gap)
        for i in range(len(groups))
        for j in range(i, len(groups))
    ]
    return np.concatenate([pairs for pairs, _ in touching]), np.concatenate(
        [overlap for _, overlap in touching]
    )


def _pairs(
    trees: "tuple[cKDTree, cKDTree]", groups: tuple[Array, Array], radius: Array, gap: float
) -> tuple[Array, Array]:
    first, second = groups
    reach = radius[first].max() + radius[second].max()
    reach += 2 * gap * min(radius[first].max(), radius[second].max())
    near = trees[0].sparse_distance_matrix(trees[1], reach, output_type="coo_matrix")
    pairs = np.column_stack([first[near.row], second[near.col]])
    overlap = radius[pairs].sum(axis=1) - near.data
    limit = -2 * gap * radius[pairs].min(axis=1)
    keep = (overlap > limit) & ((pairs[:, 0] < pairs[:, 1]) | (trees[0] is not trees[1]))
    return pairs[keep], overlap[keep]


def groups_apart(spheres: Snapshot, periodic: tuple[bool, bool, bool]) -> Array:
    """The group (N,) of each sphere, from 1; no two spheres of a group touch.

    Greedy colouring of the graph of contacts, those with most contacts first (Welsh and Powell
    1967). It takes at most one group more than a sphere has contacts.
    """
    pairs, _ = touching_pairs(spheres, periodic, gap=_ROUNDING)
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    starts = np.searchsorted(ends[:, 0], np.arange(len(spheres) + 1))
    group = np.zeros(len(spheres), int)
    for sphere in np.argsort(-np.diff(starts), kind="stable"):
        taken = set(group[ends[starts[sphere] : starts[sphere + 1], 1]].tolist())
        group[sphere] = next(number for number in count(1) if number not in taken)
    return group


def max_overlap(
    spheres: Snapshot, periodic: tuple[bool, bool, bool], *, only_fines: bool = False
) -> float:
    """Largest overlap of two spheres over the smaller one's diameter; 0 if none touch.

    `only_fines` leaves out pairs of grains.
    """
    pairs, overlap = touching_pairs(spheres, periodic)
    if only_fines:
        fine = np.any(spheres.kind[pairs] == Kind.FINE, axis=1)
        pairs, overlap = pairs[fine], overlap[fine]
    if len(pairs) == 0:
        return 0.0
    return float(np.max(overlap / (2 * np.min(spheres.radius[pairs], axis=1))))
