"""The conductance of a clean throat by extended lubrication theory, without a fitted constant.

Along the normal of its facet a throat is a tube of slowly varying section. The section at height z
carries the flux M(z) per pressure gradient over viscosity (`cross_section`), as much as a round
tube of radius a = (8 M / pi)^(1/4). Where the tube widens, the fluid also shears sideways. To
second order in the slope a' = da/dz of a periodic round tube the resistance is the integral of
8 / (pi a^4) (1 + 4/3 a'^2) dz (Sisavath, Jing and Zimmerman 2001, Phys. Fluids 13, 2762; rederived
in docs/physics_network.md). Beyond small slopes that is too large. The resistance used here has
the same expansion and scales as an orifice does where the slope is large:

    dR = 8 / (pi a^4) sqrt(dz^2 + 8/3 da^2).

It is within 7.6 % of the exact flow through every hyperboloid from a long tube to Sampson's
orifice (Happel and Brenner 1965, section 4-29).

What holds the fluid in a section is in `cross_section`: the spheres at the corners, side walls, a
grain that an x face cuts, and, with `around`, the spheres around a facet, which narrow sections
that one of its own does not reach.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import on_all_cores
from fdnet.network.laws.cross_section import BEYOND, OPEN, Sections, section_fluxes, shapes_of
from fdnet.network.laws.reaching_grains import sphere_trees, spheres_around, with_open_sections
from fdnet.network.laws.wedges import OPEN_WIDENING, WIDENING, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

STEPS = 8  # Steps in height between the facet and a node
OPEN_STEPS = 4  # The same among open sections; with 8, k of slabs changes by 0.2 % on average
THROATS = 20_000  # Throats that are worked off at once


def half_resistances(network: Network, *, around: bool = False) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the node on either side.

    Viscosity is factored out. Where a node lies on the facet (`nodes`), the throat is a resistance
    on the other side alone, and so it is where both nodes lie on one side. A closed throat has an
    infinite one. Heights whose sum is below 1e-3 mean grain radii are taken as that. With
    `around` the spheres around a facet narrow the sections that one of its own does not reach.
    """
    every = np.ones(len(network.throat_pores), bool)
    return side_resistances(network, every, nodes_of(network).heights, around=around)[0]


def side_resistances(
    network: Network, wanted: Array, heights: Array, *, around: bool, among_all: bool = False
) -> tuple[Array, Array]:
    """Resistance (T, 2) 1/m3 of the sides of throats, and how narrow these are at their ends.

    The second is 1/a (T, 3) 1/m at both nodes and at the facet, where a is the radius of the round
    tube that carries as much; nan where the throat has no such section, or a closed one.

    Args:
        network: pores and throats.
        wanted: (T,) whether a throat is measured; the resistances of all others are 0.
        heights: (T, 2) m, of the nodes above the facet.
        around: whether the spheres around a facet count.
        among_all: whether they do in all sections, which are open where a sphere of the facet
            has ended.
    """
    floor, trees = LENGTH_FLOOR * network.grain_radius, sphere_trees(network) if around else []
    kind, steps, widening = BEYOND, STEPS, WIDENING
    if among_all:
        kind, steps, widening = OPEN, OPEN_STEPS, OPEN_WIDENING
    resistance, narrow = np.zeros((len(wanted), 2)), np.full((len(wanted), 3), np.nan)

    def measure(part: slice) -> None:
        shapes, some, near = shapes_of(network, part), np.flatnonzero(wanted[part]), None
        sections = sections_of(some, spans_of(heights[part][some], floor), steps + 1)
        if around:
            high = np.where(wanted[part, None], heights[part], 0.0)
            rows = some if among_all else with_open_sections(network, part, high)
            near = spheres_around(network, part, rows, high, trees)
        flux, share = section_fluxes(shapes, sections, near, kind)
        flux *= 1.0 if among_all else share
        own, throat = shapes.part[sections.throat], part.start + sections.throat
        resistance[throat, sections.side] = resistance_of(flux, own, sections.step, widening)
        ends = flux[:, [0, -1]]
        tube = np.where(ends > 0.0, 8.0 / np.pi * ends, np.nan) ** -0.25
        narrow[throat, 2], narrow[throat, sections.side] = tube.T

    on_all_cores(measure, geometry.slices(len(wanted), THROATS))
    if not among_all:
        whole = ~np.any(network.image_outward[network.throat_images] != 0, axis=1)
        resistance[(network.throat_radius <= 0) & whole] = np.inf
    return resistance, narrow


def spans_of(heights: Array, floor: float) -> Array:
    """Lowest and highest section (K, 2, 2) m of each side of throats, above the facet.

    `heights` (K, 2) m are those of the nodes above the facet, each on its side. Their sum is
    taken as `floor` m where it is less. A side that the throat does not have ends at 0 or below.
    """
    low = -heights[:, 0]
    high = np.maximum(heights[:, 1], low + floor)
    spans = np.stack([np.maximum(-high, 0.0), -low, np.maximum(low, 0.0), high], axis=1)
    return spans.reshape(-1, 2, 2)


def sections_of(throats: Array, spans: Array, count: int) -> Sections:
    """`count` sections of the sides that some `throats` (K,) have.

    `spans` (K, 2, 2) m are of `spans_of`.
    """
    row, side = np.nonzero(spans[:, :, 1] > 0.0)
    low = spans[row, side, 0]
    step = (spans[row, side, 1] - low) / (count - 1)
    return Sections(throat=throats[row], side=side, low=low, step=step, many=count)
