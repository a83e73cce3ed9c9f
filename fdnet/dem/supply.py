"""The slab of fines upstream of the face: random, at the given concentration, touching nothing."""

import math

import numpy as np
from scipy.spatial import cKDTree

from fdnet.case import Case
from fdnet.errors import CaseError
from fdnet.scales import Scales
from fdnet.snapshot import Array, Kind, Snapshot

CLEARANCE = 1.02
"""Fines start at least this many radius sums apart."""
_ROUNDS = 400
SURE_CROWDING = 0.2
"""Up to this `crowding` every fine finds a place: random sequential addition of equal spheres saturates at 0.38 (Talbot
et al. 1991), and none of 8,465 draws at 0.2 failed (docs/physics.md, section 3).
"""


def front_of(grains: Snapshot) -> float:
    """x (m) below which there is no grain: grain surfaces stand up to 0.07 mm beyond the face of a dense pack."""
    return float(min(0.0, np.min(grains.position[:, 0] - grains.radius)))


def refuse_crowded_supply(case: Case, scales: Scales) -> None:
    """Raises CaseError when the slab cannot hold its fines, which does not depend on the grains.

    Tries it only where they might not fit: the draw takes seconds for a million fines.
    """
    if crowding(case) > SURE_CROWDING:
        _draw(case, scales, end=0.0)


def crowding(case: Case) -> float:
    """An eighth of the space shut to the centre of one of the largest fines, as a share: c for equal fines far apart.

    c <(R + r)^3> / (8 <r^3>) for radii r uniform up to R, over the section that centres can reach (a diameter less
    between walls); inf if there is none. Places up to 2 % of a radius sum apart are counted as free.
    """
    assert case.fines is not None
    low, high = case.fines.radius_range_m
    shut = (2 * high + low + high) * ((2 * high) ** 2 + (low + high) ** 2) / (8 * (low + high) * (low**2 + high**2))
    sides = zip(case.size_m[1:], case.periodic[1:], strict=True)
    reach = [1.0 if periodic else 1 - 2 * high / side for side, periodic in sides]
    return case.fines.concentration * shut / math.prod(reach) if min(reach) > 0 else math.inf


def place_fines(case: Case, scales: Scales, grains: Snapshot) -> Snapshot:
    """Fines (N) in the slab upstream of all grains, moving with the fluid.

    Raises CaseError when the slab cannot hold them without overlap.
    """
    assert case.fines is not None
    position, radius = _draw(case, scales, end=front_of(grains) - 2 * case.fines.radius_range_m[1])
    velocity = np.zeros((len(radius), 3))
    velocity[:, 0] = scales.upstream_velocity
    first = int(grains.id.max()) + 1
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


def _draw(case: Case, scales: Scales, *, end: float) -> tuple[Array, Array]:
    """Places (N, 3) and radii (N,) m of the slab's fines; it ends at x = `end`."""
    assert case.fines is not None
    rng = np.random.default_rng([case.seed, 11])
    radius = rng.uniform(*case.fines.radius_range_m, scales.supplied_count)
    return _add_sequentially(case, radius, (end - scales.slab_length, end), rng), radius


def _add_sequentially(case: Case, radius: Array, slab: tuple[float, float], rng: np.random.Generator) -> Array:
    """Random sequential addition, largest first, in batches: of two that overlap the later one is drawn again."""
    size = np.array([slab[1] - slab[0], *case.size_m[1:]])
    period = np.where(case.periodic, size, 0.0)
    order = np.argsort(-radius, kind="stable")
    placed = np.empty((0, 3))
    position = np.empty((len(radius), 3))
    waiting = order
    done: Array = np.empty(0, int)
    for _ in range(_ROUNDS):
        if not len(waiting):
            return position + np.array([slab[0], 0.0, 0.0])
        margin = np.where(period > 0, 0.0, radius[waiting][:, None]) * np.array([0.0, 1.0, 1.0])
        drawn = margin + rng.random((len(waiting), 3)) * (size - 2 * margin)
        free = _free(np.concatenate([placed, drawn]), radius[np.concatenate([done, waiting])], len(placed), period)
        position[waiting[free]] = drawn[free]
        done, placed = np.concatenate([done, waiting[free]]), np.concatenate([placed, drawn[free]])
        waiting = waiting[~free]
    raise CaseError(
        f"fines.concentration: {case.fines.concentration if case.fines else 0:g} leaves {len(waiting)} of "
        f"{len(radius)} fines "
        f"without a place in a slab of {1e3 * size[0]:.3g} mm; lower it or lengthen fines.slab_mm"
    )


def _free(points: Array, radius: Array, placed: int, period: Array) -> Array:
    """For each newly drawn sphere (index >= placed): does it clear all placed ones and all drawn before it?"""
    tree = cKDTree(points, boxsize=period)
    pairs = tree.query_pairs(2 * CLEARANCE * radius.max(), output_type="ndarray")
    gap = points[pairs[:, 0]] - points[pairs[:, 1]]
    gap -= np.where(period > 0, period * np.round(gap / np.where(period > 0, period, 1.0)), 0.0)
    clash = np.sqrt(np.sum(gap**2, axis=1)) < CLEARANCE * radius[pairs].sum(axis=1)
    free = np.ones(len(points), bool)
    free[np.max(pairs[clash], axis=1, initial=0)] = False
    return free[placed:]
