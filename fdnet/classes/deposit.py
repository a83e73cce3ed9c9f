"""Where solids that were held sit, what they leave of passages and conductances, and the cake.

The first fine that a throat holds sits in the throat, the next ones in the pore before it. A pore
is full when its void is packed at the porosity `PACKED`. What flows on through a full pore leaves
behind whatever is wider than the gaps of its bed, and so does the cake, which is what the full
pores of the face turn away.
"""

from dataclasses import dataclass, replace

import numpy as np

from fdnet.classes.capture import (
    TIGHT,
    SizeClasses,
    bridging_chance,
    covered,
    wider_share,
)
from fdnet.classes.transport import Streams, Swept
from fdnet.network.flow.flow import PLANE_TOLERANCE
from fdnet.network.network import Network
from fdnet.scales.flow import carman_kozeny
from fdnet.spheres.snapshot import Array, frozen, one_line

PACKED = 0.40
"""Porosity of the solids in a full pore, and of a cake whose permeability is not given."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sieve:
    """Pores (N) and throats (T) as solids meet them, SI units; a pore is a group of `Network`.

    Attributes:
        ends: (T, 2) the pores that a throat joins.
        passage: (T,) m, diameter of the largest sphere that passes the clean throat.
        opening: (T,) m, radius of the circle of its open area.
        halves: (T, 2) 1/m3, resistances of the sides of the clean throat.
        way: (T,) m, length of the throat over the tortuosity.
        void: (N,) m3 inside the box.
        surface: (N,) m2 of grains.
        place: (N, 3) m.
        throat_place: (T, 3) m.
        inlet: (N,) whether a pore lies on the formation face.
        outlet: (N,) whether it lies on the other end.
        area: m2, of the face.
        length: m, of the specimen.
    """

    ends: Array
    passage: Array
    opening: Array
    halves: Array
    way: Array
    void: Array
    surface: Array
    place: Array
    throat_place: Array
    inlet: Array
    outlet: Array
    area: float
    length: float

    __repr__ = one_line


def sieve_of(network: Network, halves: Array, flux: Array) -> Sieve:
    """The sieve of a network; `halves` (T, 2) 1/m3 and `flux` (T,) are those of clean throats."""
    group, size = network.pore_group, np.ptp(network.box, axis=1)
    count = int(group.max()) + 1
    first = np.unique(group, return_index=True)[1]
    place = network.pore_position[first]
    (low, high), reach = network.box[0], PLANE_TOLERANCE * size[0]
    two = network.throat_ends
    along = (two[:, 1, 0] - two[:, 0, 0]) * flux
    winding = float(np.sum(network.throat_length * np.abs(flux))) / max(float(along.sum()), 1e-300)
    middle = network.throat_corner.mean(axis=1)
    middle[:, 1:] = (middle[:, 1:] - network.box[1:, 0]) % size[1:] + network.box[1:, 0]
    return Sieve(
        ends=frozen(group[network.throat_pores]),
        passage=frozen(2.0 * network.throat_radius),
        opening=frozen(np.maximum(network.throat_radius_effective, network.throat_radius)),
        halves=frozen(np.where(np.isfinite(halves), halves, 0.0)),
        way=frozen(network.throat_length / max(winding, 1.0)),
        void=frozen(np.bincount(group, np.maximum(network.pore_volume, 0.0) * network.pore_share)),
        surface=frozen(np.bincount(group, network.pore_wall_surface * network.pore_share, count)),
        place=frozen(place),
        throat_place=frozen(middle),
        inlet=frozen(place[:, 0] <= low + reach),
        outlet=frozen(place[:, 0] >= high - reach),
        area=network.area,
        length=float(size[0]),
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Deposits:
    """Where the solids of classes (C) are, m3: in pores (N), throats (T), the cake, and beyond.

    Attributes:
        carried: (N, C) in the fluid of the pores.
        in_pores: (N, C) held in pores.
        attached: (N, C) stuck to the grains of pores.
        in_throats: (T, C) held in throats.
        cake: (C,) before the face.
        passed: (C,) through the outlet.
        supplied: (C,) all that came to the face.
    """

    carried: Array
    in_pores: Array
    attached: Array
    in_throats: Array
    cake: Array
    passed: Array
    supplied: Array

    __repr__ = one_line

    @property
    def missing(self) -> Array:
        """(C,) what the ledger does not find again, over what was supplied; rounding."""
        found = self.inside_by_class + self.cake + self.passed
        return np.asarray((self.supplied - found) / np.maximum(self.supplied, 1e-300))

    @property
    def inside(self) -> tuple[Array, Array, Array, Array]:
        """What is in the specimen, by pore or throat."""
        return self.carried, self.in_pores, self.attached, self.in_throats

    @property
    def inside_by_class(self) -> Array:
        """(C,) m3 in the specimen."""
        return np.sum([one.sum(axis=0) for one in self.inside], axis=0)


def no_solids(sieve: Sieve, classes: SizeClasses) -> Deposits:
    """A specimen that no mud has reached."""
    pores, count = len(sieve.void), len(classes.diameter)
    nothing = np.zeros((pores, count))
    return Deposits(
        carried=nothing,
        in_pores=nothing.copy(),
        attached=nothing.copy(),
        in_throats=np.zeros((len(sieve.ends), count)),
        cake=np.zeros(count),
        passed=np.zeros(count),
        supplied=np.zeros(count),
    )


# ------------------------------------------------------------------------------------------------
# What the deposit leaves of passages, pores and conductances.


WEDGE_LEAVES = 0.35
"""Passage beside a fine in a throat over that of the clean throat."""
WEDGE_KEEPS = 1.0
"""Share of its conductance that a throat keeps with one fine in it."""
WEDGES = 1.3
"""A fine up to so many passages wide sits in the throat that holds it, a wider one before it."""
LOOSE = 0.33
"""Share by which solids in a pore pack less densely, for each of their diameters over the cubic
root of its void."""
FULL = 0.95
"""Filled share from which a pore begins to act as a bed."""


def wedged(solids: Deposits, classes: SizeClasses) -> Array:
    """Number (T,) of fines in each throat, at most 1."""
    return np.minimum(solids.in_throats @ (1.0 / classes.volume), 1.0)


def pore_capacity(sieve: Sieve, solids: Deposits, classes: SizeClasses) -> Array:
    """Deposits (N,) m3 that fill each pore: packed less densely where they are as large as it."""
    size = np.cbrt(np.maximum(sieve.void, 1e-30))
    wide = bed_diameter(solids.in_pores + solids.attached, classes) / size
    return sieve.void * (1.0 - PACKED) * np.maximum(1.0 - LOOSE * wide, 0.25)


def filled_share(sieve: Sieve, solids: Deposits, classes: SizeClasses) -> Array:
    """Deposits (N,) of each pore over its capacity; fines in throats count half for each side."""
    capacity = pore_capacity(sieve, solids, classes)
    half = 0.5 * solids.in_throats.sum(axis=1)
    count = len(sieve.void)
    beside = np.bincount(sieve.ends[:, 0], half, count) + np.bincount(
        sieve.ends[:, 1], half, count
    )
    held = solids.in_pores.sum(axis=1) + solids.attached.sum(axis=1) + beside
    return np.divide(held, capacity, out=np.zeros(count), where=capacity > 0)


def bed_diameter(deposit: Array, classes: SizeClasses) -> Array:
    """Sauter diameter (...,) m of solids (..., C) m3; 0 where there are none."""
    inverse = deposit @ (1.0 / classes.diameter)
    return np.divide(deposit.sum(axis=-1), inverse, out=np.zeros_like(inverse), where=inverse > 0)


def kept_shares(sieve: Sieve, solids: Deposits, classes: SizeClasses) -> Array:
    """Share (T, 2) of its clean conductance that each side of a throat keeps.

    Along a pore that is filled to the share s the conductance falls to the share of a full one to
    the power s; a full one is a bed of Carman and Kozeny's permeability k in the open area of the
    throat, of the radius r: 8 k / r^2.
    """
    fill = np.minimum(filled_share(sieve, solids, classes), 1.0)
    size = bed_diameter(solids.in_pores + solids.attached, classes)
    permeability = carman_kozeny(PACKED, 1.0) * size**2
    kept = np.ones(sieve.ends.shape)
    wedge = 1.0 - wedged(solids, classes) * (1.0 - WEDGE_KEEPS)
    for side in (0, 1):
        pore = sieve.ends[:, side]
        bed = np.minimum(8.0 * permeability[pore] / np.maximum(sieve.opening, 1e-12) ** 2, 1.0)
        bed = np.where(bed > 0, bed, 1.0)
        kept[:, side] = wedge * bed ** fill[pore]
    return kept


def bed_holds(deposit: Array, classes: SizeClasses) -> Array:
    """Share (N, C) of each class that beds of the solids `deposit` (N, C) m3 hold."""
    return wider_share(classes, TIGHT * bed_diameter(deposit, classes))


def full_share(fill: Array) -> Array:
    """How far pores act as beds (N,): 0 up to a filled share of `FULL`, 1 from 1 on."""
    return np.clip((fill - FULL) / (1.0 - FULL), 0.0, 1.0)


# ------------------------------------------------------------------------------------------------
# What each link holds back, and where that goes.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Holding:
    """What links (K) and the face hold back in one step.

    Attributes:
        held: (K, C) share of each class that a link holds back.
        stuck: (K, C) the part of it that sticks to grains, as a share of all.
        admitted: (N, C) share of the mud's solids that enter a pore of the face.
    """

    held: Array
    stuck: Array
    admitted: Array

    __repr__ = one_line


def holding(
    sieve: Sieve, solids: Deposits, classes: SizeClasses, streams: Streams, filtering: Array
) -> Holding:
    """What holds back what, with the deposit as it is; `filtering` (C,) 1/m is of clean grains."""
    fill, wedge = filled_share(sieve, solids, classes), wedged(solids, classes)
    bed = solids.in_pores + solids.attached
    full = full_share(fill)[:, None] * bed_holds(bed, classes)
    throat = streams.link
    clean = np.maximum(sieve.passage[throat], 1e-12)
    free = _passing(classes, clean, 1.0)
    beside = _passing(classes, clean, WEDGE_LEAVES)
    share = wedge[throat][:, None]
    passing = ((1.0 - share) * free + share * beside) * (1.0 - full[streams.target])
    stuck = np.zeros_like(passing)
    if np.any(filtering > 0):
        bare = 1.0 - covered(solids.attached, classes, sieve.surface)[streams.source]
        stuck = -np.expm1(-filtering * (sieve.way[throat] * bare)[:, None])
    held = 1.0 - (1.0 - stuck) * passing
    return Holding(held=held, stuck=stuck, admitted=_admitted(sieve, solids, classes, full))


def _passing(classes: SizeClasses, passage: Array, left: float) -> Array:
    """Share (K, C) of classes that neither strains nor bridges in `left` of passages (K,) m."""
    narrow = left * passage
    bridged = bridging_chance(classes.diameter / narrow[:, None])
    return (1.0 - wider_share(classes, narrow)) * (1.0 - bridged)


def _admitted(sieve: Sieve, solids: Deposits, classes: SizeClasses, full: Array) -> Array:
    covers = min(1.0, cake_layers(sieve, solids, classes))
    through = 1.0 - covers * bed_holds(solids.cake[None], classes)
    return (1.0 - full) * through


def cake_layers(sieve: Sieve, solids: Deposits, classes: SizeClasses) -> float:
    """Thickness of the cake in its own Sauter diameters."""
    size = float(bed_diameter(solids.cake, classes))
    return thickness_of_cake(sieve, solids) / size if size > 0 else 0.0


def thickness_of_cake(sieve: Sieve, solids: Deposits) -> float:
    """m, of the cake at the porosity `PACKED`."""
    return float(solids.cake.sum()) / (1.0 - PACKED) / sieve.area


def settled(
    sieve: Sieve,
    solids: Deposits,
    classes: SizeClasses,
    streams: Streams,
    step: tuple[Holding, Swept, float],
) -> Deposits:
    """The solids after a step: what was held goes to throats, pores and grains.

    `step` holds what held back, what the flow carried, and the m3 of fluid that entered.
    """
    what, carried, filtrate = step
    count = len(sieve.void)
    sticks = np.divide(what.stuck, what.held, out=np.zeros_like(what.held), where=what.held > 0)
    stuck = carried.held * sticks
    rest, room = carried.held - stuck, 1.0 - wedged(solids, classes)[streams.link]
    in_pores, attached = solids.in_pores.copy(), solids.attached.copy()
    in_throats, volume = solids.in_throats.copy(), classes.volume
    passage = sieve.passage[streams.link]
    for i in reversed(range(len(volume))):
        fits = classes.diameter[i] <= WEDGES * passage
        wedges = np.where(fits, np.minimum(rest[:, i], room * volume[i]), 0.0)
        room = np.maximum(room - wedges / volume[i], 0.0)
        in_throats[streams.link, i] += wedges
        in_pores[:, i] += np.bincount(streams.source, rest[:, i] - wedges, count)
        attached[:, i] += np.bincount(streams.source, stuck[:, i], count)
    come = filtrate * streams.fed[:, None] * classes.concentration
    void = fluid_void(sieve, solids)
    return replace(
        solids,
        carried=carried.concentration * void[:, None],
        in_pores=in_pores,
        attached=attached,
        in_throats=in_throats,
        cake=solids.cake + np.sum(come * (1.0 - what.admitted), axis=0),
        passed=solids.passed + carried.passed,
        supplied=solids.supplied + come.sum(axis=0),
    )


LEAST_VOID = 1e-3
"""Share of its void that a pore keeps at least for fluid."""


def fluid_void(sieve: Sieve, solids: Deposits) -> Array:
    """Void (N,) m3 that the solids leave to the fluid."""
    taken = (solids.in_pores + solids.attached).sum(axis=1)
    least = LEAST_VOID * np.maximum(sieve.void, 1e-6 * sieve.void.mean())
    return np.maximum(sieve.void - taken, least)
