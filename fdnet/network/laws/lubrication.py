"""Resistance of throats by extended lubrication theory, without a fitted constant.

Along the normal of its facet a throat is a tube of slowly varying section. The section at height z
carries the flux M(z) per pressure gradient over viscosity (`cross_section`), as much as a round
tube of radius a = (8 M / pi)^(1/4). Where the tube widens, the fluid also shears sideways. To
second order in the slope a' = da/dz of a periodic round tube the resistance is the integral of 8 /
(pi a^4) (1 + 4/3 a'^2) dz (Sisavath, Jing and Zimmerman 2001, Phys. Fluids 13, 2762; rederived in
docs/physics_network.md). Beyond small slopes that is too large. The resistance used here has the
same expansion and scales as an orifice does where the slope is large:

    dR = 8 / (pi a^4) sqrt(dz^2 + 8/3 da^2).

It is within 7.5 % of the exact flow through every hyperboloid from a long tube to Sampson's
orifice (Happel and Brenner 1965, section 4-29).

Where side walls hold the fluid (`Network.walls` "no-slip"), the sections that they cut are those
of `wall_cross_section`.
"""

import numpy as np

from fdnet.network import geometry
from fdnet.network.compiled import compiled
from fdnet.network.laws.cross_section import even_flux, uneven_flux, wedges
from fdnet.network.laws.wall_cross_section import wall_cuts, wall_flux
from fdnet.network.laws.wedge import ratio_table
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.spheres.snapshot import Array

WIDENING = 8.0 / 3.0
"""Factor of da^2 in the resistance above."""
STEPS = 8
"""Steps in height between the facet and a power centre."""
TIP = 1e-2
"""Smallest radius of the disc that a grain shows in a section, in radii of the grain."""
EQUAL = 1e-9
"""Radii that differ by at most this share are equal."""


def half_resistances(network: Network, *, widening: float = WIDENING) -> Array:
    """Resistance (T, 2) 1/m3 of each throat from its facet to the power centre on either side.

    Viscosity is factored out. A throat with both centres on one side of its facet is a resistance
    on that side alone. A closed throat has an infinite one. Heights whose sum is below 1e-3 mean
    grain radii are taken as that. `widening` is the factor of da^2 in the formula of this module.
    """
    corner = geometry.flat(network.throat_corner)
    radius = np.ascontiguousarray(network.throat_corner_radius)
    heights = np.ascontiguousarray(network.throat_heights)
    floor = LENGTH_FLOOR * network.grain_radius
    resistance = _halves(
        corner, radius, heights, wall_cuts(network), (floor, float(widening)), ratio_table()
    )
    resistance[network.throat_radius <= 0] = np.inf
    return resistance


@compiled
def _halves(
    corner: Array,
    radius: Array,
    heights: Array,
    cuts: tuple[Array, Array, Array],
    given: tuple[float, float],
    table: Array,
) -> Array:
    order, place, part = cuts
    floor, widening = given
    resistance = np.zeros((len(corner), 2))
    for t in range(len(corner)):
        low, high = -heights[t, 0], heights[t, 1]
        high = max(high, low + floor)
        even = np.max(radius[t]) - np.min(radius[t]) <= EQUAL * radius[t, 0]
        wedge = wedges(corner[t]) if even else np.empty((0, 7))
        wall = (order[t], place[t], part[t])
        if low < 0.0 and high > 0.0:
            resistance[t, 0] = _resistance(
                corner[t], radius[t], wedge, wall, (0.0, -low, widening), table
            )
            resistance[t, 1] = _resistance(
                corner[t], radius[t], wedge, wall, (0.0, high, widening), table
            )
        elif low >= 0.0:
            resistance[t, 1] = _resistance(
                corner[t], radius[t], wedge, wall, (low, high, widening), table
            )
        else:
            resistance[t, 0] = _resistance(
                corner[t], radius[t], wedge, wall, (-high, -low, widening), table
            )
    return resistance


@compiled
def _resistance(
    base: Array,
    radius: Array,
    wedge: Array,
    wall: tuple[Array, Array, float],
    span: tuple[float, float, float],
    table: Array,
) -> float:
    """Integral of dR between two heights, 1/m3.

    1/a is linear within a step; the integral is extrapolated from STEPS and STEPS / 2 steps.
    """
    low, high, widening = span
    step = (high - low) / STEPS
    narrow = np.empty(STEPS + 1)
    disc = np.empty(3)
    order, place, part = wall
    for k in range(STEPS + 1):
        z = low + k * step
        for i in range(3):
            disc[i] = np.sqrt(max(radius[i] ** 2 - z * z, (TIP * radius[i]) ** 2))
        if order[0] >= 0:
            flux = part * wall_flux(place, disc[order[0]], disc[order[1]], table)
        else:
            flux = part * _slipping_flux(base, disc, wedge, table)
        if not flux > 0.0:
            return np.inf
        narrow[k] = 1.0 / np.sqrt(np.sqrt(8.0 * flux / np.pi))
    return (4.0 * summed(narrow, step, 1, widening) - summed(narrow, step, 2, widening)) / 3.0


@compiled
def _slipping_flux(base: Array, disc: Array, wedge: Array, table: Array) -> float:
    flux = even_flux(wedge, disc[0], table) if len(wedge) else 0.0
    return flux if flux > 0.0 else uneven_flux(base, disc, table)


@compiled
def summed(narrow: Array, step: float, every: int, widening: float) -> float:
    """Resistance 1/m3 between sections of 1/a = `narrow` (K,) 1/m that lie `step` m apart.

    It is the sum of dR over the intervals between every `every`-th of them.
    """
    total = 0.0
    for k in range(every, len(narrow), every):
        a, b = narrow[k - every], narrow[k]
        straight = every * step * (a**4 + a**3 * b + a**2 * b**2 + a * b**3 + b**4) / 5.0
        sideways = np.sqrt(widening) * abs(b**3 - a**3) / 3.0
        total += 8.0 / np.pi * np.hypot(straight, sideways)
    return total
