"""Grains at the mirrored faces of a box: which reach in, and what stands for those centred on or beyond a face."""

from dataclasses import replace

import numpy as np

from fdnet.network.tessellation.delaunay import ON_FACE_HAIR
from fdnet.spheres.snapshot import Array, Snapshot

INSET = 1e-4
ITERATIONS = 20


def reaching(grains: Snapshot, periodic: tuple[bool, ...]) -> Array:
    """Indices of the grains whose sphere reaches into the box."""
    beyond = np.maximum(grains.box[:, 0] - grains.position, grains.position - grains.box[:, 1])
    return np.flatnonzero(np.all((beyond < grains.radius[:, None]) | np.array(periodic), axis=1))


def onto_walls(grains: Snapshot, periodic: tuple[bool, ...]) -> tuple[Snapshot, int]:
    """Grains with every centre inside or on the mirrored faces, and how many were centred beyond one.

    Of a grain centred beyond a face only a cap is inside; a half sphere of the cap's volume, centred on the face,
    stands for it: the specimen stays its own mirror image and keeps its void. Centres within a hair of a face
    are put on it; at the x faces 1e-4 mean radii inside it, so that facets between three of them are throats that end
    in pores on the face, where the pressure is held.
    """
    scale = float(grains.radius.mean())
    hair = ON_FACE_HAIR * scale
    position, radius = grains.position.copy(), grains.radius.copy()
    moved = np.zeros(len(grains), bool)
    for axis in np.flatnonzero(~np.array(periodic)):
        low, high = grains.box[axis]
        beyond = np.maximum(low - position[:, axis], position[:, axis] - high)
        outside = beyond > hair
        height = np.where(outside, radius - beyond, radius)
        # half sphere 2 pi r^3 / 3 against cap pi h^2 (3 R - h) / 3
        depth = INSET * scale if axis == 0 else 0.0
        radius = np.where(outside, _same_cap(radius, height, depth), radius)
        near = beyond > -max(hair, depth)
        middle = 0.5 * (low + high)
        position[near, axis] = np.where(position[near, axis] < middle, low + depth, high - depth)
        moved |= outside
    return replace(grains, position=position, radius=radius), int(moved.sum())


def _same_cap(radius: Array, height: Array, depth: float) -> Array:
    """Radius of the sphere centred `depth` m inside a face that shows the box the volume of a cap of `height` m."""
    cap = 0.5 * height**2 * (3.0 * radius - height)
    found = np.cbrt(cap)
    for _ in range(ITERATIONS):
        found = np.cbrt(np.maximum(cap - 1.5 * depth * found**2 + 0.5 * depth**3, 0.0))
    return np.maximum(found, depth)
