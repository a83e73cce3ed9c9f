"""Grains at the mirrored faces of a box: which reach in, and what stands for those centred on or beyond a face."""

from dataclasses import replace

import numpy as np

from fdnet.network.delaunay import ON_FACE_HAIR
from fdnet.snapshot import Array, Snapshot


def reaching(grains: Snapshot, periodic: tuple[bool, ...]) -> Array:
    """Indices of the grains whose sphere reaches into the box."""
    beyond = np.maximum(grains.box[:, 0] - grains.position, grains.position - grains.box[:, 1])
    return np.flatnonzero(np.all((beyond < grains.radius[:, None]) | np.array(periodic), axis=1))


def onto_walls(grains: Snapshot, periodic: tuple[bool, ...]) -> tuple[Snapshot, int]:
    """Grains with every centre inside or on the mirrored faces, and how many were centred beyond one.

    Of a grain centred beyond a face only a cap is inside; a half sphere of the cap's volume, centred on the face,
    stands for it: the specimen stays its own mirror image and keeps its void. Centres within a hair of a face
    are put on it.
    """
    hair = ON_FACE_HAIR * float(grains.radius.mean()) if len(grains) else 0.0
    position, radius = grains.position.copy(), grains.radius.copy()
    moved = np.zeros(len(grains), bool)
    for axis in np.flatnonzero(~np.array(periodic)):
        low, high = grains.box[axis]
        beyond = np.maximum(low - position[:, axis], position[:, axis] - high)
        outside = beyond > hair
        height = np.where(outside, radius - beyond, radius)
        # half sphere 2 pi r^3 / 3 against cap pi h^2 (3 R - h) / 3
        radius = np.where(outside, np.cbrt(0.5 * height**2 * (3.0 * radius - height)), radius)
        near = beyond > -hair
        middle = 0.5 * (low + high)
        position[near, axis] = np.where(position[near, axis] < middle, low, high)
        moved |= outside
    return replace(grains, position=position, radius=radius), int(moved.sum())
