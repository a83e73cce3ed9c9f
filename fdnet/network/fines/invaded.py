"""Where the fines ended: how many invaded, how deep, and the cake before the formation face."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fdnet.spheres.contacts import touching_pairs
from fdnet.spheres.snapshot import Kind, Snapshot

CONTACT_GAP = 0.01
"""Spheres this far apart, in diameters of the smaller one, touch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Invaded:
    """Fines centred in the box, and the cake. The formation face is the low x face, x = 0.

    Attributes:
        count: number of these fines.
        volume: m3, of whole spheres.
        depth: m, of the deepest; 0 without fines.
        depth_p95: m, above which 95 % of them lie; 0 without fines.
        cake_thickness: m, of the fines upstream of the face that touch the pack.
    """

    count: int
    volume: float
    depth: float
    depth_p95: float
    cake_thickness: float


def measure_invaded(spheres: Snapshot, *, periodic: Sequence[bool]) -> Invaded:
    """Invasion by the fines of `spheres`; depth is measured from the low x face of the box.

    `periodic` says whether the sides x, y and z are periodic.
    """
    fines = spheres.fines()
    low, high = spheres.box[0]
    within = (fines.position[:, 0] >= low) & (fines.position[:, 0] < high)
    depth = fines.position[within, 0] - low
    return Invaded(
        count=int(within.sum()),
        volume=float(4.0 / 3.0 * np.pi * np.sum(fines.radius[within] ** 3)),
        depth=float(depth.max(initial=0.0)),
        depth_p95=float(np.quantile(depth, 0.95)) if len(depth) else 0.0,
        cake_thickness=_cake_thickness(spheres, fines, periodic),
    )


def _cake_thickness(spheres: Snapshot, fines: Snapshot, periodic: Sequence[bool]) -> float:
    """How far upstream of the face, m, the cake reaches."""
    low = float(spheres.box[0, 0])
    if not np.any(fines.position[:, 0] < low):
        return 0.0
    cake = cake_of(spheres, periodic)
    front = cake.position[:, 0] - cake.radius
    return float(max(low - front.min(initial=low), 0.0))


def cake_of(spheres: Snapshot, periodic: Sequence[bool]) -> Snapshot:
    """The fines upstream of the face that touch the pack, maybe by other fines.

    Contact is a gap of at most 1 % of the smaller diameter. The pack is the grains and the fines
    centred inside the box.
    """
    low = float(spheres.box[0, 0])
    reach = float(np.max(spheres.radius)) * (2.0 + 4.0 * CONTACT_GAP)
    everything = spheres.where(spheres.position[:, 0] < low + reach)
    upstream = (everything.position[:, 0] < low) & (everything.kind == Kind.FINE)
    around = (False, bool(periodic[1]), bool(periodic[2]))
    pair, _ = touching_pairs(everything, around, gap=CONTACT_GAP)
    # all spheres of the pack are one group: tie them to an extra node
    count = len(everything)
    pack = np.flatnonzero(~upstream)
    rows = np.concatenate([pair[:, 0], pack])
    columns = np.concatenate([pair[:, 1], np.full(len(pack), count)])
    graph = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count + 1, count + 1))
    _, group = connected_components(graph, directed=False)
    return everything.where(upstream & (group[:-1] == group[-1]))
