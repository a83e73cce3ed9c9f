"""The laws of many sections of a throat, asked for a single one."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np

from fdnet.network.laws.cross_section import (
    LANES,
    Sections,
    WallCuts,
    edge_fluxes,
    even_fluxes,
    even_room,
    tangents,
    touching_fluxes,
    uneven_fluxes,
    uneven_room,
    wall_fluxes,
)
from fdnet.spheres.snapshot import Array

FIRST = np.zeros(1, int)


@cache
def from_python(function: Any) -> Callable[..., Any]:
    """A function that compiled functions alone can call (`loops_inside`), for Python."""

    @numba.njit
    def call(*given: Any) -> Any:
        return function(*given)

    return call  # type: ignore[no-any-return]


_touching = from_python(touching_fluxes)


def sections_with(discs: Array) -> Sections:
    """Sections with the radii `discs` (3, n) m of one side of a throat."""
    none = np.zeros(1)
    return Sections(throat=FIRST, side=FIRST, low=none, step=none, disc=discs[None].copy())


def even_flux(base: Array, disc: float, table: Array) -> float:
    """Flux m4 through the triangle `base` (3, 2) m with equal discs of radius `disc` m."""
    base, flux, discs = base[None], np.empty((1, 1)), np.full((3, 1), disc)
    even_fluxes(FIRST, sections_with(discs), base, tangents(base), table, even_room(1), flux)
    return float(flux[0, 0])


def uneven_flux(base: Array, disc: Array, table: Array) -> float:
    """Flux m4 through the triangle `base` (3, 2) m with discs of the radii `disc` (3,) m."""
    flux = np.empty((1, 1))
    uneven_fluxes(FIRST, sections_with(disc[:, None]), base[None], table, uneven_room(1), flux)
    return float(flux[0, 0])


def touching_flux(base: Array, disc: Array, table: Array) -> float:
    """Flux m4 of the signed shares of three discs that a circle touches, else 0."""
    flux = np.empty(1)
    _touching(base, np.ascontiguousarray(disc[:, None]), table, uneven_room(1), flux)
    return float(flux[0])


def wall_flux(place: Array, first: Array, second: Array, table: Array) -> Array:
    """Fluxes m4 between the wall and discs of the radii `first` and `second` m, of one or more.

    `place` (3,) m is as in `WallCuts`.
    """
    cuts = WallCuts(order=np.array([[0, 1]]), place=place[None], part=np.ones(1))
    return _walled(wall_fluxes, np.stack([first, second, second]), cuts, table)


def edge_flux(place: Array, disc: Array, table: Array) -> Array:
    """Fluxes m4 between two walls and discs of radius `disc` m, `place` (2,) m away."""
    cuts = WallCuts(order=np.array([[0, -1]]), place=np.array([[*place, 0.0]]), part=np.ones(1))
    return _walled(edge_fluxes, np.stack([disc, disc, disc]), cuts, table)


def _walled(law: Any, discs: Array, cuts: WallCuts, table: Array) -> Array:
    flux = np.empty((1, discs[0].size))
    lanes = np.full((LANES, flux.size), np.nan)
    law(FIRST, sections_with(discs.reshape(3, -1)), cuts, table, lanes, flux)
    return flux[0] if discs.ndim > 1 else flux[0, 0]
