"""Damage by the share that the fines leave of each section of a throat.

The sections of a throat are those of `lubrication`, with discs of the three grains. Every fine
that reaches into the throat shows a disc in the sections that it meets. Together they leave the
share s of the flux through the section, summed over rays (`outside.share_around`). The section
then carries s^m of its clean flux.

With m = 1 the fluid would go straight through the gaps between the fines. But the gaps of one
section do not lie behind those of the next, so its path winds. Archie (1942, Trans. AIME 146, 54)
measured the same for an electric current in unconsolidated sand: its resistance grows as porosity
to the power -1.3. The same power is taken here.

The factor of the widening tube (`lubrication`) is that of the narrowed sections.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled_for_loops, loops_in_place
from fdnet.network.fines.occupancy import Occupancy, ratio
from fdnet.network.laws.beside_throats import FineImages, Prisms, prisms_of
from fdnet.network.laws.damage import BLOCKED, CLEAN, SECTIONS, Damage
from fdnet.network.laws.lubrication import (
    THROATS,
    WIDENING,
    Prepared,
    Span,
    prepared,
    resistance_of,
    set_fluxes,
    spans_of,
    throat_at,
)
from fdnet.network.laws.open_sections import SectionRoom, forget, section_room
from fdnet.network.laws.outside import meet, share_around
from fdnet.network.laws.section_rays import set_sides
from fdnet.network.laws.wall_cross_section import wall_cuts
from fdnet.network.laws.wedge import ratio_table
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.arrays import one_line
from fdnet.spheres.snapshot import Array, Snapshot, frozen

EXPONENT = 1.3
"""Power of the share that the fines leave: Archie's for unconsolidated sand."""
STEP = 1.0 / 8.0
"""Greatest step between two sections, in radii of the smallest fine in the throat."""
LEAST_STEPS = 8
"""Smallest number of steps between a facet and a node."""
MOST_STEPS = 512
"""Largest number of them, enough for fines of a fiftieth of a grain. Throats with smaller fines
are counted."""


def section_archie_damage(network: Network, occupancy: Occupancy, clean: Array) -> Damage:
    """Conductance of throats whose sections carry s^1.3 of their clean flux.

    s is the share of the flux that the fines leave of a section; see this module. The clean
    conductance is multiplied by the ratio of the resistances without and with fines.
    """
    without, with_fines, coarse = fine_resistances(network, occupancy.fines)
    whole, raised = without.sum(axis=1), with_fines.sum(axis=1)
    factor = np.where(np.isfinite(whole), 0.0, 1.0)
    still = np.isfinite(raised)
    factor[still] = ratio(whole[still], raised[still])
    law = np.where(factor >= 1.0, CLEAN, np.where(factor == 0.0, BLOCKED, SECTIONS)).astype("<U10")
    counts = {
        "throats_filled": int(np.sum(factor == 0.0)),
        "throats_capped": int(np.sum(factor > 1.0)),
        "throats_coarse": coarse,
    }
    return Damage(
        conductance=frozen(clean * np.minimum(factor, 1.0)), law_used=frozen(law), counts=counts
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Part:
    """What does not depend on the fines, of throats (K) that are computed together.

    It takes some 0.5 kB a throat.

    Attributes:
        throats: their place among all throats.
        prisms: in which fines are looked for.
        given: of their sections, as `prepared` gives it.
        heights: (K, 2) m of the nodes above the facets.
    """

    throats: slice
    prisms: Prisms
    given: Prepared
    heights: Array

    __repr__ = one_line


def parts_of(network: Network) -> Iterator[Part]:
    """All throats of a network, part by part."""
    walls, heights = wall_cuts(network), nodes_of(network).heights
    for part in geometry.slices(len(network.throat_pores), THROATS):
        yield Part(
            throats=part,
            prisms=prisms_of(network, part, heights[part]),
            given=prepared(network, part, walls),
            heights=np.ascontiguousarray(heights[part]),
        )


def fine_resistances(
    network: Network,
    fines: Snapshot,
    *,
    among: Array | None = None,
    parts: Iterable[Part] | None = None,
    step: float = STEP,
) -> tuple[Array, Array, int]:
    """Resistances (T, 2) 1/m3 of the sides of throats without and with `fines`.

    Both are summed over the same sections. Those of throats without fines are 1 and 1, and 0 for a
    side that a throat does not have. The third value is the number of throats with fines too small
    for `MOST_STEPS`. Where `among` (T,) is given, throats where it is False are left at 1 and 1,
    and are not counted. `parts` is what `parts_of` gives for the network, made anew without it.
    `step` is as `STEP`.
    """
    images, table = FineImages(network, fines.position, fines.radius), ratio_table()
    floor = LENGTH_FLOOR * network.grain_radius
    coarse = 0
    both = np.ones((2, len(network.throat_pores), 2))
    for part in parts_of(network) if parts is None else parts:
        rows = None if among is None else np.flatnonzero(among[part.throats])
        beside = images.beside(part.prisms, rows)
        height = np.abs(part.heights).max(axis=1)
        some, steps = _steps(beside.first, beside.place, height, step)
        coarse += int(np.sum(steps > MOST_STEPS))
        steps = np.minimum(steps, MOST_STEPS)
        for count in np.unique(steps):
            chosen = some[steps == count]
            both[:, part.throats.start + chosen] = _resistances(
                (chosen, int(count) + 1),
                part.given,
                part.heights,
                (floor, WIDENING, EXPONENT),
                (beside.first, beside.place, table),
            )
    return both[0], both[1], coarse


def _steps(first: Array, place: Array, height: Array, step: float) -> tuple[Array, Array]:
    """Throats (K,) with fines, and the steps of each of their sides, a power of two.

    None is longer than `step` radii of the smallest fine in the throat. Where more than
    `MOST_STEPS` are wanted, they are twice as many.
    """
    some = np.flatnonzero(np.diff(first))
    if not len(some):
        return some, some
    smallest = np.minimum.reduceat(place[:, 3], first[some])
    wanted = np.clip(height[some] / (step * smallest), LEAST_STEPS, 2 * MOST_STEPS)
    return some, 2 ** np.ceil(np.log2(wanted)).astype(int)


@compiled_for_loops
def _resistances(
    which: tuple[Array, int],
    given: Prepared,
    heights: Array,
    numbers: tuple[float, float, float],
    fines: tuple[Array, Array, Array],
) -> Array:
    """Resistances (2, K, 2) 1/m3 of the throats `which` (K) without and with `fines`."""
    chosen, count = which
    first, most = fines[0], 0
    for t in chosen:
        most = max(most, first[t + 1] - first[t])
    room, clear = section_room(most, count), (np.zeros(5), np.empty((0, 5)))
    resistance = np.zeros((2, len(chosen), 2))
    _set_sides(resistance, (chosen, given), heights, numbers, (clear, room, *fines))
    return resistance


@loops_in_place
def _set_sides(
    resistance: Array,
    which: tuple[Array, Prepared],
    heights: Array,
    numbers: tuple[float, float, float],
    more: tuple[tuple[Array, Array], SectionRoom, Array, Array, Array],
) -> None:
    """Sets the `resistance` (2, K, 2) 1/m3 of `_resistances`."""
    chosen, given = which
    floor, widening, power = numbers
    clear, room, first, spheres, table = more
    for n in range(len(chosen)):
        t = chosen[n]
        throat, faces = throat_at(given, t, room)
        spans = spans_of(heights[t], floor)
        inside = spheres[first[t] : first[t + 1]]
        forget(room, len(inside))
        for side in range(2):
            if spans[side][1] > 0.0:
                set_fluxes(throat, faces, spans[side], clear, (room, table))
                both = _both(
                    throat[0], spans[side], (inside, faces[2], widening, power), (room, table)
                )
                resistance[0, n, side], resistance[1, n, side] = both


@loops_in_place
def _both(
    base: Array,
    span: Span,
    given: tuple[Array, float, float, float],
    more: tuple[SectionRoom, Array],
) -> tuple[float, float]:
    """Resistances 1/m3 of one side without and with fines, from the clean fluxes in the room."""
    fines, part, widening, power = given
    room, table = more
    flux, rows, (rays, seen), side = room[0], room[3][0], room[4], room[5][0]
    clear = room[2][0][0]  # what the clean fluxes needed is free now
    step = (span[1] - span[0]) / (len(flux) - 1)
    set_sides(base, side)
    for k in range(len(flux)):
        clear[k] = flux[k]
        z = span[2] * (span[0] + k * step)
        count = meet(rows[k], base, z, fines, seen)
        flux[k] *= share_around(base, side, (count, seen), rays, table) ** power
    given_step = (part, step, widening)
    return resistance_of(clear, given_step), resistance_of(flux, given_step)
