"""The forces that hold the fluid at the walls, by conjugate gradients.

All of space is taken as fluid, and the walls push back with forces F. With the flow S of forces
(`response`), the slack D of the walls (`walls`) and the superficial velocity U,

    S F + D F + U = 0 at every wall node.

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

import numpy as np

from fdnet.errors import FlowError
from fdnet.network.field.collective import Collective
from fdnet.network.field.response import Response
from fdnet.network.field.wall_nodes import advance, differences, dot, moved_at, turn
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
