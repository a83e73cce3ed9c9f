"""Where solids that were held sit, what they leave of passages and conductances, and the cake.

The first fine that a throat holds sits in the throat, the next ones in the pore before it. A pore
is full when its void is packed at the porosity `PACKED`. What flows on through a full pore leaves
behind whatever is wider than the gaps of its bed, and so does the cake, which is what the full
pores of the face turn away.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fdnet.classes.capture import TIGHT, SizeClasses, covered, wider_share
from fdnet.classes.transport import Streams, carry, pile_up
from fdnet.network.flow.flow import PLANE_TOLERANCE
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array, frozen, one_line

PACKED = 0.40
"""Porosity of the solids in a full pore, and of a cake whose permeability is not given."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sieve:
    """Pores (N) and throats (T) as solids meet them, SI units; a pore is a group of `Network`."""

    ends: Array  # (T, 2) the pores that a throat joins
    passage: Array  # (T,) m, diameter of the largest sphere that passes the clean throat
    opening: Array  # (T,) m, radius of the circle of its open area
    halves: Array  # (T, 2) 1/m3, resistances of the sides of the clean throat
    reach: Array  # (T,) m, length of the throat
    winding: float  # the tortuosity of the flow
    void: Array  # (N,) m3 inside the box
    room: Array  # (N,) m, cubic root of the mean void of the tetrahedra that make up a pore
    surface: Array  # (N,) m2 of grains
    place: Array  # (N, 3) m
    throat_place: Array  # (T, 3) m
    inlet: Array  # (N,) whether a pore lies on the formation face
    outlet: Array  # (N,) whether it lies on the other end
    area: float  # m2, of the face
    length: float  # m, of the specimen

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
    whole = np.maximum(network.pore_volume, 0.0)
    middle = network.throat_corner.mean(axis=1)
    middle[:, 1:] = (middle[:, 1:] - network.box[1:, 0]) % size[1:] + network.box[1:, 0]
    return Sieve(
        ends=frozen(group[network.throat_pores]),
        passage=frozen(2.0 * network.throat_radius),
        opening=frozen(np.maximum(network.throat_radius_effective, network.throat_radius)),
        halves=frozen(np.where(np.isfinite(halves), halves, 0.0)),
        reach=frozen(network.throat_length),
        winding=max(winding, 1.0),
        void=frozen(np.bincount(group, whole * network.pore_share)),
        room=frozen(np.cbrt(np.bincount(group, whole) / np.bincount(group))),
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
    """Where the solids of classes (C) are, m3: in pores (N), throats (T), the cake, and beyond."""

    carried: Array  # (N, C) in the fluid of the pores
    in_pores: Array  # (N, C) held in pores
    attached: Array  # (N, C) stuck to the grains of pores
    in_throats: Array  # (T, C) held in throats
    cake: Array  # (C,) before the face
    passed: Array  # (C,) through the outlet
    supplied: Array  # (C,) all that came to the face

    __repr__ = one_line

    @property
    def missing(self) -> Array:
        """(C,) what the ledger does not find again, over what was supplied; rounding."""
        found = self.inside_by_class + self.cake + self.passed
        return np.asarray((self.supplied - found) / np.maximum(self.supplied, 1e-300))

    @property
    def inside_by_class(self) -> Array:
        """(C,) m3 in the specimen."""
        parts = (self.carried, self.in_pores, self.attached, self.in_throats)
        return np.sum([one.sum(axis=0) for one in parts], axis=0)


def no_solids(sieve: Sieve, classes: SizeClasses) -> Deposits:
    """A specimen that no mud has reached."""
    count, pores = len(classes.diameter), ("carried", "in_pores", "attached")
    return Deposits(
        **{name: np.zeros((len(sieve.void), count)) for name in pores},
        in_throats=np.zeros((len(sieve.ends), count)),
        **{name: np.zeros(count) for name in ("cake", "passed", "supplied")},
    )


# ---- What the deposit leaves of passages, pores and conductances.
LOOSE = 0.29
"""Share by which solids in a pore pack less densely, for each of their diameters over the cubic
root of its void: 0.55 of the void at 0.35, 0.42 at 0.9, 0.38 at 1.2 (docs/theory/size_classes)."""
FULL = 0.95  # Filled share from which a pore begins to act as a bed
ADDED, BED = 1210.0, 855.0
"""Resistance that a deposit adds to a side of a throat, times (d l)^1.5 and d^2 l, over the square
of the share of the void that it takes: measured for large fines, and Carman and Kozeny's bed."""


class Loads(NamedTuple):
    """What the deposit takes of pores (N): the share of the void, this over that of a full pore,
    and its Sauter diameter, m, 0 where there is none."""

    share: Array
    filled: Array
    diameter: Array


def loads_of(
    sieve: Sieve, solids: Deposits, classes: SizeClasses, *, with_attached: bool = False
) -> Loads:
    """The loads of the pores; a fine in a throat counts half for each side.

    What sticks to the grains is no pile that stops others, but narrows the pore all the same.
    """
    count = len(sieve.void)
    sums, own = np.zeros((count, 2)), classes.diameter
    pile_up(sieve.ends, solids.in_pores, solids.in_throats, own, sums)
    if with_attached:
        pile_up(sieve.ends, solids.attached, solids.in_throats[:0], own, sums)
    volume, inverse = sums.T
    size = np.divide(volume, inverse, out=np.zeros(count), where=inverse > 0)
    share = np.divide(volume, sieve.void, out=np.zeros(count), where=sieve.void > 0)
    wide = np.divide(size, sieve.room, out=np.zeros(count), where=sieve.room > 0)
    full = (1.0 - PACKED) * np.maximum(1.0 - LOOSE * wide, 0.25)
    return Loads(share=share, filled=share / full, diameter=size)


def bed_diameter(deposit: Array, classes: SizeClasses) -> Array:
    """Sauter diameter (...,) m of solids (..., C) m3; 0 where there are none."""
    inverse = deposit @ (1.0 / classes.diameter)
    return np.divide(deposit.sum(axis=-1), inverse, out=np.zeros_like(inverse), where=inverse > 0)


def kept_shares(sieve: Sieve, solids: Deposits, classes: SizeClasses) -> Array:
    """Share (T, 2) of its clean conductance that each side of a throat keeps.

    Solids of the diameter d that take the share s of a pore of the size l add to each side

        dR = s^2 max(A / (d l)^1.5, B / (d^2 l)).
    """
    loads = loads_of(sieve, solids, classes, with_attached=True)
    size, room = np.maximum(loads.diameter, 1e-12), np.maximum(sieve.room, 1e-9)
    share = np.minimum(loads.share, 1.0 - PACKED)
    added = np.maximum(ADDED / (size * room) ** 1.5, BED / (size**2 * room)) * share**2
    added = np.where(loads.diameter > 0, added, 0.0)
    raised = sieve.halves + added[sieve.ends]
    return np.divide(sieve.halves, raised, out=np.ones_like(raised), where=sieve.halves > 0)


def bed_holds(size: Array, classes: SizeClasses) -> Array:
    """Share (N, C) of each class that beds of the Sauter diameter `size` (N,) m hold."""
    return np.where(size[:, None] > 0, wider_share(classes, TIGHT * size), 0.0)


# ---- What each link holds back, and where that goes.
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Holding:
    """What pores (N) and the face (F of them) hold back in one step."""

    solid: Array  # (N,) m3 of deposit, which stops fines beside it
    full: Array  # (N,) 0 up to a filled share of FULL, 1 in a full pore, which acts as a bed
    gap: Array  # (N,) logarithm of the widest sphere, m, that passes the deposit
    bare: Array  # (N,) share of the surface to which nothing sticks yet
    filtering: Array  # (C,) 1/m, of clean grains
    feed: Array  # (F, C) volume over that of the fluid that enters

    __repr__ = one_line


def holding(
    sieve: Sieve, solids: Deposits, classes: SizeClasses, streams: Streams, filtering: Array
) -> Holding:
    """What holds back what, with the deposit as it is; `filtering` (C,) 1/m is of clean grains."""
    loads, face = loads_of(sieve, solids, classes), np.flatnonzero(streams.fed)
    full = np.clip((loads.filled - FULL) / (1.0 - FULL), 0.0, 1.0)
    bare = np.ones(len(full))
    if np.any(filtering > 0):
        bare -= covered(solids.attached, classes, sieve.surface)
    gap = np.log(TIGHT * np.where(loads.diameter > 0, loads.diameter, np.inf))
    size, own = (bed_diameter(cake, classes) for cake in (solids.cake[None], solids.cake))
    layers = thickness_of_cake(sieve, solids) / float(own) if own > 0 else 0.0
    admitted = 1.0 - full[face, None] * bed_holds(loads.diameter[face], classes)
    admitted *= 1.0 - min(1.0, layers) * bed_holds(size, classes)
    return Holding(
        solid=loads.share * sieve.void,
        full=full,
        gap=gap,
        bare=bare,
        filtering=filtering,
        feed=admitted * classes.concentration,
    )


def thickness_of_cake(sieve: Sieve, solids: Deposits) -> float:
    """m, of the cake at the porosity `PACKED`."""
    return float(solids.cake.sum()) / (1.0 - PACKED) / sieve.area


def advanced(
    sieve: Sieve,
    solids: Deposits,
    classes: SizeClasses,
    streams: Streams,
    what: Holding,
    filtrate: float,
) -> Deposits:
    """The solids after `filtrate` m3 of fluid entered, of which `what` says what was held back.

    What was held goes to throats, pores and grains.
    """
    face, entered = np.flatnonzero(streams.fed), filtrate * streams.fed[streams.fed > 0, None]
    names = ["carried", "in_pores", "in_throats", "passed"]
    names += ["attached"] if np.any(what.filtering > 0) else []
    new = replace(solids, **{name: getattr(solids, name).copy() for name in names})
    new.carried[face] += entered * what.feed
    low, high = np.log(classes.low), np.log(classes.high)
    carry(
        *(streams.order, streams.first, streams.target, streams.link, streams.share),
        *(streams.outlet, filtrate, fluid_void(sieve, solids), np.maximum(sieve.void, 1e-30)),
        *(what.solid, what.full, what.gap, what.bare, np.maximum(sieve.passage, 1e-12)),
        *(sieve.reach / sieve.winding, what.filtering, classes.diameter, classes.volume),
        *(high, 1.0 / np.maximum(high - low, 1e-12)),
        *(new.carried, new.in_pores, new.attached, new.in_throats, new.passed),
    )
    come = classes.concentration
    return replace(
        new,
        cake=solids.cake + np.sum(entered * (come - what.feed), axis=0),
        supplied=solids.supplied + np.sum(entered * come, axis=0),
    )


# ---- Release: the flow lifts what sticks where it pulls at the wall hard enough.
class Release(NamedTuple):
    """What the flow lifts."""

    stress: float  # Pa, of the wall of a throat, above which it does
    time: float  # s, in which it lifts all but 1/e


def released(
    sieve: Sieve, solids: Deposits, streams: Streams, drop: float, seconds: float, law: Release
) -> Deposits:
    """The solids when some of the deposit went back into the fluid, in so many `seconds`.

    A throat of radius r and length l, of the pressure drop dp, has the wall stress r dp / (2 l).
    Above that of the `law` the deposit in it falls as exp(-t / time); what sticks to the grains
    of a pore does so by the share of its outflow that leaves through such throats. What was lifted
    is in the fluid of the pore before the throat. `drop` Pa is that of the specimen.
    """
    one, other = sieve.ends.T
    high, low = streams.pressure[one], streams.pressure[other]
    stress = sieve.opening * np.abs(high - low) * drop / (2.0 * sieve.reach)
    lifts = stress > law.stress
    loose, count = -np.expm1(-seconds / law.time), len(sieve.void)
    swept = np.bincount(streams.source, streams.share * lifts[streams.link], count)
    out = np.bincount(streams.source, streams.share, count)
    share = np.divide(swept, out, out=np.zeros(count), where=out > 0)
    from_grains = solids.attached * (loose * share)[:, None]
    from_throats = solids.in_throats * (loose * lifts)[:, None]
    before = np.where(high >= low, one, other)
    freed = np.stack([np.bincount(before, own, count) for own in from_throats.T], axis=1)
    return replace(
        solids,
        carried=solids.carried + freed + from_grains,
        attached=solids.attached - from_grains,
        in_throats=solids.in_throats - from_throats,
    )


LEAST_VOID = 1e-3  # Share of its void that a pore keeps at least for fluid


def fluid_void(sieve: Sieve, solids: Deposits) -> Array:
    """Void (N,) m3 that the solids leave to the fluid."""
    taken = solids.in_pores.sum(axis=1) + solids.attached.sum(axis=1)
    least = LEAST_VOID * np.maximum(sieve.void, 1e-6 * sieve.void.mean())
    return np.maximum(sieve.void - taken, least)
