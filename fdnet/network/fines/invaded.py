"""Where the fines ended: how many invaded, how deep, and the cake before the formation face (x = 0)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fdnet.spheres.images import make_images
from fdnet.spheres.snapshot import Array, Kind, Snapshot

CONTACT_GAP = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Invaded:
    """Fines centred in the box: `count`, `volume` m3 (whole spheres), `depth` m of the deepest, `depth_p95` m above
    which 95 % of them lie (0 without); `cake_thickness` m upstream of x = 0."""

    count: int
    volume: float
    depth: float
    depth_p95: float
    cake_thickness: float


def measure_invaded(spheres: Snapshot, *, periodic: Sequence[bool]) -> Invaded:
    """Invasion by the fines of `spheres`; depth is measured from the low x face of the box."""
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
    """How far upstream of the face the fines reach that touch the pack, directly or through other fines.

    Contact: gap at most 1 % of the smaller diameter. The pack: grains, and fines centred inside the box.
    """
    low = float(spheres.box[0, 0])
    if not np.any(fines.position[:, 0] < low):
        return 0.0
    reach = float(np.max(spheres.radius)) * (2.0 + 4.0 * CONTACT_GAP)
    everything = spheres.where(spheres.position[:, 0] < low + reach)
    upstream = (everything.position[:, 0] < low) & (everything.kind == Kind.FINE)
    pair = _contacts(everything, upstream, (False, bool(periodic[1]), bool(periodic[2])))
    # all spheres of the pack are one group: tie them to an extra node
    count = len(everything)
    pack = np.flatnonzero(~upstream)
    rows, columns = (
        np.concatenate([pair[:, 0], pack]),
        np.concatenate([pair[:, 1], np.full(len(pack), count)]),
    )
    graph = sparse.coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count + 1, count + 1))
    _, group = connected_components(graph, directed=False)
    cake = upstream & (group[:-1] == group[-1])
    front = everything.position[cake, 0] - everything.radius[cake]
    return float(max(low - front.min(initial=low), 0.0))


def _contacts(spheres: Snapshot, upstream: Array, periodic: tuple[bool, ...]) -> Array:
    """Pairs (K, 2) in contact of which the first is upstream."""
    largest = float(spheres.radius[upstream].max()) * (1.0 + 2.0 * CONTACT_GAP)
    margin = np.where(periodic, largest + float(spheres.radius.max()), np.nan)
    images = make_images(spheres.position, spheres.box, periodic=periodic, margin=margin, hair=0.0)
    fine = spheres.kind[images.owner] == Kind.FINE
    found = []
    source = np.flatnonzero(upstream[images.owner] & np.all(images.shift == 0, axis=1))
    tree = cKDTree(images.position[source])
    # fines and grains are searched apart: their reaches differ by much
    for group in (np.flatnonzero(fine), np.flatnonzero(~fine)):
        if not len(group):
            continue
        reach = largest + float(spheres.radius[images.owner[group]].max())
        near = tree.sparse_distance_matrix(
            cKDTree(images.position[group]), reach, output_type="coo_matrix"
        )
        first, second = images.owner[source[near.row]], images.owner[group[near.col]]
        radius = spheres.radius[first], spheres.radius[second]
        touching = near.data <= radius[0] + radius[1] + CONTACT_GAP * 2.0 * np.minimum(*radius)
        found.append(np.stack([first, second], axis=1)[touching])
    return np.concatenate(found)
