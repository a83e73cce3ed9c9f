"""Damage by flow through the fines around each throat: local upscaling.

The network of all spheres knows every fine but has many times the throats. Here it is solved in
small regions only, each a pore between grains and three rings of neighbours (`local_flow`). From
the flux Q across a facet between grains and the difference dp of the mean pressures of the two
pores at it follows the conductance of the throat. Both pores have a region of their own, so there
are two fluxes and two differences, and the conductance is (sum of Q^2 / sum of dp^2)^(1/2). There
is no constant in it. The network of the grains with these conductances then gives the
permeability.

A throat may come out more conductive than without fines, where fluid that fines turn away from a
neighbour passes through it.
"""

import numpy as np

from fdnet.errors import NetworkError
from fdnet.network.cores import on_all_cores
from fdnet.network.laws.damage import BLOCKED, CLEAN, UPSCALED, Damage
from fdnet.network.network import Network, build_network
from fdnet.network.upscaling.local_flow import LocalFlow
from fdnet.network.upscaling.overlay import Overlay, overlay_of
from fdnet.network.upscaling.wanted import Wanted, wanted_of
from fdnet.spheres.snapshot import Array, Snapshot, frozen

PORES = 60_000
"""Pores of all regions that are solved at once."""


def upscaled_damage(network: Network, spheres: Snapshot, clean: Array) -> Damage:
    """Conductance of the throats of a network of grains, from flow through all `spheres` nearby.

    Throats between pores without fines keep the clean conductance.

    Args:
        network: of the grains.
        spheres: grains and fines, m, in the box of the network.
        clean: (T,) m3, without fines.

    Raises:
        NetworkError: grains and fines together make no network.
    """
    try:
        whole = build_network(spheres, periodic=network.periodic, walls=network.walls)
    except NetworkError as error:
        raise NetworkError(
            f"upscaled: grains and fines together make no network: {error}; use "
            "analysis.damage_law = 'section-archie'"
        ) from error
    overlay = overlay_of(network, clean, whole)
    throat, facet = overlay.coarse.throat, overlay.facets.of_link
    touched = overlay.filled[network.pore_group[network.throat_pores]]
    touched = np.logical_or(touched[:, 0], touched[:, 1])
    asked = np.zeros(len(overlay.facets.ends), bool)
    asked[facet[touched[throat]]] = True
    factor = np.ones(len(clean))
    factor[throat] = _factors(overlay, asked)[facet]
    law = np.where(touched, np.where(factor > 0.0, UPSCALED, BLOCKED), CLEAN)
    counts = {
        "throats_filled": int(np.sum(factor == 0.0)),
        "throats_above_clean": int(np.sum(factor > 1.0)),
        "links_without_facet": overlay.crossings.lost,
    }
    return Damage(
        conductance=frozen(clean * factor), law_used=frozen(law.astype("<U10")), counts=counts
    )


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
    centres = wanted.centres(asked)
    if not len(centres):
        return []
    parts = flow.parts(centres, PORES)
    return on_all_cores(lambda part: flow.across_facets(part, wanted), parts)
