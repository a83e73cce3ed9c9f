"""Which facets between grains the fluid of each link crosses.

A link mostly joins two pores in one cell, or on both sides of one facet. A pore that sticks out of
its cell may also have a neighbour in a cell that shares only an edge with it. The flux then goes
through the cells in between.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network.upscaling.facets import Facets, Hop, hops, ordered
from fdnet.network.upscaling.owners import Owners
from fdnet.network.upscaling.pore_graph import PoreGraph
from fdnet.network.upscaling.shifts import Shift, shift_of
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Seen:
    """Links (K) between nodes of grains, each seen from one of its two ends, its home.

    Home is the end in a cell between the planes, where there is one.

    Attributes:
        link: (K,) index of the link.
        nodes: (K, 2) nodes of grains in which the home and the other end lie.
        shift: (K, 3) whole periods from the first of them to the second; 0 where it is a plane.
        image: (K, 3) shift of the first end of the link, with the node of the home at its place.
        way: (K,) 1 where the first end is the home, else -1.
        direct: (K,) whether both ends are planes.
    """

    link: Array
    nodes: Array
    shift: Array
    image: Array
    way: Array
    direct: Array

    __repr__ = one_line

    def where(self, kept: Array) -> "Seen":
        """Some of the links."""
        return Seen(
            link=self.link[kept],
            nodes=self.nodes[kept],
            shift=self.shift[kept],
            image=self.image[kept],
            way=self.way[kept],
            direct=self.direct[kept],
        )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Crossings:
    """Crossings (N) of facets by links.

    Attributes:
        facet: (N,) the facet.
        link: (N,) the link.
        share: (N,) of its flux, from the first to the second node of the facet.
        image: (N, 3) shift of the first end of the link, with the first node of the facet at its
            place.
        lost: number of links between nodes that no facets join.
    """

    facet: Array
    link: Array
    share: Array
    image: Array
    lost: int

    __repr__ = one_line


def links_across(whole: PoreGraph, coarse: PoreGraph, owners: Owners) -> Seen:
    """The links of the graph of all spheres that lead from one node of grains to another."""
    count, cells, ends = len(whole.node), len(coarse.node), whole.ends
    plane = ends >= count
    pore = np.where(plane, 0, ends)
    nodes = np.where(plane, cells + ends - count, coarse.node[owners.cell[pore]])
    offset = np.where(plane[:, :, None], 0, owners.offset[pore])
    inner = nodes < cells
    second = np.logical_and(~inner[:, 0], np.logical_or(inner[:, 1], plane[:, 0]))
    column = second[:, None]
    shift = whole.shift + offset[:, 0] - offset[:, 1]
    seen = Seen(
        link=np.arange(len(ends)),
        nodes=np.where(column, nodes[:, ::-1], nodes),
        shift=np.where(column, -shift, shift) * np.logical_and(*inner.T)[:, None],
        image=np.where(column, offset[:, 1] - whole.shift, offset[:, 0]),
        way=np.where(second, -1.0, 1.0),
        direct=np.logical_and(*plane.T),
    )
    return seen.where((nodes[:, 0] != nodes[:, 1]) | (seen.shift != 0).any(axis=1))


def crossings_of(seen: Seen, facets: Facets) -> Crossings:
    """All crossings of facets by the links that lead from node to node of grains."""
    facet, there = facets.at(seen.nodes, seen.shift)
    direct, facet = seen.where(there), facet[there]
    turned = ordered(direct.nodes, direct.shift)[2]
    first = np.where(turned[:, None], direct.shift, 0)
    parts = [(facet, direct.link, direct.way * np.where(turned, -1.0, 1.0), direct.image - first)]
    astray, lost = seen.where(~there), 0
    known: dict[tuple[int, int, Shift], list[Hop]] = {}
    for k, (home, other) in enumerate(astray.nodes.tolist()):
        key = home, other, shift_of(astray.shift[k])
        if key not in known:
            known[key] = list(hops(facets, *key))
        steps = known[key] if home < facets.cells or astray.direct[k] else []
        lost += not steps
        one = slice(k, k + 1)
        for number, way, at, share in steps:
            on_the_way = astray.way[one] * way * share
            parts.append(
                (np.array([number]), astray.link[one], on_the_way, astray.image[one] - at)
            )
    facet, link, shares, image = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Crossings(facet=facet, link=link, share=shares, image=image, lost=lost)
