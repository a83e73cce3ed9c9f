"""The flow that follows the deposit, on the pore network.

What the fall of pressure in a damaged network does to grains and fines.

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

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fdnet.network import geometry
from fdnet.network.field.field import VelocityField, velocity_field
from fdnet.network.fines.deposit import (
    Holders,
    KeptDeposit,
    holders_of,
    measured_deposit,
    reaching_inside,
)
from fdnet.network.fines.occupancy import ratio
from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.section_archie import (
    KeptSections,
    ThroatPart,
    measured_sections,
    parts_of,
)
from fdnet.network.network import Network, build_network
from fdnet.spheres.geometry import neighbour_tree, wrapped
from fdnet.spheres.snapshot import Array, Snapshot, frozen


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


# ------------------------------------------------------------------------------------------------
# The flow through a pack with its deposit: shape from the intact pack, share from the network.
#
# The resolved Stokes flow of the intact pack (`fdnet.network.field`) is solved once and says how
# the fluid moves inside each pore. The pore network, damaged by the fines that are there now, says
# how much of it each pore still carries. In a pore the velocity is that of the intact pack times
# the ratio of the damaged to the clean flux, both at the same rate through the specimen.


STAGNANT = 1e-2
"""A pore that carries less than this share of the mean flux of a pore, clean, keeps ratio 1."""
RENEWED = 0.2
"""Share of the deposit by volume that may change before the network is solved anew
(`scripts/solve_lag.py`, `fdnet study flow-updates`)."""
STEP = 1.0 / 3.0
"""Greatest step between two sections of a throat, in radii of its smallest fine. The analysis
takes an eighth (`scripts/solve_lag.py`)."""
MOVED = 0.01
"""Way in radii within which a fine that moves is taken to be at one place (`placed`)."""
LEAK = 1e-6
"""Share of its clean conductance that a side keeps at least, so that pressures are known beyond
what the fines close."""
CELLS, SLIP = 10.0, 0.15
"""Cells of the resolved field across a grain (`fdnet study velocity-field`), and the rms velocity
over the superficial one that it leaves at the walls. The default of `velocity_field` takes half as
many iterations again (docs/velocity_field.md)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Carried:
    """What the pores (P) of a damaged pack still carry.

    Attributes:
        k_over_k0: permeability over that of the intact pack.
        ratio: (P,) flux over that of the intact pack at the same rate through the specimen.
        stagnant: number of pores that carry next to nothing when clean; their ratio is 1.
        pressed: forces of the fluid on grains and fines over the drop of pressure.
    """

    k_over_k0: float
    ratio: Array
    stagnant: int
    pressed: Pressed


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PackFlow:
    """The intact pack: its network, its flow, and its resolved velocity field.

    Attributes:
        network: pores and throats of the grains.
        clean: (T,) m3, conductances.
        halves: (T, 2) 1/m3, resistances of the sides of the clean throats; 0 where infinite.
        facets: of the throats.
        holders: the pores, which hold the deposit.
        parts: what the damage of the throats needs and does not depend on the fines.
        flow: through the clean network.
        through: (P,) share of the inflow that each pore carries.
        shape: resolved velocity field of the grains.
        tree: search tree of the places of the pores.
    """

    network: Network
    clean: Array
    halves: Array
    facets: Facets
    holders: Holders
    parts: Sequence[ThroatPart]
    flow: Flow
    through: Array
    shape: VelocityField
    tree: Any

    @property
    def length(self) -> float:
        """Of the specimen, m."""
        return float(np.ptp(self.network.box[0]))

    @property
    def permeability(self) -> float:
        """Of the intact pack by its network, m2."""
        return self.flow.inflow * self.length / self.network.area

    @property
    def scale(self) -> float:
        """The network's resistance over that of the coarse resolved field."""
        return self.length / self.permeability / self.shape.resistance

    def sections(self, fines: Snapshot, former: KeptSections | None) -> KeptSections:
        """The sections of the throats among `fines`, from a `former` state where there is one."""
        if former is not None:
            return former.changed_to(fines)
        return measured_sections(self.network, fines, parts=self.parts, step=STEP)

    def carried(self, kept: Array, fines: Array) -> Carried:
        """What the pores carry when the sides have `kept` (T, 2) of their clean conductances.

        `fines` (P,) m3 is the volume of the fines in each pore.
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
            pressed=pressed_by(self.network, self.facets, (self.halves, factor), flow, fines),
        )

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
    halves = half_resistances(network)
    clean = 1.0 / halves.sum(axis=1)
    flow = solve_flow(network, clean)
    return PackFlow(
        network=network,
        clean=clean,
        halves=np.where(np.isfinite(halves), halves, 0.0),
        facets=facets_of(network),
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
    """What a damaged pack carries: its deposit followed, its network solved when enough changed.

    Attributes:
        pack: the intact pack.
        renewed: share of the deposit that may change before the network is solved anew.
        solved: the fines of the last solve; None before the first.
        deposit: the fines as they are measured.
        sections: of the throats, as they were at the last solve.
        carried: what the last solve gave.
        solves: number of solves.
    """

    pack: PackFlow
    renewed: float = RENEWED
    solved: Snapshot | None = None
    deposit: KeptDeposit | None = None
    sections: KeptSections | None = None
    carried: Carried | None = None
    solves: int = 0

    def of(self, fines: Snapshot, *, anew: bool) -> tuple[Carried, KeptDeposit]:
        """What the pores carry with standing `fines`, which are `placed`.

        The network is solved when enough of them changed, and where `anew` asks. What a solve
        gives does not depend on earlier ones, to the last digit.
        """
        inside = fines.where(reaching_inside(self.pack.network, fines))
        self.deposit = (
            measured_deposit(self.pack.holders, inside)
            if self.deposit is None
            else self.deposit.changed_to(inside)
        )
        if anew or self.carried is None or changed_share(self.solved, inside) > self.renewed:
            self.sections = self.pack.sections(inside, self.sections)
            self.carried = self.pack.carried(self.sections.factor, self.deposit.in_pores)
            self.solved, self.solves = inside, self.solves + 1
        return self.carried, self.deposit


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
