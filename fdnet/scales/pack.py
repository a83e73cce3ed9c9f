"""The pack: how dense it can be, its sizes, the number of grains, how it is grown.

Farr and Groot (J. Chem. Phys. 131 (2009) 244104) map spheres in space to rods on a line: the rods
are the chords that a random line cuts out of the spheres, and neighbours keep a gap of at least
0.7654 of the shorter one. Rods put in from the longest to the shortest, each into the widest gap,
fill the same share of the line as random close packing does of space. The factor is theirs, from
the 0.6435 of equal spheres.
"""

import heapq
import math
from collections.abc import Iterator

import numpy as np

from fdnet.case.case import Case, InvasionCase
from fdnet.case.spheres import Fines, Spheres
from fdnet.errors import CaseError, Doubt
from fdnet.scales.contacts import REFERENCE_OVERLAP, Contact, mass_range
from fdnet.sizes import SURFACE, SizeCurve

POROSITY_TOLERANCE = 0.003  # Accepted difference of a pack to the porosity of the case
WORST_OVERLAP = 3.0
"""Largest overlap of a pack over the mean one of `refuse_unreachable`: 3.3, 2.8 and 2.5 measured
at porosities of 0.30, 0.25 and 0.20 (grains of cases/quick.toml)."""
GAP = 0.7654  # Smallest gap over the shorter of its two rods
RODS = 5000  # Rods on the line; the result is within 0.001 of that of many more
EQUAL_SPHERES = 0.6435  # Random close packing of equal spheres; every range of sizes fills more


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

    The overlap grows with that beyond `rigid`, the densest porosity without it; `porosity` and
    `overlap` are those of the pack.
    """
    start, made = (1 - rigid) ** (1 / 3), (1 - porosity) ** (1 / 3)
    return 1 - (start + limit / overlap * (made - start)) ** 3


def close_packing(curve: SizeCurve) -> float:
    """Share of space that spheres of these sizes fill at random close packing.

    The rods are chords, longest first: a line meets spheres by their cross-section, at a random
    distance, and cuts one of diameter D in a chord above L with the probability 1 - (L / D)^2. The
    diameters and the distances are taken evenly, in an order that mixes them (golden ratio).
    """
    even = (np.arange(RODS) + 0.5) / RODS
    mixed = np.mod(even * RODS * (math.sqrt(5) - 1) / 2, 1.0)
    diameter = np.full(RODS, curve.low)
    if curve.low != curve.high:
        diameter = np.exp(np.interp(even, curve.finer(SURFACE), np.log(curve.edges)))
    rods = sorted((diameter * np.sqrt(1 - mixed)).tolist(), reverse=True)
    gaps, total_gap = [-GAP * rods[0]], GAP * rods[0]
    for rod in rods[1:]:
        least = GAP * rod
        widest = -heapq.heappop(gaps)
        left = max(widest - rod - least, least)
        total_gap += left + least - widest
        heapq.heappush(gaps, -left)
        heapq.heappush(gaps, -least)
    return math.fsum(rods) / (math.fsum(rods) + total_gap)


# ---- The measured sizes of a case: diameters of its curves, and what these miss and leave out.
SHARES = (0.1, 0.5, 0.9)  # Shares by volume whose diameters are shown: D10, D50 and D90
MOST_TAIL = 0.02
"""Share of the solids left out at one end of a curve from which a warning names it: the end of a
curve is cut at 1 % unless the case says otherwise."""
MOST_MISFIT = 0.05
"""Difference of a law to a given diameter, over it, above which a warning names it: a quarter of
the step between two sieves of the series R 40/3 (ISO 565), 19 %."""


def curves_of(case: Case) -> dict[str, Spheres]:
    """Grains and fines whose sizes are given by curves, by the names of their tables."""
    fines = {"fines": case.fines} if isinstance(case, InvasionCase) else {}
    both: dict[str, Spheres] = {"grains": case.grains, **fines}
    return {name: spheres for name, spheres in both.items() if spheres.measured}


def diameter_at(curve: SizeCurve, share: float) -> float | None:
    """Diameter, m, that `share` of all solids is finer than; None where that size is left out."""
    inside = (share - curve.below) / curve.kept
    return curve.size_at(inside) if 0 <= inside <= 1 else None


def size_warnings(case: Case) -> Iterator[Doubt]:
    """What curves miss and what they leave out, and a sand denser than rigid spheres get."""
    by_classes = isinstance(case, InvasionCase) and case.by_classes
    for name, spheres in curves_of(case).items():
        given = [] if spheres.sizes is None else [(f"{name}.sizes", spheres.sizes)]
        for number, one in enumerate(getattr(spheres, "materials", None) or ()):
            given.append((f"{name}.materials.{number}.sizes", one.sizes))
        for key, sizes in given:
            if sizes.fit is not None and sizes.fit.worst > MOST_MISFIT:
                missed = ", ".join(
                    f"D{100 * share:.0f} by {100 * off:+z.0f} %"
                    for share, off in sizes.fit.misfit.items()
                )
                yield Doubt(
                    "curve-misses-its-points",
                    f"{key}: the {sizes.fit.name} curve misses {missed}; give the measured curve "
                    "(size and passing, or a file) if it matters",
                )
        curve, below, thinner = spheres.curve, spheres.curve.below, ""
        if isinstance(spheres, Fines):
            if by_classes:
                continue
            below *= not isinstance(case, InvasionCase) or not case.with_classes
            thinner = (
                f"; the mud carries {100 * spheres.placed_fraction:.3g} % of solids by volume "
                f"instead of {100 * spheres.volume_fraction:.3g} %"
            )
        ends = ((below, "finer", curve.low), (curve.above, "coarser", curve.high))
        parts = [
            f"{100 * share:.3g} % of the solids ({side} than {1e6 * size:.3g} um)"
            for share, side, size in ends
            if share > MOST_TAIL
        ]
        if parts:
            yield Doubt("sizes-left-out", f"{name}: {' and '.join(parts)} are left out{thinner}")
    porosity = case.grains.porosity
    if case.grains.measured and case.grains.count is None and porosity is not None:
        rigid = 1 - close_packing(case.grains.curve)
        if porosity < rigid:
            most = WORST_OVERLAP * (1 - ((1 - rigid) / (1 - porosity)) ** (1 / 3))
            refused = ": the pack will be refused" if most > case.grains.max_overlap else ""
            yield Doubt(
                "denser-than-spheres",
                f"grains.porosity: {reach_text(rigid)}; at {porosity:g} grains overlap by up to "
                f"some {100 * most:.0f} % of a diameter (grains.max_overlap is "
                f"{case.grains.max_overlap:g}{refused})",
            )


# ---- The pack of grains in closed form: its porosity, the number of grains, and how it is grown.
PACK_STAGES, PACK_STAGE_STEPS, PACK_RELAX_STEPS, PACK_START, PACK_STEP = 30, 300, 20_000, 0.6, 0.15
"""Growth of a pack: number of stages and steps in each, steps of the first relaxation, radius at
the start over the final one, time step over sqrt(m/k)."""


def target_porosity(case: Case) -> float:
    """The porosity that the case names; with `grains.count` that of the plain sum of spheres."""
    if case.grains.count is not None:
        return 1 - case.grains.count * case.grains.mean_volume_m3 / math.prod(case.size_m)
    assert case.grains.porosity is not None
    return case.grains.porosity


def grain_count(case: Case) -> int:
    """First guess of the number of grains, (1 - phi) V / v, or the count that is given."""
    if case.grains.count is not None:
        return case.grains.count
    return max(
        1, round((1 - target_porosity(case)) * math.prod(case.size_m) / case.grains.mean_volume_m3)
    )


def pack_step(case: Case, contact: Contact) -> float:
    """Time step of packing, s: `PACK_STEP` of sqrt(m/k) of the lightest grain.

    By Hertz the stiffness of the `contact` of two grains is the tangent at `grains.max_overlap`.
    """
    stiffness = contact.normal_stiffness
    if contact.elastic:
        size = case.grains.radius_range_m[0] / case.grains.mean_radius_m
        stiffness *= 1.5 * size * math.sqrt(case.grains.max_overlap / REFERENCE_OVERLAP)
    return PACK_STEP * math.sqrt(mass_range(case.grains)[0] / stiffness)
