"""Images of spheres beyond the faces of a box.

They are shifted across periodic sides and mirrored across the others.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot

INSIDE, MIRROR_LOW, MIRROR_HIGH, ON_FACE = 0, 1, 2, 3


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Images:
    """M images, the spheres themselves among them.

    Attributes:
        owner: (M,) index of the sphere.
        position: (M, 3) centres, m.
        shift: (M, 3) number of periods along each axis.
        mirror: (M, 3) INSIDE, MIRROR_LOW or MIRROR_HIGH along each axis; ON_FACE for a centre on
            or beyond a face, which has no mirror image across that axis.
    """

    owner: Array
    position: Array
    shift: Array
    mirror: Array

    __repr__ = one_line


def wrapped(position: Array, box: Array, periodic: tuple[bool, ...]) -> Array:
    """Positions (N, 3) brought into [low, high) along the periodic axes."""
    low, size = box[:, 0], box[:, 1] - box[:, 0]
    return np.where(periodic, low + (position - low) % size, position)


def neighbour_tree(position: Array, box: Array, *, periodic: tuple[bool, ...]) -> cKDTree:
    """Search tree of `position` (N, 3) that sees across the periodic sides."""
    low, size = box[:, 0], box[:, 1] - box[:, 0]
    place = wrapped(position, box, periodic) - low
    # rounding may leave a wrapped place at the size itself
    return cKDTree(
        np.where(periodic & (place >= size), 0.0, place), boxsize=np.where(periodic, size, 0.0)
    )


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
    count = len(position)
    owner, shift, mirror = (
        np.arange(count),
        np.zeros((count, 3), np.int16),
        np.zeros((count, 3), np.int8),
    )
    position = wrapped(position, box, periodic)
    for axis in range(3):
        if np.isnan(margin[axis]):
            continue
        make = _shifted if periodic[axis] else _mirrored
        pick, place, steps, codes = make(
            position[:, axis], box[axis], float(margin[axis]), tolerance
        )
        owner, position, shift, mirror = owner[pick], position[pick], shift[pick], mirror[pick]
        position[:, axis], shift[:, axis], mirror[:, axis] = place, steps, codes
    return Images(owner=owner, position=position, shift=shift, mirror=mirror)


def _shifted(
    x: Array, bounds: Array, margin: float, tolerance: float
) -> tuple[Array, Array, Array, Array]:
    low, high = bounds
    reach = int(np.ceil(margin / (high - low)))
    steps = np.repeat(np.arange(-reach, reach + 1), len(x))
    pick = np.tile(np.arange(len(x)), 2 * reach + 1)
    place = x[pick] + steps * (high - low)
    near = (place >= low - margin) & (place < high + margin)
    return pick[near], place[near], steps[near], np.zeros(near.sum(), int)


def _mirrored(
    x: Array, bounds: Array, margin: float, tolerance: float
) -> tuple[Array, Array, Array, Array]:
    low, high = bounds
    own = np.where((x <= low + tolerance) | (x >= high - tolerance), ON_FACE, INSIDE)
    # a centre on one face has an image as far beyond the other when the margin is the whole side
    lower = np.flatnonzero((x > low + tolerance) & (x < low + margin + tolerance))
    upper = np.flatnonzero((x < high - tolerance) & (x > high - margin - tolerance))
    pick = np.concatenate([np.arange(len(x)), lower, upper])
    place = np.concatenate([x, 2 * low - x[lower], 2 * high - x[upper]])
    codes = np.concatenate(
        [own, np.full(len(lower), MIRROR_LOW), np.full(len(upper), MIRROR_HIGH)]
    )
    return pick, place, np.zeros(len(pick), int), codes


def label(images: Images) -> Array:
    """One integer (M,) for each sphere and its mirrors; images whole periods apart share it."""
    mirror = np.where(images.mirror == ON_FACE, INSIDE, images.mirror)
    return images.owner * 27 + mirror @ np.array([9, 3, 1])


def packed_shift(shift: Array) -> Array:
    """One integer per whole-period shift (..., 3), |shift| < 512; order is that of the rows."""
    steps = shift.astype(np.int64) + 512
    return (steps[..., 0] * 1024 + steps[..., 1]) * 1024 + steps[..., 2]
