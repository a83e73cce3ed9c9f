"""Sections of throats: the laws asked for a single one, and resolved flow through them.

Flux in m4 is the integral of w over the open part where laplacian(w) = -1 and w = 0 on the discs.
"""

from functools import cache
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import fsolve
from scipy.sparse.linalg import splu, spsolve
from scipy.spatial import Delaunay

from fdnet.network.laws import cross_section
from fdnet.network.laws.cross_section import HUGE, Sections, Shapes, section_fluxes
from fdnet.network.laws.reaching_grains import SpheresBeside
from fdnet.spheres.snapshot import Array


def polygon_flux(corner: Any, discs: Any, walls: Any = (), middle: Any = None) -> float:
    """Flux m4 through a polygon of 3 or 4 corners among discs (x, y, radius), all in m.

    The `walls` are discs of `HUGE` radii. The rays of a disc are divided at the `middle` (2,) m.
    """
    corner, bodies = np.array(corner, float), np.array([*discs, *walls], float)
    four, body = np.zeros((1, 4, 2)), np.zeros((1, cross_section.MOST_BODIES, 5))
    four[0, : len(corner)] = corner
    others = np.insert(bodies, 2, 0.0, axis=1)
    flatness = np.repeat([1.0, 0.0], [len(discs), len(walls)])
    beside = np.column_stack([others, flatness])
    around = SpheresBeside(first=np.array([0, len(others)]), place=beside)
    place = corner.mean(axis=0) if middle is None else middle
    count = np.array([len(corner)])
    shapes = Shapes(four, count, body, np.ones(1), np.array([place], float))
    none, side = np.zeros(1), np.zeros(1, int)
    sections = Sections(throat=side, side=side, low=none, step=none, many=1)
    return float(section_fluxes(shapes, sections, around, cross_section.OPEN)[0][0, 0])


def disc_flux(base: Array, disc: Array) -> float:
    """Flux m4 through the triangle `base` (3, 2) m with discs of the radii `disc` (3,) m."""

    def rims(guess: Array) -> Array:
        return np.linalg.norm(base - guess[:2], axis=1) - disc - guess[2]

    start = [*base.mean(axis=0), 0.1 * float(np.ptp(base))]
    found, _, done, _ = fsolve(rims, start, full_output=True)
    middle = found[:2] if done == 1 else None
    return polygon_flux(base, np.column_stack([base, disc]), middle=middle)


def wall_flux(place: Any, first: float, second: float) -> float:
    """Flux m4 between the wall and discs of the radii `first` and `second` m.

    `place` (3,) m: both heights of the discs above the wall, and how far apart they are along it.
    """
    one, two, apart = place
    huge = HUGE * max(place)
    corner = [(0.0, one), (apart, two), (apart, 0.0), (0.0, 0.0)]
    if two == 0.0:
        del corner[1]
    discs = [(0.0, one, first), (apart, two, second)]
    return polygon_flux(corner, discs, [(0.5 * apart, -huge, huge)])


def edge_flux(place: Any, disc: float) -> float:
    """Flux m4 between two walls and a disc of radius `disc` m, `place` (2,) m away."""
    high, far = place
    huge = HUGE * max(place)
    walls = [(0.5 * far, -huge, huge), (far + huge, 0.5 * high, huge)]
    corner = [(0.0, high), (far, high), (far, 0.0), (0.0, 0.0)]
    return polygon_flux(corner, [(0.0, high, disc)], walls)


# ---- Triangles with discs, by finite elements on a free mesh.
def resolved_flux(
    base: Array, disc: Array, nodes: int = 800, *, centre: Array | None = None
) -> float:
    """Flux m4, w = 0 on the discs and no shear on the sides, extrapolated from two meshes.

    `base` (3, 2) m is the triangle, `disc` (n,) m the radii about `centre` (n, 2) m, by default
    about its corners.
    """
    middle = base if centre is None else centre
    coarse, fine = (_flux(base, middle, disc, count) for count in (nodes, 4 * nodes))
    return fine + (fine - coarse) / 3.0


def _flux(base: Array, centre: Array, disc: Array, nodes: int) -> float:
    low, high = base.min(axis=0), base.max(axis=0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], 200), np.linspace(low[1], high[1], 200))
    point = np.column_stack([x.ravel(), y.ravel()])
    share = np.mean(_gap(point[_inside(point, base) > 0], centre, disc) > 0)
    area = 0.5 * abs(np.linalg.det(base[1:] - base[0]))
    free, held = _points(base, centre, disc, np.sqrt(area * share / nodes))
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


def _points(base: Array, centre: Array, disc: Array, size: float) -> tuple[Array, Array]:
    """Free points, in a triangular grid and on the sides, and held ones on the rims."""
    low, high = base.min(axis=0) - size, base.max(axis=0) + size
    across = np.arange(low[1], high[1], size * np.sqrt(0.75))
    x, y = np.meshgrid(np.arange(low[0], high[0], size), across)
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


# ---- Sections that side walls hold, by finite differences.
@cache
def resolved_beside_walls(place: Any, disc: Any, cells: int = 200, *, edge: bool = False) -> float:
    """Flux m4 in a trapezoid: w = 0 on the wall and on two discs, no shear on the other sides.

    `place` and `disc` as in `wall_flux`. With `edge` a second wall stands where the second disc
    would be, and the trapezoid is a rectangle.
    """
    step = place[2] / cells
    up = np.arange(step / 2, max(place[:2]), step)
    x, y = np.meshgrid((np.arange(cells) + 0.5) * step, up, indexing="ij")
    first = x**2 + (y - place[0]) ** 2 < disc[0] ** 2
    solid = first | ((x - place[2]) ** 2 + (y - place[1]) ** 2 < disc[1] ** 2)
    inside = y < place[0] + (place[1] - place[0]) * x / place[2]
    fluid, held = np.pad(inside & ~solid, 1), np.pad(inside & solid, 1)
    held[:, 0] = True
    held[-1] |= edge
    index = np.full(fluid.shape, -1)
    index[fluid] = np.arange(fluid.sum())
    own, rows, columns = np.zeros(fluid.sum()), [], []
    x, y = np.nonzero(fluid)
    for axis, shift in ((0, 1), (0, -1), (1, 1), (1, -1)):
        neighbour = np.roll(index, shift, axis=axis)[fluid]
        at_wall = y == 1 if axis == 1 else edge & (x == cells)
        half = at_wall & ((axis, shift) in ((1, 1), (0, -1)))
        own += (neighbour >= 0) + np.roll(held, shift, axis=axis)[fluid] * np.where(half, 2.0, 1.0)
        rows.append(np.flatnonzero(neighbour >= 0))
        columns.append(neighbour[neighbour >= 0])
    row, column = np.concatenate(rows), np.concatenate(columns)
    shape = (len(own),) * 2
    system = sparse.coo_matrix((-np.ones(len(row)), (row, column)), shape=shape).tolil()
    system.setdiag(own)
    return float(spsolve(system.tocsc(), np.full(len(own), step**2)).sum() * step**2)
