"""Which nodes of a staggered grid hold a wall, and how far the walls stand from them.

Lengths are in units of the grid (`staggered`): a cell has the volume 1. Component d of the
velocity has its nodes at (i, j, k) + 1/2 across the other two axes.

* A node inside a sphere, less than one spacing below that sphere's own surface, carries the
  condition u = 0. Every sphere keeps its whole shell, also where it lies in another sphere, so the
  neck between overlapping spheres is closed by its own lens of nodes and nothing leaks from solid
  to solid.
* A node in the fluid with a neighbour in the solid, the wall at a fraction t of the spacing, feels
  the wall there: (0 - u) / t replaces (u_neighbour - u) (Shortley and Weller 1938, in the
  symmetric form of Gibou et al. 2002, J. Comput. Phys. 176, 205). Compared with the plain grid,
  that is the extra drag (1/t - 1) u.

The grid is periodic along an axis, or two walls close it, or, along x, it is the slab 0 <= x <= n
of spheres that may reach out of it, mirrored at both of these planes: what lies outside is no
solid, and the neighbour of a node beyond a plane is the image of the one before it. A plane cuts a
sphere open, so all of its nodes on that plane carry u = 0: else a sphere that both planes cut
would be a pipe from one to the other. A closed axis has a layer of solid cells at its end, where
all nodes carry u = 0, as those on its surfaces do, and a sphere ends at it.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.stokes.staggered import Staggered
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

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
