"""The damage law of sections: what fines leave of the flow through each section of a throat.

Which fines reach into the sections of a throat, and where they lie as seen from its facet.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled, compiled_for_loops, loops_in_place
from fdnet.network.fines.deposit import mirrored_images, points_in_boxes, size_classes
from fdnet.network.fines.occupancy import Occupancy, ratio
from fdnet.network.geometry import dot, flat
from fdnet.network.laws.cross_section import inwards, set_sides, wall_cuts
from fdnet.network.laws.damage import BLOCKED, CLEAN, SECTIONS, Damage
from fdnet.network.laws.lubrication import (
    THROATS,
    WIDENING,
    Prepared,
    SectionRoom,
    Span,
    forget,
    prepared,
    resistance_of,
    section_room,
    set_fluxes,
    spans_of,
    throat_at,
)
from fdnet.network.laws.reaching_grains import facet_axes, meet, share_around
from fdnet.network.laws.wedges import ratio_table
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line, unmoved


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FinesBeside:
    """Fines that reach into the prisms of K throats, from node to node.

    Attributes:
        first: (K+1,) the first fine of each throat, and their number N at the end.
        place: (N, 5) m, along the first edge of the facet, across it towards the third corner,
            and height above the facet towards the second pore, of its centre from the first
            corner; its radius m, and 1 (a sphere is not flat).
    """

    first: Array
    place: Array

    __repr__ = one_line


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Prisms:
    """The prisms of K throats, from node to node.

    Attributes:
        origin: (K, 3) m, the first corner of each facet.
        axes: unit vectors (K, 3) of `facet_axes`.
        base: (K, 3, 2) m, corners of the facets in their own planes.
        height: (K, 2) m above the facets, of the lower and the upper end.
        low: (K, 3) m, lower corners of the boxes around them.
        high: (K, 3) m, their upper corners.
    """

    origin: Array
    axes: tuple[Array, Array, Array]
    base: Array
    height: Array
    low: Array
    high: Array

    __repr__ = one_line


def prisms_of(network: Network, part: slice, heights: Array) -> Prisms:
    """The prisms of the throats `part` (K), whose nodes are `heights` (K, 2) m above the facet."""
    facet = network.image_position[network.throat_images[part]]
    axes = facet_axes(network, np.arange(part.start, part.stop), facet)
    height = heights * (-1.0, 1.0)
    ends = (facet[:, None] + (height[:, :, None] * axes[2][:, None])[:, :, None]).reshape(
        len(facet), 6, 3
    )
    return Prisms(
        origin=facet[:, 0].copy(),
        axes=axes,
        base=flat(facet),
        height=np.sort(height, axis=1),
        low=ends.min(axis=1),
        high=ends.max(axis=1),
    )


class FineImages:
    """Spheres at `position` (N, 3) m of `radius` (N,) m, with their images near all throats.

    The images are shifted or mirrored. A fine that is centred on or beyond a face that is not
    periodic has no mirror image there: its body inside the box is that of the sphere itself.
    """

    def __init__(self, network: Network, position: Array, radius: Array) -> None:
        used = np.zeros(len(network.image_position), bool)
        used[network.throat_images] = True
        corner = network.image_position[used]
        low, high = corner.min(axis=0), corner.max(axis=0)
        self._classes: list[tuple[Array, Array]] = []
        for some in size_classes(radius) if len(radius) else []:
            own = radius[some]
            place, owner = mirrored_images(network, position[some], low, high, float(own.max()))
            self._classes.append((place, own[owner]))

    def beside(self, prisms: Prisms, rows: Array | None = None) -> FinesBeside:
        """The fines that reach into the prisms (K), or into those of some `rows` alone."""
        throats, places = [np.zeros(0, np.intp)], [np.zeros((0, 5))]
        for throat, place in self._reaching(prisms, rows):
            throats.append(throat)
            places.append(place)
        throat, place = np.concatenate(throats), np.concatenate(places)
        order = np.lexsort((*place[:, 2::-1].T, throat))  # whatever order the search has
        first = np.searchsorted(throat[order], np.arange(len(prisms.low) + 1))
        return FinesBeside(first=frozen(first), place=frozen(place[order]))

    def reached(self, prisms: Prisms) -> Array:
        """Whether a fine reaches into each of the prisms (K,)."""
        some = np.zeros(len(prisms.low), bool)
        for throat, _ in self._reaching(prisms, None):
            some[throat] = True
        return some

    def _reaching(self, prisms: Prisms, rows: Array | None) -> Iterator[tuple[Array, Array]]:
        """The throat (N,) and `place` (N, 5) of fines of one size after the other, not sorted."""
        low, high = prisms.low, prisms.high
        if rows is not None:
            low, high = low[rows], high[rows]
        for position, radius in self._classes:
            widest = float(radius.max())
            row, image = points_in_boxes(position, low - widest, high + widest)
            reach = radius[image, None]  # its own, whatever other fines are in the class
            near = (position[image] >= low[row] - reach) & (position[image] <= high[row] + reach)
            row, image = (one[near.all(axis=1)] for one in (row, image))
            throat = row if rows is None else rows[row]
            away = position[image] - prisms.origin[throat]
            place = np.ones((len(throat), 5))
            for k, axis in enumerate(prisms.axes):
                place[:, k] = dot(away, axis[throat])
            place[:, 3] = radius[image]
            real = _reaching(prisms.base, prisms.height, throat, place)
            yield throat[real], place[real]


@compiled
def _reaching(base: Array, height: Array, throat: Array, place: Array) -> Array:
    """Whether spheres (N) reach between two heights (K, 2) m and within the lines of a triangle.

    The triangles are `base` (K, 3, 2) m, `throat` (N,) says which, and `place` (N, 5) is that of
    `FinesBeside`.
    """
    real, side = np.empty(len(throat), np.bool_), np.empty((3, 3))
    for n in range(len(throat)):
        t, x, y, z, r = throat[n], place[n, 0], place[n, 1], place[n, 2], place[n, 3]
        real[n] = height[t, 0] - r < z < height[t, 1] + r
        if real[n]:
            set_sides(base[t], side)
            for i in range(3):
                real[n] = real[n] and inwards(base[t], side, i, x, y) > -r
    return real


# ------------------------------------------------------------------------------------------------
# Damage by the share that the fines leave of each section of a throat.
#
# The sections of a throat are those of `lubrication`, with discs of the three grains. Every fine
# that reaches into the throat shows a disc in the sections that it meets. Together they leave the
# share s of the flux through the section, summed over rays (`outside.share_around`). The section
# then carries s^m of its clean flux.
#
# With m = 1 the fluid would go straight through the gaps between the fines. But the gaps of one
# section do not lie behind those of the next, so its path winds. Archie (1942, Trans. AIME 146,
# 54) measured the same for an electric current in unconsolidated sand: its resistance grows as
# porosity to the power -1.3. The same power is taken here.
#
# The factor of the widening tube (`lubrication`) is that of the narrowed sections.


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


# ------------------------------------------------------------------------------------------------
# The damage law `section-archie` where fines come, leave and move between the solves of a flow.
#
# The resistances of a throat depend on the fines that reach into it and on nothing else. Only
# throats that a changed fine reaches, at its former place or at its new one, are summed anew.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptSections:
    """Resistances of the sides of throats (T) among fines.

    Attributes:
        network: pores and throats.
        parts: what does not depend on the fines, of its throats.
        step: greatest between two sections, in radii of the smallest fine in the throat.
        fines: at the places for which the resistances hold.
        without: (T, 2) 1/m3, without the fines; see `fine_resistances`.
        raised: (T, 2) 1/m3, with them.
        renewed: number of throats that the last change summed anew.
    """

    network: Network
    parts: Sequence[Part]
    step: float
    fines: Snapshot
    without: Array
    raised: Array
    renewed: int

    __repr__ = one_line

    @property
    def factor(self) -> Array:
        """Share (T, 2) of its clean conductance that each side keeps, at most 1."""
        finite = np.where(np.isfinite(self.raised), self.raised, 0.0)
        left = ratio(self.without, finite)  # 0 where the fines close a side
        return np.where(self.raised > self.without, left, 1.0)

    def changed_to(self, fines: Snapshot) -> "KeptSections":
        """The resistances among other `fines`; those at the same place are taken as unchanged."""
        new, old = unmoved((fines.id, fines.position), (self.fines.id, self.fines.position))
        gone, come = np.ones(len(self.fines), bool), np.ones(len(fines), bool)
        gone[old] = come[new] = False
        reached = self._throats_beside(
            np.concatenate([self.fines.position[gone], fines.position[come]]),
            np.concatenate([self.fines.radius[gone], fines.radius[come]]),
        )
        both = fine_resistances(
            self.network, fines, among=reached, parts=self.parts, step=self.step
        )[:2]
        without, raised = (
            np.where(reached[:, None], now, before)
            for now, before in zip(both, (self.without, self.raised), strict=True)
        )
        return replace(
            self,
            fines=fines,
            without=frozen(without),
            raised=frozen(raised),
            renewed=int(reached.sum()),
        )

    def _throats_beside(self, position: Array, radius: Array) -> Array:
        """Whether spheres at `position` (N, 3) m of `radius` (N,) m reach into each throat."""
        images = FineImages(self.network, position, radius)
        return np.concatenate([images.reached(part.prisms) for part in self.parts])


def measured_sections(
    network: Network,
    fines: Snapshot,
    *,
    parts: Sequence[Part] | None = None,
    step: float = STEP,
) -> KeptSections:
    """The resistances among `fines`, those of all throats summed; `parts` of the network."""
    parts = tuple(parts_of(network)) if parts is None else parts
    without, raised, _ = fine_resistances(network, fines, parts=parts, step=step)
    return KeptSections(
        network=network,
        parts=parts,
        step=step,
        fines=fines,
        without=frozen(without),
        raised=frozen(raised),
        renewed=len(without),
    )
