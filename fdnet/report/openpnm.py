"""The network with its conductances for OpenPNM (optional: pip install "fdnet[openpnm]")."""

from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.flow.links import INLET, OUTLET, Links, open_links
from fdnet.network.network import Network
from fdnet.spheres.arrays import Array


def to_openpnm(network: Network, conductance: Array, *, viscosity: float) -> Any:
    """The part of the network that carries flow along x, as an OpenPNM network in SI units.

    fdnet holds the pressure on the two faces of the box. A throat that a face cuts therefore ends
    in a pore of its own on that face, with the conductance of the part inside. Pores of one
    `pore_group` have one pressure and are one pore. Pores and throats that no flow reaches are
    left out.

    Args:
        network: the pore network; its box is not periodic along x.
        conductance: (T,) conductance of each throat, m3 (flux times viscosity over pressure drop).
        viscosity: dynamic viscosity of the fluid, Pa s.

    Returns:
        An `openpnm.network.Network` with `pore.coords` (m), `pore.diameter` (m), `pore.volume`
        (m3), labels `pore.inlet`, `pore.outlet` and `throat.periodic`, `throat.diameter` (m),
        `throat.length` (m), `throat.hydraulic_conductance` (m3/(Pa s)), and the row numbers
        `pore.fdnet_pore` (-1 on a face) and `throat.fdnet_throat` of pores.csv and throats.csv.

    Raises:
        CaseError: OpenPNM is not installed, the network is periodic along x, or no path is open.
    """
    arrays = openpnm_arrays(network, conductance, viscosity=viscosity)
    try:
        import openpnm
    except ImportError as error:
        raise CaseError(
            'OpenPNM is not installed; install it with pip install "fdnet[openpnm]", or use '
            "pores.csv and throats.csv of the run"
        ) from error
    made = openpnm.network.Network(
        coords=arrays.pop("pore.coords"), conns=arrays.pop("throat.conns")
    )
    for name, values in arrays.items():
        made[name] = values
    return made


def openpnm_arrays(network: Network, conductance: Array, *, viscosity: float) -> dict[str, Array]:
    """The arrays of `to_openpnm` by their OpenPNM names."""
    if network.periodic[0]:
        raise CaseError(
            "OpenPNM: the network is periodic along x, where fdnet prescribes a pressure drop per "
            "period; build it with walls along x (periodic='yz')"
        )
    if not viscosity > 0:
        raise CaseError(f"viscosity: {viscosity} Pa s, expected a number above 0")
    links = open_links(network, conductance)
    if not len(links.throat):
        raise CaseError("OpenPNM: no open path leads from the inlet to the outlet face")
    conns, groups, faces = _numbered(links)
    pore = np.unique(network.pore_group, return_index=True)[1][groups]
    inside, none, plane = np.zeros(len(pore), bool), np.zeros(len(faces)), links.ends[*faces.T]
    volume = np.bincount(
        network.pore_group, weights=np.maximum(network.pore_volume, 0.0) * network.pore_share
    )
    return {
        "pore.coords": np.concatenate(
            [network.pore_position[pore], _on_faces(network, links, faces)]
        ),
        "throat.conns": np.sort(conns, axis=1),
        "pore.diameter": np.append(2.0 * network.pore_radius[pore], none),
        "pore.volume": np.append(volume[groups], none),
        "pore.inlet": np.append(inside, plane == INLET),
        "pore.outlet": np.append(inside, plane == OUTLET),
        "pore.fdnet_pore": np.append(pore, np.full(len(faces), -1)),
        "throat.diameter": 2.0 * network.throat_radius[links.throat],
        "throat.length": network.throat_length[links.throat],
        "throat.hydraulic_conductance": links.conductance / viscosity,
        "throat.fdnet_throat": links.throat,
        "throat.periodic": np.any(network.throat_shift[links.throat], axis=1),
    }


def _numbered(links: Links) -> tuple[Array, Array, Array]:
    """Pores (K, 2) of each link: first the groups that occur (G,), then each end on a face (E, 2).

    An end on a face is given by its link and its place in it (0 or 1).
    """
    groups = np.unique(links.ends[links.ends >= 0])
    faces = np.argwhere(links.ends < 0)
    conns = np.searchsorted(groups, links.ends)
    conns[*faces.T] = len(groups) + np.arange(len(faces))
    return conns, groups, faces


def _on_faces(network: Network, links: Links, faces: Array) -> Array:
    """(E, 3) where the throats of `faces` cross the face at which they end, m."""
    link, end = faces.T
    ends = network.throat_ends[links.throat[link]]
    rows = np.arange(len(faces))
    here, there = ends[rows, end], ends[rows, 1 - end]
    x = np.where(links.ends[link, end] == INLET, network.box[0, 0], network.box[0, 1])
    run = here[:, 0] - there[:, 0]
    share = np.divide(x - there[:, 0], run, out=np.ones(len(rows)), where=run != 0)
    return there + share[:, None] * (here - there)
