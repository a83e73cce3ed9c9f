"""Where the fines come from: a slab of suspension upstream of the face, cut into batches.

They get random places, class of sizes by class of sizes, from the largest. A large sphere finds no
place among small ones that are there already. So every class is placed to the last sphere before
the next one begins, in the whole slab at once: a batch that is filled before its neighbour would
leave no place for large ones at their boundary.

Rounds in which every sphere without a place is drawn again leave the last ones over by chance. So
each of these is drawn many more times before it counts as one without a place.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fdnet.case.case import InvasionCase, concentration_text
from fdnet.errors import CaseError
from fdnet.scales.clock import ARRIVALS
from fdnet.scales.scales import InvasionScales
from fdnet.sizes import dealt
from fdnet.spheres.geometry import in_period, wrapped
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting

CLEARANCE = 1.02  # Fines start at least this many radius sums apart
ROUNDS = 400  # Times that a sphere without a place is drawn again, together with the others
LAST_TRIES, LAST_SHARE = 100_000, 0.05
"""Times that each of the last spheres is drawn, and the share of all that may be the last ones."""
_CLASS, _MOST, _BLOCK = 2**0.25, 50_000, 1_000
"""Largest ratio of radii in a class, most spheres that are drawn at once, and how many places for
one of the last spheres are drawn at once."""

Indices = NDArray[np.int64]
NOBODY = (np.empty((0, 3)), np.empty(0))  # Places and radii of no sphere


def places_by_size(
    radius: Array,
    low: Array,
    width: Array,
    size: Array,
    *,
    rng: np.random.Generator,
    others: tuple[Array, Array] = NOBODY,
    patient: bool = True,
    at_once: bool = False,
) -> tuple[Array, int]:
    """Random places that touch nothing, by random sequential addition of whole classes.

    It goes in rounds: of two spheres that overlap the later one, which is no larger, is drawn
    again.

    Args:
        radius: (N,) m.
        low: (N, 3) m, smallest coordinates of each centre.
        width: (N, 3) m, from these to the largest ones.
        size: (3,) m, period along each axis, 0 where there is none.
        rng: gives the places.
        others: places (M, 3) m and radii (M,) m of spheres that are there already.
        patient: whether the last spheres of a class are drawn `LAST_TRIES` times.
        at_once: whether all sizes are one class.

    Returns:
        Places (N, 3) m, and how many spheres got none; those places mean nothing then.
    """
    count = len(radius)
    place = np.concatenate([np.empty((count, 3)), others[0]])
    done = np.arange(len(place)) >= count
    radius = np.concatenate([radius, others[1]])
    order = np.argsort(-radius[:count], kind="stable")
    for waiting in [order] if at_once else _classes(radius[:count], order):
        for _ in range(ROUNDS):
            if not len(waiting):
                break
            place[waiting] = low[waiting] + rng.random((len(waiting), 3)) * width[waiting]
            clear = _clear(place, radius, waiting, np.flatnonzero(done), size)
            done[waiting[clear]] = True
            waiting = waiting[~clear]
        if patient and 0 < len(waiting) <= max(1.0, LAST_SHARE * count):
            left = radius[waiting], low[waiting], width[waiting]
            last = _last_places(*left, size, rng, (place[done], radius[done]))
            place[waiting[: len(last)]], done[waiting[: len(last)]] = last, True
            waiting = waiting[len(last) :]
        if len(waiting):
            return place[:count], int(np.sum(~done))
    return place[:count], 0


def _last_places(
    radii: Array,
    lows: Array,
    widths: Array,
    size: Array,
    rng: np.random.Generator,
    others: tuple[Array, Array],
) -> Array:
    """Places (K, 3) m of the first K spheres, each clear of the ones before it and of `others`.

    K is N, or as many as there are before the first one that `LAST_TRIES` draws give no place.
    """
    from scipy.spatial import cKDTree

    place, there = others
    for one, low, width in zip(radii, lows, widths, strict=True):
        tree = cKDTree(place, boxsize=size)
        reach = CLEARANCE * (one + float(there.max(initial=0.0)))
        for _ in range(LAST_TRIES // _BLOCK):
            drawn = low + rng.random((_BLOCK, 3)) * width
            other = cKDTree(drawn, boxsize=size)
            near = other.sparse_distance_matrix(tree, reach, output_type="ndarray")
            clear = np.ones(_BLOCK, bool)
            clear[near["i"][near["v"] < CLEARANCE * (one + there[near["j"]])]] = False
            if clear.any():
                break
        else:
            break
        place, there = np.vstack([place, drawn[np.argmax(clear)]]), np.append(there, one)
    return place[len(others[0]) :]


def _classes(radius: Array, order: Indices) -> Iterator[Indices]:
    """Indices of the spheres of each class, from the largest; in `order` they go by size."""
    start = 0
    while start < len(order):
        alike = radius[order[start:]] > radius[order[start]] / _CLASS
        end = min(start + int(np.sum(alike)), start + _MOST)
        yield order[start:end]
        start = end


def _clear(
    place: Array, radius: Array, drawn: Indices, others: Indices, size: Array
) -> NDArray[np.bool_]:
    """Whether each drawn sphere clears the others and the drawn ones before it."""
    from scipy.spatial import cKDTree

    clear = np.ones(len(drawn), bool)
    tree, reach = cKDTree(place[drawn], boxsize=size), CLEARANCE * radius[drawn].max()
    if len(others):
        there, most = cKDTree(place[others], boxsize=size), CLEARANCE * radius[others].max()
        near = tree.sparse_distance_matrix(there, reach + most, output_type="ndarray")
        least = CLEARANCE * (radius[drawn[near["i"]]] + radius[others[near["j"]]])
        clear[near["i"][near["v"] < least]] = False
    near = tree.sparse_distance_matrix(tree, 2 * reach, output_type="ndarray")
    near = near[near["i"] < near["j"]]
    least = CLEARANCE * (radius[drawn[near["i"]]] + radius[drawn[near["j"]]])
    clear[near["j"][near["v"] < least]] = False
    return clear


# ------------------------------------------------------------------------------------------------
# How the slab of fines is cut into batches, and when each of them enters.
#
# A batch enters at the start of a chunk, where the fluid would have carried it by then. No cake of
# `LOOSEST_CAKE` overtakes a batch. Where the deposit slows the mud down (`Drag.slowed`) a batch
# follows from the distance that the mud has moved (docs/physics.md, "Supply of fines").


LOOSEST_CAKE = 0.5
"""Volume fraction of the loosest cake that batches leave room for. Random loose packing has 0.55
(Onoda & Liniger 1990)."""
AT_ONCE = 2
"""Batches present from the start: the one that arrives in the first chunk, and the next."""
ROUNDING = 1e-9  # Share of a chunk's travel that rounding may take from the distance of the mud


@dataclass(frozen=True, slots=True, kw_only=True)
class Batches:
    """How a slab is cut: fines in each batch, its length, the way of mud in a chunk, both m."""

    counts: tuple[int, ...]
    length: float
    travel: float

    @property
    def reach(self) -> float:
        """Largest distance, m, of a fine to the slab's end when it enters undisturbed mud."""
        later = max(0, len(self.counts) - AT_ONCE)
        return min(AT_ONCE, len(self.counts)) * self.length + later * (self.length - self.travel)

    def entered_at(self, chunk: int) -> int:
        """Batches that are in the simulation in a chunk (numbered from 1) of undisturbed mud."""
        return min(len(self.counts), chunk + AT_ONCE - 1)

    def entered_after(self, distance: float) -> int:
        """Batches that are in the simulation once the mud has moved by a `distance`, m."""
        return self.entered_at(1 + math.floor(distance / self.travel + ROUNDING))

    def entered_with(self, fines: int) -> int:
        """The smallest number of batches that hold so many `fines`, and at least the first ones.

        They are all batches where not even these hold so many.
        """
        needed = int(np.searchsorted(np.cumsum(self.counts), fines)) + 1
        return min(len(self.counts), max(needed, self.entered_at(1)))

    def supplied(self, entered: int) -> int:
        """Fines in the first batches, `entered` of them."""
        return sum(self.counts[:entered])


def batches_of(case: InvasionCase, scales: InvasionScales) -> Batches:
    """The batches of a case: of equal length, with the slab's fines shared out evenly.

    A slab that is fed at once is one batch, and so is one of so few fines that some batch would be
    empty; mud without an end has longer batches then. No batch is thinner than a fine, so that
    each must clear only the one next to it.
    """
    travel = scales.upstream_velocity * scales.checkpoint_steps * scales.time_step
    apart = 1.01 * CLEARANCE * 2 * case.fines.radius_range_m[1]
    length = max(travel / (1 - case.fines.placed_fraction / LOOSEST_CAKE), apart)
    if case.fines.endless:  # no batch is empty
        length = max(length, ARRIVALS * scales.slab_length / scales.supplied_count)
    whole = Batches(counts=(scales.supplied_count,), length=scales.slab_length, travel=travel)
    if case.fines.supply == "slab" or scales.slab_length <= AT_ONCE * length:
        return whole
    number = math.ceil(scales.slab_length / length - 1e-9)
    share = np.minimum(np.arange(1, number + 1) * length / scales.slab_length, 1.0)
    counts = np.diff(np.round(share * scales.supplied_count).astype(int), prepend=0)
    counts = counts[counts > 0] if case.fines.endless else counts
    if not counts.all():
        return whole
    return Batches(counts=tuple(int(count) for count in counts), length=length, travel=travel)


# ---- Fines of measured sizes: which radius and density each has, and in which batch it comes.
class Drawn(NamedTuple):
    """Radius, m, and density, kg/m3, of some fines, (N,) each."""

    radius: Array
    density: Array


def drawn_fines(case: InvasionCase, counts: Sequence[int]) -> list[Drawn]:
    """Fines of measured sizes for batches of `counts`, each with the curve of the whole mud.

    All fines are drawn at once, as strata of the curve of each material, and then dealt out. How
    many are of each material follows by the largest remainder.
    """
    fines, count = case.fines.components, sum(counts)
    rates = [one.share * one.curve.kept / one.curve.mean(3) for one in fines]
    exact = [count * rate / sum(rates) for rate in rates]
    numbers = [int(one) for one in exact]
    missing = count - sum(numbers)
    for index in sorted(range(len(exact)), key=lambda i: numbers[i] - exact[i])[:missing]:
        numbers[index] += 1
    parts = zip(fines, numbers, strict=True)
    radius = np.concatenate([0.5 * one.curve.strata(number) for one, number in parts])
    density = np.repeat([one.density for one in fines], numbers)
    rng = np.random.default_rng([case.seed, 13])
    return [Drawn(radius[index], density[index]) for index in dealt(counts, rng)]


def densities(case: InvasionCase, counts: Sequence[int]) -> Array:
    """(N,) density of every fine, kg/m3, in the order of their ids."""
    if not case.fines.measured:
        return np.full(sum(counts), case.fines.density_kg_m3)
    return np.concatenate([batch.density for batch in drawn_fines(case, counts)])


# ------------------------------------------------------------------------------------------------
# The slab of fines upstream of the face: random, at the given concentration, touching nothing.


SURE_CROWDING = 0.2
"""Up to this `crowding` every fine gets a place. Random sequential addition of equal spheres
saturates at 0.38 (Talbot et al. 1991), and none of 8,465 draws at 0.2 failed (docs/physics.md).
"""


def refuse_crowded_supply(case: InvasionCase, scales: InvasionScales) -> None:
    """Raises CaseError when the slab cannot hold its fines, whatever the grains.

    The fines are drawn only where they might not fit, since that takes seconds for a million.
    """
    if crowding(case) > SURE_CROWDING:
        list(_draw(case, scales, end=0.0))


def crowding(case: InvasionCase) -> float:
    """How crowded the slab is: the concentration c for equal fines, more for unequal ones.

    It is an eighth of the share of space that is closed to the centre of a largest fine,
    c <(R + r)^3> / (8 <r^3>) for radii r up to R, over the share of the cross-section that
    centres can reach (a diameter less between walls); inf when that is nothing. The `CLEARANCE`
    between fines is not counted.
    """
    low, high = case.fines.radius_range_m
    if case.fines.measured:
        curve, wide = case.fines.curve, 2 * high
        one, two, three = (curve.mean(power) / wide**power for power in (1, 2, 3))
        shut = (1 + 3 * one + 3 * two + three) / (8 * three)
    else:
        above = (2 * high + low + high) * ((2 * high) ** 2 + (low + high) ** 2)
        shut = above / (8 * (low + high) * (low**2 + high**2))
    sides = zip(case.size_m[1:], case.periodic[1:], strict=True)
    reach = [1.0 if periodic else 1 - 2 * high / side for side, periodic in sides]
    return case.fines.placed_fraction * shut / math.prod(reach) if min(reach) > 0 else math.inf


def slab_end(case: InvasionCase, grains: Snapshot) -> float:
    """x (m) where the slab ends: one diameter of the largest fine upstream of all grains.

    Surfaces of grains stand up to 0.07 mm beyond the face of a dense pack.
    """
    front = float(min(0.0, np.min(grains.position[:, 0] - grains.radius)))
    return front - 2 * case.fines.radius_range_m[1]


def place_batches(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot
) -> Iterator[Snapshot]:
    """The slab batch by batch, each where the fluid has carried it when it enters.

    The ids are numbered through all batches. A batch does not depend on how many follow, but for
    measured sizes, of which each batch gets its part of the whole. Raises CaseError when the slab
    cannot hold its fines without overlap.
    """
    travel, first = batches_of(case, scales).travel, int(grains.id.max()) + 1
    for number, (place, radius) in enumerate(_draw(case, scales, end=slab_end(case, grains))):
        carried = max(0, number + 1 - AT_ONCE) * travel
        yield _moving(scales, grains, place + np.array([carried, 0.0, 0.0]), radius, first)
        first += len(radius)


def _moving(
    scales: InvasionScales, grains: Snapshot, position: Array, radius: Array, first: int
) -> Snapshot:
    """Fines that move with the mud; `first` is the id of the first one."""
    fines = resting(position, radius, grains.box, Kind.FINE)
    velocity = fines.velocity + np.array([scales.upstream_velocity, 0.0, 0.0])
    return replace(fines, id=fines.id + (first - 1), velocity=velocity)


def later_batch(
    case: InvasionCase, scales: InvasionScales, spheres: Snapshot, number: int, moved: float
) -> Snapshot:
    """Batch `number` (from 0), where mud that has moved by `moved` m has carried it.

    It is clear of the fines among the `spheres` that are there. Where these leave too little room,
    it reaches further upstream, up to twice the length of a batch. Raises CaseError where that is
    too little.
    """
    batches, grains, there = batches_of(case, scales), spheres.grains(), spheres.fines()
    rng = np.random.default_rng([case.seed, 11, number])
    if case.fines.measured:
        radius = drawn_fines(case, batches.counts)[number].radius
    else:
        radius = rng.uniform(*case.fines.radius_range_m, batches.counts[number])
    size, period, margin = _across(case, radius)
    high = slab_end(case, grains) + moved - number * batches.length
    some = there.where(there.position[:, 0] < high + 2.5 * case.fines.radius_range_m[1])
    place = wrapped(some.position, spheres.box, case.periodic)
    others = in_period(place, period), some.radius
    own = min(batches.length, scales.slab_length - number * batches.length)
    lost, lengths = 0, np.linspace(own, 2.0 * batches.length, 5)
    # the last fines of a batch that has its full length are drawn many more times
    for length, patient in [*((one, False) for one in lengths), (lengths[-1], True)]:
        low, most = margin.copy(), size - margin
        low[:, 0], most[:, 0] = high - length, high
        room = low, most - low, period
        place, lost = places_by_size(radius, *room, rng=rng, others=others, patient=patient)
        if not lost:
            first = int(grains.id.max()) + 1 + batches.supplied(number)
            return _moving(scales, grains, place, radius, first)
    raise CaseError(
        f"{concentration_text(case.fines)}: {lost} of the {len(radius)} fines of batch "
        f"{number + 1} find no room among the fines that wait upstream, over "
        f"{2e3 * batches.length:.3g} mm; lower it, or set fines.supply = 'slab'"
    )


def _across(case: InvasionCase, radius: Array) -> tuple[Array, Array, Array]:
    """Size and period (3,) m of the box, margins (N, 3) m of fines of `radius` to its walls."""
    size = np.array(case.size_m)
    period = np.where(case.periodic, size, 0.0)
    return size, period, np.where(period > 0, 0.0, radius[:, None]) * np.array([0.0, 1.0, 1.0])


def _draw(
    case: InvasionCase, scales: InvasionScales, *, end: float
) -> Iterator[tuple[Array, Array]]:
    """Places (n, 3) m and radii (n,) m of each batch of the slab, which ends at x = `end`.

    Fines of measured sizes are placed all at once. Others are clear of the batch before.
    """
    batches, before, slab = batches_of(case, scales), NOBODY, case.fines.supply == "slab"
    highs = end - np.arange(len(batches.counts)) * batches.length
    lows = np.maximum(highs - batches.length, end - scales.slab_length)
    if case.fines.measured:
        radii = [batch.radius for batch in drawn_fines(case, batches.counts)]
        every, batch = np.concatenate(radii), np.repeat(np.arange(len(radii)), batches.counts)
        size, period, margin = _across(case, every)
        low, high = np.zeros((len(every), 3)), np.tile(size, (len(every), 1))
        low[:, 0], high[:, 0] = lows[batch], highs[batch]
        rng = np.random.default_rng([case.seed, 11])
        width = (high - margin) - (low + margin)
        place, lost = places_by_size(every, low + margin, width, period, rng=rng)
        _refuse_lost(case, lost, len(every), scales.slab_length)
        yield from zip(np.split(place, np.cumsum(batches.counts)[:-1]), radii, strict=True)
        return
    for number, count in enumerate(batches.counts):
        rng = np.random.default_rng([case.seed, 11, *([] if slab else [number])])
        radius = rng.uniform(*case.fines.radius_range_m, count)
        size, period, margin = _across(case, radius)
        size[0], corner = highs[number] - lows[number], np.array([lows[number], 0.0, 0.0])
        room, others = (margin, size - 2 * margin, period), (before[0] - corner, before[1])
        place, lost = places_by_size(radius, *room, rng=rng, others=others, at_once=True)
        _refuse_lost(case, lost, count, size[0])
        before = place + corner, radius
        yield before


def _refuse_lost(case: InvasionCase, lost: int, count: int, length: float) -> None:
    if lost:
        or_longer = "" if case.fines.endless else " or lengthen fines.slab_mm"
        raise CaseError(
            f"{concentration_text(case.fines)} leaves {lost} of {count} fines without a place in "
            f"a slab of {1e3 * length:.3g} mm; lower it{or_longer}"
        )
