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

Where side walls hold the fluid (`Network.walls` "no-slip"), the sections that they cut are those
of `wall_fluxes` and `edge_fluxes`. The cap of a grain centred beyond an x face shows the discs of
a half ellipsoid (`Network.image_height`), and the flux is corrected for where the disc of the
grain itself lies (`cut_fluxes`). With `around`, the spheres around a facet narrow the sections
that one of its own does not reach (`narrow_fluxes`).
"""

from typing import NamedTuple

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import loops_in_place, on_all_cores
from fdnet.network.laws.cross_section import (
    LANES,
    Sections,
    WallCuts,
    disc_fluxes,
    disc_room,
    edge_fluxes,
    wall_cuts,
    wall_fluxes,
)
from fdnet.network.laws.reaching_grains import (
    cut_corners,
    cut_fluxes,
    discs_of,
    narrow_fluxes,
    ray_room,
    sphere_trees,
    spheres_around,
)
from fdnet.network.laws.wedges import WIDENING, ratio_table, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

STEPS = 8
"""Steps in height between the facet and a node."""
TIP = 1e-2
"""Smallest radius of the disc that a grain shows in a section, in radii of the grain."""
THROATS = 20_000
"""Throats that are worked off at once."""


class Prepared(NamedTuple):
    """What the sections of K throats need, whatever their nodes."""

    base: Array
    """(K, 3, 2) m, corners of the facets in their own planes."""
    square: Array
    """(K, 3) m2, of the radii of the discs in the facets."""
    flatness: Array
    """(K, 3) of these discs (`discs_of`)."""
    walls: WallCuts
    is_cut: Array
    """(K,) whether an x face cuts a grain of the throat."""
    cut: Array
    """(K, 3, 4) of `cut_corners`."""


def prepared(network: Network, part: slice, walls: WallCuts) -> Prepared:
    """What the sections of the throats `part` (K) need; `walls` is what `wall_cuts` gives."""
    images = network.throat_images[part]
    facet = network.image_position[images]
    radius, flatness = discs_of(network, images, facet)
    cut = cut_corners(network, part, facet)
    return Prepared(
        base=geometry.flat(facet),
        square=radius * radius,
        flatness=flatness,
        walls=WallCuts(*(one[part] for one in walls)),
        is_cut=np.any(cut[:, :, 3] > 0.0, axis=1),
        cut=cut,
    )


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
    floor, walls = LENGTH_FLOOR * network.grain_radius, wall_cuts(network)
    trees = sphere_trees(network) if around else []
    resistance = np.zeros((len(network.throat_pores), 2))

    def measure(part: slice) -> None:
        given, some = prepared(network, part, walls), np.flatnonzero(left[part])
        sections = sections_of(given, some, spans_of(heights[part][some], floor), STEPS + 1)
        flux = clear_fluxes(given, sections)
        if around:
            high = np.where(left[part, None], heights[part], 0.0)
            spheres = spheres_around(network, part, high, trees)
            narrow_fluxes(
                sections,
                given.base,
                given.square,
                given.flatness,
                spheres,
                ratio_table(),
                ray_room(int(np.diff(spheres.first).max(initial=0))),
                flux,
            )
        cut_by_faces(given, sections, flux)
        own = given.walls.part[sections.throat]
        resistance[part][sections.throat, sections.side] = resistance_of(
            flux, own, sections.step, widening
        )

    on_all_cores(measure, geometry.slices(len(resistance), THROATS))
    shut = np.flatnonzero(network.throat_radius <= 0)
    flat = (network.image_height < network.image_radius)[network.throat_images[shut]]
    resistance[shut[~np.any(flat, axis=1)]] = np.inf
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


def sections_of(given: Prepared, throats: Array, spans: Array, count: int) -> Sections:
    """`count` sections of the sides that some `throats` (K,) have, with their discs.

    `spans` (K, 2, 2) m are of `spans_of`.
    """
    row, side = np.nonzero(spans[:, :, 1] > 0.0)
    low, throat = spans[row, side, 0], throats[row]
    step = (spans[row, side, 1] - low) / (count - 1)
    disc = np.empty((len(throat), 3, count))
    sections = Sections(throat=throat, side=side, low=low, step=step, disc=disc)
    _set_discs(sections, given.square, given.flatness)
    return sections


@loops_in_place
def _set_discs(sections: Sections, square: Array, flatness: Array) -> None:
    for s in range(len(sections.throat)):
        for i in range(3):
            disc, t = sections.disc[s, i], sections.throat[s]
            whole, flat = square[t, i], flatness[t, i]
            for k in range(len(disc)):
                z = sections.low[s] + k * sections.step[s]
                disc[k] = np.sqrt(max(whole - flat * z * z, TIP * TIP * whole))


def clear_fluxes(given: Prepared, sections: Sections) -> Array:
    """Fluxes (S, n) m4 of laplacian(w) = -1 among the discs of sections, and side walls."""
    table, walls, count = ratio_table(), given.walls, sections.disc.shape[2]
    flux = np.empty((len(sections.throat), count))
    order = walls.order[sections.throat]
    at_wall, in_edge = order[:, 1] >= 0, (order[:, 1] < 0) & (order[:, 0] >= 0)
    rows = np.flatnonzero(~(at_wall | in_edge))
    disc_fluxes(rows, sections, given.base, table, disc_room(count), flux)
    lanes = np.empty((LANES, count))
    if at_wall.any():
        wall_fluxes(np.flatnonzero(at_wall), sections, walls, table, lanes, flux)
    if in_edge.any():
        edge_fluxes(np.flatnonzero(in_edge), sections, walls, table, lanes, flux)
    return flux


def cut_by_faces(given: Prepared, sections: Sections, flux: Array) -> None:
    """Corrects the `flux` (S, n) m4 of sections whose grains an x face cuts."""
    rows = np.flatnonzero(given.is_cut[sections.throat])
    if len(rows):
        room, discs = ray_room(0), np.empty((2, 3, 3))
        cut_fluxes(rows, sections, given.base, given.cut, ratio_table(), room, discs, flux)
