"""Facets between cells, and the facets that fluid crosses on its way between cells apart."""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from fdnet.network.upscaling.pore_graph import PoreGraph
from fdnet.network.upscaling.shifts import HERE, Shift, between, both, keys_of, looked_up, shift_of
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array

MOST_CELLS = 1000
"""Cells that are looked at on the way to another one."""
Hop = tuple[int, int, Shift, float]
"""A facet, 1 or -1 for its direction, the shift of its first node, and the share of the flux."""
Step = tuple[int, int]
"""A facet, and 1 or -1 for its direction."""
Neighbours = dict[tuple[int, Shift], Step]
"""The facet to each neighbour, by its node and shift."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Facets:
    """Pairs of nodes (E) of a network of grains that throats join, in the order of their keys.

    The nodes are the cells, and after them the inlet and the outlet plane (`PoreGraph`).

    Attributes:
        ends: (E, 2) nodes; the second is the larger one, so a plane is always the second.
        shift: (E, 3) whole periods from the place of the first to that of the second next to it.
        conductance: (E,) m3, of all throats between them together.
        of_link: (K,) the pair of each link of the graph.
        near: of each node, its neighbours.
        cells: number of cells, and that of the inlet plane.
    """

    ends: Array
    shift: Array
    conductance: Array
    of_link: Array
    near: list[Neighbours]
    cells: int

    __repr__ = one_line

    def at(self, nodes: Array, shift: Array) -> tuple[Array, Array]:
        """The facets (K,) between `nodes` (K, 2), and whether there is one (K,)."""
        ends, turn, _ = ordered(nodes, shift)
        size = len(self.near)
        keys = keys_of(*self.ends.T, shift=self.shift, size=size)
        return looked_up(keys, keys_of(*ends.T, shift=turn, size=size))


def facets_of(graph: PoreGraph) -> Facets:
    """The facets of a graph of grains."""
    ends, shift, _ = ordered(graph.ends, graph.shift)
    table, of_link = np.unique(np.column_stack([ends, shift]), axis=0, return_inverse=True)
    near: list[Neighbours] = [{} for _ in range(len(graph.node) + 2)]
    for facet, (one, other, *turn) in enumerate(table.tolist()):
        x, y, z = turn
        near[one][other, (x, y, z)] = facet, 1
        near[other][one, (-x, -y, -z)] = facet, -1
    return Facets(
        ends=table[:, :2],
        shift=table[:, 2:],
        conductance=np.bincount(of_link.ravel(), weights=graph.conductance, minlength=len(table)),
        of_link=of_link.ravel(),
        near=near,
        cells=len(graph.node),
    )


def from_plane_to_plane(facets: Facets) -> list[int]:
    """The cells with a facet to both planes."""
    inlet, outlet = facets.near[facets.cells : facets.cells + 2]
    return [cell for cell, at in inlet if (cell, at) in outlet]


def ordered(ends: Array, shift: Array) -> tuple[Array, Array, Array]:
    """Ends with the smaller node first, their shifts, and which pairs (K,) were turned."""
    first = shift[np.arange(len(shift)), np.argmax(shift != 0, axis=1)]
    alike = np.logical_and(ends[:, 0] == ends[:, 1], first < 0)
    turned = np.logical_or(ends[:, 0] > ends[:, 1], alike)
    column = turned[:, None]
    return np.where(column, ends[:, ::-1], ends), np.where(column, -shift, shift), turned


def hops(facets: Facets, one: int, other: int, shift: Shift) -> Iterator[Hop]:
    """The facets on the ways from a cell to a node that is no neighbour of it, at `shift`.

    The ways lead through one cell in between, in the shares that the two throats would carry in
    series without fines; through a plane only where there is no cell. Where there is neither, the
    way through the fewest cells is taken.
    """
    ways = list(through_one(facets, one, other, shift))
    ways = [way for way in ways if way[0] < facets.cells] or ways
    if not ways:
        yield from _fewest_facets(facets, one, other, shift)
        return
    carried = [1.0 / np.sum(1.0 / facets.conductance[[a, b]]) for _, _, ((a, _), (b, _)) in ways]
    for (_, at, steps), weight in zip(ways, carried, strict=True):
        for step, start in zip(steps, (HERE, at), strict=True):
            yield _hop(facets, step, start, float(weight / sum(carried)))


def through_one(
    facets: Facets, one: int, other: int, shift: Shift
) -> Iterator[tuple[int, Shift, tuple[Step, Step]]]:
    """The nodes next to both of two nodes, their shifts, and the two steps."""
    for (node, at), first in facets.near[one].items():
        second = facets.near[node].get((other, _rest(facets, shift, at, other)))
        if second is not None:
            yield node, at, (first, second)


def _fewest_facets(facets: Facets, one: int, other: int, shift: Shift) -> Iterator[Hop]:
    """The facets on the way through the fewest cells, and no plane.

    Of several such ways the one of least resistance without fines is taken (Dijkstra 1959, Numer.
    Math. 1, 269). No more than `MOST_CELLS` cells are looked at.
    """
    goal, start = (other, shift), (one, HERE)
    behind: dict[tuple[int, Shift], tuple[tuple[int, Shift], Step]] = {}
    done: set[tuple[int, Shift]] = set()
    ahead = [(0, 0.0, start, start, (0, 0))]
    while ahead and goal not in done and len(done) < MOST_CELLS:
        crossed, resistance, node, before, step = heappop(ahead)
        if node in done:
            continue
        done.add(node)
        behind[node] = before, step
        if node[0] >= facets.cells:
            continue
        for (next_, turn), (facet, way) in facets.near[node[0]].items():
            at = HERE if next_ >= facets.cells else both(node[1], turn)
            more = resistance + 1.0 / float(facets.conductance[facet])
            if (next_, at) == goal or next_ < facets.cells:
                heappush(ahead, (crossed + 1, more, (next_, at), node, (facet, way)))
    node = goal
    while goal in done and node != start:
        node, step = behind[node]
        yield _hop(facets, step, node[1], 1.0)


def _hop(facets: Facets, step: Step, start: Shift, share: float) -> Hop:
    """A step from the node at `start`."""
    facet, way = step
    first = start if way > 0 else between(start, shift_of(facets.shift[facet]))
    return facet, way, first, share


def _rest(facets: Facets, shift: Shift, at: Shift, other: int) -> Shift:
    """What is left of the `shift` to the node `other` from a node at `at`; 0 to a plane."""
    return HERE if other >= facets.cells else between(shift, at)
