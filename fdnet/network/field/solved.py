"""Stokes flow on a staggered grid around grains and fines."""

from dataclasses import dataclass

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.field.forces import Held, Problem, hold
from fdnet.network.field.lattice import LEAST_CELLS, Lattice
from fdnet.network.field.response import Response, build_response
from fdnet.network.field.walls import SIDE_WALL, Marks, Walls, clear_marks, find_walls, mark
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

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
