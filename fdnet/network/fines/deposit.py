"""What the fines fill of each pore, exact for every fine.

Points in given boxes, by sorting the points into cubic cells.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, copysign, pi, sqrt
from typing import NamedTuple

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled, compiled_in_place
from fdnet.network.network import Network
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line, unmoved


def points_in_boxes(point: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """All pairs of a box and a point in it, in the order of the boxes.

    Args:
        point: (N, 3) m.
        low: (M, 3) m, low corners of the boxes.
        high: (M, 3) m, high corners; points on the faces of a box are in it.

    Returns:
        Index of the box (K,) and of the point (K,).
    """
    if not len(point) or not len(low):
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    grid, order = grid_of(point)
    placed, count = point[order], np.empty(len(low), np.intp)
    _search(grid, placed, low, high, count, np.zeros(0, np.intp))
    box = np.repeat(np.arange(len(low)), count)
    inside = np.empty(len(box), np.intp)
    _search(grid, placed, low, high, count, inside)
    return box, order[inside]


class Grid(NamedTuple):
    """Cubic cells that hold points."""

    start: Array
    """(3,) m, the low corner."""
    edge: float
    """m, of a cell."""
    shape: Array
    """(3,) number of cells along each axis."""
    first: Array
    """Of each cell the index of its first point, and the number of points at the end."""


def grid_of(point: Array, edge: float | None = None) -> tuple[Grid, Array]:
    """Points (N, 3) m sorted into cubic cells of `edge` m, with N at least 1.

    Without an edge the cells are as many as the points along the longest side of a cube.

    Returns:
        The cells, and the order (N,) in which they hold the points.
    """
    start = point.min(axis=0)
    if edge is None:
        edge = max(float(np.ptp(point, axis=0).max()) / len(point) ** (1.0 / 3.0), 1e-300)
    cell = ((point - start) / edge).astype(np.intp)
    shape = cell.max(axis=0) + 1
    flat = np.ravel_multi_index(tuple(cell.T), tuple(shape))
    order = np.argsort(flat, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(flat, minlength=int(shape.prod())))])
    return Grid(start, edge, shape, first), order


@compiled_in_place
def cells_between(
    low: float, high: float, start: float, edge: float, number: int
) -> tuple[int, int]:
    """The first cell along an axis between `low` and `high` m, and the one after the last.

    The `number` cells begin at `start` m, and each is `edge` m long.
    """
    lower, upper = (low - start) / edge, (high - start) / edge + 1.0
    return int(min(max(lower, 0.0), float(number))), int(min(max(upper, 0.0), float(number)))


@compiled_in_place
def _search(
    grid: Grid, point: Array, low: Array, high: Array, count: Array, inside: Array
) -> None:
    """Sets the number of points (M,) in each box, and their indices where `inside` has room."""
    start, edge, shape, first = grid.start, grid.edge, grid.shape, grid.first
    total = 0
    for box in range(len(low)):
        x, y, z = low[box, 0], low[box, 1], low[box, 2]
        u, v, w = high[box, 0], high[box, 1], high[box, 2]
        i0, i1 = cells_between(x, u, start[0], edge, shape[0])
        j0, j1 = cells_between(y, v, start[1], edge, shape[1])
        k0, k1 = cells_between(z, w, start[2], edge, shape[2])
        before = total
        for i in range(i0, i1):
            for j in range(j0, j1):
                row = (i * shape[1] + j) * shape[2]
                for k in range(first[row + k0], first[row + max(k1, k0)]):
                    if x <= point[k, 0] <= u and y <= point[k, 1] <= v and z <= point[k, 2] <= w:
                        if total < len(inside):
                            inside[total] = k
                        total += 1
        count[box] = total - before


# ------------------------------------------------------------------------------------------------
# The piece of a ball inside a tetrahedron: volume and surface in closed form.
#
# The two may lie anywhere. The tetrahedron is the signed sum of the cones from the centre of the
# ball to its facets. Each cone is the signed sum, over the edges of its facet, of the cones to the
# triangles between the edge and the foot of the centre on the facet.
#
# Lengths are in units of the radius of the ball: d is the distance of the facet from the centre, h
# the distance of the edge from the foot, t the place along the edge from the point nearest to the
# foot; all are signed. phi = arctan(t / h) is the angle about the foot. The part of the sphere in
# a cone is made of the directions that leave the ball before they reach the facet:
#
#     integral of (1 - cos theta) d phi  less the same within the disc of the facet
#         = c phi(t) - arctan(t d / (h sqrt(t^2 + h^2 + d^2))),
#
# taken between the ends of each part of the edge outside the disc of radius sqrt(1 - d^2). Here
# c = d where the plane of the facet cuts the ball, and c = 1 where the ball lies inside of it
# (outside of it the piece is empty). With cos theta = d / sqrt(d^2 + h^2 / cos^2 phi) the second
# term is the integral of cos theta.
#
# The volume is a third of that surface, plus d / 3 times the area common to triangle and disc
# (divergence theorem). Strobl, Formella and Poeschel 2016 (J. Comput. Phys. 311, 158) decompose by
# facets and edges too.


ROUNDING = 1e-13
"""A piece of less volume, in cubes of the radius, is rounding."""
OTHERS = np.array([(1, 2, 3), (2, 3, 0), (3, 0, 1), (0, 1, 2)])
"""(4, 3) corners of the facet opposite each corner."""

Vector = tuple[float, float, float]


@compiled
def pieces(corner: Array, pairs: tuple[Array, Array], centre: Array, radius: Array) -> Array:
    """Volume m3 and surface m2 (K, 2) of the piece of a ball in a tetrahedron, pair by pair.

    Both are 0 where the two are apart. Pieces below 1e-13 cubes of the radius are rounding and
    left out.

    Args:
        corner: (P, 4, 3) m, corners of the tetrahedra.
        pairs: index of the tetrahedron and of the ball (K,), which may be apart.
        centre: (N, 3) m, of the balls.
        radius: (N,) m, of the balls.
    """
    pore, ball = pairs
    normal, place, depth = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros(4)
    measured = np.zeros((len(pore), 2))
    last = -1
    for k in range(len(pore)):
        p, b = pore[k], ball[k]
        if p != last:
            _facet_normals(corner[p], normal)
            last = p
        cuts = np.int64(0)
        for f in range(4):
            depth[f] = _dot(normal[f], _apart(corner[p, OTHERS[f, 0]], centre[b])) / -radius[b]
            cuts += 1 if depth[f] < 1.0 else 0
        if min(min(depth[0], depth[1]), min(depth[2], depth[3])) <= -1.0:
            continue
        for c in range(4):
            for axis in range(3):
                place[c, axis] = (corner[p, c, axis] - centre[b, axis]) / radius[b]
        inside, area = _piece(place, normal, depth, cuts)
        if inside > ROUNDING:
            measured[k, 0], measured[k, 1] = inside * radius[b] ** 3, area * radius[b] ** 2
    return measured


@compiled
def _apart(a: Array, b: Array) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _facet_normals(corner: Array, normal: Array) -> None:
    """Inward unit normals (4, 3) of the facets opposite each corner."""
    turn = 1.0
    for f in range(4):
        a, b, c = corner[OTHERS[f, 0]], corner[OTHERS[f, 1]], corner[OTHERS[f, 2]]
        across = _cross(_apart(b, a), _apart(c, a))
        if f == 0:
            # one sign for all four, so that the facets of a flat tetrahedron face each other
            turn = copysign(1.0, _dot(_apart(corner[0], a), across))
        scale = (turn if f % 2 == 0 else -turn) / sqrt(_dot(across, across))
        for axis in range(3):
            normal[f, axis] = scale * across[axis]


@compiled
def _piece(place: Array, normal: Array, depth: Array, cuts: int) -> tuple[float, float]:
    """Volume and surface of the unit ball about the origin inside a tetrahedron.

    `place` (4, 3) are its corners, `normal` (4, 3) the inward normals of its facets, `depth` (4,)
    the distances of the facets and `cuts` the number of facets that cut the ball: the piece is the
    whole ball, a cap, or the sum over facets and edges.
    """
    if cuts == 0:
        return 4.0 / 3.0 * pi, 4.0 * pi
    if cuts == 1:
        height = 1.0 + min(min(depth[0], depth[1]), min(depth[2], depth[3]))
        return pi * height**2 * (3.0 - height) / 3.0, 2.0 * pi * height
    volume, surface = 0.0, 0.0
    for f in range(4):
        for e in range(3):
            start, end, third = (
                place[OTHERS[f, e]],
                place[OTHERS[f, e - 2]],
                place[OTHERS[f, e - 1]],
            )
            side = _apart(end, start)
            length = sqrt(_dot(side, side))
            if length == 0.0:  # shorter than the rounding of places in radii of the ball
                continue
            inward = _cross(normal[f], side)
            height = -_dot(inward, start) / length
            if _dot(inward, _apart(third, start)) < 0.0:
                height = -height
            area, shadow = _edge(
                depth[f], height, _dot(side, start) / length, _dot(side, end) / length
            )
            volume += (shadow + depth[f] * area) / 3.0
            surface += shadow
    return volume, surface


@compiled
def _edge(depth: float, height: float, start: float, end: float) -> tuple[float, float]:
    """Area of the triangle (foot, edge) within the disc, and solid angle of the part outside it.

    The facet lies at `depth`, the edge at `height` from the foot, from `start` to `end` > `start`.
    The area has the sign of `height`, the solid angle that of `depth` times `height`.
    """
    disc = 1.0 - depth**2
    if disc <= 0.0:
        return 0.0, _shadow(1.0, depth, height, start, end)[0]
    chord = disc - height**2
    if chord <= 0.0:
        shadow, turn = _shadow(depth, depth, height, start, end)
        return 0.5 * disc * turn, shadow
    enter = min(max(-sqrt(chord), start), end)
    leave = min(max(sqrt(chord), start), end)
    before, turn_before = _shadow(depth, depth, height, start, enter)
    after, turn_after = _shadow(depth, depth, height, leave, end)
    return 0.5 * (height * (leave - enter) + disc * (turn_before + turn_after)), before + after


@compiled
def _shadow(
    weight: float, depth: float, height: float, start: float, end: float
) -> tuple[float, float]:
    """Solid angle over the part of an edge from `start` to `end`, and its angle about the foot."""
    if start == end:
        return 0.0, 0.0
    side, away = copysign(1.0, height), abs(height)
    square = height**2 + depth**2
    turn = side * (atan2(end, away) - atan2(start, away))
    tilt = atan2(end * depth, away * sqrt(end**2 + square)) - atan2(
        start * depth, away * sqrt(start**2 + square)
    )
    return weight * turn - side * tilt, turn


# ------------------------------------------------------------------------------------------------
# The parts of tetrahedra inside the box: cut at its mirrored faces into smaller tetrahedra.


FLAT = 1e-14
"""Volume over the cube of the longest edge, below which a tetrahedron is flat."""


def clip_to_box(corner: Array, box: Array, periodic: tuple[bool, ...]) -> tuple[Array, Array]:
    """The parts of tetrahedra within the faces of `box` that are not periodic.

    Args:
        corner: (C, 4, 3) m, corners of the tetrahedra.
        box: (3, 2) m, lower and upper bounds.
        periodic: whether the axes x, y and z are periodic; their faces cut nothing.

    Returns:
        Corners (K, 4, 3) m of the tetrahedra that make up the parts, and the index (K,) of the
        tetrahedron that each is a part of.
    """
    owner = np.arange(len(corner))
    for axis in range(3):
        for face, sign in zip(box[axis], (1.0, -1.0), strict=True):
            if not periodic[axis]:
                height = sign * (corner[:, :, axis] - face)
                corner, owner = _above(corner, owner, height)
    solid = _is_solid(corner)
    return corner[solid], owner[solid]


def _is_solid(corner: Array) -> Array:
    """Whether tetrahedra (C, 4, 3) have a volume beyond rounding, against the cube of an edge."""
    edge = np.ptp(corner, axis=1).max(axis=1)
    return np.abs(geometry.signed_volume(corner)) > FLAT * edge**3


def _above(corner: Array, owner: Array, height: Array) -> tuple[Array, Array]:
    """Parts of tetrahedra above the plane over which their corners lie `height` (C, 4) m high."""
    positive = height > 0.0
    count = positive.sum(axis=1)
    whole = count == 4
    corners, owners = [corner[whole]], [owner[whole]]
    for kept, parts in ((1, _cut_one), (2, _cut_two), (3, _cut_three)):
        chosen = np.flatnonzero(count == kept)
        order = np.argsort(~positive[chosen], axis=1, kind="stable")
        sorted_corner = np.take_along_axis(corner[chosen], order[:, :, None], axis=1)
        sorted_height = np.take_along_axis(height[chosen], order, axis=1)
        pieces = parts(sorted_corner, sorted_height)
        corners.append(pieces.reshape(-1, 4, 3))
        owners.append(np.repeat(owner[chosen], pieces.shape[1]))
    return np.concatenate(corners), np.concatenate(owners)


def _crossing(corner: Array, height: Array, first: int, second: int) -> Array:
    """Points (C, 3) where the edges from corner `first` to `second` meet the plane."""
    share = height[:, first] / (height[:, first] - height[:, second])
    return corner[:, first] + share[:, None] * (corner[:, second] - corner[:, first])


def _cut_one(corner: Array, height: Array) -> Array:
    """One corner above the plane: the tetrahedron of this corner and three crossings."""
    points = [corner[:, 0], *(_crossing(corner, height, 0, other) for other in (1, 2, 3))]
    return np.stack(points, axis=1)[:, None]


def _cut_two(corner: Array, height: Array) -> Array:
    """Two corners above: a wedge with the triangles (0, 02, 03) and (1, 12, 13)."""
    near = [corner[:, 0], _crossing(corner, height, 0, 2), _crossing(corner, height, 0, 3)]
    far = [corner[:, 1], _crossing(corner, height, 1, 2), _crossing(corner, height, 1, 3)]
    return _wedge(near, far)


def _cut_three(corner: Array, height: Array) -> Array:
    """Three corners above: a wedge between their facet and the three crossings."""
    near = [corner[:, k] for k in (0, 1, 2)]
    far = [_crossing(corner, height, k, 3) for k in (0, 1, 2)]
    return _wedge(near, far)


def _wedge(near: list[Array], far: list[Array]) -> Array:
    """Three tetrahedra (C, 3, 4, 3) of the wedge between two triangles."""
    a, b, c = near
    d, e, f = far
    pieces = [[a, b, c, d], [b, c, d, e], [c, d, e, f]]
    return np.stack([np.stack(piece, axis=1) for piece in pieces], axis=1)


# ------------------------------------------------------------------------------------------------
# Which fines reach into the box; their images, shifted or mirrored, beyond its faces.


def centred_inside(network: Network, position: Array) -> Array:
    """True (N,) for `position` (N, 3) m within the box along the axes that are not periodic."""
    low, high = network.box.T
    return np.all(((position >= low) & (position < high)) | np.array(network.periodic), axis=1)


def reaching_inside(network: Network, fines: Snapshot) -> Array:
    """True (N,) for fines whose sphere reaches into the box along axes that are not periodic."""
    low, high = network.box.T
    reach = fines.radius[:, None]
    inside = (fines.position + reach > low) & (fines.position - reach < high)
    return np.all(inside | np.array(network.periodic), axis=1)


def images_near(
    network: Network,
    position: Array,
    low: Array,
    high: Array,
    largest: float,
    *,
    mirrored: bool = True,
) -> tuple[Array, Array]:
    """Places (M, 3) m and owners (M,) of all images near a region.

    They are those across periodic sides, and the mirror images beyond the other faces where
    `mirrored`. The region is [`low`, `high`] (3,) m, widened by `largest` m. A centre (`position`,
    (N, 3) m) on or beyond a face that is not periodic has no mirror image there.
    """
    beyond = np.maximum(network.box[:, 0] - low, high - network.box[:, 1])
    margin = np.maximum(beyond, 0.0) + largest
    images = make_images(
        position,
        network.box,
        periodic=network.periodic,
        margin=margin if mirrored else np.where(network.periodic, margin, np.nan),
        tolerance=0.0,
    )
    return images.position, images.owner


def size_classes(radius: Array) -> list[Array]:
    """Indices of `radius` (N,) m in classes within a factor of two.

    A few large fines then do not widen the search for all.
    """
    step = np.floor(np.log2(radius / radius.min())).astype(int)
    return [np.flatnonzero(step == one) for one in np.unique(step)]


# ------------------------------------------------------------------------------------------------
# What the fines fill of each pore, exact for every fine.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Holders:
    """The pores (P) of a network, which hold fines, as tetrahedra inside the box.

    Attributes:
        network: whose pores they are.
        piece: (K, 4, 3) m, the tetrahedra.
        low: (K, 3) m, their lower corners.
        high: (K, 3) m, their upper corners.
        pore: (K,) that each is a part of.
    """

    network: Network
    piece: Array
    low: Array
    high: Array
    pore: Array

    __repr__ = one_line


def holders_of(network: Network) -> Holders:
    """The pores of a network, cut at the faces of its box."""
    piece, pore = clip_to_box(network.pore_corner, network.box, network.periodic)
    return Holders(
        network=network,
        piece=frozen(np.ascontiguousarray(piece)),
        low=frozen(piece.min(axis=1)),
        high=frozen(piece.max(axis=1)),
        pore=frozen(pore),
    )


def _pieces(holders: Holders, fines: Snapshot) -> Iterator[tuple[Array, Array, Array]]:
    """The tetrahedron and the fine (N,) of pairs that may touch, and what they share (N, 2).

    That is the volume m3 and the surface m2 of the piece of the fine; it may be 0. The pairs of
    one size of fines after the other are given, with the images across periodic sides.
    """
    for some in size_classes(fines.radius) if len(fines) and len(holders.piece) else []:
        radius = fines.radius[some]
        largest = float(radius.max())
        low, high = holders.low.min(axis=0), holders.high.max(axis=0)
        position, image = images_near(
            holders.network, fines.position[some], low, high, largest, mirrored=False
        )
        pairs = points_in_boxes(position, holders.low - largest, holders.high + largest)
        yield (
            pairs[0],
            some[image[pairs[1]]],
            pieces(holders.piece, pairs, position, radius[image]),
        )


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """What `fines`, each reaching into the box, fill of each tetrahedron.

    Only what lies inside the box counts, with the images across periodic sides. A pore that a
    mirrored face cuts stands for the whole mirrored tetrahedron, so what the part inside holds is
    divided by the share inside (`Network.pore_share`); this is exact for all pores of one
    `pore_group` together. What fines hide of each other or of grains is not subtracted.

    Returns:
        Volume (P,) m3 and surface (P,) m2 of the fines inside.
    """
    holders = holders_of(network)
    filled, total = np.zeros((len(holders.piece), 2)), np.zeros((len(network.pore_corner), 2))
    for piece, _, measured in _pieces(holders, fines):
        np.add.at(filled, piece, measured)
    np.add.at(total, holders.pore, filled)
    volume, surface = (total / network.pore_share[:, None]).T
    return volume, surface


# ------------------------------------------------------------------------------------------------
# The deposit of a pack measured fine by fine, so that only fines that moved are measured anew.
#
# The volume of each fine in each pore is kept as a piece. When fines come, leave or move, their
# pieces are replaced. The order of the pieces does not depend on which were kept, and so neither
# do sums over them, to the last digit.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptDeposit:
    """Fines (N) and their pieces (K) in the pores.

    Attributes:
        holders: of the network.
        fines: as they were measured.
        pore: (K,) that holds the piece.
        fine: (K,) index of the fine; pieces are sorted by the number of the fine, then by pore.
        volume: (K,) m3 of the fine in the pore, over the share of the pore inside the box.
        renewed: number of fines that the last change measured.
    """

    holders: Holders
    fines: Snapshot
    pore: Array
    fine: Array
    volume: Array
    renewed: int

    __repr__ = one_line

    @property
    def in_pores(self) -> Array:
        """Volume (P,) m3 of the fines in each pore."""
        return np.bincount(self.pore, self.volume, len(self.holders.network.pore_position))

    def changed_to(self, fines: Snapshot) -> "KeptDeposit":
        """The deposit of other `fines`; the pieces of those at the same place are kept."""
        new, old = unmoved((fines.id, fines.position), (self.fines.id, self.fines.position))
        moved = np.setdiff1d(np.arange(len(fines)), new, assume_unique=True)
        now = np.full(len(self.fines), -1)
        now[old] = new
        stays = now[self.fine] >= 0
        pore, fine, volume = _pieces_of(self.holders, fines.where(moved))
        pore = np.concatenate([self.pore[stays], pore])
        fine = np.concatenate([now[self.fine[stays]], moved[fine]])
        volume = np.concatenate([self.volume[stays], volume])
        return _sorted(self.holders, fines, (pore, fine, volume), renewed=len(moved))


def measured_deposit(holders: Holders, fines: Snapshot) -> KeptDeposit:
    """The deposit of `fines`, each reaching into the box, all measured."""
    return _sorted(holders, fines, _pieces_of(holders, fines), renewed=len(fines))


def _sorted(
    holders: Holders, fines: Snapshot, parts: tuple[Array, Array, Array], *, renewed: int
) -> KeptDeposit:
    """The deposit with its pieces (pore, fine, volume) sorted."""
    order = np.lexsort((parts[0], fines.id[parts[1]]))
    pore, fine, volume = (frozen(column[order]) for column in parts)
    return KeptDeposit(
        holders=holders, fines=fines, pore=pore, fine=fine, volume=volume, renewed=renewed
    )


def _pieces_of(holders: Holders, fines: Snapshot) -> tuple[Array, Array, Array]:
    """Pore, fine and volume m3 of each piece of `fines`."""
    parts = [(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))]
    for piece, fine, measured in _pieces(holders, fines):
        real = measured[:, 0] > 0.0
        pore = holders.pore[piece[real]]
        share = holders.network.pore_share[pore]
        parts.append((pore, fine[real], measured[real, 0] / share))
    pore, fine, volume = (np.concatenate(column) for column in zip(*parts, strict=True))
    return pore, fine, volume
