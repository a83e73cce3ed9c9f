"""Resolved Stokes flow between spheres on a staggered grid.

The staggered (MAC) grid on which resolved Stokes flow is solved.

Component d of the velocity has its nodes on the faces of the cells across d, at whole numbers
along d and at half numbers along the other axes; pressures are in the middle of the cells. The
unit of length is the cube root of a cell's volume, so that a cell has the volume 1 also where its
edges differ.
"""

import logging
import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Protocol

import numpy as np
from scipy import fft

from fdnet.errors import CaseError, FlowError
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line

LEAST_CELLS = 4
WHOLE = 1e-6
"""Part of the longest edge by which an edge may miss a whole number of cubic cells."""
Shape = tuple[int, int, int]
Closed = tuple[bool, bool, bool]
OPEN: Closed = (False, False, False)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Staggered:
    """A grid that repeats along every axis, or is the half of a cell that is mirrored along x.

    Attributes:
        shape: cells along the axes, those inside walls included.
        step: (3,) edges of a cell over the unit of length; their product is 1.
        mirrored: whether the grid is mirrored at both ends of x; component 0 then has one more
            node along x.
        closed: whether walls that hold the fluid close an axis; never x of a mirrored grid.
        inside: cells along the axes between these walls; the others of `shape` are solid.
    """

    shape: Shape
    step: Array = field(default_factory=lambda: np.ones(3))
    mirrored: bool = False
    closed: Closed = OPEN
    inside: Shape | None = None

    __repr__ = one_line

    @property
    def fluid_cells(self) -> Shape:
        """Cells along the axes without those inside walls."""
        return self.inside or self.shape

    @property
    def share(self) -> float:
        """Volume of the specimen over that of the grid."""
        return float(np.prod(self.fluid_cells) / np.prod(self.shape))

    @property
    def shapes(self) -> tuple[Shape, Shape, Shape]:
        """Nodes of each velocity component along the axes."""
        return (self.shape[0] + self.mirrored, *self.shape[1:]), self.shape, self.shape


def stagger(
    edges: Array, cells: int, *, mirrored: bool = False, closed: Closed = OPEN
) -> tuple[Staggered, float]:
    """The grid with `cells` on the longest of the `edges` (3,) m, and its unit of length, m.

    Where another edge is no whole number of cubic cells, the cells are a little longer or shorter
    along it, in a number whose Fourier transform is fast.

    Raises:
        CaseError: there are too few cells, or an edge is not positive.
    """
    if cells < LEAST_CELLS or not np.all(edges > 0.0):
        raise CaseError(
            f"stokes: {cells} cells on edges {edges.tolist()} m, expected at least {LEAST_CELLS} "
            "and positive edges"
        )
    cube = float(edges.max()) / cells
    counts = np.maximum(np.rint(edges / cube).astype(int), 2)
    for axis in np.flatnonzero(np.abs(counts * cube - edges) > WHOLE * edges.max()):
        counts[axis] = fft.next_fast_len(int(counts[axis]), real=True)
    whole = counts.copy()
    for axis in np.flatnonzero(closed):
        whole[axis] = fft.next_fast_len(int(counts[axis]) + 1, real=True)
    unit = float(np.prod(edges / counts)) ** (1.0 / 3.0)
    grid = Staggered(
        shape=(int(whole[0]), int(whole[1]), int(whole[2])),
        step=edges / counts / unit,
        mirrored=mirrored,
        closed=closed,
        inside=(int(counts[0]), int(counts[1]), int(counts[2])),
    )
    return grid, unit


# ------------------------------------------------------------------------------------------------
# Flow of point forces in a periodic box on a staggered grid, volume of a cell and viscosity 1.
#
# The discrete Stokes equations, -Laplace(u) + grad(p) = f and div(u) = 0 with the 7-point
# Laplacian, are diagonal under the Fourier transform. With g_d = (1 - exp(-i k_d)) / s_d, the
# symbol of the backward difference over a step s_d, and lambda = sum |g_d|^2, the velocity is
#
#     u_d = (f_d - g_d sum_e(conj(g_e) f_e) / lambda) / lambda,        mean velocity 0
#
# (Hasimoto 1959, J. Fluid Mech. 5, 317, with the differences of Harlow and Welch 1965, Phys.
# Fluids 8, 2182). The result is free of divergence in every cell to rounding. Transforms are in
# single precision: compared with double precision, k changes by 3e-6 (docs/stokes.md), at half the
# time and memory.
#
# A periodic box that is its own mirror image about the planes x = 0 and x = n needs only its half
# of n cells (`MirroredGreen`). The velocity across the planes is even and has nodes on both of
# them (n + 1 nodes, cosine transform DCT-I); the velocities along them are odd (n nodes, sine
# transform DST-II). The backward difference along x then has the real symbol 2 sin(pi i / 2n) /
# s_0, and the rest is as above.


class Grid(Protocol):
    """What a grid offers to the forces on it."""

    @property
    def grid(self) -> Staggered:
        """Where its nodes are."""

    @property
    def volume(self) -> float:
        """Cells of the whole periodic box."""

    def copies(self, component: int, node: Array) -> Array:
        """How many nodes of the whole box each of the flat indices `node` stands for, (M,)."""

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of `grid.shapes`, of the forces `force`, three such arrays."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Green:
    """Symbols of one grid under the Fourier transform.

    Attributes:
        grid: of n0, n1, n2 cells.
        difference: symbol g_d of the backward difference along each axis, complex.
        inverse_laplace: (n0, n1, n2 // 2 + 1), 1 / lambda.
    """

    grid: Staggered
    difference: tuple[Array, Array, Array]
    inverse_laplace: Array

    __repr__ = one_line

    @property
    def volume(self) -> float:
        """Cells of the box."""
        return float(np.prod(self.grid.shape))

    def copies(self, component: int, node: Array) -> Array:
        """One (M,): every node stands for itself."""
        return np.ones(len(node))

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of the grid's shape, of the forces `force`, three such arrays."""
        waves = [fft.rfftn(part, workers=1) for part in force]
        _respond(waves, self.difference, self.inverse_laplace)
        return [fft.irfftn(wave, s=self.grid.shape, workers=1, overwrite_x=True) for wave in waves]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class MirroredGreen:
    """Symbols of the half of a mirrored box under cosine, sine and Fourier transforms.

    Attributes:
        grid: of n0, n1, n2 cells, the half; the box has 2 n0 along x.
        difference: symbol g_d of the backward difference along each axis, real along x.
        inverse_laplace: (n0 + 1, n1, n2 // 2 + 1), 1 / lambda.
    """

    grid: Staggered
    difference: tuple[Array, Array, Array]
    inverse_laplace: Array

    __repr__ = one_line

    @property
    def volume(self) -> float:
        """Cells of the box and its mirror image."""
        return 2.0 * float(np.prod(self.grid.shape))

    def copies(self, component: int, node: Array) -> Array:
        """Two (M,), for a node and its image, and one for nodes on the planes."""
        along = node // (self.grid.shape[1] * self.grid.shape[2])
        on_plane = (component == 0) & ((along == 0) | (along == self.grid.shape[0]))
        return np.where(on_plane, 1.0, 2.0)

    def velocity(self, force: list[Array]) -> list[Array]:
        """Velocity, three arrays of `grid.shapes`, of the forces `force`, three such arrays."""
        waves = [fft.rfftn(fft.dct(force[0], type=1, axis=0), axes=(1, 2))]
        for part in force[1:]:
            wave = np.zeros(self.inverse_laplace.shape, np.complex64)
            wave[1:] = fft.rfftn(fft.dst(part, type=2, axis=0), axes=(1, 2))
            waves.append(wave)
        _respond(waves, self.difference, self.inverse_laplace)
        flows = [
            fft.irfftn(wave, s=self.grid.shape[1:], axes=(1, 2))
            for wave in (waves[0], waves[1][1:], waves[2][1:])
        ]
        return [
            fft.idct(flows[0], type=1, axis=0, overwrite_x=True),
            *(fft.idst(flow, type=2, axis=0, overwrite_x=True) for flow in flows[1:]),
        ]


def build_green(grid: Staggered) -> Green | MirroredGreen:
    """The Green's function of a grid, of half of a mirrored box where it is mirrored."""
    n = grid.shape[0]
    if grid.mirrored:
        along = 2.0 * np.sin(0.5 * np.pi * np.arange(n + 1) / n)
        difference, inverse = _symbols(along, grid)
        return MirroredGreen(grid=grid, difference=difference, inverse_laplace=inverse)
    difference, inverse = _symbols(1.0 - np.exp(-2j * np.pi * fft.fftfreq(n)), grid)
    return Green(grid=grid, difference=difference, inverse_laplace=inverse)


def _symbols(along: Array, grid: Staggered) -> tuple[tuple[Array, Array, Array], Array]:
    """Symbols of the differences and 1 / lambda, from that of the differences `along` x."""
    waves = (fft.fftfreq(grid.shape[1]), fft.rfftfreq(grid.shape[2]))
    g0, g1, g2 = (
        one / step
        for one, step in zip(
            (along, *(1.0 - np.exp(-2j * np.pi * wave) for wave in waves)), grid.step, strict=True
        )
    )
    laplace = (np.abs(g0) ** 2)[:, None, None] + (np.abs(g1) ** 2)[:, None] + np.abs(g2) ** 2
    laplace[0, 0, 0] = np.inf
    symbols = (frozen(g0, np.complex64), frozen(g1, np.complex64), frozen(g2, np.complex64))
    return symbols, frozen(1.0 / laplace, np.float32)


def _respond(
    waves: list[Array], difference: tuple[Array, Array, Array], inverse_laplace: Array
) -> None:
    """Turns the transforms of forces into those of velocities, in place."""
    g0, g1, g2 = difference
    for i, inverse in enumerate(inverse_laplace):
        f0, f1, f2 = (wave[i] for wave in waves)
        pressure = (np.conj(g0[i]) * f0 + np.conj(g1)[:, None] * f1 + np.conj(g2) * f2) * inverse
        for part, symbol in ((f0, g0[i]), (f1, g1[:, None]), (f2, g2)):
            part -= symbol * pressure
            part *= inverse


# ------------------------------------------------------------------------------------------------
# Which nodes of a staggered grid hold a wall, and how far the walls stand from them.
#
# Lengths are in units of the grid (`staggered`): a cell has the volume 1. Component d of the
# velocity has its nodes at (i, j, k) + 1/2 across the other two axes.
#
# * A node inside a sphere, less than one spacing below that sphere's own surface, carries the
#   condition u = 0. Every sphere keeps its whole shell, also where it lies in another sphere, so
#   the neck between overlapping spheres is closed by its own lens of nodes and nothing leaks from
#   solid to solid.
# * A node in the fluid with a neighbour in the solid, the wall at a fraction t of the spacing,
#   feels the wall there: (0 - u) / t replaces (u_neighbour - u) (Shortley and Weller 1938, in the
#   symmetric form of Gibou et al. 2002, J. Comput. Phys. 176, 205). Compared with the plain grid,
#   that is the extra drag (1/t - 1) u.
#
# The grid is periodic along an axis, or two walls close it, or, along x, it is the slab 0 <= x <=
# n of spheres that may reach out of it, mirrored at both of these planes: what lies outside is no
# solid, and the neighbour of a node beyond a plane is the image of the one before it. A plane cuts
# a sphere open, so all of its nodes on that plane carry u = 0: else a sphere that both planes cut
# would be a pipe from one to the other. A closed axis has a layer of solid cells at its end, where
# all nodes carry u = 0, as those on its surfaces do, and a sphere ends at it.


LEAST_DISTANCE = 1e-9
LEAST_DRAG = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Walls:
    """M nodes of one velocity component that carry a force.

    Attributes:
        node: (M,) flat index in the grid.
        slack: (M,) velocity per force at the node, for a viscosity of 1: 0 where u = 0 is imposed,
            1 / sum((1/t - 1) / step^2) at fluid nodes next to a wall.
    """

    node: Array
    slack: Array

    __repr__ = one_line


def find_walls(centre: Array, radius: Array, grid: Staggered, *, component: int) -> Walls:
    """Walls of spheres at `centre` (S, 3) with `radius` (S,), for one velocity component.

    Args:
        centre: in units of the grid, from its corner.
        radius: in units of the grid.
        grid: the grid.
        component: of the velocity, 0, 1 or 2.
    """
    offset = np.full(3, 0.5)
    offset[component] = 0.0
    nodes = grid.shapes[component]
    marks = _Marks(
        shell=np.zeros(nodes, bool),
        solid=np.zeros(nodes, bool),
        reach=np.ones((3, 2, *nodes), np.float32),
        grid=grid,
        on_planes=grid.mirrored and component == 0,
    )
    for point, r in zip(centre - offset * grid.step, radius, strict=True):
        _stamp(point, r, marks)
    for axis in np.flatnonzero(grid.closed):
        _close(marks, int(axis), across=axis == component)
    drag = _extra_drag(marks)
    node = np.flatnonzero(marks.shell | (drag > LEAST_DRAG))
    free = ~marks.solid.reshape(-1)[node]
    slack = np.zeros(len(node))
    slack[free] = 1.0 / drag.reshape(-1)[node[free]]
    return Walls(node=frozen(node), slack=frozen(slack))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Marks:
    """What the spheres have marked on the nodes of one component, changed in place.

    Attributes:
        shell: nodes that carry u = 0.
        solid: nodes inside a sphere.
        reach: (3, 2, ...) free way along each axis, ahead and back, in steps, at most 1.
        grid: the grid.
        on_planes: whether nodes lie on the planes of the mirror.
    """

    shell: Array
    solid: Array
    reach: Array
    grid: Staggered
    on_planes: bool


def _stamp(point: Array, r: float, marks: _Marks) -> None:
    """Marks the nodes of one sphere and shortens the reach of the fluid nodes around it."""
    shell, solid, grid = marks.shell, marks.solid, marks.grid
    axes = [_reached(point, r, axis, marks) for axis in range(3)]
    apart = [h * axis - c for h, axis, c in zip(grid.step, axes, point, strict=True)]
    square = apart[0][:, None, None] ** 2 + apart[1][:, None] ** 2 + apart[2] ** 2
    wrapped = [axis.astype(np.int64) % n for axis, n in zip(axes, solid.shape, strict=True)]
    inside = np.nonzero(square <= r * r)
    within = tuple(w[i] for w, i in zip(wrapped, inside, strict=True))
    solid[within] = True
    if marks.on_planes:
        shell[within] |= (within[0] == 0) | (within[0] == solid.shape[0] - 1)
    deep = float(max(grid.step))
    near = np.nonzero((square < (r + deep) ** 2) & (square > max(r - deep, 0.0) ** 2 - (r < deep)))
    power = square[near] - r * r
    node = np.ravel_multi_index(
        tuple(w[i] for w, i in zip(wrapped, near, strict=True)), solid.shape
    )
    shell.reshape(-1)[node[power <= 0.0]] = True
    for axis, step in enumerate(grid.step):
        away = apart[axis][near[axis]]
        for side, sign in enumerate((1.0, -1.0)):
            _shorten(marks.reach[axis, side].reshape(-1), node, (-sign * away, power, step))


def _reached(point: Array, r: float, axis: int, marks: _Marks) -> Array:
    """Numbers of the nodes along `axis` that a sphere reaches, or that are next to it."""
    grid = marks.grid
    centre, reach = point[axis] / grid.step[axis], (r + max(grid.step)) / grid.step[axis]
    numbers = np.arange(np.floor(centre - reach), np.ceil(centre + reach) + 1.0)
    if grid.closed[axis]:
        return numbers[(numbers >= 0.0) & (numbers <= grid.fluid_cells[axis])]
    if axis == 0 and grid.mirrored:
        return numbers[(numbers >= 0.0) & (numbers < marks.solid.shape[0])]
    return numbers


def _shorten(reach: Array, node: Array, way: tuple[Array, Array, float]) -> None:
    """Least distance, in steps, along one direction to a sphere.

    `way` is how far its centre is ahead (K,), the power (K,) of the nodes and the step.
    """
    ahead, power, step = way
    hit = (power > 0.0) & (ahead > 0.0) & (ahead**2 > power)
    distance = (ahead[hit] - np.sqrt(ahead[hit] ** 2 - power[hit])) / step
    np.minimum.at(reach, node[hit], distance.astype(np.float32))


def _close(marks: _Marks, axis: int, *, across: bool) -> None:
    """Marks the solid layer at the end of an axis.

    Its surfaces are node planes of the component `across` the axis, and lie half a step from the
    nodes of the others.
    """
    first, last = marks.grid.fluid_cells[axis], marks.grid.shape[axis]
    for one in (marks.shell, marks.solid):
        nodes = np.moveaxis(one, axis, 0)
        nodes[first:last] = True
        if across:
            nodes[0] = True
    if not across:
        ahead, back = (np.moveaxis(marks.reach[axis, side], axis, 0) for side in (0, 1))
        np.minimum(ahead[first - 1], 0.5, out=ahead[first - 1])
        np.minimum(back[0], 0.5, out=back[0])


def _extra_drag(marks: _Marks) -> Array:
    """Sum of (1/t - 1) / step^2 over the ways on which a fluid node has a solid neighbour."""
    solid, reach, grid = marks.solid, marks.reach, marks.grid
    if marks.on_planes:
        reach[0, 1, 0], reach[0, 0, -1] = reach[0, 0, 0], reach[0, 1, -1]
    drag = np.zeros(solid.shape)
    for axis in range(3):
        for side, sign in enumerate((1, -1)):
            beyond = np.roll(solid, -sign, axis=axis)
            if grid.mirrored and axis == 0:
                end = -1 if sign == 1 else 0
                beyond[end] = solid[end - sign if marks.on_planes else end]
            wall = beyond & ~solid
            free = np.maximum(reach[axis, side][wall], LEAST_DISTANCE)
            drag[wall] += (1.0 / free - 1.0) / grid.step[axis] ** 2
    return drag


# ------------------------------------------------------------------------------------------------
# The wall forces of least dissipation on a grid, by projected conjugate gradients.


LOG = logging.getLogger(__name__)
OWN_RESPONSE = 2.0 / 3.0 * 0.252731
"""Velocity of a node under a unit force on itself.

It is 2/3 of the lattice Green's function at 0 (Watson 1939).
"""
ITERATIONS = 6000
LARGEST_SLIP = 0.05
Axes = tuple[int, ...]


class Problem:
    """The scaled operator A = W (S + D) W over the wall nodes, and its constraint.

    In a mirrored cell a node of the half stands for as many nodes of the whole as its grid says
    (`Grid.copies`). The scaled forces are components along an orthonormal basis of the symmetric
    forces, so that A stays symmetric and the energies are those of the whole cell.
    """

    def __init__(self, walls: list[Walls], green: Grid, *, axis: int, balanced: Axes) -> None:
        ends = np.cumsum([0, *(len(wall.node) for wall in walls)])
        self.parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.nodes = [wall.node for wall in walls]
        self.slack = np.concatenate([wall.slack for wall in walls])
        self.weight = 1.0 / np.sqrt(OWN_RESPONSE + self.slack)
        copies = [green.copies(d, wall.node) for d, wall in enumerate(walls)]
        self.root = np.sqrt(np.concatenate(copies))
        self.load = self.weight * self.root
        self.axis, self.balanced = axis, balanced
        self.norms = [float(self.load[part] @ self.load[part]) for part in self.parts]
        self.volume = green.volume
        self.green = green
        self.grids = [np.zeros(shape, np.float32) for shape in green.grid.shapes]

    def apply(self, scaled: Array) -> Array:
        """A times `scaled` (M,)."""
        force = self.weight / self.root * scaled
        for grid, node, part in zip(self.grids, self.nodes, self.parts, strict=True):
            grid.reshape(-1)[node] = force[part]
        moved = self.slack * force
        for flow, node, part in zip(
            self.green.velocity(self.grids), self.nodes, self.parts, strict=True
        ):
            moved[part] += flow.reshape(-1)[node]
        return self.load * moved

    def project(self, scaled: Array) -> Array:
        """`scaled` without the part that carries a net force, changed in place."""
        for component in self.balanced:
            part = self.parts[component]
            load = self.load[part]
            scaled[part] -= load * float(load @ scaled[part] / self.norms[component])
        return scaled

    def start(self) -> Array:
        """Forces on the nodes of one component that balance a unit body force."""
        scaled = np.zeros(len(self.weight))
        part = self.parts[self.axis]
        scaled[part] = -self.volume / self.norms[self.axis] * self.load[part]
        return scaled

    def slip(self, square: float, energy: float) -> float:
        """Rms wall velocity over the superficial one, from the square of the residual."""
        return float(np.sqrt(square / self.norms[self.axis]) * self.volume / energy)

    def permeability(self, scaled: Array) -> tuple[float, float]:
        """k in squared units of the grid and the slip, from one fresh application."""
        moved = self.apply(scaled)
        energy = float(scaled @ moved)
        residual = self.project(moved)
        return energy / self.volume, self.slip(float(residual @ residual), energy)


def minimise(problem: Problem, tolerance: float) -> tuple[Array, int]:
    """The scaled forces of least dissipation and the iterations that they took."""
    scaled = problem.start()
    moved = problem.apply(scaled)
    energies = [float(scaled @ moved)]
    residual = problem.project(-moved)
    step, square = residual.copy(), float(residual @ residual)
    for iteration in range(1, ITERATIONS + 1):
        moved = problem.project(problem.apply(step))
        length = square / float(step @ moved)
        scaled += length * step
        residual -= length * moved
        energies.append(energies[-1] - length * square)
        if not 0.0 < energies[-1] <= energies[-2]:
            raise FlowError(
                f"stokes: dissipation {energies[-1]:.3g} after {energies[-2]:.3g} "
                f"at iteration {iteration}, expected it to fall; refine the grid"
            )
        before, square = square, float(residual @ residual)
        slip = problem.slip(square, energies[-1])
        if iteration % 25 == 0:
            LOG.info(
                "iteration %d: k %.6g spacings squared, slip %.2g",
                iteration,
                energies[-1] / problem.volume,
                slip,
            )
        if slip < LARGEST_SLIP and _settled(energies, tolerance):
            return scaled, iteration
        step *= square / before
        step += residual
    raise FlowError(
        f"stokes: k still fell by more than {tolerance:g} after {ITERATIONS} iterations, down to "
        f"{energies[-1] / energies[0]:.3g} of its start; is the pore space closed? "
        "Otherwise raise the tolerance"
    )


def _settled(energies: list[float], tolerance: float) -> bool:
    """Whether the dissipation fell by less than `tolerance` over the last iterations.

    These are the last quarter of them, at least 20.
    """
    window = max(20, len(energies) // 4)
    return (
        len(energies) > window and energies[-1 - window] - energies[-1] < tolerance * energies[-1]
    )


# ------------------------------------------------------------------------------------------------
# Resolved Stokes flow through a cell or a slab of spheres: the reference of the pore network.
#
# The formulation is our own and is derived in docs/stokes.md. A uniform body force G drives the
# fluid. All of space is taken as fluid, and the walls push back with forces F at wall nodes, so
# that with the periodic Green's function S (`green`), the slack D of the wall distances (`walls`),
# the volume V of the cell and the superficial velocity U (a vector)
#
#     S F + D F + U = 0 at every wall node,        sum(F) = - G V.
#
# S + D is symmetric and positive semi-definite, and U is the multiplier of the constraint: F
# minimises the dissipation E = F.(S + D)F among all forces of that sum, and E = V G.U at the
# minimum. Conjugate gradients, projected on the constraint and scaled by (S_ii + D)^(-1/2), lower
# E monotonically. So k = mu U / G, mu being the viscosity, comes from above, and its error is the
# square of the slip that is left at the walls. k is of second order in the spacing; `extrapolate`
# removes the leading term.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StokesFlow:
    """A solved cell.

    Attributes:
        k: permeability along the axis, m2.
        iterations: of the conjugate gradients.
        residual: rms velocity that is left at the walls over the superficial velocity.
        seconds: that the solve took.
        cells: on the longest edge.
        unknowns: number of forces.
    """

    k: float
    iterations: int
    residual: float
    seconds: float
    cells: int
    unknowns: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Extrapolated:
    """The permeability at zero spacing.

    Attributes:
        k: m2.
        relative_error: a third of the last step of the extrapolation, over k.
    """

    k: float
    relative_error: float


def solve_stokes(
    spheres: Snapshot,
    *,
    cells: int,
    axis: int = 0,
    tolerance: float = 1e-4,
    transverse: bool = True,
) -> StokesFlow:
    """Permeability of the periodic cell `spheres.box`.

    Progress goes to the log of this module every 25 iterations.

    Args:
        spheres: the solid.
        cells: on the longest edge of the cell.
        axis: of the flow, 0, 1 or 2.
        tolerance: the solve ends when the dissipation, and with it k, fell by less than this share
            over the last quarter of the iterations, and the rms slip at the walls is below 5 % of
            the mean velocity.
        transverse: whether the fluid may flow sideways. If so, k is the diagonal entry of the
            permeability tensor K; if not, it is 1 / (K^-1)_aa, which is somewhat lower.

    Raises:
        CaseError: the grid is too coarse, or there is no wall.
        FlowError: the iterations run out.
    """
    if axis not in (0, 1, 2):
        raise CaseError(f"stokes: axis {axis!r}, expected 0, 1 or 2 (x, y or z)")
    way = _Way(axis=axis, balanced=(0, 1, 2) if transverse else (axis,))
    return _solved(spheres, cells, way, tolerance)


def solve_slab(
    spheres: Snapshot,
    span: tuple[float, float],
    *,
    cells: int,
    tolerance: float = 1e-4,
    closed: Closed = OPEN,
) -> StokesFlow:
    """Permeability along x of a slab between planes of one pressure.

    The slab and its mirror image make a periodic cell. Under a uniform force its planes of
    symmetry have a constant pressure and no velocity along them, so half of the cell is solved.
    The sides y and z of `spheres.box` are periodic, or walls that hold the fluid.

    Args:
        spheres: the solid; what lies outside the slab is no part of it, but the bodies of spheres
            centred outside count as far as they reach in.
        span: lower and upper plane, x in m.
        cells: on the longest of the slab's edges.
        tolerance: as of `solve_stokes`.
        closed: whether the sides across x (never), y and z are walls.

    Raises:
        CaseError: the grid is too coarse, or there is no wall.
        FlowError: the iterations run out.
    """
    box = np.array([span, *spheres.box[1:]])
    way = _Way(axis=0, balanced=(0,), mirrored=True, closed=closed)
    return _solved(replace(spheres, box=box), cells, way, tolerance)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Way:
    """How the fluid is driven: axis, components without net force, mirrored or not, walls."""

    axis: int
    balanced: Axes
    mirrored: bool = False
    closed: Closed = OPEN


def _solved(spheres: Snapshot, cells: int, way: _Way, tolerance: float) -> StokesFlow:
    start = time.monotonic()
    edges = np.diff(spheres.box, axis=1)[:, 0]
    grid, unit = stagger(edges, cells, mirrored=way.mirrored, closed=way.closed)
    centre, radius = (spheres.position - spheres.box[:, 0]) / unit, spheres.radius / unit
    walls = [find_walls(centre, radius, grid, component=d) for d in range(3)]
    if not all(len(wall.node) for wall in walls):
        raise CaseError(
            f"stokes: no wall on the grid of {grid.shape} cells, expected spheres; "
            "add some or refine the grid"
        )
    problem = Problem(walls, build_green(grid), axis=way.axis, balanced=way.balanced)
    forces, iterations = minimise(problem, tolerance)
    k, slip = problem.permeability(forces)
    if not (k > 0.0 and slip < 2.0 * LARGEST_SLIP):
        raise FlowError(
            f"stokes: k {k * unit**2:.3g} m2 and a slip of {slip:.3g} of the mean velocity "
            f"by a fresh application after {iterations} iterations, expected below "
            f"{LARGEST_SLIP}: rounding has taken over; refine the grid"
        )
    took = time.monotonic() - start
    return StokesFlow(
        k=k * unit**2 / grid.share,
        iterations=iterations,
        residual=slip,
        seconds=took,
        cells=cells,
        unknowns=len(forces),
    )


def extrapolate(coarse: StokesFlow, fine: StokesFlow, *, order: float = 2.0) -> Extrapolated:
    """Richardson extrapolation of two grids of the same cell.

    Raises:
        CaseError: the second grid is not the finer one.
    """
    if fine.cells <= coarse.cells:
        raise CaseError(
            f"stokes: grids of {coarse.cells} and {fine.cells} cells, "
            "expected the second to be finer"
        )
    step = (fine.k - coarse.k) / ((fine.cells / coarse.cells) ** order - 1.0)
    return Extrapolated(k=fine.k + step, relative_error=abs(step) / 3.0 / (fine.k + step))


# ------------------------------------------------------------------------------------------------
# A permeability and its error from two grids whose cells are 1.5 times apart.
#
# The scheme is of second order, and on packs without fines the extrapolation of that order is
# within 0.3 % (rms; docs/stokes.md). Between fines in contact the fluid is thinner than a cell, so
# on the grids that can be afforded a deposit converges more slowly, with orders of 1.3 to 2. Its
# permeability is therefore the mean of the extrapolations of order 1.5 and 2, and its error is
# their difference.


ORDERS = (1.5, 2.0)
LEAST_ERROR = 3e-3
"""Relative error that is always left."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A permeability at zero spacing.

    Attributes:
        k: m2.
        error: share of k.
    """

    k: float
    error: float


def estimate(coarse: StokesFlow, fine: StokesFlow, *, with_fines: bool) -> Estimate:
    """The permeability at zero spacing. Raises CaseError as `extrapolate` does."""
    if not with_fines:
        end = extrapolate(coarse, fine)
        return Estimate(k=end.k, error=max(end.relative_error, LEAST_ERROR))
    low, high = (extrapolate(coarse, fine, order=order).k for order in ORDERS)
    k = 0.5 * (low + high)
    return Estimate(k=k, error=max(abs(high - low) / k, LEAST_ERROR))
