"""The solve of the velocity field: forces on the spheres that hold the fluid at their surfaces.

Forces that vary slowly from grain to grain, for the preconditioner of the wall forces.

The differences of `forces` weigh each force by what its own wall does. Where the grains of a
region are all pushed alike, the fluid between them moves along, and they move it much farther than
each of them alone. Without more, conjugate gradients take most of their iterations for such
forces.

So most of them are taken out of what the differences G give. With Z, which spreads three smooth
fields on the wall nodes, and the low-pass filter F of fields without divergence,

    preconditioner = G - share G Z F Z' G,        F = exp(-|q|2 reach2) for the wave number q.

Z is scaled by the smoothed density of the walls, so that Z' G Z is about 1. The greatest
eigenvalue of F Z' G Z sets the share, so that the whole stays positive definite. The fields live
on cells of half the reach, where all this costs little.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.ndimage import gaussian_filter

from fdnet.errors import FlowError, NetworkError
from fdnet.network.compiled import loops_in_place
from fdnet.network.field.grid import (
    LEAST_CELLS,
    SIDE_WALL,
    Lattice,
    Marks,
    Response,
    Walls,
    advance,
    build_response,
    clear_marks,
    differences,
    dot,
    find_walls,
    mark,
    moved_at,
    symbols,
    turn,
)
from fdnet.spheres.snapshot import Array, frozen, one_line

SHARE = 0.99
"""Share that is taken out of the force that the differences weigh most."""
REACH = 1.2
"""Length within which forces are alike, over the mean radius of the grains."""
PROBED = 12
"""Steps of the process of Lanczos for the greatest eigenvalue. In the pack of specimen 5 they give
it to 0.1 %, so the whole stays positive definite."""

Blocks = tuple[Array, Array, Array]
"""The coarse cell (n,) of each node along x, y and z."""


class Collective:
    """The slowly varying forces on wall nodes, on grids (3, n0, n1, n2).

    Args:
        weight: of the nodes, 0 where there is no wall.
        response: of the grid.
        differences: G, from forces to forces.
        radius: mean radius of the grains, in cells along x.
    """

    def __init__(
        self,
        weight: Array,
        response: Response,
        differences: Callable[[Array], Array],
        radius: float,
    ) -> None:
        fine, reach = np.array(response.shape), REACH * radius
        scale = response.scale
        coarse = np.round(fine / scale / (0.5 * reach)).astype(int)
        coarse = np.clip(coarse, np.minimum(LEAST_CELLS, fine), fine)
        self.shape = (int(coarse[0]), int(coarse[1]), int(coarse[2]))
        self.weight, self.differences = weight, differences
        self.blocks = _blocks(response.shape, self.shape)
        difference = symbols(self.shape, response.walled, scale * coarse / fine)
        self.response = replace(response, shape=self.shape, difference=difference)
        squares = np.meshgrid(*(np.abs(one) ** 2 for one in difference), indexing="ij")
        wave = np.asarray(sum(squares), np.float32)
        self.kept = wave * np.exp(-(reach**2) * wave)
        self.scale = self._scales(reach * coarse / fine * scale)
        self.share = SHARE / self._greatest()

    def reduced(self, force: Array) -> Array:
        """The `force` less what is taken out of it: `force` - share Z F Z' G `force`."""
        fields = self.scale * self._smooth(self.scale * self._gathered(self.differences(force)))
        reduced = np.empty_like(force)
        _reduce((force, self.weight), self.blocks, self.share * fields, reduced)
        return reduced

    def _smooth(self, fields: Array) -> Array:
        """F times the `fields`."""
        return np.stack(self.response.velocity(list(fields.astype(np.float32)), self.kept))

    def _gathered(self, force: Array) -> Array:
        """Sums (3, m0, m1, m2) of weight times `force` over the nodes of each block."""
        total = np.zeros((3, *self.shape))
        _gather(force, self.weight, self.blocks, np.empty(force.shape[3]), total)
        return total

    def _scales(self, width: Array) -> Array:
        """One over the root of the smoothed density of the walls, for three components."""
        own = self._gathered(self.differences(self.weight))
        modes = ["reflect" if walled else "wrap" for walled in self.response.walled]
        parts = []
        for density in own:
            some = (density > 0).astype(float)
            smooth, area = (
                gaussian_filter(one, np.sqrt(2.0) * width, mode=modes) for one in (density, some)
            )
            mean = np.divide(smooth, area, out=np.zeros_like(smooth), where=density > 0)
            parts.append(np.divide(1.0, np.sqrt(mean), out=mean, where=mean > 0))
        return np.stack(parts)

    def _greatest(self) -> float:
        """The greatest eigenvalue of F Z' G Z, by the process of Lanczos (1950).

        With E = Z' G Z, F E is symmetric in the product x' E y.
        """
        field = np.asarray(np.random.default_rng(0).standard_normal(self.scale.shape))
        former = np.zeros_like(field)
        diagonal: list[float] = []
        beside: list[float] = []
        for _ in range(PROBED):
            weighed = self._weighed(field)
            size = float(np.sqrt(max(float(np.vdot(field, weighed)), 0.0)))
            if not size > 0.0:
                break
            field, weighed = field / size, weighed / size
            moved = self._smooth(weighed)
            beside.append(size)
            diagonal.append(float(np.vdot(moved, weighed)))
            former, field = field, moved - diagonal[-1] * field - size * former
        if not max(diagonal, default=0.0) > 0.0:
            return 1.0
        return float(eigh_tridiagonal(diagonal, beside[1:], eigvals_only=True)[-1])

    def _weighed(self, fields: Array) -> Array:
        """Z' G Z times the `fields`."""
        forces = np.empty_like(self.weight)
        given = (np.zeros_like(self.weight), self.weight)
        _reduce(given, self.blocks, -self.scale * fields, forces)
        return np.asarray(self.scale * self._gathered(self.differences(forces)))


def _blocks(fine: tuple[int, ...], coarse: tuple[int, ...]) -> Blocks:
    """The coarse cell of each node along each axis."""
    x, y, z = (np.arange(n) * m // n for n, m in zip(fine, coarse, strict=True))
    return x, y, z


@loops_in_place
def _gather(force: Array, weight: Array, blocks: Blocks, row: Array, total: Array) -> None:
    """Adds weight times `force` to the `total` (3, m0, m1, m2); `row` is room for n2 numbers."""
    x, y, z = blocks
    for d in range(3):
        for i in range(len(x)):
            for j in range(len(y)):
                if j == 0 or y[j] != y[j - 1]:
                    row[:] = 0.0
                one, own = force[d, i, j], weight[d, i, j]
                for k in range(len(z)):
                    row[k] += np.float64(own[k] * one[k])
                if j + 1 == len(y) or y[j + 1] != y[j]:
                    into = total[d, x[i], y[j]]
                    for k in range(len(z)):
                        into[z[k]] += row[k]


@loops_in_place
def _reduce(given: tuple[Array, Array], blocks: Blocks, fields: Array, reduced: Array) -> None:
    """Sets `reduced` to the force less weight times the field of each node's block."""
    force, weight = given
    x, y, z = blocks
    for d in range(3):
        for i in range(len(x)):
            for j in range(len(y)):
                field, one, own = fields[d, x[i], y[j]], force[d, i, j], weight[d, i, j]
                done = reduced[d, i, j]
                for k in range(len(z)):
                    done[k] = one[k] - own[k] * np.float32(field[z[k]])


# ------------------------------------------------------------------------------------------------
# The forces that hold the fluid at the walls, by conjugate gradients.
#
# All of space is taken as fluid, and the walls push back with forces F. With the flow S of forces
# (`response`), the slack D of the walls (`walls`) and the superficial velocity U,
#
#     S F + D F + U = 0 at every wall node.
#
# U is 1 along x. Along periodic sides the fluid may drift: the forces add up to 0 there, and that
# component of U is the multiplier. S + D is symmetric and positive semi-definite. The resistance
# of the specimen follows from the balance of momentum, sum(F) = -(pressure gradient) x (volume).
#
# Forces on a plane that vary with the wave number q along it move the plane by 1 / sqrt(q2 (4 +
# q2)) of themselves, with q2 = 4 sin2(q/2), so S damps the short waves. The seven-point
# differences of the same forces, 0 off the plane, are 2 + q2 times them. Both together are within
# 6 % of each other for short waves, so the differences, with a share of the forces themselves, are
# the preconditioner. What they make of forces that vary slowly from grain to grain is taken out
# (`collective`).


OWN_RESPONSE = 2.0 / 3.0 * 0.252731
"""Velocity of a node under a unit force on itself.

It is 2/3 of the lattice Green's function at 0 (Watson 1939). It only scales the unknowns.
"""
ITERATIONS = 4000
DIFFERENCES = 10.0
"""Weight of the differences in the preconditioner over that of the forces themselves."""


class Problem:
    """The scaled operator A = W (S + D) W over the wall nodes.

    Numbers at the nodes are grids (3, n0, n1, n2) of single precision, 0 where there is no wall.
    """

    def __init__(self, walls: list[Walls], response: Response, radius: float) -> None:
        self.walls, self.response = walls, response
        self.weight, self.own = (np.zeros((3, *response.shape), np.float32) for _ in range(2))
        for wall, weight, own in zip(walls, self.weight, self.own, strict=True):
            square = 1.0 / (OWN_RESPONSE + wall.slack)
            weight.reshape(-1)[wall.node] = np.sqrt(square)
            own.reshape(-1)[wall.node] = wall.slack * square
        self.drifting = [d for d in (1, 2) if not response.walled[d]]
        self.norms = [dot(part, part) for part in self.weight]
        self.collective = Collective(self.weight, response, self._differences, radius)

    def apply(self, scaled: Array, force: Array) -> Array:
        """A times `scaled`, whose `force` is weight times it."""
        flows, moved = self.response.velocity(list(force)), np.empty_like(scaled)
        for flow, *rest in zip(flows, self.weight, self.own, scaled, moved, strict=True):
            moved_at(flow.reshape(-1), *(part.reshape(-1) for part in rest))
        return moved

    def smoothed(self, residual: Array) -> Array:
        """The preconditioner times a `residual`, projected."""
        return self.project(self._differences(self.collective.reduced(residual)))

    def _differences(self, value: Array) -> Array:
        return differences(value, self.weight, DIFFERENCES / 6.0)

    def project(self, scaled: Array) -> Array:
        """`scaled` without the part that carries a net force sideways, changed in place."""
        for component in self.drifting:
            load, part = self.weight[component], scaled[component]
            if self.norms[component]:
                part -= load * np.float32(dot(load, part) / self.norms[component])
        return scaled

    def right(self) -> Array:
        """Right-hand side for a unit velocity along x and walls at rest."""
        right = np.zeros_like(self.weight)
        right[0] -= self.weight[0]
        return right

    def slip(self, square: float) -> float:
        """Rms wall velocity that is left over the superficial one, from a squared residual."""
        return float(np.sqrt(square / self.norms[0]))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Held:
    """Solved wall forces.

    Attributes:
        force: (3, n0, n1, n2) on the fluid at each node, over viscosity and superficial velocity.
        drift: (3,) mean velocity, 1 along x.
        slip: rms velocity left at the walls over the superficial one.
        iterations: of the conjugate gradients.
    """

    force: Array
    drift: Array
    slip: float
    iterations: int

    __repr__ = one_line


def hold(problem: Problem, tolerance: float) -> Held:
    """The wall forces, solved until the slip is below `tolerance`.

    Raises:
        FlowError: the iterations run out.
    """
    right, weight = problem.right(), problem.weight
    scaled, residual = np.zeros_like(right), right.copy()
    problem.project(residual)
    step = problem.smoothed(residual)
    force = weight * step
    product, square, iteration = dot(residual, step), dot(residual, residual), 0
    while problem.slip(square) > tolerance:
        iteration += 1
        if iteration > ITERATIONS:
            raise FlowError(
                f"velocity field: a slip of {problem.slip(square):.3g} of "
                f"the superficial velocity is left at the walls after {ITERATIONS} iterations, "
                f"expected {tolerance:g}; is the pore space closed? Otherwise raise the tolerance"
            )
        moved = problem.project(problem.apply(step, force))
        square = advance(scaled, residual, product / dot(step, moved), (step, moved))
        turned = problem.smoothed(residual)
        before, product = product, dot(residual, turned)
        turn(step, product / before, turned, (weight, force))
    return _finished(problem, right, (scaled, iteration))


def _finished(problem: Problem, right: Array, solved: tuple[Array, int]) -> Held:
    """Drift and true slip by one fresh application."""
    scaled, iterations = solved
    force = problem.weight * scaled
    rest = right - problem.apply(scaled, force)
    drift = np.array([1.0, 0.0, 0.0])
    for component in problem.drifting:
        if problem.norms[component]:
            load = dot(problem.weight[component], rest[component])
            drift[component] = load / problem.norms[component]
    problem.project(rest)
    return Held(
        force=force,
        drift=drift,
        slip=problem.slip(dot(rest, rest)),
        iterations=iterations,
    )


# ------------------------------------------------------------------------------------------------
# Stokes flow on a staggered grid around grains and fines.


Spheres = tuple[Array, Array]
"""Centres (N, 3) m and radii (N,) m."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Skeleton:
    """The grains on their grid: what every deposit among them shares.

    Attributes:
        lattice: the grid.
        grains: centres (N, 3) m and radii (N,) m.
        marks: what the grains mark on the nodes of each velocity component.
        response: flow of forces on the grid.
    """

    lattice: Lattice
    grains: Spheres
    marks: tuple[Marks, Marks, Marks]
    response: Response

    __repr__ = one_line


def build_skeleton(lattice: Lattice, grains: Spheres) -> Skeleton:
    """Marks the grains on the grid."""
    marks = [clear_marks(lattice) for _ in range(3)]
    for component, one in enumerate(marks):
        mark(one, lattice, component, grains, 0)
    return Skeleton(
        lattice=lattice,
        grains=grains,
        marks=(marks[0], marks[1], marks[2]),
        response=build_response(lattice),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Solved:
    """A solved flow. G grains, N fines, forces on the fluid by the walls.

    Attributes:
        force: for each component (n0, n1, n2) force at its nodes, over viscosity and superficial
            velocity, in units of the lattice (spacing along x 1).
        drift: (3,) mean velocity over the superficial one along x.
        slip: rms velocity left at the walls, over the superficial one.
        iterations: of the conjugate gradients.
        solid: for each component (n0, n1, n2), true at nodes in the solid.
        sphere_force: (G + N, 3) m, force of the fluid on each sphere over viscosity and
            superficial velocity.
        wall_force: (3,) m, likewise on the side walls.
    """

    force: tuple[Array, Array, Array]
    drift: Array
    slip: float
    iterations: int
    solid: tuple[Array, Array, Array]
    sphere_force: Array
    wall_force: Array

    __repr__ = one_line


def solve(skeleton: Skeleton, fines: Spheres, tolerance: float) -> Solved:
    """The flow around grains and fines with a superficial velocity of 1 along x.

    Args:
        skeleton: the grains.
        fines: centres (N, 3) m and radii (N,) m; each holds the fluid at its surface.
        tolerance: rms velocity over the superficial one that may be left at the walls.

    Raises:
        NetworkError: no node of the grid feels a wall.
        FlowError: the iterations run out.
    """
    lattice, count = skeleton.lattice, len(skeleton.grains[1])
    walls, solid = [], []
    for component, clean in enumerate(skeleton.marks):
        marks = clean
        if len(fines[1]):
            marks = clean.copy()
            mark(marks, lattice, component, fines, count)
        walls.append(find_walls(marks, lattice, component))
        solid.append(marks.solid != 0)
    if not any(len(wall.node) for wall in walls):
        raise NetworkError(
            f"velocity field: no wall on the grid of {lattice.shape} cells, expected grains in "
            "the box; give grains or a finer grid"
        )
    problem = Problem(walls, skeleton.response, _radius(skeleton))
    held = hold(problem, tolerance)
    return _result(walls, held, (lattice, count + len(fines[1])), solid)


def _radius(skeleton: Skeleton) -> float:
    """The mean radius of the grains in cells along x; a few cells where there is no grain."""
    radius = skeleton.grains[1]
    return float(radius.mean()) / skeleton.lattice.unit if len(radius) else float(LEAST_CELLS)


def _result(
    walls: list[Walls], held: Held, given: tuple[Lattice, int], solid: list[Array]
) -> Solved:
    """What the forces do to all spheres; `given` are the grid and the number of spheres."""
    lattice, count = given
    # a node's force is per volume of a cell, in units of the spacing along x
    scale = -np.prod(lattice.spacing) / lattice.unit**2
    on_spheres, on_walls = np.zeros((count, 3)), np.zeros(3)
    for component, (wall, grid) in enumerate(zip(walls, held.force, strict=True)):
        force, who = scale * grid.reshape(-1)[wall.node].astype(float), wall.owner
        spheres = who >= 0
        on_spheres[:, component] = np.bincount(who[spheres], force[spheres], minlength=count)
        on_walls[component] = force[who == SIDE_WALL].sum()
    grids = [frozen(grid) for grid in held.force]
    return Solved(
        force=(grids[0], grids[1], grids[2]),
        drift=frozen(held.drift),
        slip=held.slip,
        iterations=held.iterations,
        solid=(solid[0], solid[1], solid[2]),
        sphere_force=frozen(on_spheres),
        wall_force=frozen(on_walls),
    )
