"""Resolved Stokes flow around spheres on a staggered grid.

It is the reference of the pore network (`solve_stokes`, `solve_slab`) and, on coarser grids, the
flow that `fdnet.network.field` interpolates. Method and checks: docs/theory/resolved_flow.md.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from math import ceil, floor, sqrt
from typing import NamedTuple

import numpy as np
from scipy import fft

from fdnet.errors import CaseError, FlowError, NetworkError
from fdnet.network.compiled import compiled, loops_in_place
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line

FEWEST_CELLS = 4
WHOLE_CELLS = 1e-6
"""Part of the longest edge by which an edge may miss a whole number of cubic cells."""
Shape = tuple[int, int, int]
Walled = tuple[bool, bool, bool]
OPEN: Walled = (False, False, False)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Lattice:
    """A staggered grid of cells that are nearly cubes.

    Node (i, j, k) of velocity component d lies at i along d and at j + 1/2, k + 1/2 along the
    others, in cells. Pressures are in the middle of the cells. Between two walls, node 0 of the
    component across them lies on the lower wall and carries no flow; there is none on the upper.
    """

    low: Array  # (3,) m, lower corner
    spacing: Array  # (3,) m, edges of a cell
    shape: Shape  # cells along x, y and z
    walled: Walled  # whether the sides across x (never), y and z are walls; else they are periodic
    specimen: tuple[float, float]
    """Lower and upper end of the specimen along x, m; the side walls hold the fluid between them,
    and let it slip beyond."""
    repeats: bool  # whether the specimen itself fills the grid along x
    planes: bool = False
    """Whether the sides across x are planes of one pressure each, with no velocity along them;
    component 0 has nodes on both of them."""

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
    def response(self) -> "Response":
        """The flow of forces on the grid."""
        return Response(self)


def divide(edges: Array, cells: int) -> Shape:
    """Cells along edges (3,) m, `cells` of them on the longest.

    Where another edge is no whole number of cubic cells, the cells are a little longer or shorter
    along it, in a number whose Fourier transform is fast. Raises CaseError on too few cells.
    """
    if cells < FEWEST_CELLS or not np.all(edges > 0.0):
        raise CaseError(
            f"stokes: {cells} cells on edges {edges.tolist()} m, expected at least {FEWEST_CELLS} "
            "and positive edges"
        )
    cube = float(edges.max()) / cells
    counts = np.maximum(np.rint(edges / cube).astype(int), 2)
    for axis in np.flatnonzero(np.abs(counts * cube - edges) > WHOLE_CELLS * edges.max()):
        counts[axis] = fft.next_fast_len(int(counts[axis]), real=True)
    return int(counts[0]), int(counts[1]), int(counts[2])


# ------------------------------------------------------------------------------------------------
# The flow S of point forces, by transforms (Hasimoto 1959, J. Fluid Mech. 5, 317, with the
# differences of Harlow and Welch 1965, Phys. Fluids 8, 2182). Spacing along x and viscosity are 1.
# With g_d, the symbol of the backward difference along axis d over the spacing there, and lambda =
# sum |g_d|^2,
#
#     p = sum_e(conj(g_e) f_e) / lambda,        u_d = (f_d - g_d p) / lambda,        means 0
#
# The transforms and the g_d of each pair of sides stand in docs/theory/resolved_flow.md.


class Response:
    """The symbols of one grid: `nodes` is the shape of its arrays, `difference` the g_d (n,).

    Between planes the last row of an array is of component 0 alone, and on the planes a number is
    a force or a velocity over the root of 2, since such a node stands for one node of the mirrored
    cell and all others for two: so S stays symmetric.
    """

    def __init__(self, lattice: Lattice) -> None:
        shape, walled, planes = lattice.shape, lattice.walled, lattice.planes
        self.walled, self.planes, scale = walled, planes, lattice.unit / lattice.spacing
        self.nodes: Shape = (shape[0] + planes, *shape[1:])
        self.wrapping = tuple(d for d in range(3) if not (walled[d] or (d == 0 and planes)))
        self.between_walls = tuple(d for d in range(3) if walled[d])
        self.difference: list[Array] = []
        for axis, n in enumerate(shape):
            if axis in self.wrapping:
                waves = fft.rfftfreq(n) if axis == self.wrapping[-1] else fft.fftfreq(n)
                symbol = 1.0 - np.exp(-2j * np.pi * waves)
            elif walled[axis]:
                symbol = -2.0 * np.sin(0.5 * np.pi * np.arange(n) / n) + 0j
            else:
                symbol = 2.0 * np.sin(0.5 * np.pi * np.arange(n + 1) / n) + 0j
            self.difference.append(np.asarray(scale[axis] * symbol, np.complex64))
        if not self.wrapping:  # all transforms are real then
            self.difference = [one.real.copy() for one in self.difference]

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of nodes with mean 0, of such forces."""
        waves = [self._forward(part, d) for d, part in enumerate(force)]
        _respond(*waves, *self.difference, False)
        return [self._back(wave, d) for d, wave in enumerate(waves)]

    def pressure(self, force: list[Array]) -> Array:
        """Pressure in the middle of the cells, mean 0, of forces (three arrays of nodes)."""
        waves = [self._forward(part, d) for d, part in enumerate(force)]
        _respond(*waves, *self.difference, True)
        return self._back(waves[0], -1)

    def _forward(self, part: Array, component: int) -> Array:
        part = part.copy()  # the only one: what follows may work in place
        if self.planes and component == 0:
            part = fft.dct(part, type=1, axis=0, norm="ortho", overwrite_x=True)
        elif self.planes:
            part[1:] = fft.dst(part[:-1], type=2, axis=0, norm="ortho")
            part[0] = 0.0
        for axis in self.between_walls:
            if axis == component:
                part = _inside(fft.dst, part, axis)
            else:
                part = fft.dct(part, axis=axis, overwrite_x=True)
        return fft.rfftn(part, axes=self.wrapping) if self.wrapping else part

    def _back(self, part: Array, component: int) -> Array:
        if self.wrapping:
            size = [self.nodes[axis] for axis in self.wrapping]
            part = fft.irfftn(part, s=size, axes=self.wrapping, overwrite_x=True)
        for axis in self.between_walls:
            if axis == component:
                part = _inside(fft.idst, part, axis)
            else:
                part = fft.idct(part, axis=axis, overwrite_x=True)
        if self.planes and component == 0:
            part = fft.idct(part, type=1, axis=0, norm="ortho", overwrite_x=True)
        elif self.planes:
            part[:-1] = fft.idst(part[1:], type=2, axis=0, norm="ortho")
            part[-1] = 0.0
        return part


def _inside(transform: Callable[..., Array], part: Array, axis: int) -> Array:
    """A sine transform of the nodes between two walls, in place; node 0, on one, has no mode."""
    nodes = np.moveaxis(part, axis, 0)
    done = transform(nodes[1:], type=1, axis=0, overwrite_x=True)
    if not np.may_share_memory(done, part):
        nodes[1:] = done
    nodes[0] = 0.0
    return part


@compiled
def _respond(
    a: Array, b: Array, c: Array, g0: Array, g1: Array, g2: Array, pressure: bool
) -> None:
    """Turns the transforms of forces into those of velocities, or `a` into that of pressure."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                p, q, r = g0[i], g1[j], g2[k]
                square = p.real * p.real + p.imag * p.imag
                square = square + q.real * q.real + q.imag * q.imag
                square = square + r.real * r.real + r.imag * r.imag
                inverse = np.float32(0.0) if square == 0.0 else np.float32(1.0) / square
                x, y, z = a[i, j, k], b[i, j, k], c[i, j, k]
                along = (np.conj(p) * x + np.conj(q) * y + np.conj(r) * z) * inverse
                if pressure:
                    a[i, j, k] = along
                else:
                    a[i, j, k] = (x - p * along) * inverse
                    b[i, j, k] = (y - q * along) * inverse
                    c[i, j, k] = (z - r * along) * inverse


# ------------------------------------------------------------------------------------------------
# Which nodes of the grid hold a wall, how far the walls stand, and whose they are
# (docs/theory/resolved_flow.md, 1 and 6). Beyond a plane of one pressure lies the mirror image of
# what is before it. Lengths are in the spacing along x.


SIDE_WALL = -2  # Owner of the drag of the side walls
LEAST_DRAG = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Walls:
    """M nodes of one velocity component that carry a force."""

    node: Array  # (M,) flat index in an array of nodes
    slack: Array  # (M,) velocity per force: 0 where u = 0 is imposed, else 1 / drag
    owner: Array  # (M,) sphere that the force is on, or SIDE_WALL
    solid: Array  # array of nodes, true in the solid


class Marks(NamedTuple):
    """What is known of each node of a velocity component."""

    solid: Array  # 0 fluid, 1 shell, 2 deeper
    reach: Array  # (6, ...) free way ahead and back along x, y, z in cells, at most 1
    nearest: Array  # the sphere that shortens the reach most or that a shell node is of
    closest: Array  # that least reach, or minus the depth of a shell node


def find_walls(lattice: Lattice, component: int, position: Array, radius: Array) -> Walls:
    """The nodes of a velocity component, 0 to 2, that carry a force.

    The spheres have their centres at `position` (N, 3) m and `radius` (N,) m.
    """
    nodes = (lattice.shape[0] + lattice.planes, *lattice.shape[1:])
    stagger = np.where(np.arange(3) == component, 0.0, 0.5)
    marks = Marks(
        solid=np.zeros(nodes, np.uint8),
        reach=np.ones((6, *nodes), np.float32),
        nearest=np.full(nodes, -1, np.int32),
        closest=np.ones(nodes, np.float32),
    )
    on_planes = lattice.planes and component == 0
    last = np.array(lattice.shape) - 1
    last[0] += on_planes
    wraps = ~np.array(lattice.walled)
    wraps[0] = not lattice.planes
    _mark(
        marks,
        (position - lattice.low) / lattice.spacing - stagger,
        np.asarray(radius) / lattice.unit,
        lattice.spacing / lattice.unit,
        wraps,
        last,
        on_planes,
    )
    solid, drag = marks.solid != 0, np.zeros(nodes)
    weight = (lattice.unit / lattice.spacing) ** 2
    x = lattice.low[0] + lattice.spacing[0] * (np.arange(nodes[0]) + stagger[0])
    held = (x >= lattice.specimen[0]) & (x <= lattice.specimen[1]) | lattice.repeats
    for axis, side in product(range(3), range(2)):
        beyond, way = np.roll(solid, 2 * side - 1, axis), marks.reach[2 * axis + side]
        end = 0 if side else last[axis]
        outside = np.moveaxis(beyond, axis, 0)[end]
        if lattice.walled[axis]:
            outside[:] = False
            if axis != component:
                np.moveaxis(drag, axis, 0)[end] += 2.0 * weight[axis] * held[:, None]
        elif axis == 0 and on_planes:
            outside[:] = solid[end - 1 + 2 * side]
            way[end] = marks.reach[1 - side, end]
        elif axis == 0 and lattice.planes:
            outside[:] = False
        wall = beyond & ~solid
        drag[wall] += weight[axis] * (1.0 / np.maximum(way[wall], 1e-9, dtype=float) - 1.0)
    free = drag > LEAST_DRAG
    free[solid] = False
    free[last[0] + 1 :] = False
    carries = free | (marks.solid == 1)
    if lattice.walled[component]:
        np.moveaxis(carries, component, 0)[0] = False
    node = np.flatnonzero(carries)
    slack = np.divide(1.0, drag, out=np.zeros(nodes), where=free).reshape(-1)[node]
    owner = marks.nearest.reshape(-1)[node]
    return Walls(node=node, slack=slack, owner=np.where(owner < 0, SIDE_WALL, owner), solid=solid)


@compiled
def _mark(
    marks: Marks,
    centre: Array,
    radius: Array,
    step: Array,
    wraps: Array,
    last: Array,
    on_planes: bool,
) -> None:
    """Marks nodes for spheres at `centre` (N, 3), in cells, of `radius` (N,)."""
    solid, reach, nearest, closest = marks
    low, high, shape = np.zeros(3, np.int64), np.zeros(3, np.int64), solid.shape
    deep = max(step[0], step[1], step[2])
    apart, at = np.zeros(3), np.zeros(3, np.int64)
    for s in range(len(radius)):
        r = radius[s]
        for axis in range(3):
            low[axis] = floor(centre[s, axis] - r / step[axis] - 1.0)
            high[axis] = ceil(centre[s, axis] + r / step[axis] + 1.0)
            if not wraps[axis]:
                low[axis] = max(low[axis], 0)
                high[axis] = min(high[axis], last[axis])
        for i in range(low[0], high[0] + 1):
            apart[0], at[0] = (i - centre[s, 0]) * step[0], i % shape[0]
            open_plane = on_planes and (i == 0 or i == last[0])
            for j in range(low[1], high[1] + 1):
                apart[1], at[1] = (j - centre[s, 1]) * step[1], j % shape[1]
                for k in range(low[2], high[2] + 1):
                    apart[2], at[2] = (k - centre[s, 2]) * step[2], k % shape[2]
                    square = apart[0] ** 2 + apart[1] ** 2 + apart[2] ** 2
                    a, b, c = at
                    if square <= r * r:
                        depth = r - sqrt(square)
                        shell = depth < deep or open_plane
                        if shell and -depth < closest[a, b, c]:
                            closest[a, b, c], nearest[a, b, c] = -depth, s
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
                                closest[a, b, c], nearest[a, b, c] = way, s


# ---- The preconditioner G of the wall forces, and sums (docs/theory/resolved_flow.md, 5).
OWN_RESPONSE = 2.0 / 3.0 * 0.252731
"""Velocity of a node under a unit force on itself, which scales the unknowns: 2/3 of the lattice
Green's function at 0 (Watson 1939)."""
DIFFERENCES = 10.0
"""Weight of the differences in the preconditioner over that of the forces themselves."""


@loops_in_place
def _differ(value: Array, weight: Array, share: float, result: Array) -> None:
    """Sets value + share (6 value - sum of neighbours), which repeat, where there is weight."""
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


def summed_product(one: Array, other: Array) -> float:
    """Sum of the products of two arrays of one shape (..., n); rows add up in double precision."""
    return float(np.einsum("...k,...k->...", one, other).sum(dtype=np.float64))


# ------------------------------------------------------------------------------------------------
# The forces that hold the fluid at the walls, by conjugate gradients: S F + D F + U = 0 at every
# wall node, with the slack D of the walls and the superficial velocity U
# (docs/theory/resolved_flow.md, 2 to 4). U is 1 along x. Along periodic sides the fluid may drift:
# the forces add up to 0 there, and that component of U is the multiplier. Numbers at the nodes are
# whole arrays of single precision, 0 where there is no wall, which some half of all nodes feel.


MOST_ITERATIONS = 6000
LARGEST_SLIP = 0.05  # Of the reference


class Problem:
    """The scaled operator A = W (S + D) W over the wall nodes, on arrays (3, n0, n1, n2).

    `walls` are those of the three velocity components, `response` is S.
    """

    def __init__(self, walls: list[Walls], response: Response) -> None:
        self.walls, self.response = walls, response
        self.weight, self.own = (np.zeros((3, *response.nodes), np.float32) for _ in range(2))
        for wall, weight, own in zip(walls, self.weight, self.own, strict=True):
            square = 1.0 / (OWN_RESPONSE + wall.slack)
            weight.reshape(-1)[wall.node] = np.sqrt(square)
            own.reshape(-1)[wall.node] = wall.slack * square
        self.right, self.scaled = np.zeros_like(self.weight), np.zeros_like(self.weight)
        self.right[0] -= self.weight[0]
        if response.planes:
            self.right[0, [0, -1]] *= np.float32(sqrt(0.5))
        self.norms = [summed_product(part, part) for part in (self.right[0], *self.weight[1:])]
        sideways = () if response.planes else (1, 2)
        self.drifting = [d for d in sideways if self.norms[d] and not response.walled[d]]

    def apply(self, scaled: Array, room: Array) -> Array:
        """A times `scaled`, in an array `room` of its shape."""
        flows = self.response.velocity(list(np.multiply(self.weight, scaled, out=room)))
        np.multiply(self.own, scaled, out=room)
        for flow, weight, moved in zip(flows, self.weight, room, strict=True):
            flow *= weight
            moved += flow
        return room

    def smoothed(self, residual: Array) -> Array:
        """The preconditioner G times a `residual`, projected."""
        result = np.empty_like(residual)
        for one, weight, done in zip(residual, self.weight, result, strict=True):
            _differ(one, weight, DIFFERENCES / 6.0, done)
        return self.project(result)

    def project(self, scaled: Array) -> Array:
        """`scaled` without the part that carries a net force sideways, changed in place."""
        for d in self.drifting:
            load, part = self.weight[d], scaled[d]
            part -= load * np.float32(summed_product(load, part) / self.norms[d])
        return scaled

    def slip(self, square: float) -> float:
        """Rms wall velocity that is left over the superficial one, from a squared residual."""
        return sqrt(square / self.norms[0])

    def steps(self) -> Iterator[tuple[float, float]]:
        """Slip of the `scaled` solution, and what its last step added to the resistance."""
        residual = self.project(self.right.copy())
        step = self.smoothed(residual)
        product, square = summed_product(residual, step), summed_product(residual, residual)
        gained, room = 0.0, np.empty_like(step)
        while True:
            yield self.slip(square), gained
            moved = self.project(self.apply(step, room))
            length = product / summed_product(step, moved)
            gained = length * product
            moved *= np.float32(length)
            residual -= moved
            self.scaled += np.multiply(step, np.float32(length), out=room)
            square = summed_product(residual, residual)
            turned = self.smoothed(residual)
            before, product = product, summed_product(residual, turned)
            step *= np.float32(product / before)
            step += turned


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GridFlow:
    """A solved flow around N spheres with the superficial velocity U along x; viscosity mu."""

    lattice: Lattice  # the grid
    force: Array  # (3, n0, n1, n2) force on the fluid at each node over mu U; spacing along x 1
    drift: Array  # (3,) mean velocity over U
    slip: float  # rms velocity left at the walls over U
    iterations: int  # of the conjugate gradients
    k: float  # permeability m2
    walls: tuple[Walls, Walls, Walls]  # of the three velocity components

    __repr__ = one_line

    def forces(self, count: int) -> tuple[Array, Array]:
        """Force of the fluid on each of `count` spheres (N, 3), side walls (3,), over mu U, m."""
        # a node's force is per volume of a cell, in units of the spacing along x
        scale = -np.prod(self.lattice.spacing) / self.lattice.unit**2
        on_spheres, on_walls = np.zeros((count, 3)), np.zeros(3)
        for component, (wall, grid) in enumerate(zip(self.walls, self.force, strict=True)):
            force, who = scale * grid.reshape(-1)[wall.node].astype(float), wall.owner
            spheres = who >= 0
            on_spheres[:, component] = np.bincount(who[spheres], force[spheres], minlength=count)
            on_walls[component] = force[who == SIDE_WALL].sum()
        return on_spheres, on_walls


def solve(
    lattice: Lattice, position: Array, radius: Array, *, slip: float, change: float | None = None
) -> GridFlow:
    """The flow around spheres of `position` and `radius` m, superficial velocity 1 along x.

    It ends at the rms velocity `slip` over the superficial one at the walls, and where there is a
    `change`, when k fell by less than this share over the last quarter of the iterations, at least
    10. Raises NetworkError where no node of the grid feels a wall, and FlowError where the
    iterations run out or rounding has taken over.
    """
    walls = [find_walls(lattice, d, position, radius) for d in range(3)]
    if not len(walls[0].node):
        raise NetworkError(
            f"resolved flow: no wall on the grid of {lattice.shape} cells, expected spheres "
            "in the box; add some or refine the grid"
        )
    problem = Problem(walls, lattice.response)
    resistance = [0.0]
    for iterations, (left, gained) in enumerate(problem.steps()):
        resistance.append(resistance[-1] + gained)
        window = max(10, iterations // 4)
        fell = resistance[-1] - resistance[max(0, iterations + 1 - window)]
        if left <= slip and (change is None or not left or fell < change * resistance[-1]):
            break
        if iterations == MOST_ITERATIONS or not gained >= 0.0:
            raise FlowError(
                f"resolved flow: a slip of {left:.3g} of the superficial velocity is left at the "
                f"walls after {iterations} iterations, expected {slip:g}, and k fell by "
                f"{fell / resistance[-1]:.2g} over the last {window} of them; is the pore space "
                "closed? Otherwise raise the tolerance or refine the grid"
            )
    # drift, true slip and k by one fresh application
    scaled = problem.scaled
    moved = problem.apply(scaled, np.empty_like(scaled))
    total, energy = summed_product(problem.right, scaled), summed_product(scaled, moved)
    rest, drift = problem.right - moved, np.array([1.0, 0.0, 0.0])
    for d in problem.drifting:
        drift[d] = summed_product(problem.weight[d], rest[d]) / problem.norms[d]
    problem.project(rest)
    return GridFlow(
        lattice=lattice,
        force=frozen(problem.weight * scaled),
        drift=frozen(drift),
        slip=problem.slip(summed_product(rest, rest)),
        iterations=iterations,
        k=lattice.cells * energy / total**2 * lattice.unit**2,
        walls=(walls[0], walls[1], walls[2]),
    )


# ---- The reference of the pore network: permeability of a periodic cell or of a slab.
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StokesFlow:
    """A solved cell or slab."""

    k: float  # permeability along x, m2
    iterations: int  # of the conjugate gradients
    residual: float  # rms velocity that is left at the walls over the superficial velocity
    seconds: float  # that the solve took
    cells: int  # on the longest edge
    unknowns: int  # number of forces


class Estimate(NamedTuple):
    """The permeability at zero spacing: k, m2, and its error as a share of k."""

    k: float
    error: float


def solve_stokes(spheres: Snapshot, *, cells: int, tolerance: float = 1e-4) -> StokesFlow:
    """Permeability along x of the periodic cell `spheres.box`, where the fluid may flow sideways.

    There are `cells` on the longest edge. The solve ends when k fell by less than `tolerance` over
    the last quarter of the iterations, and the rms slip at the walls is below 5 % of the mean
    velocity. Raises CaseError where
    the grid is too coarse or there is no wall, FlowError where the iterations run out.
    """
    return _reference(spheres, spheres.box, cells, tolerance, OPEN, planes=False)


def solve_slab(
    spheres: Snapshot,
    span: tuple[float, float],
    *,
    cells: int,
    tolerance: float = 1e-4,
    closed: Walled = OPEN,
) -> StokesFlow:
    """Permeability along x of a slab between planes of one pressure; otherwise `solve_stokes`.

    The sides y and z of `spheres.box` are periodic, or `closed`: walls that hold the fluid. `span`
    are the lower and the upper plane, x in m. Of spheres centred outside the slab the bodies count
    as far as they reach in.
    """
    box = np.array([span, *spheres.box[1:]])
    return _reference(spheres, box, cells, tolerance, closed, planes=True)


def _reference(
    spheres: Snapshot, box: Array, cells: int, tolerance: float, closed: Walled, *, planes: bool
) -> StokesFlow:
    start, edges = time.monotonic(), np.diff(box)[:, 0]
    shape = divide(edges, cells)
    lattice = Lattice(
        low=frozen(box[:, 0]),
        spacing=frozen(edges / shape),
        shape=shape,
        walled=closed,
        specimen=(float(box[0, 0]), float(box[0, 1])),
        repeats=True,
        planes=planes,
    )
    try:
        flow = solve(
            lattice, spheres.position, spheres.radius, slip=LARGEST_SLIP, change=tolerance
        )
    except NetworkError as error:
        raise CaseError(str(error)) from error
    if not (flow.k > 0.0 and flow.slip < 2.0 * LARGEST_SLIP):
        raise FlowError(
            f"stokes: k {flow.k:.3g} m2 and a slip of {flow.slip:.3g} of the mean velocity "
            f"by a fresh application after {flow.iterations} iterations, expected below "
            f"{LARGEST_SLIP}: rounding has taken over; refine the grid"
        )
    return StokesFlow(
        k=flow.k,
        iterations=flow.iterations,
        residual=flow.slip,
        seconds=time.monotonic() - start,
        cells=cells,
        unknowns=sum(len(wall.node) for wall in flow.walls),
    )


def extrapolate(coarse: StokesFlow, fine: StokesFlow, *, order: float = 2.0) -> Estimate:
    """Richardson extrapolation of two grids of the same cell; the error is a third of its step.

    Raises CaseError where the second grid is not the finer one.
    """
    if fine.cells <= coarse.cells:
        raise CaseError(
            f"stokes: grids of {coarse.cells} and {fine.cells} cells, expected a finer second one"
        )
    step = (fine.k - coarse.k) / ((fine.cells / coarse.cells) ** order - 1.0)
    return Estimate(k=fine.k + step, error=abs(step) / 3.0 / (fine.k + step))


LEAST_ERROR = 3e-3  # Relative error that is always left


def estimate(coarse: StokesFlow, fine: StokesFlow, *, with_fines: bool) -> Estimate:
    """The permeability at zero spacing, from grids whose cells are 1.5 times apart.

    On packs without fines the extrapolation of second order is within 0.3 % (rms;
    docs/theory/resolved_flow.md). Between fines in contact the fluid is thinner than a cell, so on
    the grids that can be afforded a deposit converges with orders of 1.3 to 2. Its permeability is
    the mean of the extrapolations of order 1.5 and 2, and its error is their difference.
    """
    end = extrapolate(coarse, fine)
    if not with_fines:
        return Estimate(k=end.k, error=max(end.error, LEAST_ERROR))
    low = extrapolate(coarse, fine, order=1.5).k
    k = 0.5 * (low + end.k)
    return Estimate(k=k, error=max(abs(end.k - low) / k, LEAST_ERROR))
