"""Resolved Stokes flow through a periodic cell of spheres: the test oracle of the pore network.

The formulation is our own and is derived in docs/stokes.md. A uniform body force G drives the
fluid. All of space is taken as fluid, and the walls push back with forces F at wall nodes, so that
with the periodic Green's function S (`green`), the slack D of the wall distances (`walls`), the
volume V of the cell and the superficial velocity U (a vector)

    S F + D F + U = 0 at every wall node,        sum(F) = - G V.

S + D is symmetric and positive semi-definite, and U is the multiplier of the constraint: F
minimises the dissipation E = F.(S + D)F among all forces of that sum, and E = V G.U at the
minimum. Conjugate gradients, projected on the constraint and scaled by (S_ii + D)^(-1/2), lower E
monotonically. So k = mu U / G, mu being the viscosity, comes from above, and its error is the
square of the slip that is left at the walls. k is of second order in the spacing; `extrapolate`
removes the leading term.
"""

import logging
import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fdnet.errors import CaseError, FlowError
from fdnet.spheres.snapshot import Array, Snapshot
from fdnet.studies.stokes.green import Green, build_green
from fdnet.studies.stokes.walls import Walls, find_walls

LOG = logging.getLogger(__name__)
OWN_RESPONSE = 2.0 / 3.0 * 0.252731
"""Velocity of a node under a unit force on itself.

It is 2/3 of the lattice Green's function at 0 (Watson 1939).
"""
ITERATIONS = 6000
LARGEST_SLIP = 0.05
EDGE_MISMATCH = 1e-6


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
        CaseError: the edges are no multiples of the spacing, or there is no wall.
        FlowError: the iterations run out.
    """
    start = time.monotonic()
    shape, spacing = _grid(spheres.box, cells)
    if axis not in (0, 1, 2):
        raise CaseError(f"stokes: axis {axis!r}, expected 0, 1 or 2 (x, y or z)")
    centre, radius = (spheres.position - spheres.box[:, 0]) / spacing, spheres.radius / spacing
    walls = [find_walls(centre, radius, shape, component=d) for d in range(3)]
    if not all(len(wall.node) for wall in walls):
        raise CaseError(
            f"stokes: no wall on the grid of {shape} cells, expected spheres; "
            "add some or refine the grid"
        )
    problem = _Problem(walls, build_green(shape), axis=axis, transverse=transverse)
    forces, iterations = _minimise(problem, tolerance)
    k, slip = problem.permeability(forces)
    if not (k > 0.0 and slip < 2.0 * LARGEST_SLIP):
        raise FlowError(
            f"stokes: k {k * spacing**2:.3g} m2 and a slip of {slip:.3g} of the mean velocity "
            f"by a fresh application after {iterations} iterations, expected below "
            f"{LARGEST_SLIP}: rounding has taken over; refine the grid"
        )
    took = time.monotonic() - start
    return StokesFlow(
        k=k * spacing**2,
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


def _grid(box: Array, cells: int) -> tuple[tuple[int, int, int], float]:
    """Cells along the edges and their spacing (m)."""
    edges = box[:, 1] - box[:, 0]
    if cells < 4 or not np.all(edges > 0.0):
        raise CaseError(
            f"stokes: {cells} cells on edges {edges.tolist()} m, "
            "expected at least 4 and positive edges"
        )
    spacing = float(edges.max()) / cells
    counts = np.rint(edges / spacing).astype(int)
    if np.any(counts < 2) or np.any(
        np.abs(counts * spacing - edges) > EDGE_MISMATCH * edges.max()
    ):
        raise CaseError(
            f"stokes: edges {edges.tolist()} m are no multiples of {spacing:.6g} m "
            f"({cells} cells on the longest); choose cells so that all edges are"
        )
    return (int(counts[0]), int(counts[1]), int(counts[2])), spacing


class _Problem:
    """The scaled operator A = W (S + D) W over the wall nodes, and its constraint."""

    def __init__(self, walls: list[Walls], green: Green, *, axis: int, transverse: bool) -> None:
        ends = np.cumsum([0, *(len(wall.node) for wall in walls)])
        self.parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.nodes = [wall.node for wall in walls]
        self.slack = np.concatenate([wall.slack for wall in walls])
        self.weight = 1.0 / np.sqrt(OWN_RESPONSE + self.slack)
        self.axis, self.balanced = axis, (0, 1, 2) if transverse else (axis,)
        self.norms = [float(self.weight[part] @ self.weight[part]) for part in self.parts]
        self.volume = float(np.prod(green.shape))
        self.green = green
        self.grids = [np.zeros(green.shape, np.float32) for _ in range(3)]

    def apply(self, scaled: Array) -> Array:
        """A times `scaled` (M,)."""
        force = self.weight * scaled
        for grid, node, part in zip(self.grids, self.nodes, self.parts, strict=True):
            grid.reshape(-1)[node] = force[part]
        moved = self.slack * force
        for flow, node, part in zip(
            self.green.velocity(self.grids), self.nodes, self.parts, strict=True
        ):
            moved[part] += flow.reshape(-1)[node]
        return self.weight * moved

    def project(self, scaled: Array) -> Array:
        """`scaled` without the part that carries a net force, changed in place."""
        for component in self.balanced:
            part = self.parts[component]
            weight = self.weight[part]
            scaled[part] -= weight * float(weight @ scaled[part] / self.norms[component])
        return scaled

    def start(self) -> Array:
        """Forces on the nodes of one component that balance a unit body force."""
        scaled = np.zeros(len(self.weight))
        part = self.parts[self.axis]
        scaled[part] = -self.volume / self.norms[self.axis] * self.weight[part]
        return scaled

    def slip(self, square: float, energy: float) -> float:
        """Rms wall velocity over the superficial one, from the square of the residual."""
        return float(np.sqrt(square / self.norms[self.axis]) * self.volume / energy)

    def permeability(self, scaled: Array) -> tuple[float, float]:
        """k in squared spacings and the slip, from one fresh application."""
        moved = self.apply(scaled)
        energy = float(scaled @ moved)
        residual = self.project(moved)
        return energy / self.volume, self.slip(float(residual @ residual), energy)


def _minimise(problem: _Problem, tolerance: float) -> tuple[Array, int]:
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
