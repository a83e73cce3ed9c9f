"""The slab of fines upstream of the face: random, at the given concentration, touching nothing.

With `fines.supply` = "batches" it comes in batches (`batches`).
"""

import math
from collections.abc import Iterator

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.case.size_rules import concentration_text
from fdnet.dem.batches import Batches, batches_of
from fdnet.dem.measured_fines import drawn_fines
from fdnet.dem.size_classes import CLEARANCE, ROUNDS, few, last_places, places_by_size
from fdnet.errors import CaseError
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.images import wrapped
from fdnet.spheres.snapshot import Array, Kind, Snapshot

SURE_CROWDING = 0.2
"""Up to this `crowding` every fine gets a place. Random sequential addition of equal spheres
saturates at 0.38 (Talbot et al. 1991), and none of 8,465 draws at 0.2 failed (docs/physics.md).
"""


def front_of(grains: Snapshot) -> float:
    """x (m) below which no grain reaches, at most 0.

    Surfaces of grains stand up to 0.07 mm beyond the face of a dense pack.
    """
    return float(min(0.0, np.min(grains.position[:, 0] - grains.radius)))


def refuse_crowded_supply(case: InvasionCase, scales: InvasionScales) -> None:
    """Raises CaseError when the slab cannot hold its fines, whatever the grains.

    The fines are drawn only where they might not fit, since that takes seconds for a million.
    """
    if crowding(case) <= SURE_CROWDING:
        return
    if case.fines.supply == "slab":
        _draw(case, scales, end=0.0)
    else:
        list(_draw_batches(case, scales, end=0.0))


def crowding(case: InvasionCase) -> float:
    """How crowded the slab is: the concentration c for equal fines, more for unequal ones.

    It is an eighth of the share of space that is closed to the centre of a largest fine,
    c <(R + r)^3> / (8 <r^3>) for radii r up to R, over the share of the cross-section that
    centres can reach (a diameter less between walls); inf when that is nothing. The `CLEARANCE`
    between fines is not counted.
    """
    low, high = case.fines.radius_range_m
    if case.fines.measured:
        one, two, three = (
            case.fines.curve.mean(power) / (2 * high) ** power for power in (1, 2, 3)
        )
        shut = (1 + 3 * one + 3 * two + three) / (8 * three)
    else:
        shut = (
            (2 * high + low + high)
            * ((2 * high) ** 2 + (low + high) ** 2)
            / (8 * (low + high) * (low**2 + high**2))
        )
    sides = zip(case.size_m[1:], case.periodic[1:], strict=True)
    reach = [1.0 if periodic else 1 - 2 * high / side for side, periodic in sides]
    return case.fines.placed_fraction * shut / math.prod(reach) if min(reach) > 0 else math.inf


def place_fines(case: InvasionCase, scales: InvasionScales, grains: Snapshot) -> Snapshot:
    """Fines (N) in the slab upstream of all grains, moving with the fluid.

    Raises CaseError when the slab cannot hold them without overlap.
    """
    position, radius = _draw(case, scales, end=slab_end(case, grains))
    return _moving(case, scales, grains, position, radius, first=int(grains.id.max()) + 1)


def slab_end(case: InvasionCase, grains: Snapshot) -> float:
    """x (m) where the slab ends: one diameter of the largest fine upstream of all grains."""
    return front_of(grains) - 2 * case.fines.radius_range_m[1]


def _moving(
    case: InvasionCase,
    scales: InvasionScales,
    grains: Snapshot,
    position: Array,
    radius: Array,
    *,
    first: int,
) -> Snapshot:
    velocity = np.zeros((len(radius), 3))
    velocity[:, 0] = scales.upstream_velocity
    return Snapshot(
        step=0,
        time_s=0.0,
        box=grains.box,
        id=np.arange(first, first + len(radius)),
        kind=np.full(len(radius), Kind.FINE),
        position=position,
        radius=radius,
        velocity=velocity,
    )


def place_batches(
    case: InvasionCase, scales: InvasionScales, grains: Snapshot
) -> Iterator[Snapshot]:
    """The slab batch by batch, each where the fluid has carried it when it enters.

    The ids are numbered through all batches. A batch does not depend on how many follow, but for
    measured sizes, of which each batch gets its part of the whole.
    """
    batches, first = batches_of(case, scales), int(grains.id.max()) + 1
    for number, (position, radius) in enumerate(
        _draw_batches(case, scales, end=slab_end(case, grains))
    ):
        carried = np.array([batches.distance_of(number), 0.0, 0.0])
        yield _moving(case, scales, grains, position + carried, radius, first=first)
        first += len(radius)


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
    size, high = np.array(case.size_m), slab_end(case, grains) + moved - number * batches.length
    near = high + 2.5 * case.fines.radius_range_m[1]
    some = there.where(there.position[:, 0] < near)
    period, place = np.where(case.periodic, size, 0.0), some.position
    place = wrapped(place, spheres.box, case.periodic)
    # rounding may leave a wrapped place at the size itself
    others = (np.where((period > 0) & (place >= period), 0.0, place), some.radius)
    margin = np.where(period > 0, 0.0, radius[:, None]) * np.array([0.0, 1.0, 1.0])
    own = min(batches.length, scales.slab_length - number * batches.length)
    lost, lengths = 0, np.linspace(own, 2.0 * batches.length, 5)
    # the last fines of a batch that has its full length are drawn many more times
    for length, patient in [*((one, False) for one in lengths), (lengths[-1], True)]:
        low, most = margin.copy(), np.tile(size, (len(radius), 1)) - margin
        low[:, 0], most[:, 0] = high - length, high
        place, lost = places_by_size(
            radius, low, most, period, rng=rng, others=others, patient=patient
        )
        if not lost:
            first = int(grains.id.max()) + 1 + batches.supplied(number)
            return _moving(case, scales, grains, place, radius, first=first)
    raise CaseError(
        f"{concentration_text(case.fines)}: {lost} of the {len(radius)} fines of batch "
        f"{number + 1} find no room among the fines that wait upstream, over "
        f"{2e3 * batches.length:.3g} mm; lower it, or set fines.supply = 'slab'"
    )


def _draw_batches(
    case: InvasionCase, scales: InvasionScales, *, end: float
) -> Iterator[tuple[Array, Array]]:
    """Places (n, 3) m in the slab and radii (n,) m of each batch, clear of the one before."""
    batches, before = batches_of(case, scales), (np.empty((0, 3)), np.empty(0))
    if case.fines.measured:
        yield from _draw_measured(case, scales, batches, end=end)
        return
    for number, count in enumerate(batches.counts):
        rng = np.random.default_rng([case.seed, 11, number])
        radius = rng.uniform(*case.fines.radius_range_m, count)
        high = end - number * batches.length
        low = max(high - batches.length, end - scales.slab_length)
        before = (_add_sequentially(case, radius, (low, high), rng, others=before), radius)
        yield before


def _draw_measured(
    case: InvasionCase, scales: InvasionScales, batches: Batches, *, end: float
) -> Iterator[tuple[Array, Array]]:
    """The same for measured sizes, placed all at once."""
    radius = [batch.radius for batch in drawn_fines(case, batches.counts)]
    every, batch = np.concatenate(radius), np.repeat(np.arange(len(radius)), batches.counts)
    size = np.array(case.size_m)
    low, high = np.zeros((len(every), 3)), np.tile(size, (len(every), 1))
    high[:, 0] = end - batch * batches.length
    low[:, 0] = np.maximum(high[:, 0] - batches.length, end - scales.slab_length)
    period = np.where(case.periodic, size, 0.0)
    margin = np.where(period > 0, 0.0, every[:, None]) * np.array([0.0, 1.0, 1.0])
    rng = np.random.default_rng([case.seed, 11])
    place, lost = places_by_size(every, low + margin, high - margin, period, rng=rng)
    if lost:
        raise _no_place(case, lost, len(every), scales.slab_length)
    yield from zip(np.split(place, np.cumsum(batches.counts)[:-1]), radius, strict=True)


def _no_place(case: InvasionCase, lost: int, count: int, length: float) -> CaseError:
    return CaseError(
        f"{concentration_text(case.fines)} leaves {lost} of {count} fines without a place in a "
        f"slab of {1e3 * length:.3g} mm; lower it or lengthen fines.slab_mm"
    )


def _draw(case: InvasionCase, scales: InvasionScales, *, end: float) -> tuple[Array, Array]:
    """Places (N, 3) and radii (N,) m of the slab's fines; it ends at x = `end`."""
    if case.fines.measured:
        return next(_draw_measured(case, scales, batches_of(case, scales), end=end))
    rng = np.random.default_rng([case.seed, 11])
    radius = rng.uniform(*case.fines.radius_range_m, scales.supplied_count)
    return _add_sequentially(case, radius, (end - scales.slab_length, end), rng), radius


def _add_sequentially(
    case: InvasionCase,
    radius: Array,
    slab: tuple[float, float],
    rng: np.random.Generator,
    others: tuple[Array, Array] = (np.empty((0, 3)), np.empty(0)),
) -> Array:
    """Places (N, 3) m by random sequential addition, largest first, between the x of `slab`, m.

    It goes in rounds: of two fines that overlap the later one is drawn again. `others` are places
    (M, 3) and radii (M,) m of spheres to keep clear of. After `ROUNDS` rounds the last ones are
    drawn many more times, one by one. Raises CaseError where one has no place even then.
    """
    size = np.array([slab[1] - slab[0], *case.size_m[1:]])
    period = np.where(case.periodic, size, 0.0)
    order = np.argsort(-radius, kind="stable")
    corner = np.array([slab[0], 0.0, 0.0])
    placed = others[0] - corner
    position = np.empty((len(radius), 3))
    waiting = order
    done = others[1]
    margins = np.where(period > 0, 0.0, radius[:, None]) * np.array([0.0, 1.0, 1.0])
    for _ in range(ROUNDS):
        if not len(waiting):
            break
        margin = margins[waiting]
        drawn = margin + rng.random((len(waiting), 3)) * (size - 2 * margin)
        free = _free(
            np.concatenate([placed, drawn]),
            np.concatenate([done, radius[waiting]]),
            len(placed),
            period,
        )
        position[waiting[free]] = drawn[free]
        done, placed = (
            np.concatenate([done, radius[waiting[free]]]),
            np.concatenate([placed, drawn[free]]),
        )
        waiting = waiting[~free]
    if few(len(waiting), len(radius)):
        span = margins[waiting], size - margins[waiting]
        last = last_places(radius[waiting], span, period, rng=rng, others=(placed, done))
        position[waiting[: len(last)]] = last
        waiting = waiting[len(last) :]
    if len(waiting):
        raise _no_place(case, len(waiting), len(radius), size[0])
    return position + corner


def _free(points: Array, radius: Array, placed: int, period: Array) -> Array:
    """Whether each newly drawn sphere clears all others: (N - placed,) truth values.

    `points` (N, 3) m and `radius` (N,) m hold the `placed` spheres first, which all stay, and then
    the drawn ones. Of two drawn ones that overlap the first stays.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(points, boxsize=period)
    pairs = tree.query_pairs(2 * CLEARANCE * radius.max(), output_type="ndarray")
    gap = points[pairs[:, 0]] - points[pairs[:, 1]]
    gap -= np.where(period > 0, period * np.round(gap / np.where(period > 0, period, 1.0)), 0.0)
    clash = np.sqrt(np.sum(gap**2, axis=1)) < CLEARANCE * radius[pairs].sum(axis=1)
    free = np.ones(len(points), bool)
    free[np.max(pairs[clash], axis=1, initial=0)] = False
    return free[placed:]
