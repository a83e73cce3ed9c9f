"""What the fall of pressure in a damaged network does to grains and fines.

The pressure of a pore acts on the facets of its tetrahedron. The facets of a closed body add up to
nothing, so over all throats t, with the fall of pressure dp, the area a of the whole facet and its
normal n from the first to the second pore,

    sum of dp a n_x = (drop of pressure) A

holds exactly, however the flow is: it is the momentum of fluid, grains and fines together. Each
fall of pressure is the sum of what the clean sides take and of what the fines add. What they add
acts on the open section, which they fill, and on the grains around it. Fines that fill a section
S(z) as a bed feel the sum of dp S over the height z, and in a bed dp goes with dz / S. So it acts
on the harmonic mean of S,

    S_h = h / (integral of dz / S(z)),  S(z) = S_0 + pi z^2 / 2,

where S_0 is the open area of the facet: the discs that three grains show at the height z are
smaller by pi z^2 / 2 in all, since the angles of a triangle add up to pi.
"""

from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.fines.kept_deposit import KeptDeposit
from fdnet.network.flow.flow import Flow
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, frozen


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Facets:
    """The facets of the throats (T).

    Attributes:
        area: (T, 3) m2, area inside the box times the normal from the first to the second pore.
        section: (T, 2) share of it on which a bed of fines in either side is pressed.
    """

    area: Array
    section: Array


def facets_of(network: Network) -> Facets:
    """The facets of a network."""
    corner = network.throat_corner
    whole = geometry.triangle_area(corner)
    normal = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    middle = network.pore_corner.mean(axis=1)[network.throat_pores]
    middle[:, 1] += network.throat_shift * np.ptp(network.box, axis=1)
    forth = np.sum((middle[:, 1] - middle[:, 0]) * normal, axis=1)
    turned = np.where(forth < 0, -network.throat_share, network.throat_share)
    return Facets(
        area=frozen(turned[:, None] * normal),
        section=frozen(np.minimum(bed_section(network) / whole[:, None], 1.0)),
    )


def bed_section(network: Network) -> Array:
    """S_h (T, 2) m2 of the sides of each throat; 0 where grains close the facet."""
    height = np.abs(network.throat_heights)
    narrow = np.maximum(network.throat_area, 0.0)[:, None]
    angle = np.sqrt(np.pi / (2.0 * np.where(narrow > 0, narrow, 1.0))) * height
    wider = np.divide(angle, np.arctan(angle), out=np.ones_like(angle), where=angle > 1e-6)
    return narrow * wider


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Pressed:
    """Forces of the fluid over the drop of pressure, m2.

    Attributes:
        grains: (3,) on all grains.
        groups: (G, 3) on the fines in each pore; pores of one group are one.
    """

    grains: Array
    groups: Array


def pressed_by(
    network: Network, facets: Facets, sides: tuple[Array, Array], flow: Flow, fines: Array
) -> Pressed:
    """The forces in a `flow` on grains, and on fines in the pores.

    What the fines add to a side acts on those in its pore. A fine also narrows sides whose pores
    it does not reach: that acts on the fines in the pore behind the throat, and on the grains
    where that has none either.

    Args:
        network: pores and throats.
        facets: of the throats.
        sides: their clean resistances (T, 2) 1/m3, and the shares (T, 2), above 0, that they keep
            of their conductances.
        flow: through the damaged network.
        fines: (P,) m3, volume of the fines in each pore.
    """
    halves, factor = sides
    first, second = flow.pore_pressure[network.throat_pores].T
    drop = np.nan_to_num(first - second)
    raised = halves / factor
    whole = raised.sum(axis=1, keepdims=True)
    added = (raised - halves) / np.where(whole > 0, whole, 1.0)
    on_fines = (drop[:, None] * added * facets.section)[..., None] * facets.area[:, None]
    group = network.pore_group[network.throat_pores]
    count = int(network.pore_group.max()) + 1
    holding = np.bincount(network.pore_group, fines, count) > 0
    group = np.where(holding[group], group, group[:, ::-1])
    on_fines *= holding[group][..., None]
    groups = np.stack(
        [np.bincount(group.ravel(), on_fines[..., axis].ravel(), count) for axis in range(3)],
        axis=1,
    )
    everything = drop @ facets.area
    return Pressed(grains=frozen(everything - groups.sum(axis=0)), groups=frozen(groups))


def on_each_fine(pressed: Pressed, deposit: KeptDeposit) -> Array:
    """Force (N, 3) m2 on each fine of a deposit: what its pores feel, by its share of the fines.

    A pore without fines leaves its force to nobody; so does one whose fines left since the solve.
    """
    group = deposit.holders.network.pore_group[deposit.pore]
    held = np.bincount(group, deposit.volume, len(pressed.groups))
    share = deposit.volume / held[group]
    force = pressed.groups[group] * share[:, None]
    count = len(deposit.fines)
    return np.stack(
        [np.bincount(deposit.fine, force[:, axis], count) for axis in range(3)], axis=1
    )
