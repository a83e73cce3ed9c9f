"""The resistance of a throat between spheres of any size, grains and fines alike.

Throats that a fine bounds have open sections, among all spheres that stand around; all others have
those of `lubrication`, narrowed by the spheres around.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import on_all_cores
from fdnet.network.laws.cross_section import OPEN, section_fluxes, shapes_of
from fdnet.network.laws.lubrication import THROATS, half_resistances, sections_of, spans_of
from fdnet.network.laws.reaching_grains import sphere_trees, spheres_around
from fdnet.network.laws.wedges import OPEN_WIDENING, WIDENING, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

# ------------------------------------------------------------------------------------------------
# Resistance of throats that a fine bounds.
#
# Where a fine and grains bound a throat, its sections are open on the side on which the fine has
# ended, and what holds the fluid there are the spheres that stand beyond the triangle.


STEPS = 4
"""Steps in height between the facet and a node; with 8, k of slabs changes by 0.2 % on average."""


def bounded_by_fines(network: Network) -> Array:
    """Whether throats (T,) have a fine at a corner.

    A bed of fines alone, such as a cake, is a pack like others and has none.
    """
    fine = network.image_fine[network.throat_images].any(axis=1)
    return np.asarray(fine & (not network.image_fine.all()))


def mixed_pores(network: Network) -> Array:
    """Whether polyhedra (G,), numbered as `pore_group`, are bounded by grains and by fines."""
    group = network.pore_group
    fine = network.image_fine[network.pore_images]
    count = int(group.max()) + 1
    some = np.bincount(group, weights=fine.any(axis=1), minlength=count) > 0
    grains = np.bincount(group, weights=~fine.all(axis=1), minlength=count) > 0
    return some & grains


def open_resistances(network: Network, throats: Array, heights: Array) -> tuple[Array, Array]:
    """Resistance (K, 2) 1/m3 of the sides of `throats` (K,), and how narrow they are at the ends.

    The second is 1/a (K, 3) 1/m at both nodes and at the facet, where a is the radius of the round
    tube that carries as much; nan where the throat has no such section, or a closed one. A
    resistance is 0 where the throat has no side, and infinite where a section is closed. `heights`
    (T, 2) m are those of the nodes of all throats.
    """
    trees, floor = sphere_trees(network), LENGTH_FLOOR * network.grain_radius
    resistance, ends = np.zeros((len(throats), 2)), np.full((len(throats), 3), np.nan)

    def measure(part: slice) -> None:
        here = np.flatnonzero((throats >= part.start) & (throats < part.stop))
        some = throats[here] - part.start
        near = spheres_around(network, part, some, heights[part], trees)
        sections = sections_of(some, spans_of(heights[throats[here]], floor), STEPS + 1)
        shapes = shapes_of(network, part)
        flux = section_fluxes(shapes, sections, near, OPEN)[0]
        own, row = shapes.part[sections.throat], here[np.searchsorted(some, sections.throat)]
        resistance[row, sections.side] = resistance_of(flux, own, sections.step, OPEN_WIDENING)
        tube = np.where(flux > 0.0, 8.0 / np.pi * flux, np.nan) ** -0.25
        ends[row, sections.side], ends[row, 2] = tube[:, -1], tube[:, 0]

    on_all_cores(measure, geometry.slices(len(network.throat_pores), THROATS))
    return resistance, ends


# ------------------------------------------------------------------------------------------------
# Resistance of the throats between grains and fines.
#
# In a pore between grains and fines the throats are of very different width, and the fluid goes on
# spreading behind the node, from the section of a throat at the node to the width of the pore. Its
# sideways shear is that of a tube that widens (`lubrication`, dR = 8 / (pi a^4) (8/3)^(1/2) |da|).
# The fluid spreads along the grains at the corners of the throat, and hardly along fines, which
# end behind it. With g grains at the corners this adds
#
#     R = 0.6 g 8 / (3 pi) (8/3)^(1/2) (1 / a^3 - 1 / <a^3>)
#
# where that is positive. a is the radius of the round tube that carries as much as the section at
# the node, and < > the mean over the throats of the pore, weighted with their conductances. The
# number 0.6 is fitted to resolved flow (docs/evidence/accuracy.md).


SPREAD = 0.6
"""Share of that shear for each grain at the corners of a throat, fitted to resolved flow."""


def deposit_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the node on either side.

    As `half_resistances` gives it, for a network of grains and fines (`Network.image_fine`).
    """
    bounded, mixed = bounded_by_fines(network), mixed_pores(network)
    heights = nodes_of(network).heights
    halves = half_resistances(network, around=True, heights=heights, but=bounded)
    near = mixed[network.pore_group[network.throat_pores]].any(axis=1)
    throats = np.flatnonzero(bounded | (near & np.isfinite(halves.sum(axis=1))))
    if not len(throats):
        return halves
    own, ends = open_resistances(network, throats, heights)
    halves[bounded] = own[bounded[throats]]
    halves[throats] += node_resistances(network, throats, halves[throats], ends, mixed)
    return halves


def grain_resistances(network: Network) -> Array:
    """Resistance (T, 2) 1/m3 of the throats between grains.

    As `half_resistances` gives it. Spheres that lie mostly inside a grain, as those of a clump do,
    leave of their throats what fines in a corner leave, so there it is `deposit_resistances`.
    """
    return deposit_resistances(network) if network.image_fine.any() else half_resistances(network)


def node_resistances(
    network: Network, throats: Array, halves: Array, ends: Array, mixed: Array
) -> Array:
    """What spreading behind the nodes adds to the sides of `throats` (K,), (K, 2) 1/m3.

    Args:
        network: of grains and fines.
        throats: those that bound the mixed pores.
        halves: (K, 2) 1/m3, their resistances to the nodes.
        ends: (K, 3) 1/m, 1/a at both nodes and at the facet (`open_resistances`).
        mixed: (G,) whether the polyhedra are `mixed_pores`.
    """
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
