"""Porosity of spheres in a box, by depth: overlap counted once, spheres clipped to the box.

The method is that of chords. Straight lines along x stand on a regular (y, z) lattice; on each
line the union of the spheres' chords is exact. Several lattices with random shifts give the mean
and its standard error (Cranley and Patterson 1976, SIAM J. Numer. Anal. 13, 904). The shifts are
spread over the cell as a Latin square (McKay et al. 1979), so the reported error is on the safe
side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen

LATTICES = 8
LINES_PER_LATTICE = 5_000
SHIFT_SEED = 20_110_501
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Porosity:
    """Porosity of a box of spheres, all values between 0 and 1.

    Attributes:
        mean: porosity with the overlap of spheres counted once.
        standard_error: standard error of `mean`.
        edges: (B+1,) edges of the bins of depth, m.
        profile: (B,) porosity of each bin, overlap counted once.
        sum: porosity from the plain sum, 1 - volumes of the spheres centred in the box / its
            volume.
    """

    mean: float
    standard_error: float
    edges: Array
    profile: Array
    sum: float

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
        edges: (B+1,) edges of the bins along x, m; one bin, the box, without them.
        lines: number of chords in each of the 8 lattices.

    Raises:
        CaseError: `edges` do not ascend within the box.
    """
    low, high = spheres.box.T
    bins = _checked_edges(edges, float(low[0]), float(high[0]))
    cuts = np.unique(np.concatenate([[low[0], high[0]], bins]))
    shifts = _spread_shifts(np.random.default_rng(SHIFT_SEED))
    filled = np.array(
        [_filled_below(spheres, cuts, shift, lines, tuple(periodic)) for shift in shifts]
    )
    void = 1.0 - (filled[:, -1] - filled[:, 0]) / (high[0] - low[0])
    at_bins = filled.mean(axis=0)[np.searchsorted(cuts, bins)]
    return Porosity(
        mean=float(_without_rounding(void.mean())),
        standard_error=float(void.std(ddof=1) / np.sqrt(LATTICES)),
        edges=frozen(bins),
        profile=frozen(_without_rounding(1.0 - np.diff(at_bins) / np.diff(bins))),
        sum=_plain_sum(spheres, periodic),
    )


def _without_rounding(value: Array) -> Array:
    """`value`, but 0 or 1 where it is beyond them by the rounding of the sums alone."""
    bounded = np.clip(value, 0.0, 1.0)
    return np.where(np.abs(value - bounded) < ROUNDING, bounded, value)


def _checked_edges(edges: Array | None, low: float, high: float) -> Array:
    bins = np.array([low, high]) if edges is None else np.asarray(edges, dtype=float)
    tolerance = 1e-9 * (high - low)
    if (
        len(bins) < 2
        or np.any(np.diff(bins) <= 0)
        or bins[0] < low - tolerance
        or bins[-1] > high + tolerance
    ):
        raise CaseError(
            f"porosity bins: edges {bins.tolist()} do not ascend within the box "
            f"[{low:g}, {high:g}] m; give ascending depths inside the box"
        )
    return np.clip(bins, low, high)


def _spread_shifts(rng: np.random.Generator) -> Array:
    strata = np.stack([rng.permutation(LATTICES), rng.permutation(LATTICES)], axis=1)
    return (strata + rng.random((LATTICES, 2))) / LATTICES


def _plain_sum(spheres: Snapshot, periodic: Sequence[bool]) -> float:
    low, high = spheres.box.T
    within = np.all(
        ((spheres.position >= low) & (spheres.position < high)) | np.array(periodic), axis=1
    )
    volume = 4.0 / 3.0 * np.pi * np.sum(spheres.radius[within] ** 3)
    return float(1.0 - volume / np.prod(high - low))


def _filled_below(
    spheres: Snapshot, cuts: Array, shift: Array, lines: int, periodic: tuple[bool, ...]
) -> Array:
    """Mean solid length of a line from the first to each of `cuts` (C,), on one lattice."""
    size = spheres.box[1:, 1] - spheres.box[1:, 0]
    count = np.maximum(1, np.round(np.sqrt(lines * size / size[::-1]))).astype(int)
    sphere, line, half = _crossings(spheres, count, shift, periodic)
    start, end = _wrapped(spheres, sphere, half, periodic[0])
    line = np.resize(line, len(start))
    start, end = np.clip(start, cuts[0], cuts[-1]), np.clip(end, cuts[0], cuts[-1])
    start, end = _disjoint(line, start, end, cuts[-1] - cuts[0])
    return (_total_below(start, cuts) - _total_below(end, cuts)) / count.prod()


def _crossings(
    spheres: Snapshot, count: Array, shift: Array, periodic: tuple[bool, ...]
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


def _wrapped(
    spheres: Snapshot, sphere: Array, half: Array, periodic_x: bool
) -> tuple[Array, Array]:
    """Chord ends (K,); with a periodic x their two images are appended."""
    centre = spheres.position[sphere, 0]
    length = spheres.box[0, 1] - spheres.box[0, 0]
    if periodic_x:
        centre = spheres.box[0, 0] + (centre - spheres.box[0, 0]) % length
    images = (0.0, -length, length) if periodic_x else (0.0,)
    centre = np.concatenate([centre + image for image in images])
    half = np.tile(half, len(images))
    return centre - half, centre + half


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
