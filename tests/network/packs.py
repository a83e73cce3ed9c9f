"""Packs made in code: lattices of known porosity, random packs, fines (lengths in m)."""

from functools import cache

import numpy as np

from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting


def snapshot(
    position: Array, radius: Array | float, box: Array, kind: Array | int = Kind.GRAIN
) -> Snapshot:
    position = np.asarray(position, dtype=float).reshape(-1, 3)
    return resting(position, radius, np.asarray(box, dtype=float), kind)


def lattice(cell: list[list[float]], edge: float, repeat: int, radius: float) -> Snapshot:
    """`repeat` cubic cells each way; `cell` holds positions in units of the cell edge."""
    steps = np.indices((repeat,) * 3).reshape(3, -1).T[:, None]
    position = (steps + np.array(cell) + 0.1).reshape(-1, 3) * edge
    return snapshot(position, radius, np.array([[0.0, repeat * edge]] * 3))


def simple_cubic(repeat: int = 3, radius: float = 1.0, edge: float | None = None) -> Snapshot:
    return lattice([[0, 0, 0]], 2.0 * radius if edge is None else edge, repeat, radius)


def body_centred(repeat: int = 3, radius: float = 1.0) -> Snapshot:
    return lattice([[0, 0, 0], [0.5, 0.5, 0.5]], 4.0 * radius / np.sqrt(3.0), repeat, radius)


def face_centred(repeat: int = 3, radius: float = 1.0) -> Snapshot:
    cell = [[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]
    return lattice(cell, 2.0 * radius * np.sqrt(2.0), repeat, radius)


@cache
def random_pack(
    count: int,
    solid: float = 0.58,
    *,
    seed: int = 1,
    periodic: bool = True,
    spread: float = 0.0,
    aspect: float = 1.0,
) -> Snapshot:
    """Random pack of radii about 1, relaxed from overlap, in a box of aspect : 1 : 1."""
    rng = np.random.default_rng(seed)
    radius = 1.0 + spread * (2.0 * rng.random(count) - 1.0)
    edge = (4.0 / 3.0 * np.pi * np.sum(radius**3) / solid / aspect) ** (1.0 / 3.0)
    size = edge * np.array([aspect, 1.0, 1.0])
    position = rng.random((count, 3)) * size
    for _ in range(600):
        push = _push(position, radius, size, periodic)
        moved, reach = position + 0.5 * push, radius[:, None]
        position = moved % size if periodic else np.clip(moved, reach, size - reach)
        if np.abs(push).max() < 2e-3:
            break
    return snapshot(position, radius, np.stack([np.zeros(3), size], axis=1))


def _push(position: Array, radius: Array, size: Array, periodic: bool) -> Array:
    apart = position[:, None] - position[None]
    if periodic:
        apart -= size * np.round(apart / size)
    itself = np.eye(len(position))
    distance = np.linalg.norm(apart, axis=2) + itself
    overlap = np.maximum(radius[:, None] + radius[None] - distance, 0.0) * (1.0 - itself)
    return np.sum((overlap / distance)[:, :, None] * apart, axis=1)


def with_fines(grains: Snapshot, count: int, radius: float, *, seed: int = 5) -> Snapshot:
    """`grains` and `count` fines at random on their surfaces, away from other grains.

    The fines are centred in the box.
    """
    rng = np.random.default_rng(seed)
    size = grains.box[:, 1] - grains.box[:, 0]
    places: list[Array] = []
    while len(places) < count:
        host = rng.integers(len(grains))
        normal = rng.normal(size=3)
        normal *= (grains.radius[host] + radius) / np.linalg.norm(normal)
        place = grains.position[host] + normal
        place = grains.box[:, 0] + (place - grains.box[:, 0]) % size
        apart = grains.position - place
        apart -= size * np.round(apart / size)
        if np.all(np.linalg.norm(apart, axis=1) >= grains.radius + 0.999 * radius):
            places.append(place)
    fines = snapshot(np.array(places), radius, grains.box, Kind.FINE)
    return grains.joined(fines)
