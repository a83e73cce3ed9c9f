"""The densest random pack of rigid spheres of a range of sizes.

Farr and Groot (J. Chem. Phys. 131 (2009) 244104) map spheres in space to rods on a line: the rods
are the chords that a random line cuts out of the spheres, and neighbours keep a gap of at least
0.7654 of the shorter one. Rods put in from the longest to the shortest, each into the widest gap,
fill the same share of the line as random close packing does of space. The factor is theirs, from
the 0.6435 of equal spheres.
"""

import heapq
import math

import numpy as np

from fdnet.case.case import Case
from fdnet.case.spheres import Spheres
from fdnet.errors import CaseError
from fdnet.sizes.curve import SURFACE, SizeCurve

GAP = 0.7654
"""Smallest gap over the shorter of its two rods."""
RODS = 5000
"""Rods on the line; the result is within 0.001 of that of many more."""
EQUAL_SPHERES = 0.6435
"""Random close packing of equal spheres; every range of sizes fills more."""


def densest_porosity(spheres: Spheres) -> float:
    """Porosity of the densest random pack of rigid spheres of these sizes."""
    return 1 - close_packing(spheres.curve)


def refuse_unreachable(case: Case) -> None:
    """Raises CaseError on a porosity that needs more overlap than `grains.max_overlap`.

    Rigid spheres that grow by a share d of their diameter beyond close packing overlap by d on
    average, and fill (1 - d)^-3 as much.
    """
    porosity, most = case.grains.porosity, case.grains.max_overlap
    if case.grains.count is not None or porosity is None or 1 - porosity <= EQUAL_SPHERES:
        return
    rigid = densest_porosity(case.grains)
    least = 1 - (1 - rigid) / (1 - most) ** 3
    if porosity < least:
        raise CaseError(
            f"grains.porosity: {porosity:g} is out of reach: {reach_text(rigid)}, and below "
            f"{least:.3f} they overlap by more than grains.max_overlap {most:g} on average; ask "
            f"for {math.ceil(1e3 * rigid) / 1e3:g} or more"
        )


def reach_text(rigid: float) -> str:
    """The porosity that spheres reach without overlap, in words."""
    return (
        f"rigid spheres of these sizes reach a porosity of {rigid:.3f} at random (Farr and Groot "
        "2009)"
    )


def within_limit(rigid: float, porosity: float, overlap: float, limit: float) -> float:
    """Porosity at which the largest overlap is `limit`, from a denser pack that was made.

    It takes the overlap as proportional to the growth beyond close packing. `rigid` is the densest
    porosity without overlap; `porosity` and `overlap` are those of the pack.
    """
    start, made = (1 - rigid) ** (1 / 3), (1 - porosity) ** (1 / 3)
    return 1 - (start + limit / overlap * (made - start)) ** 3


def close_packing(curve: SizeCurve) -> float:
    """Share of space that spheres of these sizes fill at random close packing."""
    rods = _rods(curve)
    gaps, total_gap = [-GAP * rods[0]], GAP * rods[0]
    for rod in rods[1:]:
        least = GAP * rod
        widest = -heapq.heappop(gaps)
        left = max(widest - rod - least, least)
        total_gap += left + least - widest
        heapq.heappush(gaps, -left)
        heapq.heappush(gaps, -least)
    return math.fsum(rods) / (math.fsum(rods) + total_gap)


def _rods(curve: SizeCurve) -> list[float]:
    """Chords, longest first: a line meets spheres by their cross-section, at a random distance.

    A sphere of diameter D is cut in a chord above L with the probability 1 - (L / D)^2. The
    diameters and the distances are taken evenly, in an order that mixes them (golden ratio).
    """
    even = (np.arange(RODS) + 0.5) / RODS
    mixed = np.mod(even * RODS * (math.sqrt(5) - 1) / 2, 1.0)
    if curve.low == curve.high:
        diameter = np.full(RODS, curve.low)
    else:
        diameter = np.exp(np.interp(even, curve.finer(SURFACE), np.log(curve.edges)))
    chords = diameter * np.sqrt(1 - mixed)
    return sorted(chords.tolist(), reverse=True)
