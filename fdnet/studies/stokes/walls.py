"""Which nodes of a staggered grid hold a wall, and how far the walls stand from them.

Lengths are in grid spacings. Component d of the velocity has its nodes at (i, j, k) + 1/2 across
the other two axes.

* A node inside a sphere, less than one spacing below that sphere's own surface, carries the
  condition u = 0. Every sphere keeps its whole shell, also where it lies in another sphere, so the
  neck between overlapping spheres is closed by its own lens of nodes and nothing leaks from solid
  to solid.
* A node in the fluid with a neighbour in the solid, the wall at a fraction t of the spacing, feels
  the wall there: (0 - u) / t replaces (u_neighbour - u) (Shortley and Weller 1938, in the
  symmetric form of Gibou et al. 2002, J. Comput. Phys. 176, 205). Compared with the plain grid,
  that is the extra drag (1/t - 1) u.

The grid is periodic along y and z. Along x it is periodic too, or it is the slab 0 <= x <= n of
spheres that may reach out of it, mirrored at both of these planes: what lies outside is no solid,
and the neighbour of a node beyond a plane is the image of the one before it. A plane cuts a sphere
open, so all of its nodes on that plane carry u = 0: else a sphere that both planes cut would be a
pipe from one to the other.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.spheres.snapshot import Array, frozen

LEAST_DISTANCE = 1e-9
LEAST_DRAG = 1e-6


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Walls:
    """M nodes of one velocity component that carry a force.

    Attributes:
        node: (M,) flat index in the grid.
        slack: (M,) velocity per force at the node, for spacing and viscosity 1: 0 where u = 0 is
            imposed, 1 / sum(1/t - 1) at fluid nodes next to a wall.
    """

    node: Array
    slack: Array


def find_walls(
    centre: Array,
    radius: Array,
    shape: tuple[int, int, int],
    *,
    component: int,
    mirrored: bool = False,
) -> Walls:
    """Walls of spheres at `centre` (S, 3) with `radius` (S,), for one velocity component.

    Args:
        centre: in spacings from the corner of the grid.
        radius: in spacings.
        shape: cells of the grid. A mirrored grid has one more node along x for component 0.
        component: of the velocity, 0, 1 or 2.
        mirrored: whether the grid is a slab that is mirrored at both ends of x.
    """
    stagger = np.full(3, 0.5)
    stagger[component] = 0.0
    on_planes = mirrored and component == 0
    nodes = (shape[0] + 1, *shape[1:]) if on_planes else shape
    marks = _Marks(
        shell=np.zeros(nodes, bool),
        solid=np.zeros(nodes, bool),
        reach=np.ones((3, 2, *nodes), np.float32),
        mirrored=mirrored,
        on_planes=on_planes,
    )
    for point, r in zip(centre - stagger, radius, strict=True):
        _stamp(point, r, marks)
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
        reach: (3, 2, ...) free way along each axis, ahead and back, at most 1.
        mirrored: whether the grid is mirrored at both ends of x.
        on_planes: whether nodes lie on the planes of the mirror.
    """

    shell: Array
    solid: Array
    reach: Array
    mirrored: bool
    on_planes: bool


def _stamp(point: Array, r: float, marks: _Marks) -> None:
    """Marks the nodes of one sphere and shortens the reach of the fluid nodes around it."""
    axes = [np.arange(np.floor(c - r - 1.0), np.ceil(c + r + 1.0) + 1.0) for c in point]
    shell, solid, reach = marks.shell, marks.solid, marks.reach
    if marks.mirrored:
        axes[0] = axes[0][(axes[0] >= 0.0) & (axes[0] < solid.shape[0])]
    apart = [axis - c for axis, c in zip(axes, point, strict=True)]
    square = apart[0][:, None, None] ** 2 + apart[1][:, None] ** 2 + apart[2] ** 2
    wrapped = [axis.astype(np.int64) % n for axis, n in zip(axes, solid.shape, strict=True)]
    inside = np.nonzero(square <= r * r)
    within = tuple(w[i] for w, i in zip(wrapped, inside, strict=True))
    solid[within] = True
    if marks.on_planes:
        shell[within] |= (within[0] == 0) | (within[0] == solid.shape[0] - 1)
    near = np.nonzero((square < (r + 1.0) ** 2) & (square > max(r - 1.0, 0.0) ** 2 - (r < 1.0)))
    power = square[near] - r * r
    node = np.ravel_multi_index(
        tuple(w[i] for w, i in zip(wrapped, near, strict=True)), solid.shape
    )
    shell.reshape(-1)[node[power <= 0.0]] = True
    for axis in range(3):
        away = apart[axis][near[axis]]
        for side, sign in enumerate((1.0, -1.0)):
            _shorten(reach[axis, side].reshape(-1), node, -sign * away, power)


def _shorten(reach: Array, node: Array, ahead: Array, power: Array) -> None:
    """Least distance along one direction to the sphere whose centre is `ahead` (K,)."""
    hit = (power > 0.0) & (ahead > 0.0) & (ahead**2 > power)
    distance = ahead[hit] - np.sqrt(ahead[hit] ** 2 - power[hit])
    np.minimum.at(reach, node[hit], distance.astype(np.float32))


def _extra_drag(marks: _Marks) -> Array:
    """Sum of (1/t - 1) over the six directions in which a fluid node has a solid neighbour."""
    solid, reach = marks.solid, marks.reach
    if marks.on_planes:
        reach[0, 1, 0], reach[0, 0, -1] = reach[0, 0, 0], reach[0, 1, -1]
    drag = np.zeros(solid.shape)
    for axis in range(3):
        for side, sign in enumerate((1, -1)):
            beyond = np.roll(solid, -sign, axis=axis)
            if marks.mirrored and axis == 0:
                end = -1 if sign == 1 else 0
                beyond[end] = solid[end - sign if marks.on_planes else end]
            wall = beyond & ~solid
            drag[wall] += 1.0 / np.maximum(reach[axis, side][wall], LEAST_DISTANCE) - 1.0
    return drag
