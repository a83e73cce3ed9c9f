"""Spheres in a box: contacts, which lie inside others, images beyond its sides, porosity."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from scipy.spatial import cKDTree

from fdnet.errors import Doubt
from fdnet.spheres.snapshot import Array, Kind, Snapshot, frozen, one_line

_ROUNDING = 1e-6
"""Gap over the smaller diameter below which two spheres may touch, to LIGGGHTS's rounding."""
_OVERLAP_WARNING = 0.03  # Overlap over a diameter above which it is reported
_INSIDE_ROUNDING = 1e-3
"""Part of its radius by which a sphere may reach out of another one and still lie inside of it."""


def touching_pairs(
    spheres: Snapshot, periodic: tuple[bool, bool, bool], *, gap: float = 0.0
) -> tuple[Array, Array]:
    """Pairs (K, 2) of spheres that touch, and their overlaps (K,) m; a negative one is a gap.

    Two spheres touch when they are nearer than `gap` times the smaller diameter. Spheres are
    searched in two classes of size, so that a few large ones do not widen the search of all.
    """
    radius = spheres.radius
    if len(radius) == 0:
        return np.empty((0, 2), int), np.empty(0)
    period = np.where(periodic, spheres.box[:, 1] - spheres.box[:, 0], 0.0)
    place = spheres.position - spheres.box[:, 0]
    place = np.where(period > 0, np.mod(place, np.where(period > 0, period, 1.0)), place)
    position = in_period(place, period)
    small = radius <= 0.5 * radius.max()
    groups = [group for group in (np.flatnonzero(small), np.flatnonzero(~small)) if len(group)]
    trees = [cKDTree(position[group], boxsize=period) for group in groups]
    touching = [
        _pairs((trees[i], trees[j]), (groups[i], groups[j]), radius, gap)
        for i in range(len(groups))
        for j in range(i, len(groups))
    ]
    pairs, overlap = (np.concatenate(part) for part in zip(*touching, strict=True))
    return pairs, overlap


def _pairs(
    trees: tuple[cKDTree, cKDTree], groups: tuple[Array, Array], radius: Array, gap: float
) -> tuple[Array, Array]:
    first, second = groups
    reach = radius[first].max() + radius[second].max()
    reach += 2 * gap * min(radius[first].max(), radius[second].max())
    near = trees[0].sparse_distance_matrix(trees[1], reach, output_type="coo_matrix")
    pairs = np.column_stack([first[near.row], second[near.col]])
    overlap = radius[pairs].sum(axis=1) - near.data
    limit = -2 * gap * radius[pairs].min(axis=1)
    keep = (overlap > limit) & ((pairs[:, 0] < pairs[:, 1]) | (trees[0] is not trees[1]))
    return pairs[keep], overlap[keep]


def groups_apart(spheres: Snapshot, periodic: tuple[bool, bool, bool]) -> Array:
    """The group (N,) of each sphere, from 1; no two spheres of a group touch.

    Greedy colouring of the graph of contacts, those with most contacts first (Welsh and Powell
    1967). It takes at most one group more than a sphere has contacts.
    """
    pairs, _ = touching_pairs(spheres, periodic, gap=_ROUNDING)
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    starts = np.searchsorted(ends[:, 0], np.arange(len(spheres) + 1))
    group = np.zeros(len(spheres), int)
    for sphere in np.argsort(-np.diff(starts), kind="stable"):
        taken = set(group[ends[starts[sphere] : starts[sphere + 1], 1]].tolist())
        group[sphere] = next(number for number in count(1) if number not in taken)
    return group


def max_overlap(
    spheres: Snapshot, periodic: tuple[bool, bool, bool], *, only_fines: bool = False
) -> float:
    """Largest overlap of two spheres over the smaller one's diameter; 0 if none touch.

    `only_fines` leaves out pairs of grains.
    """
    pairs, overlap = touching_pairs(spheres, periodic)
    if only_fines:
        fine = np.any(spheres.kind[pairs] == Kind.FINE, axis=1)
        pairs, overlap = pairs[fine], overlap[fine]
    share = overlap / (2 * np.min(spheres.radius[pairs], axis=1))
    return float(max(share.max(initial=0.0), _own_images(spheres, periodic, only_fines)))


def _own_images(spheres: Snapshot, periodic: tuple[bool, bool, bool], only_fines: bool) -> float:
    """Overlap of the largest sphere with its own image over its diameter, as in a unit cell."""
    side = float(np.min(np.ptp(spheres.box, axis=1), where=periodic, initial=np.inf))
    wide = 2.0 * spheres.radius[(spheres.kind == Kind.FINE) | (not only_fines)]
    return float(max(1.0 - side / wide.max(initial=0.0), 0.0)) if len(wide) else 0.0


def overlap_doubts(grains: float, fines: float = 0.0) -> Iterator[str]:
    """Warnings on the largest overlaps of grains and of fines, as shares of a diameter."""
    for name, what, share in (("grains", "pack", grains), ("fines", "deposit", fines)):
        if share > _OVERLAP_WARNING:
            yield Doubt(
                "grains-overlap",
                f"{name} overlap by up to {100 * share:.1f} % of a diameter: the {what} is denser "
                "than rigid spheres get",
            )


def inside_others(spheres: Snapshot, periodic: tuple[bool, bool, bool]) -> tuple[Array, Array]:
    """Which spheres (N,) lie wholly inside others, and which others have their centre in one.

    The first add nothing to the solid. They may reach out by a thousandth of their radius, so that
    spheres that coincide or touch from within are among them but for the rounding of a file. The
    one of two that coincide is kept that comes first, a grain before a fine. One that several
    others cover together is kept: the tessellation hides it. The second are parts of clumps. Of
    two equal spheres with their centres in each other one is counted.
    """
    radius, count = spheres.radius, len(spheres)
    wholly, centred = np.zeros((2, count), bool)
    if count < 2:
        return wholly, centred
    tree = neighbour_tree(spheres.position, spheres.box, periodic=periodic)
    # among rigid spheres none has the centre of another one inside
    hosts = np.flatnonzero(tree.query_ball_point(tree.data, radius, return_length=True) > 1)
    guests = tree.query_ball_point(tree.data[hosts], radius[hosts])
    host = np.repeat(hosts, [len(one) for one in guests])
    guest = np.array([number for one in guests for number in one], int)
    rank = np.empty(count, int)
    rank[np.lexsort((np.arange(count), spheres.kind, -radius))] = np.arange(count)
    pair = np.flatnonzero(rank[host] < rank[guest])
    pair = pair[np.argsort(rank[host[pair]], kind="stable")]
    host, guest = host[pair], guest[pair]
    apart = spheres.position[host] - spheres.position[guest]
    side = np.ptp(spheres.box, axis=1)
    distance = np.linalg.norm(apart - np.where(periodic, np.rint(apart / side) * side, 0), axis=1)
    holds = distance <= radius[host] - (1 - _INSIDE_ROUNDING) * radius[guest]
    for one, other in zip(host[holds], guest[holds], strict=True):
        wholly[other] |= not wholly[one]
    centred[guest[~wholly[host]]] = True
    return wholly, centred & ~wholly


# ------------------------------------------------------------------------------------------------
# Images of spheres beyond the faces of a box.
#
# They are shifted across periodic sides and mirrored across the others.


INSIDE, MIRROR_LOW, MIRROR_HIGH, ON_FACE = 0, 1, 2, 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Images:
    """M images, the spheres themselves among them."""

    owner: Array  # (M,) index of the sphere
    position: Array  # (M, 3) centres, m
    shift: Array  # (M, 3) number of periods along each axis
    # (M, 3) INSIDE, MIRROR_LOW or MIRROR_HIGH along each axis; ON_FACE for a centre on or beyond a
    # face, which has no mirror image across that axis
    mirror: Array


def wrapped(position: Array, box: Array, periodic: tuple[bool, ...]) -> Array:
    """Positions (N, 3) brought into [low, high) along the periodic axes."""
    low, size = box[:, 0], box[:, 1] - box[:, 0]
    return np.where(periodic, low + (position - low) % size, position)


def in_period(place: Array, period: Array) -> Array:
    """Wrapped places (N, 3) in [0, period); rounding may have left some at the period itself.

    The period is 0 where there is none. Search trees refuse a place that is not below it.
    """
    return np.where((period > 0) & (place >= period), 0.0, place)


def neighbour_tree(position: Array, box: Array, *, periodic: tuple[bool, ...]) -> cKDTree:
    """Search tree of `position` (N, 3) that sees across the periodic sides."""
    period = np.where(periodic, box[:, 1] - box[:, 0], 0.0)
    place = wrapped(position, box, periodic) - box[:, 0]
    return cKDTree(in_period(place, period), boxsize=period)


def repeated(spheres: Snapshot, times: tuple[int, int, int]) -> Snapshot:
    """The spheres of a periodic box of `times` as many cells along each axis, numbered from 1."""
    if times == (1, 1, 1):
        return spheres
    size = np.ptp(spheres.box, axis=1)
    shift = np.indices(times).reshape(3, -1).T * size
    many, count = len(shift), len(shift) * len(spheres)
    return replace(
        spheres.where(np.tile(np.arange(len(spheres)), many)),
        box=np.column_stack([spheres.box[:, 0], spheres.box[:, 0] + size * times]),
        id=np.arange(1, count + 1),
        position=(spheres.position + shift[:, None]).reshape(-1, 3),
    )


def make_images(
    position: Array, box: Array, *, periodic: tuple[bool, ...], margin: Array, tolerance: float
) -> Images:
    """All images of the centres `position` (N, 3) m within `margin` (3,) m of the box.

    A margin of NaN makes no images along that axis. A centre within `tolerance` m of a
    non-periodic face, or beyond it, gets no mirror image there.
    """
    owner = np.arange(len(position))
    shift, mirror = np.zeros(position.shape, np.int16), np.zeros(position.shape, np.int8)
    position = wrapped(position, box, periodic)
    for axis in range(3):
        if np.isnan(margin[axis]):
            continue
        x, reach = position[:, axis], float(margin[axis])
        if periodic[axis]:
            pick, place, steps = _shifted(x, box[axis], reach)
            codes = np.zeros(len(pick), int)
        else:
            pick, place, codes = _mirrored(x, box[axis], reach, tolerance)
            steps = np.zeros(len(pick), int)
        owner, position, shift, mirror = owner[pick], position[pick], shift[pick], mirror[pick]
        position[:, axis], shift[:, axis], mirror[:, axis] = place, steps, codes
    return Images(owner=owner, position=position, shift=shift, mirror=mirror)


def _shifted(x: Array, bounds: Array, margin: float) -> tuple[Array, Array, Array]:
    """Which centres the images of one axis have, their places, and their numbers of periods."""
    low, high = bounds
    reach = int(np.ceil(margin / (high - low)))
    steps = np.repeat(np.arange(-reach, reach + 1), len(x))
    pick = np.tile(np.arange(len(x)), 2 * reach + 1)
    place = x[pick] + steps * (high - low)
    near = (place >= low - margin) & (place < high + margin)
    return pick[near], place[near], steps[near]


def _mirrored(
    x: Array, bounds: Array, margin: float, tolerance: float
) -> tuple[Array, Array, Array]:
    """Which centres the images of one axis have, their places, and the codes of the mirrors."""
    low, high = bounds
    own = np.where((x <= low + tolerance) | (x >= high - tolerance), ON_FACE, INSIDE)
    # a centre on one face has an image as far beyond the other when the margin is the whole side
    lower = np.flatnonzero((x > low + tolerance) & (x < low + margin + tolerance))
    upper = np.flatnonzero((x < high - tolerance) & (x > high - margin - tolerance))
    pick = np.concatenate([np.arange(len(x)), lower, upper])
    place = np.concatenate([x, 2 * low - x[lower], 2 * high - x[upper]])
    beyond = np.repeat([MIRROR_LOW, MIRROR_HIGH], [len(lower), len(upper)])
    return pick, place, np.concatenate([own, beyond])


def label(images: Images) -> Array:
    """One integer (M,) for each sphere and its mirrors; images whole periods apart share it."""
    mirror = np.where(images.mirror == ON_FACE, INSIDE, images.mirror)
    return images.owner * 27 + mirror @ np.array([9, 3, 1])


def packed_shift(shift: Array) -> Array:
    """One integer per whole-period shift (..., 3), |shift| < 512; order is that of the rows."""
    steps = shift.astype(np.int64) + 512
    return (steps[..., 0] * 1024 + steps[..., 1]) * 1024 + steps[..., 2]


# ------------------------------------------------------------------------------------------------
# Porosity of spheres in a box, by depth: overlap counted once, spheres clipped to the box.
#
# The method is that of chords. Straight lines along x stand on a regular (y, z) lattice; on each
# line the union of the spheres' chords is exact. Several lattices with random shifts give the mean
# and its standard error (Cranley and Patterson 1976, SIAM J. Numer. Anal. 13, 904). The shifts are
# spread over the cell as a Latin square (McKay et al. 1979), so the reported error is on the safe
# side.


LATTICES = 8
LINES_PER_LATTICE = 5_000
SHIFT_SEED = 20_110_501
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Porosity:
    """Porosity of a box of spheres, all values between 0 and 1."""

    mean: float  # porosity with the overlap of spheres counted once
    standard_error: float  # of `mean`
    edges: Array  # (B+1,) edges of the bins of depth, m
    profile: Array  # (B,) porosity of each bin, overlap counted once
    sum: float  # 1 - volumes of the spheres centred in the box / its volume

    __repr__ = one_line


def measure_porosity(
    spheres: Snapshot,
    *,
    periodic: Sequence[bool],
    edges: Array | None = None,
    lines: int = LINES_PER_LATTICE,
) -> Porosity:
    """Porosity of spheres in their box, as a whole and by depth.

    Args:
        spheres: the spheres, m.
        periodic: (3,) sides across which spheres reach round; across the others they are clipped.
        edges: (B+1,) ascending edges of the bins along x within the box, m; one bin without them.
        lines: number of chords in each of the 8 lattices.
    """
    low, high = spheres.box.T
    bins = np.array(spheres.box[0] if edges is None else edges, dtype=float)
    cuts = np.unique(np.concatenate([[low[0], high[0]], bins]))
    rng = np.random.default_rng(SHIFT_SEED)
    strata = np.stack([rng.permutation(LATTICES), rng.permutation(LATTICES)], axis=1)
    shifts = (strata + rng.random((LATTICES, 2))) / LATTICES
    filled = np.array([_filled_below(spheres, cuts, one, lines, periodic) for one in shifts])
    void = 1.0 - (filled[:, -1] - filled[:, 0]) / (high[0] - low[0])
    at_bins = filled.mean(axis=0)[np.searchsorted(cuts, bins)]
    centred = (spheres.position >= low) & (spheres.position < high)
    within = np.all(centred | np.array(periodic), axis=1)
    volume = 4.0 / 3.0 * np.pi * np.sum(spheres.radius[within] ** 3)
    return Porosity(
        mean=float(_without_rounding(void.mean())),
        standard_error=float(void.std(ddof=1) / np.sqrt(LATTICES)),
        edges=frozen(bins),
        profile=frozen(_without_rounding(1.0 - np.diff(at_bins) / np.diff(bins))),
        sum=float(1.0 - volume / np.prod(high - low)),
    )


def _without_rounding(value: Array) -> Array:
    """`value`, but 0 or 1 where it is beyond them by the rounding of the sums alone."""
    bounded = np.clip(value, 0.0, 1.0)
    return np.where(np.abs(value - bounded) < ROUNDING, bounded, value)


def _filled_below(
    spheres: Snapshot, cuts: Array, shift: Array, lines: int, periodic: Sequence[bool]
) -> Array:
    """Mean solid length of a line from the first to each of `cuts` (C,), on one lattice."""
    size = spheres.box[1:, 1] - spheres.box[1:, 0]
    count = np.maximum(1, np.round(np.sqrt(lines * size / size[::-1]))).astype(int)
    sphere, line, half = _crossings(spheres, count, shift, periodic)
    centre, images = spheres.position[sphere, 0], np.zeros(1)
    if periodic[0]:
        low, length = spheres.box[0, 0], spheres.box[0, 1] - spheres.box[0, 0]
        centre, images = low + (centre - low) % length, np.array([0.0, -length, length])
    centre = (centre + images[:, None]).ravel()
    half, line = np.tile(half, len(images)), np.tile(line, len(images))
    start, end = (np.clip(one, cuts[0], cuts[-1]) for one in (centre - half, centre + half))
    start, end = _disjoint(line, start, end, cuts[-1] - cuts[0])
    return (_total_below(start, cuts) - _total_below(end, cuts)) / count.prod()


def _crossings(
    spheres: Snapshot, count: Array, shift: Array, periodic: Sequence[bool]
) -> tuple[Array, Array, Array]:
    """Sphere index, line index and half chord length of every line through a sphere."""
    step = (spheres.box[1:, 1] - spheres.box[1:, 0]) / count
    centre = (spheres.position[:, 1:] - spheres.box[1:, 0]) / step - shift
    # across a period the nearest image's chord holds all others; beyond a wall there are no lines
    reach = np.minimum(spheres.radius[:, None] / step, np.where(periodic[1:], 0.5 * count, np.inf))
    low, high = np.where(periodic[1:], -np.inf, 0.0), np.where(periodic[1:], np.inf, count - 1.0)
    first = np.ceil(np.maximum(centre - reach, low)).astype(int)
    last = np.floor(np.minimum(centre + reach, high)).astype(int)
    wide = np.maximum(last - first + 1, 0)
    lines = wide[:, 0] * wide[:, 1]
    sphere = np.repeat(np.arange(len(spheres)), lines)
    rank = np.arange(len(sphere)) - np.repeat(np.cumsum(lines) - lines, lines)
    cell = first[sphere] + np.stack([rank // wide[sphere, 1], rank % wide[sphere, 1]], axis=1)
    aside = (cell - centre[sphere]) * step
    square = spheres.radius[sphere] ** 2 - aside[:, 0] ** 2 - aside[:, 1] ** 2
    inside = square > 0
    cell = cell[inside] % count
    return sphere[inside], cell[:, 0] * count[1] + cell[:, 1], np.sqrt(square[inside])


def _disjoint(line: Array, start: Array, end: Array, span: float) -> tuple[Array, Array]:
    """The same cover of each line by intervals that do not overlap."""
    offset = line * (2.0 * span)
    order = np.argsort(offset + start)
    offset, start, end = offset[order], start[order], end[order]
    reached = np.maximum.accumulate(end + offset) if len(end) else end
    before = np.concatenate([[-np.inf], reached[:-1]]) - offset
    start = np.maximum(start, before)
    open_part = end > start
    return start[open_part], end[open_part]


def _total_below(values: Array, cuts: Array) -> Array:
    """Sum of max(cut - value, 0) over the values, for each of `cuts` (C,)."""
    ordered = np.sort(values)
    summed = np.concatenate([[0.0], np.cumsum(ordered)])
    below = np.searchsorted(ordered, cuts)
    return below * cuts - summed[below]
