"""The flow through the sections of one throat, at equal steps of height above its facet.

Each section has discs of the three grains on its corners (`cross_section`), and is narrowed by a
fourth grain (`fourth_grain`) and by the spheres around (`outside`). What does not change from
section to section, such as the directions of rays, is set up once for all sections of a throat.
"""

import numpy as np

from fdnet.network.compiled import compiled, loops_in_place
from fdnet.network.laws.corner_rays import CornerRoom, aim_at_fourth, aim_corners, corner_room
from fdnet.network.laws.cross_section import (
    even_fluxes,
    even_room,
    uneven_fluxes,
    uneven_room,
)
from fdnet.network.laws.cut_grains import CutRoom, cut_room
from fdnet.network.laws.fourth_grain import depth_within, share_left
from fdnet.network.laws.outside import Bundles, Seen, bundles, meet, share_around
from fdnet.network.laws.section_rays import aim, set_sides
from fdnet.network.laws.wall_cross_section import LANES
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
