"""Flux of laplacian(w) = -1 through a triangle with discs, by finite elements on a free mesh."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

from fdnet.spheres.snapshot import Array


def resolved_flux(
    base: Array, disc: Array, nodes: int = 800, *, centre: Array | None = None
) -> float:
    """Flux m4, w = 0 on the discs and no shear on the sides, extrapolated from two meshes.

    `base` (3, 2) m is the triangle, `disc` (n,) m the radii about `centre` (n, 2) m, by default
    about its corners.
    """
    middle = base if centre is None else centre
    coarse, fine = (_flux((base, middle), disc, count) for count in (nodes, 4 * nodes))
    return fine + (fine - coarse) / 3.0


def _flux(places: tuple[Array, Array], disc: Array, nodes: int) -> float:
    base, centre = places
    first, second = base[1] - base[0], base[2] - base[0]
    area = 0.5 * abs(first[0] * second[1] - first[1] * second[0])
    size = np.sqrt(area * _open_share(places, disc) / nodes)
    free, held = _points(places, disc, size)
    point = np.concatenate([free, held])
    corner = Delaunay(point).simplices
    middle = point[corner].mean(axis=1)
    corner = corner[(_gap(middle, centre, disc) > 0) & np.any(corner < len(free), axis=1)]
    a, b, c = (point[corner[:, k]] for k in range(3))
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    flat = twice > 1e-12 * area
    corner, twice = corner[flat], twice[flat]
    side = np.stack([c - b, a - c, b - a], axis=1)[flat]
    block = np.einsum("tik,tjk->tij", side, side) / (2.0 * twice)[:, None, None]
    rows, columns = np.repeat(corner, 3, axis=1).ravel(), np.tile(corner, (1, 3)).ravel()
    matrix = sparse.csc_matrix((block.ravel(), (rows, columns)), shape=(len(point),) * 2)
    load = np.bincount(corner.ravel(), np.repeat(twice / 6.0, 3), minlength=len(point))
    own = np.flatnonzero(load[: len(free)] > 0)
    return float(load[own] @ splu(matrix[own][:, own]).solve(load[own]))


def _gap(point: Array, centre: Array, disc: Array) -> Array:
    """Distance (N,) of points (N, 2) from the nearest rim, negative within a disc."""
    apart = np.linalg.norm(point[:, None] - centre, axis=2)
    return np.asarray((apart - disc).min(axis=1))


def _inside(point: Array, base: Array) -> Array:
    """Least distance (N,) of points from the sides of a triangle turned to the left."""
    ends = np.roll(base, -1, axis=0) - base
    normal = np.column_stack([-ends[:, 1], ends[:, 0]]) / np.linalg.norm(ends, axis=1)[:, None]
    return np.asarray(np.einsum("nik,ik->ni", point[:, None] - base, normal).min(axis=1))


def _open_share(places: tuple[Array, Array], disc: Array) -> float:
    base, centre = places
    low, high = base.min(axis=0), base.max(axis=0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], 200), np.linspace(low[1], high[1], 200))
    point = np.column_stack([x.ravel(), y.ravel()])
    inside = _inside(point, base) > 0
    return float(np.mean(_gap(point[inside], centre, disc) > 0))


def _points(places: tuple[Array, Array], disc: Array, size: float) -> tuple[Array, Array]:
    """Free points, in a triangular grid and on the sides, and held ones on the rims."""
    base, centre = places
    low, high = base.min(axis=0) - size, base.max(axis=0) + size
    x, y = np.meshgrid(
        np.arange(low[0], high[0], size), np.arange(low[1], high[1], size * np.sqrt(0.75))
    )
    x = x + 0.5 * size * (np.arange(len(x)) % 2)[:, None]
    grid = np.column_stack([x.ravel(), y.ravel()])
    free = [grid[(_inside(grid, base) > 0.45 * size) & (_gap(grid, centre, disc) > 0.55 * size)]]
    held = []
    for middle, radius in zip(centre, disc, strict=True):
        count = max(int(np.ceil(2.0 * np.pi * radius / (0.7 * size))), 24)
        turn = 2.0 * np.pi * (np.arange(count) + 0.5) / count
        held.append(middle + radius * np.column_stack([np.cos(turn), np.sin(turn)]))
    held = [one[_inside(one, base) > 0.2 * size] for one in held]
    for start, end in zip(base, np.roll(base, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        foot = (centre - start) @ along
        away = np.linalg.norm(centre - start - foot[:, None] * along, axis=1)
        half = np.sqrt(np.maximum(disc**2 - away**2, 0.0))
        cuts = np.concatenate([foot - half, foot + half])[np.tile(disc > away, 2)]
        cuts = cuts[(cuts > 0) & (cuts < length)]
        even = length * np.linspace(0, 1, max(int(np.ceil(length / size)), 2) + 1)
        near = np.abs(even[:, None] - cuts).min(axis=1) if len(cuts) else np.full(len(even), 9e9)
        side = start + even[near > 0.5 * size, None] * along
        free.append(side[_gap(side, centre, disc) > 0.5 * size])
        held.append(start + cuts[:, None] * along)
    rim = np.concatenate(held)
    return np.concatenate(free), rim[_gap(rim, centre, disc) > -1e-9 * np.ptp(base)]
