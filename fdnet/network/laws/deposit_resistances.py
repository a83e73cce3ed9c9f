"""Resistance of the throats between grains and fines.

Throats that a fine bounds have the sections of `fine_sections`, all others those of
`lubrication`, narrowed by a fourth sphere and by those around. Both end at the nodes.

In a pore between grains and fines the throats are of very different width, and the fluid goes on
spreading behind the node, from the section of a throat at the node to the width of the pore. Its
sideways shear is that of a tube that widens (`lubrication`, dR = 8 / (pi a^4) (8/3)^(1/2) |da|).
The fluid spreads along the grains at the corners of the throat, and hardly along fines, which end
behind it. With g grains at the corners this adds

    R = 0.6 g 8 / (3 pi) (8/3)^(1/2) (1 / a^3 - 1 / <a^3>)

where that is positive. a is the radius of the round tube that carries as much as the section at
the node, and < > the mean over the throats of the pore, weighted with their conductances. The
number 0.6 is fitted to resolved flow (docs/accuracy.md, section 3).
"""

import numpy as np

from fdnet.network.laws.fine_sections import (
    bounded_by_fines,
    fine_resistances,
    mixed_pores,
)
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.tube import WIDENING
from fdnet.network.network import Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

SPREAD = 0.6
"""Share of that shear for each grain at the corners of a throat, fitted to resolved flow."""


def deposit_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the node on either side.

    As `half_resistances` gives it, for a network of grains and fines (`Network.image_fine`).
    """
    bounded, mixed = bounded_by_fines(network), mixed_pores(network)
    heights = nodes_of(network).heights
    halves = half_resistances(network, fourth=True, heights=heights, but=bounded)
    near = mixed[network.pore_group[network.throat_pores]].any(axis=1)
    throats = np.flatnonzero(bounded | (near & np.isfinite(halves.sum(axis=1))))
    if not len(throats):
        return halves
    own, ends = fine_resistances(network, throats, bounded[throats], heights[throats])
    halves[bounded] = own[bounded[throats]]
    halves[throats] += node_resistances(network, throats, halves[throats], (ends, mixed))
    return halves


def grain_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of the throats between grains.

    As `half_resistances` gives it. Spheres that lie mostly inside a grain, as those of a clump do,
    leave of their throats what fines in a corner leave, so there it is `deposit_resistances`.
    """
    return deposit_resistances(network) if network.image_fine.any() else half_resistances(network)


def node_resistances(
    network: Network, throats: Array, halves: Array, given: tuple[Array, Array]
) -> Array:
    """What spreading behind the nodes adds to the sides of `throats` (K,), (K, 2) 1/m3.

    Args:
        network: of grains and fines.
        throats: those that bound the mixed pores.
        halves: (K, 2) 1/m3, their resistances to the nodes.
        given: 1/a (K, 3) 1/m at both nodes and at the facet (`fine_resistances`), and whether the
            polyhedra (G,) are `mixed_pores`.
    """
    ends, mixed = given
    pores = network.pore_group[network.throat_pores[throats]]
    cube = np.where(np.isnan(ends[:, :2]), ends[:, 2:], ends[:, :2]) ** 3
    whole = halves.sum(axis=1, keepdims=True)
    real = np.isfinite(cube) & np.isfinite(whole) & (pores[:, :1] != pores[:, 1:])
    weight = np.where(real, 1.0 / whole, 0.0)
    total = np.bincount(pores.ravel(), weights=weight.ravel(), minlength=len(mixed))
    volume = np.divide(weight, cube, out=np.zeros(cube.shape), where=real)
    summed = np.bincount(pores.ravel(), weights=volume.ravel(), minlength=len(mixed))
    inverse = np.divide(total, summed, out=np.zeros(len(mixed)), where=summed > 0.0)
    excess = np.where(mixed[pores] & real, np.maximum(cube - inverse[pores], 0.0), 0.0)
    grains = np.sum(~network.image_fine[network.throat_images[throats]], axis=1)
    return SPREAD * grains[:, None] * 8.0 / (3.0 * np.pi) * np.sqrt(WIDENING) * excess
