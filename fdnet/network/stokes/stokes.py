"""Resolved Stokes flow through a cell or a slab of spheres: the reference of the pore network.

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

import time
from dataclasses import dataclass, replace

import numpy as np

from fdnet.errors import CaseError, FlowError
from fdnet.network.stokes.forces import LARGEST_SLIP, Axes, Problem, minimise
from fdnet.network.stokes.green import build_green
from fdnet.network.stokes.staggered import OPEN, Closed, stagger
from fdnet.network.stokes.walls import find_walls
from fdnet.spheres.snapshot import Snapshot


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
