"""The wall forces of least dissipation on a grid, by projected conjugate gradients."""

import logging
from itertools import pairwise

import numpy as np

from fdnet.errors import FlowError
from fdnet.network.stokes.green import Grid
from fdnet.network.stokes.walls import Walls
from fdnet.spheres.snapshot import Array

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
