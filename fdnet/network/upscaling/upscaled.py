"""Damage by flow through the fines around each throat: local upscaling.

The network of all spheres knows every fine but has many times the throats. Here it is solved in
small regions only, around a few pores between grains with three rings of neighbours
(`local_flow`). The conductance of a throat follows from the flux Q across its facet and the
difference dp of the mean pressures of the two pores at it. Both pores lie in the middle of a
region, so there are two fluxes and two differences, one of each if the pores share a region. The
conductance is (sum of Q^2 / sum of dp^2)^(1/2). There is no constant in it. The network of the
grains with these conductances then gives the permeability.

The conductances carry the flow together. That of a single throat may be several times too high or
too low, for the mean pressure of a pore moves when a fine divides it, also a small one.
"""

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.cores import on_all_cores
from fdnet.network.laws.damage import BLOCKED, CLEAN, UPSCALED, Damage
from fdnet.network.network import Network, build_network
from fdnet.network.upscaling.local_flow import LocalFlow
from fdnet.network.upscaling.overlay import Overlay, overlay_of
from fdnet.network.upscaling.pore_graph import pore_graph
from fdnet.network.upscaling.wanted import Wanted, wanted_of
from fdnet.spheres.snapshot import Array, Snapshot, frozen

MOST_PORES = 60_000
"""Bound on the pores of regions that are solved at once; there are some ten times fewer."""


def upscaled_damage(network: Network, spheres: Snapshot, clean: Array) -> Damage:
    """Conductance of the throats of a network of grains, from flow through all `spheres` nearby.

    Throats between pores without fines keep the clean conductance. All throats from a pore to one
    plane count as one, and so do all from plane to plane.

    Args:
        network: of the grains.
        spheres: grains and fines, m, in the box of the network.
        clean: (T,) m3, without fines.

    Raises:
        NetworkError: grains and fines together make no network.
    """
    factor, changed, lost = np.ones(len(clean)), np.zeros(len(clean), bool), 0
    coarse = pore_graph(network, clean)
    throat = coarse.throat
    if len(throat) and len(spheres.fines()):
        overlay = overlay_of(network, coarse, _together(network, spheres))
        facet = overlay.facets.of_link
        filled = overlay.filled[network.pore_group[network.throat_pores[throat]]]
        asked = np.zeros(len(overlay.facets.ends), bool)
        asked[facet[np.logical_or(*filled.T)]] = True
        changed[throat], lost = asked[facet], overlay.crossings.lost
        factor[throat] = _factors(overlay, asked)[facet]
    law = np.where(changed, np.where(factor > 0.0, UPSCALED, BLOCKED), CLEAN)
    counts = {
        "throats_filled": int(np.sum(factor == 0.0)),
        "throats_above_clean": int(np.sum(factor > 1.0)),
        "links_without_facet": lost,
    }
    return Damage(
        conductance=frozen(clean * factor), law_used=frozen(law.astype("<U10")), counts=counts
    )


def _together(network: Network, spheres: Snapshot) -> Network:
    """The network of all spheres in the box of the network of the grains."""
    try:
        return build_network(spheres, periodic=network.periodic, walls=network.walls)
    except NetworkError as error:
        raise NetworkError(
            f"upscaled: grains and fines together make no network: {error}; use "
            "analysis.damage_law = 'section-archie'"
        ) from error


def _factors(overlay: Overlay, asked: Array) -> Array:
    """Factor (E,) on the conductance of the facets that are `asked` for (E,), 1 on others."""
    facets = overlay.facets
    flux, drop, net = np.zeros((3, len(asked)))
    for facet, total, difference in _solved(LocalFlow(overlay), wanted_of(overlay), asked):
        np.add.at(flux, facet, total**2)
        np.add.at(drop, facet, difference**2)
        np.add.at(net, facet, total)
    across = (facets.ends >= facets.cells).all(axis=1)  # each of their crossings is seen once
    flux[across], drop[across] = net[across] ** 2, np.ptp(overlay.planes) ** 2
    mean = np.sqrt(np.divide(flux, drop, out=np.zeros(len(asked)), where=drop > 0.0))
    return np.where(asked, mean / facets.conductance, 1.0)


def _solved(flow: LocalFlow, wanted: Wanted, asked: Array) -> list[tuple[Array, Array, Array]]:
    """The fluxes and differences of all regions that see facets which are `asked` for."""
    cells = wanted.seeing(asked)
    if not len(cells):
        return []
    parts = flow.parts(cells, MOST_PORES)
    return on_all_cores(lambda part: flow.across_facets(part, wanted), parts)
