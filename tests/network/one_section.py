"""The laws of many sections of a throat, asked for a single one."""

import numpy as np

from fdnet.network.laws.cross_section import (
    LANES,
    corner_room,
    even_fluxes,
    even_room,
    set_wedges,
    uneven_fluxes,
    uneven_room,
    wall_fluxes,
)
from fdnet.spheres.snapshot import Array


def even_flux(base: Array, disc: float, table: Array) -> float:
    """Flux m4 through the triangle `base` (3, 2) m with equal discs of radius `disc` m."""
    wedge, flux = np.empty((3, 7)), np.empty(1)
    set_wedges(base, wedge)
    even_fluxes(wedge, np.full(1, disc), (even_room(1), table), flux)
    return float(flux[0])


def uneven_flux(base: Array, disc: Array, table: Array) -> float:
    """Flux m4 through the triangle `base` (3, 2) m with discs of the radii `disc` (3,) m."""
    flux = np.empty(1)
    uneven_fluxes(base, np.array([disc]), (uneven_room(1), corner_room(), table), flux)
    return float(flux[0])


def wall_flux(place: Array, first: float, second: float, table: Array) -> float:
    """Flux m4 between the wall and discs of two radii m; `place` (3,) m as in `wall_fluxes`."""
    discs, flux = (np.full(1, first), np.full(1, second)), np.empty(1)
    wall_fluxes(place, discs, (np.empty((LANES, 1)), table), flux)
    return float(flux[0])
