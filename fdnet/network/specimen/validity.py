"""Whether an answer lies where the method was validated, and whether it can be true at all."""

from collections.abc import Iterator

import numpy as np

from fdnet.spheres.contacts import touching_pairs
from fdnet.spheres.images import wrapped
from fdnet.spheres.snapshot import Array, Snapshot

VALIDATED_POROSITY = (0.25, 0.50)
"""Lowest and highest porosity of the packs with a resolved permeability (docs: accuracy)."""
SAND = (1e-6, 1e-2)
"""Smallest and largest diameter of a grain, m, that nobody wonders at."""
CARMAN_KOZENY = (1 / 20, 5.0)
"""Least and most permeability of any packing over that of Carman and Kozeny; packs and lattices
of spheres have 0.5 to 1.2 of it."""
LIKE = 1e-3
"""A fine that is smaller than the smallest grain by less than this share is as large."""
PRESSED = 0.2
"""Part of its radius by which a grain may reach across a wall: pressed grains do."""
GAPS, FEWEST, MISSING, LEAST_SIDE = (0.05, 0.5), 5.0, 0.55, 2.5
"""To find walls at periodic sides: gaps between neighbours, in diameters; the number of neighbours
across a side, and its share, below which they are missing (packs between walls have 0.1 to 0.35 of
it, periodic ones 0.8 and more); the least side, in lengths between neighbours."""
_SERIES = 2 * np.arange(200) + 1.0


def wide_fines(grains: Snapshot, fines: Snapshot) -> str:
    """Why a fine is none: wider than the box or as large as the smallest grain; empty if all are.

    Such a radius is most often a slip of units, or a type of sphere that names a material.
    """
    if not len(fines) or not len(grains):
        return ""
    largest = int(np.argmax(fines.radius))
    radius, number = float(fines.radius[largest]), int(fines.id[largest])
    side, grain = float(np.ptp(fines.box, axis=1).min()), float(grains.radius.min())
    if radius > side / 2:
        return (
            f"fines: the fine with id {number} has a radius of {radius:.4g} m, more than half the "
            f"shortest side of the box ({side / 2:.4g} m); check the units of the radii, or which "
            "spheres are fines"
        )
    if radius >= grain * (1.0 - LIKE):
        return (
            f"fines: the fine with id {number} has a radius of {radius:.4g} m, the smallest grain "
            f"one of {grain:.4g} m; expected fines that are clearly smaller than grains. Check "
            "the units of the radii, or which spheres are fines"
        )
    return ""


def fines_outside_sides(fines: Snapshot, periodic: tuple[bool, bool, bool]) -> int:
    """Number of fines that are centred beyond a side wall (across y or z) of the box."""
    beyond = (fines.position < fines.box[:, 0]) | (fines.position > fines.box[:, 1])
    return int(np.sum(np.any(beyond & ~np.array([True, *periodic[1:]]), axis=1)))


def doubts(
    *,
    porosity: float,
    permeability: float,
    box: Array,
    periodic: tuple[bool, bool, bool],
    walls: str,
) -> Iterator[str]:
    """Why the permeability (m2) of a pack without fines is to be doubted, one sentence each."""
    low, high = VALIDATED_POROSITY
    if not low <= porosity <= high:
        yield (
            f"the porosity without fines is {porosity:.3f}, outside {low:.2f} to {high:.2f}, "
            "where fdnet was compared with resolved flow: the permeability may be wrong by more "
            "than the documented error; check the box and the units, or use a resolved solver"
        )
    empty = empty_duct_permeability(box, periodic) if walls == "no-slip" else np.inf
    if permeability > empty:
        yield (
            f"the permeability without fines, {permeability:.3g} m2, is above that of the empty "
            f"box with the same walls, {empty:.3g} m2, which is impossible: do not use it; there "
            "are too few grains for the box, so check the box and the units"
        )


def packing_doubts(
    grains: Snapshot, porosity: float, permeability: float, periodic: tuple[bool, bool, bool]
) -> Iterator[str]:
    """Why grains, or their permeability (m2) without fines, are those of no sand pack."""
    least, most = 2.0 * float(grains.radius.min()), 2.0 * float(grains.radius.max())
    if most > SAND[1] or least < SAND[0]:
        yield (
            f"the grains are {least:.3g} to {most:.3g} m wide, which is no sand ({SAND[0]:g} to "
            f"{SAND[1]:g} m): the unit of length is probably another one, and the permeability "
            "goes with its square"
        )
    likely = kozeny(grains, porosity)
    # spheres that are far apart have the drag of single ones
    volume = float(np.prod(np.ptp(grains.box, axis=1)))
    lone = volume / (6.0 * np.pi * float(grains.radius.sum()))
    high = min(CARMAN_KOZENY[1] * likely, 2.0 * lone)
    low, (dense, sparse) = CARMAN_KOZENY[0] * likely, VALIDATED_POROSITY
    if permeability > high or (0.0 < permeability < low and dense <= porosity <= sparse):
        yield (
            f"the permeability without fines, {permeability:.3g} m2, is "
            f"{permeability / likely:.3g} times what Carman and Kozeny give for these radii and "
            f"this porosity ({likely:.3g} m2), which no packing has: do not use it; check the "
            "box, which sides are periodic, and whether radii and places have one unit"
        )
    for axis, pairs, expected in _walls_at_periodic_sides(grains, periodic):
        yield (
            f"no grain crosses the periodic sides {axis}, and {pairs} neighbours meet across them "
            f"where {expected:.0f} are expected: the pack stands as between walls, and the gap "
            f"there carries flow; leave {axis} out of the periodic directions unless the pack "
            "repeats like this"
        )


def kozeny(grains: Snapshot, porosity: float) -> float:
    """Permeability m2 by Carman and Kozeny with the constant 180 and the Sauter diameter."""
    sauter = 2.0 * float(np.sum(grains.radius**3) / np.sum(grains.radius**2))
    return porosity**3 * sauter**2 / (180.0 * max(1.0 - porosity, 1e-9) ** 2)


def _walls_at_periodic_sides(
    grains: Snapshot, periodic: tuple[bool, bool, bool]
) -> Iterator[tuple[str, int, float]]:
    """Periodic axes along which the pack ends as at a wall.

    No grain crosses their sides, and far fewer neighbours meet across them than across any plane
    within. Yields the axis, the number of these neighbours and the number expected.
    """
    place = wrapped(grains.position, grains.box, periodic)
    reach, (low, high) = grains.radius[:, None] * (1.0 - PRESSED), grains.box.T
    clear = np.array(periodic) & np.all((place - reach >= low) & (place + reach <= high), axis=0)
    if not clear.any():
        return
    pairs = np.empty((0, 2), int)
    for gap in GAPS:
        if len(pairs) < len(grains) / 2:
            pairs, _ = touching_pairs(grains, periodic, gap=gap)
    size = high - low
    apart = place[pairs[:, 0]] - place[pairs[:, 1]]
    inside = np.abs(apart - np.where(periodic, np.rint(apart / size) * size, 0.0))
    for axis in np.flatnonzero(clear):
        expected = float(inside[:, axis].sum() / size[axis])
        meeting = int(np.sum(np.abs(apart[:, axis]) > 0.5 * size[axis]))
        wide = size[axis] > LEAST_SIDE * inside.max(initial=0.0)
        if wide and expected >= FEWEST and meeting < MISSING * expected:
            yield "xyz"[axis], meeting, expected


def empty_duct_permeability(box: Array, periodic: tuple[bool, bool, bool]) -> float:
    """Permeability, m2, of the empty box along x between walls that hold the fluid.

    Infinite without walls, h2/12 between two plates a distance h apart, and for a rectangle of
    sides h <= w the series of Boussinesq (1868; White, Viscous Fluid Flow, equation 3-48).
    """
    sides = [float(np.ptp(box[axis])) for axis in (1, 2) if not periodic[axis]]
    if not sides:
        return np.inf
    height = min(sides)
    if len(sides) == 1:
        return height**2 / 12
    width = max(sides)
    terms = np.tanh(_SERIES * np.pi * width / (2 * height)) / _SERIES**5
    return height**2 / 12 * (1 - 192 * height / (np.pi**5 * width) * float(np.sum(terms)))
