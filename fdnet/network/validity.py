"""Whether an answer lies where the method was validated, and whether it can be true at all."""

from collections.abc import Iterator

import numpy as np

from fdnet.errors import NetworkError
from fdnet.spheres.snapshot import Array, Snapshot

VALIDATED_POROSITY = (0.25, 0.50)
"""Lowest and highest porosity of the packs with a resolved permeability (docs: accuracy)."""
_SERIES = 2 * np.arange(200) + 1.0


def refuse_wide_fines(grains: Snapshot, fines: Snapshot) -> None:
    """Raise NetworkError on a fine that is wider than the box or larger than every grain.

    Such a radius is most often a slip of units.
    """
    if not len(fines) or not len(grains):
        return
    largest = int(np.argmax(fines.radius))
    radius, number = float(fines.radius[largest]), int(fines.id[largest])
    side, grain = float(np.ptp(fines.box, axis=1).min()), float(grains.radius.max())
    limit = "half the shortest side of the box" if side / 2 < grain else "the largest grain"
    if radius > min(side / 2, grain):
        raise NetworkError(
            f"fines: the fine with id {number} has a radius of {radius:.4g} m, more than {limit} "
            f"({min(side / 2, grain):.4g} m); check the units of the radii, or which spheres are "
            "fines"
        )


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
