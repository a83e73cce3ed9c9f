"""The grid of the velocity field: lattice, response, walls, and what lies near a point.

The staggered grid of a velocity field: where its cells lie, and which sides are walls.

Cells are nearly cubic. Component d of the velocity has its nodes on the lower faces of the cells
across d: node (i, j, k) lies at i along d and at j + 1/2, k + 1/2 along the others, in cells. A
pair of periodic sides wraps. Between two walls, node 0 of the component across them lies on the
lower wall and carries no flow; there is none on the upper one. The grid always wraps along x: a
specimen that is not periodic along x lies in a gap of clear fluid, upstream and downstream of it,
that is wide enough for the flow to become even again.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, floor, sqrt
from typing import Any

import numpy as np
from scipy import fft

from fdnet.errors import NetworkError
from fdnet.network.compiled import compiled, loops_in_place
from fdnet.spheres.snapshot import Array, frozen, one_line

LEAST_CELLS = 4
"""Fewest cells along an axis."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lattice:
    """A staggered grid.

    Attributes:
        low: (3,) m, lower corner.
        spacing: (3,) m, edges of a cell.
        shape: cells along x, y and z.
        walled: whether the sides across x, y and z are walls; never those across x.
        specimen: lower and upper end of the specimen along x, m; the side walls hold the fluid
            between them, and let it slip beyond.
        repeats: whether the specimen itself is periodic along x.
    """

    low: Array
    spacing: Array
    shape: tuple[int, int, int]
    walled: tuple[bool, bool, bool]
    specimen: tuple[float, float]
    repeats: bool

    __repr__ = one_line

    @property
    def unit(self) -> float:
        """Unit of length of the solve, m: the spacing along x."""
        return float(self.spacing[0])

    @property
    def high(self) -> Array:
        """Upper corner (3,) m."""
        return np.asarray(self.low + self.spacing * self.shape)

    @property
    def cells(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape))

    @property
    def volume(self) -> float:
        """Volume m3."""
        return float(np.prod(self.spacing * self.shape))


def build_lattice(
    box: Array,
    periodic: tuple[bool, bool, bool],
    *,
    spacing: float,
    upstream: float,
    downstream: float,
) -> Lattice:
    """The grid of a specimen.

    Args:
        box: (3, 2) m, bounds of the specimen.
        periodic: whether its sides x, y, z are periodic.
        spacing: m, the largest edge of a cell.
        upstream: m of clear fluid before the specimen; without meaning where x is periodic.
        downstream: m of clear fluid, at least, beyond the specimen; likewise.

    Raises:
        NetworkError: the box has no extent, or the spacing is not positive.
    """
    edges = box[:, 1] - box[:, 0]
    if not (np.all(edges > 0.0) and 0.0 < spacing < np.inf):
        raise NetworkError(
            f"velocity field: cells of {spacing:g} m in a box of edges {edges.tolist()} m, "
            "expected positive numbers; give the spheres a box"
        )
    low = box[:, 0].copy()
    shape = [_fast(edge / spacing) for edge in edges]
    steps = edges / shape
    if not periodic[0]:
        steps[0] = spacing
        low[0] -= upstream
        shape[0] = _fast((edges[0] + upstream + downstream) / spacing)
    return Lattice(
        low=frozen(low),
        spacing=frozen(steps),
        shape=(shape[0], shape[1], shape[2]),
        walled=(False, not periodic[1], not periodic[2]),
        specimen=(float(box[0, 0]), float(box[0, 1])),
        repeats=periodic[0],
    )


def _fast(cells: float) -> int:
    """The least number of cells, `cells` at least, whose Fourier transform is fast."""
    wanted = max(LEAST_CELLS, int(np.ceil(cells * (1.0 - 1e-9))))
    return int(fft.next_fast_len(wanted))


# ------------------------------------------------------------------------------------------------
# Which walls stand near a point of the grid, and the profile of the flow that they allow.
#
# Between walls at distances d_1, d_2, ... below R the velocity is taken as a smooth vector times
#
#     phi = product of d_i (2R - d_i) / R^2,
#
# which is 0 at every wall, grows like the distance from it, and becomes flat at R. Between two
# plates the product of the distances is the exact profile of the flow, and so is that of the three
# distances in a duct whose section is an equilateral triangle. Lengths are in the spacing along x,
# from the lower corner of the grid.


REACH = 2.0
"""R, distance from which a wall no longer shapes the profile, in spacings."""

Place = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Nearby:
    """Walls near each cell of a grid.

    Attributes:
        first: (cells + 1,) row where the spheres of each cell begin.
        place: (K, 4) centre and radius of a sphere, shifted by periods to where it stands next to
            the cell.
        sides: (6,) lower and upper x between which the side walls hold the fluid; places of the
            lower and upper walls across y, then z, infinitely far away where there is none.
    """

    first: Array
    place: Array
    sides: Array

    __repr__ = one_line


def find_nearby(lattice: Lattice, position: Array, radius: Array) -> Nearby:
    """Spheres within REACH of some point of each cell; centres (N, 3) m, radii (N,) m."""
    centre = (position - lattice.low) / lattice.unit
    step = lattice.spacing / lattice.unit
    size = np.asarray(radius) / lattice.unit
    grid = (np.array(lattice.shape), step, np.array(lattice.walled))
    count = np.zeros(lattice.cells, np.int64)
    _visit(centre, size, grid, count, np.zeros((0, 4), np.float32))
    first = np.concatenate([[0], np.cumsum(count)])
    place = np.zeros((int(first[-1]), 4), np.float32)
    if len(place):
        _visit(centre, size, grid, first[:-1].copy(), place)
    return Nearby(first=frozen(first), place=place, sides=frozen(_sides(lattice, step)))


def _sides(lattice: Lattice, step: Array) -> Array:
    held = (np.array(lattice.specimen) - lattice.low[0]) / lattice.unit
    if lattice.repeats:
        held = np.array([-np.inf, np.inf])
    walls = [
        wall
        for axis in (1, 2)
        for wall in (
            (0.0, lattice.shape[axis] * step[axis]) if lattice.walled[axis] else (-np.inf, np.inf)
        )
    ]
    return np.array([*held, *walls])


@compiled
def _visit(
    centre: Array, radius: Array, grid: tuple[Array, Array, Array], count: Array, place: Array
) -> None:
    """Counts the spheres near each cell; writes them from `count` on where `place` has room."""
    shape, step, walled = grid
    half = 0.5 * sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for s in range(len(radius)):
        reach = radius[s] + REACH
        for axis in range(3):
            low[axis] = floor((centre[s, axis] - reach) / step[axis])
            high[axis] = ceil((centre[s, axis] + reach) / step[axis])
            if walled[axis]:
                low[axis], high[axis] = max(low[axis], 0), min(high[axis], shape[axis] - 1)
        for i in range(low[0], high[0] + 1):
            x = (i + 0.5) * step[0] - centre[s, 0]
            for j in range(low[1], high[1] + 1):
                y = (j + 0.5) * step[1] - centre[s, 1]
                for k in range(low[2], high[2] + 1):
                    z = (k + 0.5) * step[2] - centre[s, 2]
                    if x * x + y * y + z * z > (reach + half) ** 2:
                        continue
                    a, b, c = i % shape[0], j % shape[1], k % shape[2]
                    cell = (a * shape[1] + b) * shape[2] + c
                    if len(place):
                        row = count[cell]
                        place[row, 0] = centre[s, 0] + (a - i) * step[0]
                        place[row, 1] = centre[s, 1] + (b - j) * step[1]
                        place[row, 2] = centre[s, 2] + (c - k) * step[2]
                        place[row, 3] = radius[s]
                    count[cell] += 1


@compiled
def wall_profile(
    point: Place, rows: tuple[int, int], place: Array, sides: Array
) -> tuple[float, float, float, int]:
    """phi at a point, least and second least distance to a sphere, row of the nearest sphere.

    The point must lie in the cell of the `rows` of `place`. Distances are REACH, and the row -1,
    where no sphere is nearer. Inside a solid phi is 0.
    """
    x, y, z = point
    profile, least, second, nearest = 1.0, REACH, REACH, -1
    for row in range(rows[0], rows[1]):
        dx, dy, dz = x - place[row, 0], y - place[row, 1], z - place[row, 2]
        away = sqrt(dx * dx + dy * dy + dz * dz) - place[row, 3]
        if away <= 0.0:
            return 0.0, away, away, row
        if away < REACH:
            profile *= away * (2.0 * REACH - away) / REACH**2
            if away < least:
                least, second, nearest = away, least, row
            elif away < second:
                second = away
    if sides[0] <= x <= sides[1]:
        for side in range(4):
            away = y if side < 2 else z
            away = away - sides[2 + side] if side % 2 == 0 else sides[2 + side] - away
            if away <= 0.0:
                return 0.0, away, away, -1
            if away < REACH:
                profile *= away * (2.0 * REACH - away) / REACH**2
                second = min(second, away)
    return profile, least, second, nearest


# ------------------------------------------------------------------------------------------------
# Flow of point forces on a staggered grid, periodic or between slip planes, by transforms.
#
# Spacing along x and viscosity are 1. The discrete Stokes equations, -Laplace(u) + grad(p) = f and
# div(u) = 0 with the 7-point Laplacian, are diagonal under the transforms. With g_d, the symbol of
# the backward difference along axis d over the spacing there, and lambda = sum |g_d|^2,
#
#     p = sum_e(conj(g_e) f_e) / lambda,        u_d = (f_d - g_d p) / lambda,        means 0
#
# (Hasimoto 1959, J. Fluid Mech. 5, 317, with the differences of Harlow and Welch 1965, Phys.
# Fluids 8, 2182). Across periodic sides the transform is Fourier's and g = 1 - exp(-i k). Between
# two slip planes the velocity across them is odd (sine transform DST-I, n - 1 nodes), all else is
# even (cosine transform DCT-II), and g = -2 sin(pi i / 2n). The flow is free of divergence in
# every cell to rounding. Transforms are in single precision: see docs/stokes.md for what that
# costs.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Response:
    """Symbols of one grid.

    Attributes:
        shape: cells.
        walled: whether the sides across x, y, z are slip planes.
        scale: (3,) cells' edges along x over those along each axis.
        difference: symbol g of the backward difference along each axis, complex (n,).
    """

    shape: tuple[int, int, int]
    walled: tuple[bool, bool, bool]
    scale: Array
    difference: tuple[Array, Array, Array]

    __repr__ = one_line

    def velocity(self, force: list[Array], kept: Array | None = None) -> list[Array]:
        """Velocity, three arrays of the grid's shape with mean 0, of such forces.

        Each wave is multiplied by what is `kept` of it, where that is given.
        """
        waves = [self._forward(part, d) for d, part in enumerate(force)]
        _respond(waves[0], waves[1], waves[2], *self.difference)
        if kept is not None:
            waves = [wave * kept for wave in waves]
        return [self._back(wave, d) for d, wave in enumerate(waves)]

    def pressure(self, force: list[Array]) -> Array:
        """Pressure in the middle of the cells, mean 0, of forces (three arrays of the shape)."""
        waves = [self._forward(part, d) for d, part in enumerate(force)]
        _press(waves[0], waves[1], waves[2], *self.difference)
        return self._back(waves[0], -1)

    @property
    def _wrapping(self) -> tuple[int, ...]:
        return tuple(axis for axis in range(3) if not self.walled[axis])

    @property
    def _between_walls(self) -> tuple[int, ...]:
        return tuple(axis for axis in range(3) if self.walled[axis])

    def _forward(self, part: Array, component: int) -> Array:
        part = part.copy()  # the only one: what follows may work in place
        for axis in self._between_walls:
            part = (
                _inside(fft.dst, part, axis)
                if axis == component
                else fft.dct(part, axis=axis, overwrite_x=True)
            )
        return fft.rfftn(part, axes=self._wrapping, workers=1)

    def _back(self, wave: Array, component: int) -> Array:
        size = [self.shape[axis] for axis in self._wrapping]
        part = fft.irfftn(wave, s=size, axes=self._wrapping, workers=1, overwrite_x=True)
        for axis in self._between_walls:
            part = (
                _inside(fft.idst, part, axis)
                if axis == component
                else fft.idct(part, axis=axis, overwrite_x=True)
            )
        return part


def build_response(lattice: Lattice) -> Response:
    """The flow of forces on a grid."""
    scale = frozen(lattice.unit / lattice.spacing)
    return Response(
        shape=lattice.shape,
        walled=lattice.walled,
        scale=scale,
        difference=symbols(lattice.shape, lattice.walled, scale),
    )


def symbols(
    shape: tuple[int, ...], walled: tuple[bool, bool, bool], scale: Array
) -> tuple[Array, Array, Array]:
    """Symbols of the backward difference along each axis, times its `scale` (3,)."""
    last = max(axis for axis in range(3) if not walled[axis])
    along = []
    for axis, n in enumerate(shape):
        if walled[axis]:
            symbol = -2.0 * np.sin(0.5 * np.pi * np.arange(n) / n) + 0j
        else:
            waves = fft.rfftfreq(n) if axis == last else fft.fftfreq(n)
            symbol = 1.0 - np.exp(-2j * np.pi * waves)
        along.append(frozen(scale[axis] * symbol, np.complex64))
    return along[0], along[1], along[2]


def _inside(transform: Callable[..., Array], part: Array, axis: int) -> Array:
    """A sine transform of the nodes between two walls; node 0, on the wall, has no mode.

    `part` is overwritten.
    """
    nodes = np.moveaxis(part, axis, 0)
    done = transform(nodes[1:], type=1, axis=0, overwrite_x=True)
    if not np.may_share_memory(done, part):
        nodes[1:] = done
    nodes[0] = 0.0
    return part


@compiled
def _inverse_square(p: complex, q: complex, r: complex) -> Any:
    """One over the square of a wave's gradient (p, q, r); 0 for the mean, which has none."""
    square = (
        p.real * p.real
        + p.imag * p.imag
        + q.real * q.real
        + q.imag * q.imag
        + r.real * r.real
        + r.imag * r.imag
    )
    return np.float32(0.0) if square == 0.0 else np.float32(1.0) / square


@compiled
def _respond(a: Array, b: Array, c: Array, g0: Array, g1: Array, g2: Array) -> None:
    """Turns the transforms of forces into those of velocities, in place."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                p, q, r = g0[i], g1[j], g2[k]
                inverse = _inverse_square(p, q, r)
                x, y, z = a[i, j, k], b[i, j, k], c[i, j, k]
                along = (np.conj(p) * x + np.conj(q) * y + np.conj(r) * z) * inverse
                a[i, j, k] = (x - p * along) * inverse
                b[i, j, k] = (y - q * along) * inverse
                c[i, j, k] = (z - r * along) * inverse


@compiled
def _press(a: Array, b: Array, c: Array, g0: Array, g1: Array, g2: Array) -> None:
    """Turns the transforms of forces into that of the pressure, in place of `a`."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                p, q, r = g0[i], g1[j], g2[k]
                inverse = _inverse_square(p, q, r)
                x, y, z = a[i, j, k], b[i, j, k], c[i, j, k]
                a[i, j, k] = (np.conj(p) * x + np.conj(q) * y + np.conj(r) * z) * inverse


# ------------------------------------------------------------------------------------------------
# Numbers at the nodes of a grid that feel a wall, 0 at all others: sums and steps over them.
#
# They lie on whole grids of single precision, three components one after the other. Some half of
# all nodes feel a wall, so whole rows are passed over faster than a list of those nodes and of
# their neighbours is. Sums are of double precision, by columns first, so that the processor works
# on several at once.


def dot(one: Array, other: Array) -> float:
    """Sum of the products of two grids, each of the same shape (..., n)."""
    columns = np.zeros(one.shape[-1])
    _add_products(_rows(one), _rows(other), columns)
    return float(columns.sum())


def differences(value: Array, weight: Array, share: float) -> Array:
    """value + share (6 value - sum over the neighbours) where there is a weight, else 0.

    All are grids (3, n0, n1, n2), which repeat along all axes.
    """
    result = np.empty_like(value)
    for component in range(3):
        _differ(value[component], weight[component], share, result[component])
    return result


def advance(solution: Array, residual: Array, length: float, move: tuple[Array, Array]) -> float:
    """Adds `length` times a direction to the solution and takes what it moves off the residual.

    `move` are the direction and what it moves. Returns the square of the residual.
    """
    columns = np.zeros(residual.shape[-1])
    along, moved = move
    _advance(
        (_rows(solution), _rows(residual)), np.float32(length), _rows(along), _rows(moved), columns
    )
    return float(columns.sum())


def _rows(grid: Array) -> Array:
    return grid.reshape(-1, grid.shape[-1])


@loops_in_place
def _add_products(one: Array, other: Array, columns: Array) -> None:
    for row in range(one.shape[0]):
        a, b = one[row], other[row]
        for k in range(len(columns)):
            columns[k] += np.float64(a[k]) * np.float64(b[k])


@loops_in_place
def _advance(
    state: tuple[Array, Array], length: float, along: Array, moved: Array, columns: Array
) -> None:
    solution, residual = state
    for row in range(along.shape[0]):
        x, r, a, m = solution[row], residual[row], along[row], moved[row]
        for k in range(len(columns)):
            x[k] += length * a[k]
            r[k] -= length * m[k]
        for k in range(len(columns)):
            columns[k] += np.float64(r[k]) * np.float64(r[k])


def turn(along: Array, share: float, residual: Array, force: tuple[Array, Array]) -> None:
    """`share` of the direction `along` plus the `residual`, in place.

    `force` are the weight, and what is set to it times the direction.
    """
    weight, result = force
    flat = (part.reshape(-1) for part in (along, residual, weight, result))
    _turn(np.float32(share), *flat)


@loops_in_place
def _turn(share: float, along: Array, residual: Array, weight: Array, force: Array) -> None:
    for one in range(len(along)):
        along[one] = share * along[one] + residual[one]
        force[one] = weight[one] * along[one]


@loops_in_place
def moved_at(flow: Array, weight: Array, own: Array, scaled: Array, moved: Array) -> None:
    """Sets `moved` to weight times `flow` plus `own` times `scaled`; all are flat."""
    for one in range(len(flow)):
        moved[one] = weight[one] * flow[one] + own[one] * scaled[one]


@loops_in_place
def _differ(value: Array, weight: Array, share: float, result: Array) -> None:
    """`differences` of one component."""
    shape, zero = value.shape, np.float32(0.0)
    beside, middle = np.float32(share), np.float32(1.0 + 6.0 * share)
    last = shape[2] - 1
    for i in range(shape[0]):
        low, high = value[i - 1 if i else shape[0] - 1], value[i + 1 if i + 1 < shape[0] else 0]
        for j in range(shape[1]):
            own, some, done = value[i, j], weight[i, j], result[i, j]
            near = value[i, j - 1 if j else shape[1] - 1]
            far = value[i, j + 1 if j + 1 < shape[1] else 0]
            left, right, after, inner = low[j], high[j], own[1:], done[1:]
            for k in range(shape[2]):
                done[k] = middle * own[k] - beside * (left[k] + right[k] + near[k] + far[k])
            for k in range(last):
                done[k] -= beside * after[k]
            for k in range(last):
                inner[k] -= beside * own[k]
            done[0] -= beside * own[last]
            done[last] -= beside * own[0]
            for k in range(shape[2]):
                done[k] = done[k] if some[k] > zero else zero


# ------------------------------------------------------------------------------------------------
# Which nodes of a staggered grid hold a wall, how far the walls stand, and whose they are.
#
# As in the reference solver (docs/stokes.md):
#
# * A node inside a sphere, less than one spacing below that sphere's own surface, carries the
#   condition that the fluid moves with the sphere. Every sphere keeps its whole shell, also where
#   it lies in another one, so that necks are closed.
# * A node in the fluid with a neighbour in the solid, the wall at a fraction t of the spacing,
#   feels the wall there: -u / t replaces (u_neighbour - u) (Shortley and Weller 1938, in the
#   symmetric form of Gibou et al. 2002, J. Comput. Phys. 176, 205). Compared with the plain grid
#   that is a drag (1/t - 1) u.
# * A node half a spacing from a side wall of the specimen feels it likewise, with t = 1/2; the
#   plain grid has a slip plane there, so the whole of u / t is drag.
#
# Lengths are in the spacing along x.


FLUID, SHELL, DEEP = 0, 1, 2
SIDE_WALL = -2
"""Owner of the drag of the side walls."""
LEAST_DISTANCE = 1e-9
LEAST_DRAG = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Marks:
    """What spheres have marked on the nodes of one velocity component; changed in place.

    Attributes:
        solid: (n0, n1, n2) FLUID, SHELL or DEEP.
        reach: (6, n0, n1, n2) free way ahead and back along x, y, z, in cells, at most 1.
        nearest: (n0, n1, n2) sphere that shortens the reach most, or that a shell node is of.
        closest: (n0, n1, n2) that least reach; minus the depth for shell nodes.
    """

    solid: Array
    reach: Array
    nearest: Array
    closest: Array

    __repr__ = one_line

    def copy(self) -> "Marks":
        """Marks that may be changed apart from these."""
        return Marks(
            solid=self.solid.copy(),
            reach=self.reach.copy(),
            nearest=self.nearest.copy(),
            closest=self.closest.copy(),
        )


def clear_marks(lattice: Lattice) -> Marks:
    """Marks of a grid without a sphere."""
    return Marks(
        solid=np.zeros(lattice.shape, np.uint8),
        reach=np.ones((6, *lattice.shape), np.float32),
        nearest=np.full(lattice.shape, -1, np.int32),
        closest=np.ones(lattice.shape, np.float32),
    )


def mark(
    marks: Marks, lattice: Lattice, component: int, spheres: tuple[Array, Array], first: int
) -> None:
    """Marks the nodes of a velocity component that `spheres` touch.

    Args:
        marks: changed in place.
        lattice: the grid.
        component: of the velocity, 0, 1 or 2.
        spheres: centres (N, 3) m and radii (N,) m.
        first: number of the first of these spheres as an owner of nodes.
    """
    position, radius = spheres
    stagger = np.full(3, 0.5)
    stagger[component] = 0.0
    centre = (position - lattice.low) / lattice.spacing - stagger
    _mark(
        (marks.solid, marks.reach, marks.nearest, marks.closest),
        np.ascontiguousarray(centre),
        np.asarray(radius) / lattice.unit,
        (lattice.spacing / lattice.unit, np.array(lattice.walled)),
        first,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Walls:
    """M nodes of one velocity component that carry a force.

    Attributes:
        node: (M,) flat index in the grid.
        slack: (M,) velocity per force: 0 where the velocity is imposed, else 1 / drag.
        owner: (M,) sphere that the force is on, or SIDE_WALL.
    """

    node: Array
    slack: Array
    owner: Array

    __repr__ = one_line


def find_walls(marks: Marks, lattice: Lattice, component: int) -> Walls:
    """The nodes of a velocity component that carry a force."""
    middle = lattice.low[0] + lattice.spacing[0] * (
        np.arange(lattice.shape[0]) + (0.0 if component == 0 else 0.5)
    )
    held = (middle >= lattice.specimen[0]) & (middle <= lattice.specimen[1])
    weight = (lattice.unit / lattice.spacing) ** 2
    node, slack, owner = _collect(
        (marks.solid, marks.reach, marks.nearest),
        weight,
        np.array(lattice.walled),
        held | lattice.repeats,
        component,
    )
    return Walls(node=node, slack=slack, owner=owner)


@compiled
def _mark(
    marks: tuple[Array, Array, Array, Array],
    centre: Array,
    radius: Array,
    grid: tuple[Array, Array],
    first: int,
) -> None:
    """Marks nodes for spheres at `centre` (N, 3), in cells, of `radius` (N,)."""
    solid, reach, nearest, closest = marks
    step, walled = grid
    low, high, shape = np.zeros(3, np.int64), np.zeros(3, np.int64), solid.shape
    deep = max(step[0], step[1], step[2])
    apart, at = np.zeros(3), np.zeros(3, np.int64)
    for s in range(len(radius)):
        r = radius[s]
        for axis in range(3):
            low[axis] = floor(centre[s, axis] - r / step[axis] - 1.0)
            high[axis] = ceil(centre[s, axis] + r / step[axis] + 1.0)
            if walled[axis]:
                low[axis] = max(low[axis], 0)
                high[axis] = min(high[axis], shape[axis] - 1)
        for i in range(low[0], high[0] + 1):
            apart[0], at[0] = (i - centre[s, 0]) * step[0], i % shape[0]
            for j in range(low[1], high[1] + 1):
                apart[1], at[1] = (j - centre[s, 1]) * step[1], j % shape[1]
                for k in range(low[2], high[2] + 1):
                    apart[2], at[2] = (k - centre[s, 2]) * step[2], k % shape[2]
                    square = apart[0] ** 2 + apart[1] ** 2 + apart[2] ** 2
                    a, b, c = at
                    if square <= r * r:
                        depth = r - sqrt(square)
                        shell = depth < deep
                        if shell and -depth < closest[a, b, c]:
                            closest[a, b, c], nearest[a, b, c] = -depth, first + s
                        if shell:
                            solid[a, b, c] = 1
                        elif solid[a, b, c] == 0:
                            solid[a, b, c] = 2
                        continue
                    power = square - r * r
                    for axis in range(3):
                        rest = apart[axis] ** 2 - power
                        if rest <= 0.0 or apart[axis] == 0.0:
                            continue
                        way = (abs(apart[axis]) - sqrt(rest)) / step[axis]
                        side = 2 * axis + (0 if apart[axis] < 0.0 else 1)
                        if way < reach[side, a, b, c]:
                            reach[side, a, b, c] = way
                            if way < closest[a, b, c]:
                                closest[a, b, c], nearest[a, b, c] = way, first + s


@compiled
def _collect(
    marks: tuple[Array, Array, Array], weight: Array, walled: Array, held: Array, component: int
) -> tuple[Array, Array, Array]:
    """Nodes that carry a force, their slack and their owner."""
    solid, reach, nearest = marks
    shape = solid.shape
    room = solid.size
    node, slack, owner = np.empty(room, np.int64), np.empty(room), np.empty(room, np.int32)
    count, at, beyond = 0, np.zeros(3, np.int64), np.zeros(3, np.int64)
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                at[0], at[1], at[2] = i, j, k
                if walled[component] and at[component] == 0:
                    continue
                mark, drag, who = solid[i, j, k], 0.0, nearest[i, j, k]
                if mark == 0:
                    for axis in range(3):
                        for side in range(2):
                            beyond[:] = at
                            beyond[axis] += 1 - 2 * side
                            out = beyond[axis] < 0 or beyond[axis] >= shape[axis]
                            if out and walled[axis]:
                                if axis != component and held[i]:
                                    drag += 2.0 * weight[axis]
                                    if who < 0:
                                        who = -2
                                continue
                            beyond[axis] %= shape[axis]
                            if solid[beyond[0], beyond[1], beyond[2]] != 0:
                                t = max(reach[2 * axis + side, i, j, k], 1e-9)
                                drag += weight[axis] * (1.0 / t - 1.0)
                if mark == 1 or drag > 1e-6:
                    node[count] = (i * shape[1] + j) * shape[2] + k
                    slack[count] = 0.0 if mark == 1 else 1.0 / drag
                    owner[count] = who
                    count += 1
    return node[:count].copy(), slack[:count].copy(), owner[:count].copy()
