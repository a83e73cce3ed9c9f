"""The pores of a network as nodes of a graph, and the throats that carry flow as its edges."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.flow.links import BETWEEN, INLET, links_around, links_between
from fdnet.network.network import Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PoreGraph:
    """Polyhedra of pores (G), and the throats (K) between them that carry flow.

    The nodes 0 to G - 1 are the polyhedra (`Network.pore_group`). Where x is not periodic, the
    node G is the inlet plane and G + 1 the outlet plane.

    Attributes:
        ends: (K, 2) nodes.
        shift: (K, 3) whole periods from the place of the second to its place next to the first;
            0 where an end is a plane.
        conductance: (K,) m3.
        throat: (K,) index of the throat in the network.
        node: (G,) node that stands for a polyhedron: that of the plane on which it lies, or its
            own number.
        place: (G, 3) m.
        pore: (G,) the largest pore of each polyhedron.
    """

    ends: Array
    shift: Array
    conductance: Array
    throat: Array
    node: Array
    place: Array
    pore: Array

    __repr__ = one_line


def pore_graph(network: Network, conductance: Array) -> PoreGraph:
    """The graph of a network whose throats have the `conductance` (T,) m3."""
    group = network.pore_group
    count = int(group.max()) + 1
    order = np.lexsort((-network.pore_tetra_volume, group))
    pore = order[np.unique(group[order], return_index=True)[1]]
    if network.periodic[0]:
        links, node = links_around(network, conductance)[0], np.arange(count)
    else:
        links, where, _ = links_between(network, conductance, _span(network))
        node = np.where(where == BETWEEN, np.arange(count), count + INLET - where)
    ends = np.where(links.ends < 0, count + INLET - links.ends, links.ends)
    shift = network.throat_shift[links.throat].astype(np.intp)
    shift[(ends >= count).any(axis=1)] = 0
    return PoreGraph(
        ends=ends,
        shift=shift,
        conductance=links.conductance,
        throat=links.throat,
        node=node,
        place=inside(network, nodes_of(network).position[pore]),
        pore=pore,
    )


def _span(network: Network) -> tuple[float, float]:
    return float(network.box[0, 0]), float(network.box[0, 1])


def inside(network: Network, points: Array) -> Array:
    """`points` (N, 3) m moved onto the faces of the box that are not periodic and cut them off."""
    low, high = np.where(network.periodic, [[-np.inf], [np.inf]], network.box.T)
    return np.clip(points, low, high)
