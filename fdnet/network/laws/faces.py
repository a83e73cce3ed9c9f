"""Faces: what two polyhedra share, one throat or the several into which it is split."""

import numpy as np

from fdnet.network.network import Network
from fdnet.spheres.images import packed_shift
from fdnet.spheres.snapshot import Array


def over_faces(network: Network, values: Array) -> Array:
    """Sums (T, 2) of `values` (T, 2), by side, over the throats of the same face.

    A face with four corners or more, as that between two prisms at a wall, is split into triangles
    in one of many ways. What is summed over the face does not depend on the way. Throats within a
    polyhedron, and all whose facet is a face, keep their values.
    """
    group = network.pore_group[network.throat_pores]
    several = np.bincount(network.pore_group)[group].max(axis=1, initial=0) > 1
    there = packed_shift(network.throat_shift)
    here = int(packed_shift(np.zeros(3, int)))
    split = np.flatnonzero(several & ((group[:, 0] != group[:, 1]) | (there != here)))
    # the same face may be written from either side
    turned = (group[split, 0] > group[split, 1]) | (
        (group[split, 0] == group[split, 1]) & (there[split] < here)
    )
    shift = packed_shift(np.where(turned[:, None], -1, 1) * network.throat_shift[split])
    rows = np.column_stack([np.sort(group[split], axis=1), shift])
    face = np.unique(rows, axis=0, return_inverse=True)[1].ravel()
    side = np.where(turned[:, None], [1, 0], [0, 1])
    slot = 2 * face[:, None] + side
    summed = np.array(values, float)
    total = np.bincount(slot.ravel(), weights=summed[split].ravel())
    summed[split] = total[slot] if len(split) else summed[split]
    return summed
