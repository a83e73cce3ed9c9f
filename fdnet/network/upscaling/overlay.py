"""The network of all spheres laid over that of the grains."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.laws.deposit_resistances import deposit_resistances
from fdnet.network.network import Network
from fdnet.network.upscaling.crossings import Crossings, crossings_of, links_across
from fdnet.network.upscaling.facets import Facets, facets_of
from fdnet.network.upscaling.owners import Owners, Tetrahedra, centroids, owners_of
from fdnet.network.upscaling.pore_graph import PoreGraph, pore_graph
from fdnet.network.upscaling.regions import Lists, neighbouring_cells
from fdnet.network.upscaling.settling import Members, settled
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Overlay:
    """Two networks of one specimen.

    Attributes:
        whole: graph of the network of all spheres.
        coarse: graph of the network of the grains, with clean throats.
        facets: pairs of nodes of the grains.
        owners: the cells in which the pores lie.
        crossings: of facets by links.
        near: the neighbours of each cell.
        filled: (C,) whether a cell holds fines.
        planes: (2,) m, where inlet and outlet plane are.
    """

    whole: PoreGraph
    coarse: PoreGraph
    facets: Facets
    owners: Owners
    crossings: Crossings
    near: Lists
    filled: Array
    planes: Array

    __repr__ = one_line


def overlay_of(network: Network, coarse: PoreGraph, whole: Network) -> Overlay:
    """The network of all spheres, the `whole`, over the `network` of the grains.

    `coarse` is the graph of the grains with clean throats; it has at least one link.
    """
    fine = pore_graph(whole, 1.0 / deposit_resistances(whole).sum(axis=1))
    tetrahedra, facets = Tetrahedra(network), facets_of(coarse)
    points = centroids(whole, fine)
    members = Members(network, tetrahedra, points, coarse.place)
    owners = owners_of(points, network, coarse, tetrahedra)
    owners = settled((fine, coarse), facets, owners, members)
    with_fine = whole.image_fine[whole.pore_images].any(axis=1)
    filled = np.zeros(len(coarse.node), bool)
    filled[owners.cell[whole.pore_group[with_fine]]] = True
    throats = network.pore_group[network.throat_pores], network.throat_shift.astype(np.intp)
    return Overlay(
        whole=fine,
        coarse=coarse,
        facets=facets,
        owners=owners,
        crossings=crossings_of(links_across(fine, coarse, owners), facets),
        near=neighbouring_cells(fine, owners, throats, facets.cells),
        filled=filled,
        planes=network.box[0],
    )
