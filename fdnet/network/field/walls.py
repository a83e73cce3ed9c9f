"""Which nodes of a staggered grid hold a wall, how far the walls stand, and whose they are.

As in the reference solver (docs/stokes.md):

* A node inside a sphere, less than one spacing below that sphere's own surface, carries the
  condition that the fluid moves with the sphere. Every sphere keeps its whole shell, also where
  it lies in another one, so that necks are closed.
* A node in the fluid with a neighbour in the solid, the wall at a fraction t of the spacing, feels
  the wall there: -u / t replaces (u_neighbour - u) (Shortley and Weller 1938, in the symmetric
  form of Gibou et al. 2002, J. Comput. Phys. 176, 205). Compared with the plain grid that is a
  drag (1/t - 1) u.
* A node half a spacing from a side wall of the specimen feels it likewise, with t = 1/2; the plain
  grid has a slip plane there, so the whole of u / t is drag.

Lengths are in the spacing along x.
"""

from dataclasses import dataclass
from math import ceil, floor, sqrt

import numpy as np

from fdnet.network.compiled import compiled
from fdnet.network.field.lattice import Lattice
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

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
