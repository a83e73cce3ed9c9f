"""What the fines fill of each pore, exact for every fine.

Points in given boxes, by sorting the points into cubic cells.
"""

from dataclasses import dataclass
from math import atan2, copysign, pi, sqrt
from typing import NamedTuple

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.network import Network
from fdnet.network.tessellation.delaunay import Vector, along, times
from fdnet.spheres.geometry import make_images
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line


def points_in_boxes(point: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Index (K,) of the box and of the point of all pairs of a box and a point in it.

    They are in the order of the boxes, which reach from `low` to `high` (M, 3) m, the points
    (N, 3) m on their faces included.
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

    start: Array  # (3,) m, the low corner
    edge: float  # m, of a cell
    shape: Array  # (3,) number of cells along each axis
    first: Array  # of each cell the index of its first point, and the number of points at the end


def grid_of(point: Array, edge: float | None = None) -> tuple[Grid, Array]:
    """Cubic cells of `edge` m, and the order (N,) in which they hold the points (N, 3) m.

    There is at least one point. Without an edge the cells are as many as the points along the
    longest side of a cube.
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


@loops_in_place
def cells_between(
    low: float, high: float, start: float, edge: float, number: int
) -> tuple[int, int]:
    """The first cell along an axis between `low` and `high` m, and the one after the last.

    The `number` cells begin at `start` m, and each is `edge` m long.
    """
    lower, upper = (low - start) / edge, (high - start) / edge + 1.0
    return int(min(max(lower, 0.0), float(number))), int(min(max(upper, 0.0), float(number)))


@loops_in_place
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
# (divergence theorem; compare Strobl, Formella and Poeschel 2016, J. Comput. Phys. 311, 158).


ROUNDING = 1e-13  # A piece of less volume, in cubes of the radius, is rounding
OTHERS = np.array([(1, 2, 3), (2, 3, 0), (3, 0, 1), (0, 1, 2)])
"""(4, 3) corners of the facet opposite each corner."""


@compiled
def pieces(corner: Array, pore: Array, ball: Array, centre: Array, radius: Array) -> Array:
    """Volume m3 and surface m2 (K, 2) of the piece of a ball in a tetrahedron, pair by pair.

    Pair k is tetrahedron `pore[k]` of those with the corners `corner` (P, 4, 3) m, and ball
    `ball[k]` of those of `centre` (N, 3) m and `radius` (N,) m. Both numbers are 0 where the two
    are apart. Pieces below 1e-13 cubes of the radius are rounding and left out.
    """
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
            depth[f] = along(normal[f], _apart(corner[p, OTHERS[f, 0]], centre[b])) / -radius[b]
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
def _facet_normals(corner: Array, normal: Array) -> None:
    """Inward unit normals (4, 3) of the facets opposite each corner."""
    turn = 1.0
    for f in range(4):
        a, b, c = corner[OTHERS[f, 0]], corner[OTHERS[f, 1]], corner[OTHERS[f, 2]]
        across = times(_apart(b, a), _apart(c, a))
        if f == 0:
            # one sign for all four, so that the facets of a flat tetrahedron face each other
            turn = copysign(1.0, along(_apart(corner[0], a), across))
        scale = (turn if f % 2 == 0 else -turn) / sqrt(along(across, across))
        for axis in range(3):
            normal[f, axis] = scale * across[axis]


@compiled
def _piece(place: Array, normal: Array, depth: Array, cuts: int) -> tuple[float, float]:
    """Volume and surface of the unit ball about the origin inside a tetrahedron.

    `place` (4, 3) are its corners, `normal` (4, 3) the inward normals of its facets, `depth` (4,)
    their distances and `cuts` the number of them that cut the ball.
    """
    if cuts == 0:
        return 4.0 / 3.0 * pi, 4.0 * pi
    if cuts == 1:
        height = 1.0 + min(min(depth[0], depth[1]), min(depth[2], depth[3]))
        return pi * height**2 * (3.0 - height) / 3.0, 2.0 * pi * height
    volume, surface = 0.0, 0.0
    for f in range(4):
        for e in range(3):
            corner, start, end = OTHERS[f], place[OTHERS[f, e]], place[OTHERS[f, e - 2]]
            side = _apart(end, start)
            length = sqrt(along(side, side))
            if length == 0.0:  # shorter than the rounding of places in radii of the ball
                continue
            inward = times(normal[f], side)
            height = -along(inward, start) / length
            if along(inward, _apart(place[corner[e - 1]], start)) < 0.0:
                height = -height
            area, shadow = _edge(
                depth[f], height, along(side, start) / length, along(side, end) / length
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


# ---- The parts of tetrahedra inside the box: cut at its mirrored faces into smaller tetrahedra.
FLAT = 1e-14  # Volume over the cube of the longest edge, below which a tetrahedron is flat
ENDS = {
    1: [(0, 0), (0, 1), (0, 2), (0, 3)],
    2: [(0, 0), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3)],
    3: [(0, 0), (1, 1), (2, 2), (0, 3), (1, 3), (2, 3)],
}
"""Points of the part above a plane, by how many corners are above; these come first. (i, j) is
where the edge from corner i to j meets the plane, (i, i) is corner i. Each four in a row are the
corners of a tetrahedron."""


def clip_to_box(corner: Array, box: Array, periodic: tuple[bool, ...]) -> tuple[Array, Array]:
    """The parts of tetrahedra within the faces of `box` (3, 2) m that are not `periodic`.

    From corners (C, 4, 3) m of tetrahedra to those (K, 4, 3) m of the tetrahedra that make up the
    parts, and the index (K,) of the tetrahedron that each is a part of.
    """
    owner = np.arange(len(corner))
    for axis in range(3):
        for face, sign in zip(box[axis], (1.0, -1.0), strict=True):
            if not periodic[axis]:
                height = sign * (corner[:, :, axis] - face)
                corner, owner = _above(corner, owner, height)
    edge = np.ptp(corner, axis=1).max(axis=1)
    solid = np.abs(geometry.signed_volume(corner)) > FLAT * edge**3
    return corner[solid], owner[solid]


def _above(corner: Array, owner: Array, height: Array) -> tuple[Array, Array]:
    """Parts of tetrahedra above the plane over which their corners lie `height` (C, 4) m high."""
    positive = height > 0.0
    count = positive.sum(axis=1)
    whole = count == 4
    corners, owners = [corner[whole]], [owner[whole]]
    for kept, ends in ENDS.items():
        chosen = np.flatnonzero(count == kept)
        order = np.argsort(~positive[chosen], axis=1, kind="stable")
        place = np.take_along_axis(corner[chosen], order[:, :, None], axis=1)
        above = np.take_along_axis(height[chosen], order, axis=1)
        points = [_meeting(place, above, i, j) for i, j in ends]
        parts = [np.stack(points[n : n + 4], axis=1) for n in range(len(points) - 3)]
        corners.append(np.stack(parts, axis=1).reshape(-1, 4, 3))
        owners.append(np.repeat(owner[chosen], len(parts)))
    return np.concatenate(corners), np.concatenate(owners)


def _meeting(corner: Array, height: Array, i: int, j: int) -> Array:
    """Points (C, 3) where the edges from corner i to j meet the plane; corner i where i is j."""
    if i == j:
        return corner[:, i]
    share = height[:, i] / (height[:, i] - height[:, j])
    return corner[:, i] + share[:, None] * (corner[:, j] - corner[:, i])


# ---- Which fines reach into the box; their images, shifted or mirrored, beyond its faces.
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
    `mirrored`. The region is [`low`, `high`] (3,) m, widened by `largest` m. A centre on or beyond
    a face that is not periodic has no mirror image there.
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


# ---- What the fines fill of each pore, exact for every fine.
class Holders(NamedTuple):
    """The pores (P) of a `network`, which hold fines, as tetrahedra inside the box."""

    network: Network
    piece: Array  # (K, 4, 3) m, the tetrahedra
    pore: Array  # (K,) that each is a part of


def holders_of(network: Network) -> Holders:
    """The pores of a network, cut at the faces of its box."""
    piece, pore = clip_to_box(network.pore_corner, network.box, network.periodic)
    return Holders(network, frozen(np.ascontiguousarray(piece)), frozen(pore))


def _pieces(holders: Holders, fines: Snapshot) -> tuple[Array, Array, Array]:
    """The tetrahedron and the fine (N,) of pairs that may touch, also across periodic sides.

    With the volume m3 and the surface m2 (N, 2) of the piece of the fine, which may be 0.
    """
    parts = [(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 2)))]
    low, high = holders.piece.min(axis=1), holders.piece.max(axis=1)
    for some in size_classes(fines.radius) if len(fines) and len(low) else []:
        radius = fines.radius[some]
        most, ends = float(radius.max()), (low.min(axis=0), high.max(axis=0))
        position, image = images_near(
            holders.network, fines.position[some], *ends, most, mirrored=False
        )
        piece, ball = points_in_boxes(position, low - most, high + most)
        measured = pieces(holders.piece, piece, ball, position, radius[image])
        parts.append((piece, some[image[ball]], measured))
    piece, fine, measured = (np.concatenate(column) for column in zip(*parts, strict=True))
    return piece, fine, measured


def deposit_in_pores(network: Network, fines: Snapshot) -> tuple[Array, Array]:
    """Volume (P,) m3 and surface (P,) m2 of `fines`, each reaching into the box, in the pores.

    Only what lies inside the box counts, with the images across periodic sides. A pore that a
    mirrored face cuts stands for the whole mirrored tetrahedron, so what the part inside holds is
    divided by the share inside (`Network.pore_share`); this is exact for all pores of one
    `pore_group` together. What fines hide of each other or of grains is not subtracted.
    """
    holders = holders_of(network)
    filled, total = np.zeros((len(holders.piece), 2)), np.zeros((len(network.pore_corner), 2))
    piece, _, measured = _pieces(holders, fines)
    np.add.at(filled, piece, measured)
    np.add.at(total, holders.pore, filled)
    volume, surface = (total / network.pore_share[:, None]).T
    return volume, surface


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deposit:
    """Fines (N) and their K pieces in the pores (P), sorted by id of the fine, then by pore."""

    network: Network  # whose pores they are
    fines: Snapshot  # as they were measured
    pore: Array  # (K,) that holds the piece
    fine: Array  # (K,) index of the fine
    volume: Array  # (K,) m3 of the fine in the pore, over the share of the pore inside the box

    __repr__ = one_line

    @property
    def in_pores(self) -> Array:
        """Volume (P,) m3 of the fines in each pore."""
        return np.bincount(self.pore, self.volume, len(self.network.pore_position))


def measured_deposit(holders: Holders, fines: Snapshot) -> Deposit:
    """The deposit of `fines`, each reaching into the box."""
    piece, fine, measured = _pieces(holders, fines)
    pore, volume = holders.pore[piece], measured[:, 0]
    order = np.lexsort((pore, fines.id[fine]))
    order = order[volume[order] > 0.0]
    pore, fine, volume = pore[order], fine[order], volume[order]
    return Deposit(
        network=holders.network,
        fines=fines,
        pore=frozen(pore),
        fine=frozen(fine),
        volume=frozen(volume / holders.network.pore_share[pore]),
    )
