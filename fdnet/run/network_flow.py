"""The flow that follows the deposit, on the pore network, and what it does to grains and fines.

The derivation is on docs/physics.md, "The field of the network".
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from fdnet.classes.beside_spheres import Narrowed
from fdnet.network.field.field import VelocityField, velocity_field
from fdnet.network.fines.deposit import (
    Deposit,
    Holders,
    holders_of,
    measured_deposit,
    reaching_inside,
)
from fdnet.network.fines.occupancy import ratio
from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.section_archie import KeptSections, ThroatPart, measured_sections, parts_of
from fdnet.network.network import Network, build_network
from fdnet.spheres.geometry import neighbour_tree, wrapped
from fdnet.spheres.snapshot import Array, Snapshot, frozen


def bed_section(network: Network) -> Array:
    """S_h (T, 2) m2 of the sides of each throat; 0 where grains close the facet."""
    height = np.abs(network.throat_heights)
    narrow = np.maximum(network.throat_area, 0.0)[:, None]
    angle = np.sqrt(np.pi / (2.0 * np.where(narrow > 0, narrow, 1.0))) * height
    wider = np.divide(angle, np.arctan(angle), out=np.ones_like(angle), where=angle > 1e-6)
    return narrow * wider


class Pressed(NamedTuple):
    """Forces of the fluid over the drop of pressure, m2."""

    grains: Array  # (3,) on all grains
    groups: Array  # (G, 3) on the fines in each pore; pores of one group are one


def on_each_fine(pressed: Pressed, deposit: Deposit) -> Array:
    """Force (N, 3) m2 on each fine of a deposit: what its pores feel, by its share of the fines.

    A pore without fines leaves its force to nobody; so does one whose fines left since the solve.
    """
    group = deposit.network.pore_group[deposit.pore]
    held = np.bincount(group, deposit.volume, len(pressed.groups))
    force = pressed.groups[group] * (deposit.volume / held[group])[:, None]
    return _summed(deposit.fine, force, len(deposit.fines))


def _summed(where: Array, force: Array, count: int) -> Array:
    """Sums (count, 3) of the forces (N, 3) that belong to the same of `count` bodies."""
    return np.stack([np.bincount(where, force[:, axis], count) for axis in range(3)], axis=1)


# ------------------------------------------------------------------------------------------------
# The flow through a pack with its deposit: in a pore the velocity is that of the resolved flow
# through the intact pack, times the ratio of the damaged to the clean flux of the network.


STAGNANT = 1e-2
"""A pore that carries less than this share of the mean flux of a pore, clean, keeps ratio 1."""
RENEWED = 0.2
"""Share of the deposit by volume that may change before the network is solved anew
(docs/validation/solve_lag.csv, docs/evidence/error_against_time.md)."""
STEP = 1.0 / 3.0
"""Greatest step between two sections of a throat, in radii of its smallest fine. The analysis
takes an eighth (docs/validation/solve_lag.csv)."""
MOVED = 0.01  # Way in radii within which a fine that moves is taken to be at one place (`placed`)
LEAK = 1e-6
"""Share of its clean conductance that a side keeps at least, so that pressures are known beyond
what the fines close."""
CELLS, SLIP = 10.0, 0.15
"""Cells of the resolved field across a grain (docs/evidence/error_against_time.md), and the rms
velocity over the superficial one that it leaves at the walls (docs/theory/resolved_flow.md)."""
Finer = Callable[[Array, Array], Narrowed]
"""From the shares (T, 2) that spheres leave of the sides and their m3 (P,) in the pores."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Carried:
    """What the pores (P) of a damaged pack still carry."""

    k_over_k0: float  # permeability over that of the intact pack
    ratio: Array  # (P,) flux over that of the intact pack at the same rate through the specimen
    stagnant: int  # number of pores that carry next to nothing when clean; their ratio is 1
    pressed: Pressed  # forces of the fluid on grains and fines over the drop of pressure
    flow: Flow  # through the damaged network


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PackFlow:
    """The intact pack: its network, its flow, and its resolved velocity field."""

    network: Network  # pores and throats of the grains
    clean: Array  # (T,) m3, conductances
    halves: Array  # (T, 2) 1/m3, resistances of the sides of the clean throats; 0 where infinite
    # (T, 3) m2, area of the facet inside the box times its normal, from the first to the second
    # pore
    facet_area: Array
    bed_share: Array  # (T, 2) share of it on which a bed of fines in either side is pressed
    holders: Holders  # the pores, which hold the deposit
    # what the damage of the throats needs and does not depend on the fines
    parts: Sequence[ThroatPart]
    flow: Flow  # through the clean network
    through: Array  # (P,) share of the inflow that each pore carries
    shape: VelocityField  # resolved velocity field of the grains
    tree: Any  # search tree of the places of the pores

    @property
    def length(self) -> float:
        """Of the specimen, m."""
        return float(np.ptp(self.network.box[0]))

    @property
    def permeability(self) -> float:
        """Of the intact pack by its network, m2."""
        return self.flow.inflow * self.length / self.network.area

    def carried(self, kept: Array, fines: Array, finer: Array | None = None) -> Carried:
        """What the pores carry when the sides have `kept` (T, 2) of their clean conductances.

        `fines` (P,) m3 is the volume of the fines in each pore, `finer` (G,) m3 that of solids
        beside them in groups of pores.
        """
        factor = np.maximum(kept, LEAK)
        raised = np.sum(self.halves / factor, axis=1)
        left = ratio(self.halves.sum(axis=1), raised)
        flow = solve_flow(self.network, self.clean * left)
        usual = STAGNANT * float(np.mean(self.through))
        moving = self.through > usual
        share = pore_through(self.network, flow)
        return Carried(
            k_over_k0=flow.inflow / self.flow.inflow,
            ratio=np.divide(share, self.through, out=np.ones_like(share), where=moving),
            stagnant=int(np.sum(~moving)),
            pressed=self._pressed(factor, flow, fines, finer),
            flow=flow,
        )

    def _pressed(self, factor: Array, flow: Flow, fines: Array, finer: Array | None) -> Pressed:
        """The forces in a `flow` on grains, and on fines in the pores.

        What the fines add to a side acts on those in its pore. A fine also narrows sides whose
        pores it does not reach: that acts on the fines in the pore behind the throat, and on the
        grains where that has none either. `factor` (T, 2) is the share that the sides keep of
        their conductances, `fines` (P,) m3 the volume of the fines in each pore. They bear what
        acts on a pore by their share of its solids; `finer` ones hand theirs on to the grains.
        """
        first, second = flow.pore_pressure[self.network.throat_pores].T
        drop, raised = np.nan_to_num(first - second), self.halves / factor
        whole = raised.sum(axis=1, keepdims=True)
        added = (raised - self.halves) / np.where(whole > 0, whole, 1.0)
        on_fines = (drop[:, None] * added * self.bed_share)[..., None] * self.facet_area[:, None]
        group, count = self.network.pore_group, int(self.network.pore_group.max()) + 1
        holding, pair = np.bincount(group, fines, count) > 0, group[self.network.throat_pores]
        pair = np.where(holding[pair], pair, pair[:, ::-1])
        on_fines *= holding[pair][..., None]
        if finer is not None:
            own = np.bincount(group, fines * self.network.pore_share, count)
            on_fines *= ratio(own, own + finer)[pair][..., None]
        groups = _summed(pair.ravel(), on_fines.reshape(-1, 3), count)
        everything = drop @ self.facet_area
        return Pressed(frozen(everything - groups.sum(axis=0)), frozen(groups))

    def share_at(self, position: Array, carried: Carried) -> Array:
        """Flux (N,) of the pores at (N, 3) m over that when intact; 1 before and beyond them."""
        depth, share = position[:, 0], np.ones(len(position))
        within = (depth >= 0) & (depth < self.length)
        share[within] = carried.ratio[self.pore_of(position[within])]
        return share

    def shape_at(self, position: Array, carried: Carried) -> Array:
        """Velocity of the fluid over U, (N, 3), at places (N, 3) m; 0 where none is."""
        return self.shape.at(position) * self.share_at(position, carried)[:, None]

    def pore_of(self, position: Array) -> Array:
        """The pore (N,) whose place is nearest to each position (N, 3) m."""
        box, periodic = self.network.box, self.network.periodic
        place = wrapped(position, box, periodic) - box[:, 0]
        size = np.ptp(box, axis=1)
        return self.tree.query(np.where(periodic & (place >= size), 0.0, place))[1]


def pack_flow(grains: Snapshot, periodic: tuple[bool, bool, bool], walls: str) -> PackFlow:
    """The flow through an intact pack. Raises NetworkError or FlowError where there is none."""
    network = build_network(grains, periodic=periodic, walls=walls)
    corner, halves = network.throat_corner, half_resistances(network)
    clean = 1.0 / halves.sum(axis=1)
    flow = solve_flow(network, clean)
    normal = 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    middle = network.pore_corner.mean(axis=1)[network.throat_pores]
    middle[:, 1] += network.throat_shift * np.ptp(network.box, axis=1)
    forth = np.sum((middle[:, 1] - middle[:, 0]) * normal, axis=1)
    turned = np.where(forth < 0, -network.throat_share, network.throat_share)
    whole = np.linalg.norm(normal, axis=1)[:, None]
    return PackFlow(
        network=network,
        clean=clean,
        halves=np.where(np.isfinite(halves), halves, 0.0),
        facet_area=frozen(turned[:, None] * normal),
        bed_share=frozen(np.minimum(bed_section(network) / whole, 1.0)),
        holders=holders_of(network),
        parts=tuple(parts_of(network)),
        flow=flow,
        through=pore_through(network, flow),
        shape=velocity_field(grains, periodic=periodic, cells=CELLS, tolerance=SLIP),
        tree=neighbour_tree(network.pore_position, network.box, periodic=periodic),
    )


def pore_through(network: Network, flow: Flow) -> Array:
    """Share (P,) of the inflow that passes each pore; pores of one group are one.

    It is the larger of what comes in and what goes out, for the flux across a face of the specimen
    is that of no throat.
    """
    if flow.inflow <= 0:
        return np.zeros(len(network.pore_group))
    group, count = network.pore_group, int(network.pore_group.max()) + 1
    first, second = group[network.throat_pores].T
    flux = np.where(first == second, 0.0, flow.throat_flux)
    forth, back = np.maximum(flux, 0.0), np.maximum(-flux, 0.0)
    into = np.bincount(second, forth, count) + np.bincount(first, back, count)
    out = np.bincount(first, forth, count) + np.bincount(second, back, count)
    return (np.maximum(into, out) / flow.inflow)[group]


@dataclass(slots=True, eq=False)
class Renewal:
    """What a damaged pack carries; its network is solved when enough of the deposit changed."""

    pack: PackFlow  # the intact pack
    solved: Snapshot | None = None  # the fines of the last solve; None before the first
    sections: KeptSections | None = None  # of the throats, as they were at the last solve
    carried: Carried | None = None  # what the last solve gave

    def of(
        self, fines: Snapshot, *, anew: bool, finer: Finer | None = None
    ) -> tuple[Carried, Deposit]:
        """What the pores carry with standing `fines`, which are `placed`.

        The network is solved when enough of them changed, and where `anew` asks. What a solve
        gives does not depend on earlier ones, to the last digit. `finer` solids narrow what these
        fines leave.
        """
        inside, pack = fines.where(reaching_inside(self.pack.network, fines)), self.pack
        deposit = measured_deposit(pack.holders, inside)
        if anew or self.carried is None or changed_share(self.solved, inside) > RENEWED:
            known, parts = self.sections, pack.parts
            self.sections = (
                measured_sections(pack.network, inside, parts=parts, step=STEP)
                if known is None
                else known.changed_to(inside)
            )
            self.carried, self.solved = None, inside
        assert self.sections is not None
        kept, volume = self.sections.factor, None
        if finer is not None:
            kept, volume, grown = finer(kept, deposit.in_pores)
            self.carried = None if grown else self.carried
        if self.carried is None:
            self.carried = pack.carried(kept, deposit.in_pores, volume)
        return self.carried, deposit


def placed(fines: Snapshot) -> Snapshot:
    """The fines at the nearest places of a grid, each at most `MOVED` radii from its own place.

    What is measured there follows from the place alone, and is kept while a fine trembles.
    """
    spacing = 2.0 / math.sqrt(3.0) * MOVED * fines.radius[:, None]
    return replace(fines, position=frozen(np.round(fines.position / spacing) * spacing))


def changed_share(former: Snapshot | None, fines: Snapshot) -> float:
    """Volume of the fines that came, left, or moved by more than their radius, over that of all.

    "All" are those of either state; 0 where neither has any.
    """
    if former is None:
        return 1.0
    _, old, new = np.intersect1d(former.id, fines.id, assume_unique=True, return_indices=True)
    way = np.linalg.norm(fines.position[new] - former.position[old], axis=1)
    same = float(np.sum(fines.radius[new][way <= fines.radius[new]] ** 3))
    both = float(np.sum(fines.radius[new] ** 3))
    whole = float(np.sum(former.radius**3) + np.sum(fines.radius**3)) - both
    return 1.0 - same / whole if whole > 0 else 0.0
