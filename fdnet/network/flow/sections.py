"""Permeability, porosity and fines by depth: sections with their own k, and a finer profile."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fdnet.errors import CaseError
from fdnet.network.flow.slabs import SlabK
from fdnet.spheres.arrays import one_line
from fdnet.spheres.porosity import Porosity
from fdnet.spheres.snapshot import Array, frozen

FACE_TOLERANCE = 1e-6
"""Given edges may miss the faces of the box by this share of its length."""
DIAMETER_TOLERANCE = 1e-9
"""A section that is thinner than a grain diameter by at most this share of it is not thin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A slab [x_lo, x_hi) across the flow, before and after the fines. Permeabilities are in m2.

    "Cut out" is the slab alone, with the pressure held on its two planes (Shi 2011, section
    3.3.1). "In place" is the slab under the pressures of the whole specimen; in series these
    values make up the permeability of the whole.

    Attributes:
        section: number of the slab, from 1 at the low x face.
        x_lo: m, lower bound.
        x_hi: m, upper bound.
        porosity_initial: without fines, overlap of spheres counted once.
        porosity_damaged: with fines, overlap of spheres counted once.
        k_initial: m2, cut out, without fines.
        k_damaged: m2, cut out, with fines.
        k_reduction: 1 - k_damaged / k_initial; None where k_initial is 0.
        k_initial_inplace: m2, in place, without fines.
        k_damaged_inplace: m2, in place, with fines.
        fines_count: number of fines centred in the slab.
        fines_fraction: these as a share of all invaded fines.
    """

    section: int
    x_lo: float
    x_hi: float
    porosity_initial: float
    porosity_damaged: float
    k_initial: float
    k_damaged: float
    k_reduction: float | None
    k_initial_inplace: float
    k_damaged_inplace: float
    fines_count: int
    fines_fraction: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Profile:
    """Porosity and fines in B finer bins of depth.

    Attributes:
        edges: (B+1,) m.
        porosity_initial: (B,) without fines.
        porosity_damaged: (B,) with fines.
        fines_fraction: (B,) share of all invaded fines.
    """

    edges: Array
    porosity_initial: Array
    porosity_damaged: Array
    fines_fraction: Array

    __repr__ = one_line


def section_edges(sections: int | Sequence[float], box: Array) -> Array:
    """Edges (S+1,) m of the sections.

    `sections` is a count of equal slabs, or the edges m themselves; `box` (3, 2) m. Raises
    CaseError unless the edges ascend from face to face.
    """
    low, high = float(box[0, 0]), float(box[0, 1])
    if isinstance(sections, int | np.integer):
        if sections < 1:
            raise CaseError(
                f"analysis.sections: {sections} is not a count of slabs; give 1 or more"
            )
        return np.linspace(low, high, int(sections) + 1)
    edges = np.array(sections, dtype=float)
    tolerance = FACE_TOLERANCE * (high - low)
    if (
        len(edges) < 2
        or np.any(np.diff(edges) <= 0)
        or abs(edges[0] - low) > tolerance
        or abs(edges[-1] - high) > tolerance
    ):
        raise CaseError(
            f"analysis.sections: edges {edges.tolist()} do not ascend from {low:g} to {high:g} m"
        )
    edges[0], edges[-1] = low, high
    return edges


def profile_edges(bin_size: float, box: Array) -> Array:
    """Edges (B+1,) m of equal bins that fill the box, as near to `bin_size` m as possible.

    `box` (3, 2) m. Raises CaseError on a bin that is not above 0.
    """
    low, high = float(box[0, 0]), float(box[0, 1])
    if not bin_size > 0:
        raise CaseError(
            f"analysis.profile_bin_mm: {1e3 * bin_size:g} is not above 0; give a bin thickness"
        )
    return np.linspace(low, high, max(1, round((high - low) / bin_size)) + 1)


def make_sections(
    edges: Array, porosity: tuple[Porosity, Porosity], k: tuple[SlabK, SlabK], depth: Array
) -> tuple[Section, ...]:
    """Sections between `edges` (S+1,) m from the states before and after.

    `porosity` and `k` hold the porosity and the slab permeabilities of the two states; `depth`
    (F,) m are the places of the invaded fines along x.
    """
    count = np.histogram(depth, edges)[0]
    share = count / max(len(depth), 1)
    before, after = (pooled(one, edges) for one in porosity)
    return tuple(
        Section(
            section=s + 1,
            x_lo=float(edges[s]),
            x_hi=float(edges[s + 1]),
            porosity_initial=float(before[s]),
            porosity_damaged=float(after[s]),
            k_initial=float(k[0].cut_out[s]),
            k_damaged=float(k[1].cut_out[s]),
            k_reduction=reduction(float(k[0].cut_out[s]), float(k[1].cut_out[s])),
            k_initial_inplace=float(k[0].inplace[s]),
            k_damaged_inplace=float(k[1].inplace[s]),
            fines_count=int(count[s]),
            fines_fraction=float(share[s]),
        )
        for s in range(len(edges) - 1)
    )


def thin_slabs(sections: Sequence[Section], diameter: float) -> Iterator[str]:
    """A warning if sections are thinner than the mean `diameter` of the grains, m."""
    least = diameter * (1.0 - DIAMETER_TOLERANCE)
    thin = [one.section for one in sections if one.x_hi - one.x_lo < least]
    if not thin:
        return
    count = int((sections[-1].x_hi - sections[0].x_lo) / least)
    cure = f"take fewer sections: analysis.sections = {count} or less"
    yield (
        f"sections {thin} are thinner than the mean grain diameter ({1e3 * diameter:.3g} mm): the "
        "permeability of each is that of single throats; "
        + (cure if count else "take a specimen that is longer along x")
    )


def make_profile(edges: Array, porosity: tuple[Porosity, Porosity], depth: Array) -> Profile:
    """Profile between `edges` (B+1,) m of the porosity before and after, and of the fines.

    `depth` (F,) m are the places of the invaded fines along x.
    """
    before, after = (frozen(pooled(one, edges)) for one in porosity)
    share = np.histogram(depth, edges)[0] / max(len(depth), 1)
    return Profile(
        edges=frozen(edges),
        porosity_initial=before,
        porosity_damaged=after,
        fines_fraction=frozen(share),
    )


def pooled(porosity: Porosity, edges: Array) -> Array:
    """Porosity (S,) between `edges` (S+1,) m, averaged from the finer profile of `porosity`.

    The edges must be among those of the profile.
    """
    first, end = (
        np.searchsorted(porosity.edges, edges[:-1]),
        np.searchsorted(porosity.edges, edges[-1]),
    )
    width, void = np.diff(porosity.edges)[:end], porosity.profile[:end]
    return np.add.reduceat(width * void, first) / np.add.reduceat(width, first)


def reduction(before: float, after: float) -> float | None:
    """1 - after / before, None where `before` is 0."""
    return None if before == 0 else 1.0 - after / before
