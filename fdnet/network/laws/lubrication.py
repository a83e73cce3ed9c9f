"""The conductance of a clean throat by extended lubrication theory, without a fitted constant.

Along the normal of its facet a throat is a tube of slowly varying section. The section at height z
carries the flux M(z) per pressure gradient over viscosity (`cross_section`), as much as a round
tube of radius a = (8 M / pi)^(1/4). Where the tube widens, the fluid also shears sideways. To
second order in the slope a' = da/dz of a periodic round tube the resistance is the integral of
8 / (pi a^4) (1 + 4/3 a'^2) dz (Sisavath, Jing and Zimmerman 2001, Phys. Fluids 13, 2762; rederived
in docs/physics_network.md). Beyond small slopes that is too large. The resistance used here has
the same expansion and scales as an orifice does where the slope is large:

    dR = 8 / (pi a^4) sqrt(dz^2 + 8/3 da^2).

It is within 7.5 % of the exact flow through every hyperboloid from a long tube to Sampson's
orifice (Happel and Brenner 1965, section 4-29).

What holds the fluid in a section is in `cross_section`: the spheres at the corners, side walls, a
grain that an x face cuts, and, with `around`, the spheres around a facet, which narrow sections
that one of its own does not reach.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import on_all_cores
from fdnet.network.laws.cross_section import Sections, section_fluxes, shapes_of
from fdnet.network.laws.reaching_grains import sphere_trees, spheres_around, with_open_sections
from fdnet.network.laws.wedges import WIDENING, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

STEPS = 8
"""Steps in height between the facet and a node."""
THROATS = 20_000
"""Throats that are worked off at once."""


def half_resistances(
    network: Network,
    *,
    widening: float = WIDENING,
    around: bool = False,
    heights: Array | None = None,
    but: Array | None = None,
) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the node on either side.

    Viscosity is factored out. Where a node lies on the facet (`nodes`), the throat is a resistance
    on the other side alone, and so it is where both nodes lie on one side. A closed throat has an
    infinite one. Heights whose sum is below 1e-3 mean grain radii are taken as that.

    Args:
        network: pores and throats.
        widening: the factor of da^2 in the formula of this module.
        around: whether the spheres around a facet narrow the sections that one of its own does
            not reach.
        heights: (T, 2) m, of where the sides end above the facet; of the nodes if None.
        but: (T,) whether a throat is left out; its resistance is 0. None leaves out none.
    """
    left = np.ones(len(network.throat_pores), bool) if but is None else ~but
    heights = nodes_of(network).heights if heights is None else heights
    floor = LENGTH_FLOOR * network.grain_radius
    trees = sphere_trees(network) if around else []
    resistance = np.zeros((len(network.throat_pores), 2))

    def measure(part: slice) -> None:
        shapes, some = shapes_of(network, part), np.flatnonzero(left[part])
        sections = sections_of(some, spans_of(heights[part][some], floor), STEPS + 1)
        near = None
        if around:
            high = np.where(left[part, None], heights[part], 0.0)
            rows = with_open_sections(network, part, high)
            near = spheres_around(network, part, rows, high, trees)
        flux, share = section_fluxes(shapes, sections, near)
        own = shapes.part[sections.throat]
        resistance[part][sections.throat, sections.side] = resistance_of(
            flux * share, own, sections.step, widening
        )

    on_all_cores(measure, geometry.slices(len(resistance), THROATS))
    shut = (network.throat_radius <= 0) & ~np.any(
        network.image_outward[network.throat_images] != 0, axis=1
    )
    resistance[shut] = np.inf
    return resistance


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
