"""The damage law of sections: what fines leave of the flow through each section of a throat.

The sections of a throat are those of `lubrication`, with discs of the three grains. Every fine
that reaches into the throat shows a disc in the sections that it meets. Together they leave the
share s of the flux through the section, summed over rays (`flux_among`). The section then
carries s^m of its clean flux.

With m = 1 the fluid would go straight through the gaps between the fines. But the gaps of one
section do not lie behind those of the next, so its path winds. Archie (1942, Trans. AIME 146, 54)
measured the same for an electric current in unconsolidated sand: its resistance grows as porosity
to the power -1.3. The same power is taken here.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import loops_in_place
from fdnet.network.fines.deposit import images_near, points_in_boxes, size_classes
from fdnet.network.fines.occupancy import Occupancy, ratio
from fdnet.network.laws.cross_section import (
    EVERYWHERE,
    Shapes,
    inwards,
    section_fluxes,
    set_sides,
    shapes_of,
)
from fdnet.network.laws.damage import BLOCKED, CLEAN, SECTIONS, Damage
from fdnet.network.laws.lubrication import STEPS, THROATS, sections_of, spans_of
from fdnet.network.laws.reaching_grains import SpheresBeside, facet_axes
from fdnet.network.laws.wedges import WIDENING, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array, Snapshot, frozen, one_line, unmoved

EXPONENT = 1.3  # Power of the share that the fines leave: Archie's for unconsolidated sand
STEP = 1.0 / 8.0  # Greatest step between two sections, in radii of the smallest fine in the throat
LEAST_STEPS = 8  # Smallest number of steps between a facet and a node
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


# ---- Which fines reach into the sections of a throat, and where they lie as seen from its facet.
class ThroatPart(NamedTuple):
    """What does not depend on the fines, of throats (K) that are computed together.

    It takes some 0.5 kB a throat.
    """

    throats: slice  # their place among all throats
    shapes: Shapes  # of their sections
    heights: Array  # (K, 2) m of the nodes above the facets
    origin: Array  # (K, 3) m, the first corner of each facet
    axes: tuple[Array, Array, Array]  # unit vectors (K, 3) of `facet_axes`
    ends: Array
    """(K, 2) m above the facets, of the lower and the upper end of the prism from node to node."""
    low: Array  # (K, 3) m, lower corners of the boxes around the prisms
    high: Array  # (K, 3) m, their upper corners


def parts_of(network: Network) -> Iterator[ThroatPart]:
    """All throats of a network, part by part."""
    nodes = nodes_of(network).heights
    for part in geometry.slices(len(network.throat_pores), THROATS):
        facet = network.image_position[network.throat_images[part]]
        axes = facet_axes(network, np.arange(part.start, part.stop), facet)
        height = nodes[part] * (-1.0, 1.0)
        above = (height[:, :, None] * axes[2][:, None])[:, :, None]
        corners = (facet[:, None] + above).reshape(len(facet), 6, 3)
        yield ThroatPart(
            throats=part,
            shapes=shapes_of(network, part),
            heights=nodes[part],
            origin=facet[:, 0].copy(),
            axes=axes,
            ends=np.sort(height, axis=1),
            low=corners.min(axis=1),
            high=corners.max(axis=1),
        )


def images_of(network: Network, position: Array, radius: Array) -> list[tuple[Array, Array]]:
    """Spheres at `position` (N, 3) m of `radius` (N,) m and their images near all throats.

    They are divided by size. The images are shifted or mirrored. A fine that is centred on or
    beyond a face that is not periodic has no mirror image there: its body inside the box is that
    of the sphere itself.
    """
    used = np.zeros(len(network.image_position), bool)
    used[network.throat_images] = True
    corner = network.image_position[used]
    low, high = corner.min(axis=0), corner.max(axis=0)
    images = []
    for some in size_classes(radius) if len(radius) else []:
        own = radius[some]
        place, owner = images_near(network, position[some], low, high, float(own.max()))
        images.append((place, own[owner]))
    return images


def fines_beside(
    images: list[tuple[Array, Array]], part: ThroatPart, rows: Array | None = None
) -> SpheresBeside:
    """The fines that reach into the prisms of throats (K), or into those of `rows` alone."""
    rows = np.arange(len(part.low)) if rows is None else rows
    low, high = part.low[rows], part.high[rows]
    throats, places = [np.zeros(0, np.intp)], [np.zeros((0, 5))]
    for position, radius in images:
        widest = float(radius.max())
        row, image = points_in_boxes(position, low - widest, high + widest)
        reach = radius[image, None]  # its own, whatever other fines are in the class
        near = (position[image] >= low[row] - reach) & (position[image] <= high[row] + reach)
        row, image = (one[near.all(axis=1)] for one in (row, image))
        throat = rows[row]
        away = position[image] - part.origin[throat]
        place = np.ones((len(throat), 5))
        for k, axis in enumerate(part.axes):
            place[:, k] = geometry.dot(away, axis[throat])
        place[:, 3] = radius[image]
        real = np.zeros(len(throat), bool)
        _set_reaching(part.shapes, part.ends, throat, place, np.empty((4, 3)), real)
        throats.append(throat[real])
        places.append(place[real])
    throat, place = np.concatenate(throats), np.concatenate(places)
    order = np.lexsort((*place[:, 2::-1].T, throat))  # whatever order the search has
    first = np.searchsorted(throat[order], np.arange(len(part.low) + 1))
    return SpheresBeside(first=first, place=place[order])


@loops_in_place
def _set_reaching(
    shapes: Shapes, ends: Array, throat: Array, place: Array, side: Array, real: Array
) -> None:
    """Sets whether spheres (N) reach between the ends and the lines of the polygon of a prism.

    `side` (4, 3) is written to.
    """
    for n in range(len(throat)):
        t, x, y, z, r = throat[n], place[n, 0], place[n, 1], place[n, 2], place[n, 3]
        real[n] = ends[t, 0] - r < z < ends[t, 1] + r
        if real[n]:
            base = shapes.corner[t, : shapes.corners[t]]
            set_sides(base, side)
            for i in range(len(base)):
                real[n] = real[n] and inwards(base, side, i, x, y) > -r


# ---- The resistances without and with fines.
def fine_resistances(
    network: Network,
    fines: Snapshot,
    *,
    among: Array | None = None,
    parts: Iterable[ThroatPart] | None = None,
    step: float = STEP,
) -> tuple[Array, Array, int]:
    """Resistances (T, 2) 1/m3 of the sides of throats without and with `fines`.

    Both are summed over the same sections. Those of throats without fines are 1 and 1, and 0 for a
    side that a throat does not have. The third value is the number of throats with fines too small
    for `MOST_STEPS`. Where `among` (T,) is given, throats where it is False are left at 1 and 1,
    and are not counted. `parts` is what `parts_of` gives for the network, made anew without it.
    `step` is as `STEP`.
    """
    images = images_of(network, fines.position, fines.radius)
    floor = LENGTH_FLOOR * network.grain_radius
    coarse, both = 0, np.ones((2, len(network.throat_pores), 2))
    for part in parts_of(network) if parts is None else parts:
        rows = None if among is None else np.flatnonzero(among[part.throats])
        beside = fines_beside(images, part, rows)
        some, steps = _steps(beside, part.heights, step)
        coarse += int(np.sum(steps > MOST_STEPS))
        steps = np.minimum(steps, MOST_STEPS)
        for count in map(int, np.unique(steps)):
            chosen = some[steps == count]
            at_once = max(THROATS * STEPS // count, 1)  # so that they take no more room
            for few in geometry.slices(len(chosen), at_once):
                throats = chosen[few]
                spans = spans_of(part.heights[throats], floor)
                sections = sections_of(throats, spans, count + 1)
                flux, left = section_fluxes(part.shapes, sections, beside, EVERYWHERE)
                own = part.shapes.part[sections.throat]
                both[:, part.throats.start + throats] = 0.0
                place = part.throats.start + sections.throat, sections.side
                for result, open_flux in zip(both, (flux, flux * left**EXPONENT), strict=True):
                    result[place] = resistance_of(open_flux, own, sections.step, WIDENING)
    return both[0], both[1], coarse


def _steps(beside: SpheresBeside, heights: Array, step: float) -> tuple[Array, Array]:
    """Throats (K,) with fines, and the steps of each of their sides, a power of two.

    None is longer than `step` radii of the smallest fine in the throat. Where more than
    `MOST_STEPS` are wanted, they are twice as many.
    """
    some = np.flatnonzero(np.diff(beside.first))
    if not len(some):
        return some, some
    smallest = np.minimum.reduceat(beside.place[:, 3], beside.first[some])
    longest = np.abs(heights[some]).max(axis=1)
    wanted = np.clip(longest / (step * smallest), LEAST_STEPS, 2 * MOST_STEPS)
    return some, 2 ** np.ceil(np.log2(wanted)).astype(int)


# ------------------------------------------------------------------------------------------------
# The damage law `section-archie` where fines come, leave and move between the solves of a flow.
#
# The resistances of a throat depend on the fines that reach into it and on nothing else. Only
# throats that a changed fine reaches, at its former place or at its new one, are summed anew.


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeptSections:
    """Resistances of the sides of throats (T) among fines."""

    network: Network  # pores and throats
    parts: Sequence[ThroatPart]  # what does not depend on the fines, of its throats
    step: float  # greatest between two sections, in radii of the smallest fine in the throat
    fines: Snapshot  # at the places for which the resistances hold
    without: Array  # (T, 2) 1/m3, without the fines; see `fine_resistances`
    raised: Array  # (T, 2) 1/m3, with them
    renewed: int  # number of throats that the last change summed anew

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
        images = images_of(
            self.network,
            np.concatenate([self.fines.position[gone], fines.position[come]]),
            np.concatenate([self.fines.radius[gone], fines.radius[come]]),
        )
        each = [np.diff(fines_beside(images, part).first) > 0 for part in self.parts]
        reached = np.concatenate(each)
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


def measured_sections(
    network: Network,
    fines: Snapshot,
    *,
    parts: Sequence[ThroatPart] | None = None,
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
