"""The conductance of a clean throat by lubrication theory: its sections, and their series.

The flow through the sections of one throat, at equal steps of height above its facet.

Each section has discs of the three grains on its corners (`cross_section`), and is narrowed by a
fourth grain (`fourth_grain`) and by the spheres around (`outside`). What does not change from
section to section, such as the directions of rays, is set up once for all sections of a throat.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import (
    compiled,
    compiled_for_loops,
    compiled_inline,
    loops_in_place,
    on_all_cores,
)
from fdnet.network.laws.cross_section import (
    LANES,
    CornerRoom,
    aim,
    aim_at_fourth,
    aim_corners,
    corner_room,
    edge_fluxes,
    even_fluxes,
    even_room,
    set_sides,
    set_wedges,
    uneven_fluxes,
    uneven_room,
    wall_cuts,
    wall_fluxes,
)
from fdnet.network.laws.reaching_grains import (
    Bundles,
    CutRoom,
    Neighbourhood,
    Seen,
    bundles,
    cut_corners,
    cut_room,
    depth_within,
    fourth_grains,
    meet,
    share_around,
    share_left,
    share_of_cut,
)
from fdnet.network.laws.wedges import WIDENING, ratio_table, resistance_of
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.network.nodes import nodes_of
from fdnet.spheres.snapshot import Array

STEPS = 8
"""Steps in height between the facet and a node."""
TIP = 1e-2
"""Smallest radius of the disc that a grain shows in a section, in radii of the grain."""
SectionRoom = tuple[
    Array,
    Array,
    tuple[Array, Array],
    tuple[Array, tuple[Array, Array], CornerRoom],
    tuple[Bundles, Seen],
    CutRoom,
    tuple[Array, Array],
]
"""Fluxes (K,) m4 of K sections, radii of discs (3, K) m, room for `even_fluxes`, the radii (K, 3)
m and room for `uneven_fluxes`, room for `share_around`, room for a fourth disc or those of cut
grains, and room for `set_wedges` and for `wall_fluxes`."""
Throat = tuple[Array, Array, Array, Array]
"""Corners (3, 2) m of the facet, radii (3,) m of the discs in it, their flatness (3,), and the
wedges (`set_wedges`) of a throat with equal discs that is not obtuse, else no row."""


@compiled
def section_room(around: int, count: int = STEPS + 1) -> SectionRoom:
    """Room for `count` sections of a throat with up to `around` spheres around it."""
    return (
        np.empty(count),
        np.empty((3, count)),
        even_room(count),
        (np.empty((count, 3)), uneven_room(count), corner_room()),
        bundles(around + 3),
        cut_room(),
        (np.empty((3, 7)), np.empty((LANES, count))),
    )


@loops_in_place
def forget(room: SectionRoom, around: int) -> None:
    """Makes `room` that of another throat, which has `around` spheres around it."""
    room[3][2][3][0] = False
    for i in range(around + 3):
        room[4][0][1][i] = -1


@loops_in_place
def set_discs(throat: Throat, low: float, step: float, room: SectionRoom) -> None:
    """Sets the radii of the discs in the sections from the height `low` m on, `step` m apart."""
    radius, flatness, rows = throat[1], throat[2], room[3][0]
    for i in range(3):
        discs, square = room[1][i], radius[i] * radius[i]
        least, flat = TIP * TIP * square, flatness[i]
        for k in range(len(discs)):
            z = low + k * step
            discs[k] = np.sqrt(max(square - flat * z * z, least))
        for k in range(len(discs)):
            rows[k, i] = discs[k]


@loops_in_place
def open_fluxes(throat: Throat, room: SectionRoom, table: Array) -> None:
    """Sets the fluxes m4 of laplacian(w) = -1 among the three discs of the sections of a throat.

    `room` is of `section_room`, where `set_discs` has been called, and `table` that of
    `shear_ratio`.
    """
    base, _, _, wedge = throat
    flux, discs = room[0], room[1]
    rows, lanes, corners = room[3]
    if len(wedge):
        even_fluxes(wedge, discs[0], (room[2], table), flux)
    else:
        uneven_fluxes(base, rows, (lanes, corners, table), flux)


@loops_in_place
def narrow(
    throat: Throat,
    span: tuple[float, float, float],
    others: tuple[Array, Array],
    room: SectionRoom,
    table: Array,
) -> None:
    """Multiplies the fluxes by the shares that a fourth grain and the spheres around leave.

    Args:
        throat: its facet.
        span: m above the facet of the first section, m between two, and 1 for the side of the
            second pore or -1 for that of the first.
        others: the fourth grain (5,) on that side and the spheres around (N, 5): place (3) m,
            radius m and flatness. The height of the first is above the facet on that side, that
            of the others is towards the second pore.
        room: of `section_room`, where `forget` and `set_discs` have been called.
        table: the table of `shear_ratio`.
    """
    base, radius, flatness, _ = throat
    low, step, sense = span
    fourth, around = others
    flux, (discs, _, corners), (rays, seen), (side, own, _) = room[0], room[3], room[4], room[5]
    number = -1
    set_sides(base, side)
    depth = depth_within(base, side, fourth[0], fourth[1])
    for k in range(len(flux)):
        z, share = low + k * step, 1.0
        square = fourth[3] ** 2 - fourth[4] * (fourth[2] - z) ** 2
        if square > 0.0 and depth > -np.sqrt(square) and flux[k] > 0.0:
            if number < 0:
                aim_corners(base, corners)
                aim_at_fourth(base, fourth[0], fourth[1], corners)
                number = aim(base, side, fourth[0], fourth[1], own)
            disc = (fourth[0], fourth[1], np.sqrt(square))
            more = (base, rays[3], table)
            share = share_left(discs[k], disc, corners, (own, number), more)
        beyond = False
        for i in range(3):
            beyond = beyond or radius[i] ** 2 - flatness[i] * z * z <= 0.0
        if beyond and len(around) and flux[k] > 0.0:
            count = meet(discs[k], base, sense * z, around, seen)
            share = min(share, share_around(base, side, (count, seen), rays, table))
        flux[k] *= share


# ------------------------------------------------------------------------------------------------
# Resistance of throats by extended lubrication theory, without a fitted constant.
#
# Along the normal of its facet a throat is a tube of slowly varying section. The section at height
# z carries the flux M(z) per pressure gradient over viscosity (`cross_section`), as much as a
# round tube of radius a = (8 M / pi)^(1/4). Where the tube widens, the fluid also shears sideways.
# To second order in the slope a' = da/dz of a periodic round tube the resistance is the integral
# of 8 / (pi a^4) (1 + 4/3 a'^2) dz (Sisavath, Jing and Zimmerman 2001, Phys. Fluids 13, 2762;
# rederived in docs/physics_network.md). Beyond small slopes that is too large. The resistance used
# here has the same expansion and scales as an orifice does where the slope is large:
#
#     dR = 8 / (pi a^4) sqrt(dz^2 + 8/3 da^2).
#
# It is within 7.5 % of the exact flow through every hyperboloid from a long tube to Sampson's
# orifice (Happel and Brenner 1965, section 4-29).
#
# Where side walls hold the fluid (`Network.walls` "no-slip"), the sections that they cut are those
# of `wall_cross_section` and `edge_cross_section`. The cap of a grain centred beyond an x face
# shows the discs of a half ellipsoid (`Network.image_height`), and the flux is corrected for where
# the disc of the grain itself lies (`cut_grains`). With `fourth`, a section is narrowed by the
# fourth grain of the tetrahedron where that reaches in (`fourth_grain`).


THROATS = 20_000
"""Throats that are worked off at once."""
EQUAL = 1e-9
"""Radii that differ by at most this share are equal."""
OBTUSE = 1e-6
"""Tangent of the least angle by which the circumcentre of an obtuse facet lies beyond an edge."""
Span = tuple[float, float, float]
"""Lowest and highest section, m from the facet, and 1 for the side of the second pore or -1 for
that of the first."""
Faces = tuple[Array, Array, float, Array]
"""What the faces of the box cut of a throat: of side walls (`wall_cuts`) the order of its corners,
their places, and its share in the box; of x faces the corners (3, 4) of `cut_corners`."""


def half_resistances(
    network: Network,
    *,
    widening: float = WIDENING,
    fourth: bool = False,
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
        fourth: whether the fourth grain of a tetrahedron, and those around, narrow the sections.
        heights: (T, 2) m, of where the sides end above the facet; of the nodes if None.
        but: (T,) whether a throat is left out; its resistance is 0. None leaves out none.
    """
    but = np.zeros(len(network.throat_pores), bool) if but is None else but
    floor, table = LENGTH_FLOOR * network.grain_radius, ratio_table()
    every, heights = wall_cuts(network), nodes_of(network).heights if heights is None else heights
    resistance = np.empty((len(network.throat_pores), 2))
    around = Neighbourhood(network) if fourth else None

    def measure(part: slice) -> None:
        given = prepared(network, part, every)
        facet = network.image_position[network.throat_images[part]]
        beside = _beside(network, part, facet) if fourth else np.zeros((len(facet), 2, 5))
        outside = _outside(around, part, np.where(but[part, None], 0.0, heights[part]), facet)
        resistance[part] = _halves(
            given,
            (np.ascontiguousarray(heights[part]), but[part]),
            (floor, float(widening)),
            (beside, *outside, table),
        )

    on_all_cores(measure, geometry.slices(len(resistance), THROATS))
    shut = np.flatnonzero(network.throat_radius <= 0)
    flat = (network.image_height < network.image_radius)[network.throat_images[shut]]
    resistance[shut[~np.any(flat, axis=1)]] = np.inf
    return resistance


Prepared = tuple[Array, Array, Array, tuple[Array, Array, Array], Array]
"""Corners (K, 3, 2) m of facets in their own planes, radii (K, 3) m of the discs in them and their
flatness, what side walls cut (`wall_cuts`) and what x faces cut (`cut_corners`)."""


def prepared(network: Network, part: slice, walls: tuple[Array, Array, Array]) -> Prepared:
    """What the sections of the throats `part` (K) need; `walls` is what `wall_cuts` gives."""
    images = network.throat_images[part]
    facet = network.image_position[images]
    radius, flatness = _discs(network, images, facet)
    order, place, share = (one[part] for one in walls)
    cut = cut_corners(network, part, facet)
    return geometry.flat(facet), radius, flatness, (order, place, share), cut


def _discs(network: Network, images: Array, corner: Array) -> tuple[Array, Array]:
    """Radius (K, n) m of the discs of `images` (K, n) in the plane of a facet, and flatness.

    The radius at the height z above the facet is sqrt(radius^2 - flatness z^2); a sphere has the
    flatness 1. An ellipsoid of semi-axes h along x and a across reaches H above a plane whose
    normal makes the angle t with x, H^2 = (h cos t)^2 + (a sin t)^2, and shows ellipses of the
    area of a disc of radius sqrt(a^2 h / H (1 - z^2 / H^2)). `corner` (K, 3, 3) m is the facet.
    """
    radius, height = network.image_radius[images], network.image_height[images]
    flatness = np.ones(radius.shape)
    row, which = np.nonzero(height < radius)
    if len(row):
        normal = geometry.cross(corner[row, 1] - corner[row, 0], corner[row, 2] - corner[row, 0])
        cosine = normal[:, 0] ** 2 / geometry.dot(normal, normal)
        h, volume = height[row, which], radius[row, which] ** 3
        reach = np.sqrt(cosine * h**2 + (1.0 - cosine) * volume / h)
        radius[row, which] = np.sqrt(volume / reach)
        flatness[row, which] = volume / reach**3
    return radius, flatness


def _beside(network: Network, part: slice, corner: Array) -> Array:
    """The fourth grains (K, 2, 5): place (3) m, and their radius m and flatness as in `_discs`."""
    image, place = fourth_grains(network, part)
    radius, flatness = _discs(network, image, corner)
    return np.concatenate([place, radius[..., None], flatness[..., None]], axis=2)


def _outside(
    around: Neighbourhood | None, part: slice, heights: Array, corner: Array
) -> tuple[Array, Array]:
    """The grains around (N, 5), as in `_beside`, and the first (K+1,) of each throat."""
    if around is None:
        return np.empty((0, 5)), np.zeros(len(corner) + 1, int)
    near = around.near_facets(part, heights)
    throat = np.repeat(np.arange(len(corner)), np.diff(near.first))
    radius, flatness = _discs(around.network, near.image[:, None], corner[throat])
    return np.concatenate([near.place, radius, flatness], axis=1), near.first


@compiled_for_loops
def _halves(
    given: Prepared,
    sides: tuple[Array, Array],
    numbers: tuple[float, float],
    more: tuple[Array, Array, Array, Array],
) -> Array:
    first, resistance = more[2], np.zeros((len(sides[0]), 2))
    room = section_room(np.max(first[1:] - first[:-1]) if len(resistance) else 0)
    _set_halves(resistance, given, sides, numbers, (room, *more))
    return resistance


@loops_in_place
def _set_halves(
    resistance: Array,
    given: Prepared,
    sides: tuple[Array, Array],
    numbers: tuple[float, float],
    more: tuple[SectionRoom, Array, Array, Array, Array],
) -> None:
    """Sets the `resistance` (K, 2) 1/m3 of the sides of throats; 0 where there is none.

    `sides` are the heights (K, 2) m of the nodes, and whether a throat is left out.
    """
    heights, but = sides
    floor, widening = numbers
    room, beside, around, first, table = more
    for t in range(len(heights)):
        if but[t]:
            continue
        throat, faces = throat_at(given, t, room)
        spans = spans_of(heights[t], floor)
        outside = around[first[t] : first[t + 1]]
        forget(room, len(outside))
        for side in range(2):
            if spans[side][1] > 0.0:
                span, others = (spans[side], widening), (beside[t, side], outside)
                resistance[t, side] = _resistance(throat, faces, span, others, (room, table))


@loops_in_place
def _spread(three: Array) -> float:
    """Difference between the largest and the smallest of three numbers."""
    first, second, third = three[0], three[1], three[2]
    return max(first, second, third) - min(first, second, third)


@compiled_inline
def throat_at(given: Prepared, t: int, room: SectionRoom) -> tuple[Throat, Faces]:
    """The throat `t` of those that were prepared, and what the faces of the box cut of it."""
    corner, radius, flatness, (order, place, part), cut = given
    even = _spread(radius[t]) <= EQUAL * radius[t, 0] and _spread(flatness[t]) <= EQUAL
    wedge = room[6][0][: 3 if even else 0]
    if even:
        set_wedges(corner[t], wedge)
        if min(wedge[0, 1], wedge[1, 1], wedge[2, 1]) < -OBTUSE:
            wedge = wedge[:0]
    return (corner[t], radius[t], flatness[t], wedge), (order[t], place[t], part[t], cut[t])


@loops_in_place
def spans_of(heights: Array, floor: float) -> tuple[Span, Span]:
    """The spans (`set_fluxes`) of the sides of the first and the second pore.

    `heights` (2,) m are those of the nodes above the facet, each on its side. Their sum is
    taken as `floor` m where it is less. A side that the throat does not have ends at 0 or below.
    """
    low, high = -heights[0], heights[1]
    high = max(high, low + floor)
    return (max(-high, 0.0), -low, -1.0), (max(low, 0.0), high, 1.0)


@loops_in_place
def _resistance(
    throat: Throat,
    faces: Faces,
    span: tuple[Span, float],
    others: tuple[Array, Array],
    more: tuple[SectionRoom, Array],
) -> float:
    """Integral of dR between two heights, 1/m3."""
    heights, widening = span
    set_fluxes(throat, faces, heights, others, more)
    flux = more[0][0]
    step = (heights[1] - heights[0]) / (len(flux) - 1)
    return resistance_of(flux, (faces[2], step, widening))


@loops_in_place
def set_fluxes(
    throat: Throat,
    faces: Faces,
    span: Span,
    others: tuple[Array, Array],
    more: tuple[SectionRoom, Array],
) -> None:
    """Sets the fluxes m4 of laplacian(w) = -1 through the sections of one side of a throat.

    Args:
        throat: its facet.
        faces: what the faces of the box cut of it.
        span: of the sections.
        others: as in `narrow`; without a fourth grain no sphere narrows the sections.
        more: room for the sections, where `forget` was called, and the table of `shear_ratio`.
    """
    low, high, sense = span
    room, table = more
    flux, discs = room[0], room[1]
    step = (high - low) / (len(flux) - 1)
    set_discs(throat, low, step, room)
    order, place, _, cut = faces
    if order[1] >= 0:
        wall_fluxes(place, (discs[order[0]], discs[order[1]]), (room[6][1], table), flux)
    elif order[0] >= 0:
        edge_fluxes(place, discs[order[0]], (room[6][1], table), flux)
    else:
        open_fluxes(throat, room, table)
    if others[0][3] > 0.0:
        narrow(throat, (low, step, sense), others, room, table)
    if max(cut[0, 3], cut[1, 3], cut[2, 3]) > 0.0:
        rays = (room[5], room[4][0][3], table)
        for k in range(len(flux)):
            z = sense * (low + k * step)
            flux[k] *= share_of_cut(throat[0], room[3][0][k], z, cut, rays)
