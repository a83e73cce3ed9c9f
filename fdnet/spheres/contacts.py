"""Which spheres touch, by how much they overlap, and which lie inside others."""

from collections.abc import Iterator
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from fdnet.spheres.images import neighbour_tree
from fdnet.spheres.snapshot import Array, Kind, Snapshot

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_ROUNDING = 1e-6
"""Gap over the smaller diameter below which two spheres may touch, to LIGGGHTS's rounding."""
_OVERLAP_WARNING = 0.03
"""Overlap over a diameter above which it is reported."""
_INSIDE_ROUNDING = 1e-3
"""Part of its radius by which a sphere may reach out of another one and still lie inside of it."""


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
    share = overlap / (2 * np.min(spheres.radius[pairs], axis=1))
    return float(max(share.max(initial=0.0), _own_images(spheres, periodic, only_fines)))


def _own_images(spheres: Snapshot, periodic: tuple[bool, bool, bool], only_fines: bool) -> float:
    """Overlap of the largest sphere with its own image over its diameter, as in a unit cell."""
    side = float(np.min(np.ptp(spheres.box, axis=1), where=periodic, initial=np.inf))
    wide = 2.0 * spheres.radius[(spheres.kind == Kind.FINE) | (not only_fines)]
    return float(max(1.0 - side / wide.max(initial=0.0), 0.0)) if len(wide) else 0.0


def overlap_doubts(grains: float, fines: float = 0.0) -> Iterator[str]:
    """Warnings on the largest overlaps of grains and of fines, as shares of a diameter."""
    for name, what, share in (("grains", "pack", grains), ("fines", "deposit", fines)):
        if share > _OVERLAP_WARNING:
            yield (
                f"{name} overlap by up to {100 * share:.1f} % of a diameter: the {what} is denser "
                "than rigid spheres get"
            )


def inside_others(
    spheres: Snapshot, periodic: tuple[bool, bool, bool]
) -> tuple[Array, Array, Array]:
    """Which spheres (N,) lie wholly inside another one, mostly, or with their centre only.

    The first add nothing to the solid. They may reach out by a thousandth of their radius, so that
    spheres that coincide or touch from within are among them but for the rounding of a file. The
    one of two that coincide is kept that comes first, a grain before a fine. The second have more
    than half of their surface inside another sphere: d2 < R2 - r2 for a distance d of the centres.
    Of two equal spheres with their centres in each other one is counted.
    """
    radius, count = spheres.radius, len(spheres)
    wholly, mostly, centred = np.zeros((3, count), bool)
    if count < 2:
        return wholly, mostly, centred
    tree = neighbour_tree(spheres.position, spheres.box, periodic=periodic)
    # among rigid spheres none has the centre of another one inside
    hosts = np.flatnonzero(tree.query_ball_point(tree.data, radius, return_length=True) > 1)
    guests = tree.query_ball_point(tree.data[hosts], radius[hosts])
    host = np.repeat(hosts, [len(one) for one in guests])
    guest = np.array([number for one in guests for number in one], int)
    rank = np.empty(count, int)
    rank[np.lexsort((np.arange(count), spheres.kind, -radius))] = np.arange(count)
    pair = np.flatnonzero(rank[host] < rank[guest])
    pair = pair[np.argsort(rank[host[pair]], kind="stable")]
    host, guest = host[pair], guest[pair]
    apart = spheres.position[host] - spheres.position[guest]
    side = np.ptp(spheres.box, axis=1)
    distance = np.linalg.norm(apart - np.where(periodic, np.rint(apart / side) * side, 0), axis=1)
    holds = distance <= radius[host] - (1 - _INSIDE_ROUNDING) * radius[guest]
    for one, other in zip(host[holds], guest[holds], strict=True):
        wholly[other] |= not wholly[one]
    more = distance**2 < radius[host] ** 2 - radius[guest] ** 2
    mostly[guest[more & ~wholly[host]]] = True
    centred[guest[~wholly[host]]] = True
    return wholly, mostly & ~wholly, centred & ~mostly & ~wholly
