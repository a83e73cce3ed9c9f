"""The forces that hold the fluid at the walls, by conjugate gradients.

All of space is taken as fluid, and the walls push back with forces F. With the flow S of forces
(`response`), the slack D of the walls (`walls`), the superficial velocity U and the velocity v of
the walls,

    S F + D F + U = v at every wall node.

U is 1 along x. Along periodic sides the fluid may drift: the forces add up to 0 there, and that
component of U is the multiplier. S + D is symmetric and positive semi-definite. The resistance of
the specimen follows from the balance of momentum, sum(F) = -(pressure gradient) x (volume).

Forces on a plane that vary with the wave number q along it move the plane by 1 / sqrt(q2 (4 + q2))
of themselves, with q2 = 4 sin2(q/2), so S damps the short waves. The seven-point differences of
the same forces, 0 off the plane, are 2 + q2 times them. Both together are within 6 % of each other
for short waves, so the differences, with a share of the forces themselves, are the preconditioner.
What they make of forces that vary slowly from grain to grain is taken out (`collective`).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fdnet.errors import FlowError
from fdnet.network.field.collective import Collective
from fdnet.network.field.response import Response
from fdnet.network.field.wall_nodes import advance, differences, moved_at, neighbours_of, put, turn
from fdnet.network.field.walls import Walls
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

OWN_RESPONSE = 2.0 / 3.0 * 0.252731
"""Velocity of a node under a unit force on itself.

It is 2/3 of the lattice Green's function at 0 (Watson 1939). It only scales the unknowns.
"""
ITERATIONS = 4000
DIFFERENCES = 10.0
"""Weight of the differences in the preconditioner over that of the forces themselves."""


class Problem:
    """The scaled operator A = W (S + D) W over the wall nodes."""

    def __init__(self, walls: list[Walls], response: Response, reach: float) -> None:
        ends = np.cumsum([0, *(len(wall.node) for wall in walls)])
        self.parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.nodes = [wall.node for wall in walls]
        self.slack = np.concatenate([wall.slack for wall in walls])
        self.weight = 1.0 / np.sqrt(OWN_RESPONSE + self.slack)
        self.response = response
        self.drifting = [d for d in (1, 2) if not response.walled[d]]
        self.norms = [float(self.weight[part] @ self.weight[part]) for part in self.parts]
        self.grids = [np.zeros(response.shape, np.float32) for _ in range(3)]
        self.neighbours = np.concatenate(
            [
                neighbours_of(node, response.shape, part.start, len(self.slack))
                for node, part in zip(self.nodes, self.parts, strict=True)
            ]
        )

        self.collective = Collective(self.nodes, self.weight, response, self._differences, reach)

    def spread(self, force: Array) -> list[Array]:
        """Forces (M,) on their nodes: three grids, overwritten at the next call."""
        for grid, node, part in zip(self.grids, self.nodes, self.parts, strict=True):
            put(grid.reshape(-1), node, force[part])
        return self.grids

    def apply(self, scaled: Array) -> Array:
        """A times `scaled` (M,)."""
        flows = self.response.velocity(self.spread(self.weight * scaled))
        moved = [
            moved_at(flow.reshape(-1), node, self.slack[part], self.weight[part], scaled[part])
            for flow, node, part in zip(flows, self.nodes, self.parts, strict=True)
        ]
        return np.concatenate(moved)

    def smoothed(self, residual: Array) -> Array:
        """The preconditioner times a `residual` (M,), projected."""
        weighed = self._differences(residual)
        return self.project(weighed - self.collective.taken(weighed))

    def _differences(self, value: Array) -> Array:
        return differences(value, self.neighbours, DIFFERENCES / 6.0)

    def project(self, scaled: Array) -> Array:
        """`scaled` without the part that carries a net force sideways, changed in place."""
        for component in self.drifting:
            part = self.parts[component]
            load = self.weight[part]
            if self.norms[component]:
                scaled[part] -= load * float(load @ scaled[part] / self.norms[component])
        return scaled

    def right(self, target: Array | None) -> Array:
        """Right-hand side for a unit velocity along x and walls that move with `target` (M,)."""
        right = np.zeros(len(self.weight)) if target is None else target.copy()
        right[self.parts[0]] -= 1.0
        return self.weight * right

    def slip(self, square: float) -> float:
        """Rms wall velocity that is left over the superficial one, from a squared residual."""
        return float(np.sqrt(square / self.norms[0]))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Held:
    """Solved wall forces.

    Attributes:
        force: (M,) on the fluid at each node, over viscosity and superficial velocity.
        drift: (3,) mean velocity, 1 along x.
        slip: rms velocity left at the walls over the superficial one.
        iterations: of the conjugate gradients.
    """

    force: Array
    drift: Array
    slip: float
    iterations: int

    __repr__ = one_line


def hold(
    problem: Problem, tolerance: float, *, start: Array | None = None, target: Array | None = None
) -> Held:
    """The wall forces.

    Args:
        problem: the operator.
        tolerance: the slip at which the solve ends.
        start: (M,) forces to start from.
        target: (M,) velocities of the walls.

    Raises:
        FlowError: the iterations run out.
    """
    right = problem.right(target)
    scaled = np.zeros(len(right))
    residual = right.copy()
    if start is not None:
        scaled = problem.project(start / problem.weight)
        residual -= problem.apply(scaled)
    problem.project(residual)
    step = problem.smoothed(residual)
    product, iteration = float(residual @ step), 0
    while problem.slip(float(residual @ residual)) > tolerance:
        iteration += 1
        if iteration > ITERATIONS:
            raise FlowError(
                f"velocity field: a slip of {problem.slip(float(residual @ residual)):.3g} of "
                f"the superficial velocity is left at the walls after {ITERATIONS} iterations, "
                f"expected {tolerance:g}; is the pore space closed? Otherwise raise the tolerance"
            )
        moved = problem.project(problem.apply(step))
        length = product / float(step @ moved)
        advance(scaled, residual, length, step, moved)
        turned = problem.smoothed(residual)
        before, product = product, float(residual @ turned)
        turn(step, product / before, turned)
    return _finished(problem, right, (scaled, iteration))


def _finished(problem: Problem, right: Array, solved: tuple[Array, int]) -> Held:
    """Drift and true slip by one fresh application."""
    scaled, iterations = solved
    rest = right - problem.apply(scaled)
    drift = np.array([1.0, 0.0, 0.0])
    for component in problem.drifting:
        part = problem.parts[component]
        if problem.norms[component]:
            drift[component] = problem.weight[part] @ rest[part] / problem.norms[component]
    problem.project(rest)
    return Held(
        force=problem.weight * scaled,
        drift=drift,
        slip=problem.slip(float(rest @ rest)),
        iterations=iterations,
    )
