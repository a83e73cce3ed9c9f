"""Pores that stick out of their cell are moved into the one that leads to their neighbours.

A link between two cells that share no facet shows that one of its pores sticks out of its cell.
The pore that lies deeper in a cell in between is moved into that one. With regions of two rings
this took the permeability of known slabs from 4 to 2 % (rms) off that of all spheres.
"""

import numpy as np

from fdnet.network.network import Network
from fdnet.network.upscaling.crossings import Seen, links_across
from fdnet.network.upscaling.facets import Facets, from_plane_to_plane, through_one
from fdnet.network.upscaling.owners import Owners, Tetrahedra
from fdnet.network.upscaling.pore_graph import PoreGraph
from fdnet.network.upscaling.shifts import HERE, Shift, shift_of
from fdnet.spheres.snapshot import Array

PASSES = 3
"""How often pores may be moved."""
SHALLOWEST = -0.5
"""Least barycentric coordinate of a pore in a tetrahedron of the cell into which it is moved."""
Move = tuple[float, int, Shift]
"""How deep a pore lies in its new cell, that cell, and the offset of the pore."""
Moves = dict[int, Move]
NOWHERE: Move = (-np.inf, -1, HERE)


def settled(
    graphs: tuple[PoreGraph, PoreGraph], facets: Facets, owners: Owners, members: "Members"
) -> Owners:
    """The `owners`, after pores have been moved; `graphs` are of all spheres and of grains."""
    cell, offset = owners.cell.copy(), owners.offset.copy()
    for _ in range(PASSES):
        seen = links_across(*graphs, Owners(cell=cell, offset=offset))
        seen = seen.where(~facets.at(seen.nodes, seen.shift)[1])
        moves = _moves(seen, graphs[0], facets, members)
        held = np.bincount(cell, minlength=facets.cells)
        for pore, (_, new, at) in sorted(moves.items(), key=lambda one: one[1], reverse=True):
            if held[cell[pore]] > 1:
                held[cell[pore]] -= 1
                cell[pore], offset[pore] = new, at
        if not moves:
            break
    return Owners(cell=cell, offset=offset)


def _moves(seen: Seen, whole: PoreGraph, facets: Facets, members: "Members") -> Moves:
    """The pores of the links `seen` that may move, and where to.

    Of each link it is the pore that lies deeper in its new cell.
    """
    moves: Moves = {}
    thin = from_plane_to_plane(facets)
    for k, (home, other) in enumerate(seen.nodes.tolist()):
        if home >= facets.cells:
            pore, deepest = _into_one_of(thin, whole.ends[seen.link[k]], members)
        else:
            ways = through_one(facets, home, other, shift_of(seen.shift[k]))
            cells = [(cell, at) for cell, at, _ in ways if cell < facets.cells]
            pore, deepest = _deeper(cells, (seen, k), whole, members)
        if deepest > moves.get(pore, NOWHERE):
            moves[pore] = deepest
    return moves


def _deeper(
    cells: list[tuple[int, Shift]], seen: tuple[Seen, int], whole: PoreGraph, members: "Members"
) -> tuple[int, Move]:
    """The end of the link `seen[1]` that lies deeper in one of the `cells`, and its move."""
    links, k = seen
    link = links.link[k]
    best, deepest = -1, (SHALLOWEST, -1, HERE)
    for end, pore in enumerate(map(int, whole.ends[link])):
        if pore < len(whole.node):
            image = links.image[k] + end * whole.shift[link]
            for cell, at in cells:
                move = members.depth(cell, pore, image - at), cell, shift_of(image - at)
                if move > deepest:
                    best, deepest = pore, move
    return best, deepest if best >= 0 else NOWHERE


def _into_one_of(cells: list[int], ends: Array, members: "Members") -> tuple[int, Move]:
    """The move of a pore on one plane that a link joins to the other, into a cell at both.

    `cells` are these, and `ends` are those of the link. Where both are planes there is no move.
    """
    pore = int(ends.min())  # planes have the larger numbers
    if pore >= members.count:
        return pore, NOWHERE
    offsets = [members.offset(cell, pore) for cell in cells]
    moves = [
        (members.depth(cell, pore, np.array(at)), cell, at)
        for cell, at in zip(cells, offsets, strict=True)
    ]
    return pore, max(moves, default=NOWHERE)


class Members:
    """The tetrahedra of each cell, and how deep points lie in cells.

    Args:
        network: of the grains.
        tetrahedra: its tetrahedra.
        points: (G, 3) m, of the pores.
        places: (C, 3) m, of the cells.
    """

    def __init__(
        self, network: Network, tetrahedra: Tetrahedra, points: Array, places: Array
    ) -> None:
        self._tetrahedra, self._points, self._places = tetrahedra, points, places
        self.count = len(points)
        self._periodic = np.array(network.periodic)
        self._size = np.ptp(network.box, axis=1)
        group = network.pore_group
        self._order = np.argsort(group, kind="stable")
        self._first = np.searchsorted(group[self._order], np.arange(len(places) + 1))

    def depth(self, cell: int, pore: int, shift: Array) -> float:
        """Least barycentric coordinate in a cell of the point of a pore, moved by `shift` (3,)."""
        own = self._order[self._first[cell] : self._first[cell + 1]]
        point = self._points[pore] + shift * self._size
        return float(self._tetrahedra.depth(own, np.broadcast_to(point, (len(own), 3))).max())

    def offset(self, cell: int, pore: int) -> Shift:
        """Whole periods by which a pore has to be moved to be nearest to a cell."""
        apart = (self._places[cell] - self._points[pore]) / self._size
        return shift_of(np.where(self._periodic, np.rint(apart), 0))
