"""Local Kozeny factors of the fines: per pore, and per side of a throat."""

from dataclasses import dataclass

import numpy as np

from fdnet.network.fines.occupancy import Occupancy, ratio
from fdnet.network.flow.links import PLANE_TOLERANCE
from fdnet.network.laws.damage import BLOCKED, CLEAN, KOZENY, Damage
from fdnet.network.laws.faces import over_faces
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.pyramids import side_voids
from fdnet.network.network import Network
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, frozen

ROUNDING = 1e-12
"""A volume of fines more negative than this share of the void is negative."""


def kozeny_damage(network: Network, occupancy: Occupancy, clean: Array) -> Damage:
    """Local Kozeny factor of each pore: f = (1 - v)^3 / (1 + a)^2.

    In the tetrahedron of the pore, v is the volume of the fines over the void, and a the surface
    of the fines over that of the grains (k is proportional to porosity^3 / surface^2: Kozeny 1927,
    Carman 1937). The conductance of a throat is multiplied by the harmonic mean of the factors of
    its two pores. Pores of one `pore_group` are taken together. A pore that its fines fill (v >=
    1) is closed and counted.
    """
    deposit = _pore_deposit(network, occupancy)
    taken, filled = deposit.taken, deposit.filled
    factor = np.where(filled, 0.0, _kozeny(deposit.volume, deposit.surface))
    first, second = factor[network.throat_pores].T
    both = ratio(2.0 * first * second, first + second)
    law = _law_used(np.any(taken[network.throat_pores], axis=1), both)
    return Damage(
        conductance=frozen(clean * both), law_used=law, counts={"pores_filled": int(filled.sum())}
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sides:
    """What the sides of the clean throats (T) are, which no fine changes.

    Attributes:
        void: (T, 2) m3, of the side, or of the throat where that has one side only.
        wall: (T, 2) m2, grain surface likewise.
        single: (T,) whether both power centres lie on one side of the facet.
        own: (T, 2) whether the side can be taken by itself.
        resistance: (T, 2) 1/m3, from the facet to the power centre; 0 where it is infinite.
        tube: m, twice the hydraulic radius of the pack.
    """

    void: Array
    wall: Array
    single: Array
    own: Array
    resistance: Array
    tube: float

    __repr__ = one_line


def sides_of(network: Network) -> Sides:
    """The sides of the throats."""
    single = np.any(network.throat_heights <= 0, axis=1)
    void, wall = (_joined(network, part, single) for part in side_voids(network))
    clean = half_resistances(network, heights=network.throat_heights)
    cut = _on_pressure_plane(network)[network.throat_pores]
    return Sides(
        void=frozen(void),
        wall=frozen(wall),
        single=frozen(single),
        own=frozen((void > 0) & (wall > 0) & ~cut),
        resistance=frozen(np.where(np.isfinite(clean), clean, 0.0)),
        tube=2.0 * _hydraulic_radius(network),
    )


def side_kozeny_damage(network: Network, occupancy: Occupancy, clean: Array) -> Damage:
    """Local Kozeny factor of each side of a throat: f = (1 - s v)^3 / (1 + a)^2.

    The sides are the pyramids from the facet to the power centres. Their clean resistances are R1
    and R2: `half_resistances` with the heights of these centres, so that they belong to the same
    sides as the fines. The throat keeps (R1 + R2) / (R1 / f1 + R2 / f2) of its clean conductance.
    Nothing is fitted.

    v and a are volume and surface of the fines over those of void and grains, as in
    `kozeny_damage`. They are taken in the side where a fine is much smaller than a quarter of the
    void of the pore, and in the whole pore where it is larger: the weight of the side is
    1 / (1 + (4 V_fine / void)^2), with the volume V_fine of a fine. Pores that the inlet or the
    outlet face cuts are always taken whole, for the fluid crosses them whole. With the sign of
    the sides every fine counts once.

    s = 1 - (1 - t)^2 is the share of the section of a round tube that lies within the layer of
    fines on its wall. The radius of the tube is twice the hydraulic radius of the pack (void over
    grain surface); t is the thickness of the layer over that radius, at most 1. A film takes up
    only the slow part of the void; a bed, and fines as large as the tube, take up all of it. Fines
    deeper inside a grain than their radius make no layer (`layers_within_grains`, t = 0) and count
    by their surface alone.

    A side or pore that its fines fill (v >= 1) is closed and counted.
    """
    sides = sides_of(network)
    factor, volume, counts = _side_factors(network, occupancy, sides)
    kept = _kept(sides.resistance, factor)
    law = _law_used(np.any(volume > 0, axis=1), kept)
    return Damage(conductance=frozen(clean * kept), law_used=law, counts=counts)


def _side_factors(
    network: Network, occupancy: Occupancy, sides: Sides
) -> tuple[Array, Array, dict[str, int]]:
    """The factors (T, 2), the relative volume of the fines (T, 2), and what is counted."""
    pore, ends = _pore_deposit(network, occupancy), network.throat_pores
    volume, surface = _on_sides(network, occupancy, pore, sides)
    share = 1.0 - (1.0 - np.clip(pore.layer / sides.tube, 0.0, 1.0)) ** 2
    filled = (volume >= 1.0) | pore.filled[ends]
    factor = np.where(filled, 0.0, _kozeny(np.minimum(volume, 1.0), surface, share[ends]))
    counts = {
        "pores_filled": int(pore.filled.sum()),
        "sides_filled": int(filled.sum()),
        "layers_within_grains": int(np.sum(pore.layer < 0)),
    }
    return factor, volume, counts


def _joined(network: Network, part: Array, single: Array) -> Array:
    """Values (T, 2) of the sides; of the throat where it has one, of the face where it is split.

    A throat with both power centres on one side of its facet has one side, the difference of the
    two pyramids. The triangles into which a face between two polyhedra is split are one.
    """
    part = over_faces(network, part)
    return np.where(single[:, None], part.sum(axis=1, keepdims=True), part)


def _on_sides(
    network: Network, occupancy: Occupancy, pore: "_PoreDeposit", sides: Sides
) -> tuple[Array, Array]:
    """Volume and surface (T, 2) of the fines over void and grain surface, as the sides see them.

    They are weighted means of the side's own values and of those of its pore.
    """
    solid = _joined(network, occupancy.side_solid_volume, sides.single)
    area = _joined(network, occupancy.side_solid_surface, sides.single)
    ends, own = network.throat_pores, sides.own & (solid >= -ROUNDING * np.abs(sides.void))
    weight = np.where(own, 1.0 / (1.0 + (4.0 * ratio(pore.fine, pore.void)[ends]) ** 2), 0.0)
    volume = weight * ratio(solid, np.where(own, sides.void, 0.0))
    surface = weight * ratio(area, np.where(own, sides.wall, 0.0))
    rest = 1.0 - weight
    return volume + rest * pore.volume[ends], surface + rest * pore.surface[ends]


def _on_pressure_plane(network: Network) -> Array:
    """Whether the inlet or the outlet face of the box cuts a pore (P,).

    Such a pore is the prism between a facet and its mirror image. The fluid enters through its
    whole section, but it has no throat across the face, so its sides hold a part of it only.
    """
    if network.periodic[0]:
        return np.zeros(len(network.pore_position), bool)
    tolerance = PLANE_TOLERANCE * float(np.ptp(network.box[0]))
    apart = np.abs(network.pore_position[:, :1] - network.box[0])
    return np.any(apart <= tolerance, axis=1)


def _law_used(taken: Array, kept: Array) -> Array:
    """Rule (T,) that applied: clean without fines, blocked if nothing is `kept`, else kozeny."""
    return frozen(np.where(~taken, CLEAN, np.where(kept == 0, BLOCKED, KOZENY)).astype("<U10"))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _PoreDeposit:
    """Fines of each pore (P); pores of one group are taken together.

    Attributes:
        volume: (P,) volume of the fines over the void; 0 where filled.
        surface: (P,) surface of the fines over that of the grains; 0 where filled.
        void: (P,) m3.
        fine: (P,) m3, mean volume of a fine.
        layer: (P,) m, thickness of the layer of fines on the grains.
        taken: (P,) whether the pore holds fines.
        filled: (P,) whether the fines fill it.
    """

    volume: Array
    surface: Array
    void: Array
    fine: Array
    layer: Array
    taken: Array
    filled: Array


def _pore_deposit(network: Network, occupancy: Occupancy) -> _PoreDeposit:
    """Sums over the pores of each group."""
    group = network.pore_group
    solid = occupancy.pore_solid_volume
    held, surface, void, wall, fine, layer = (
        np.bincount(group, weights=weights)[group]
        for weights in (
            solid,
            occupancy.pore_solid_surface,
            network.pore_volume,
            network.pore_wall_surface,
            solid * occupancy.pore_fine_volume,
            solid * occupancy.pore_layer,
        )
    )
    taken = held > 0
    filled = taken & ((void <= 0) | (wall <= 0) | (held >= void))
    safe = taken & ~filled
    return _PoreDeposit(
        volume=ratio(np.where(safe, held, 0.0), void),
        surface=ratio(np.where(safe, surface, 0.0), wall),
        void=void,
        fine=ratio(fine, held),
        layer=ratio(layer, held),
        taken=taken,
        filled=filled,
    )


def _kozeny(volume: Array, surface: Array, share: Array | float = 1.0) -> Array:
    """Factor (1 - s v)^3 / (1 + a)^2 of relative volume v, surface a and share s."""
    return (1.0 - share * volume) ** 3 / (1.0 + surface) ** 2


def _hydraulic_radius(network: Network) -> float:
    """Void over grain surface of the pack, m."""
    void = np.bincount(network.pore_group, network.pore_volume)
    return float(np.sum(np.maximum(void, 0.0)) / np.sum(network.pore_wall_surface))


def _kept(resistance: Array, factor: Array) -> Array:
    """Share (T,) of the conductance that two resistances (T, 2) in series keep.

    Each resistance is divided by its factor (T, 2).
    """
    shut = np.any((factor == 0) & (resistance > 0), axis=1)
    raised = np.sum(resistance / np.where(factor > 0, factor, 1.0), axis=1)
    return np.where(shut, 0.0, ratio(resistance.sum(axis=1), raised))
