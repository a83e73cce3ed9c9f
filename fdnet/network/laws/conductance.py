"""Conductance of clean throats: five laws.

Each law takes a Network and returns the conductance g (T,) m3 of its throats. Viscosity is
factored out: flux = g dp / mu, with the pressure drop dp along the throat and the viscosity mu.
"""

from collections.abc import Callable

import numpy as np

from fdnet.network import geometry
from fdnet.network.laws.lubrication import half_resistances
from fdnet.network.laws.pyramids import side_voids
from fdnet.network.network import LENGTH_FLOOR, Network
from fdnet.spheres.snapshot import Array

Law = Callable[[Network], Array]

SERIES_POINTS = 16
"""Sections of a throat at which `series_law` takes its radius."""
INSCRIBED_WEIGHT = 0.35
HYDRAULIC_FACTOR = 0.5
WALL_ROUNDING = 1e-12
"""A grain surface of less than this many squared mean grain radii is none."""


def thesis_law(network: Network) -> Array:
    """Hagen-Poiseuille flow in a tube of the inscribed radius r: g = pi r^4 / (8 L).

    L is the length of the throat. Shi 2011, section 3.1.3.
    """
    return np.pi * network.throat_radius**4 / (8.0 * network.throat_length)


def effective_law(network: Network) -> Array:
    """Hagen-Poiseuille flow in a tube of equal open area S: g = pi r^4 / (8 L), r = sqrt(S / pi).

    Shi 2011, section 3.1.2, figure 26.
    """
    return np.pi * network.throat_radius_effective**4 / (8.0 * network.throat_length)


def hydraulic_law(network: Network) -> Array:
    """Flow by the hydraulic radius R_h of a throat: g = S R_h^2 / (2 L).

    S is the open area, L the distance of the two power centres, and R_h the void over the grain
    surface of the two pyramids from the facet to the power centres (circumcentres for equal
    radii). Heights of the pyramids are signed, and the overlap of two grains is counted once.
    Chareyre et al. 2012 (Transp. Porous Media 92, 473) with alpha = 1/2, for which a cylinder
    carries Poiseuille's flow.
    """
    heights = network.throat_heights
    void, wall = (both.sum(axis=1) for both in side_voids(network))
    some = wall > WALL_ROUNDING * network.grain_radius**2
    hydraulic_radius = np.where(some, void / np.where(some, wall, 1.0), 0.0)
    # pyramids between coinciding centres have no volume: the radius of the facet is taken instead
    thin = heights.sum(axis=1) < LENGTH_FLOOR * network.grain_radius
    hydraulic_radius = np.where(
        thin, 0.5 * network.throat_radius_effective, np.maximum(hydraulic_radius, 0.0)
    )
    return HYDRAULIC_FACTOR * network.throat_area * hydraulic_radius**2 / _height(network)


def series_law(network: Network, *, weight: float = INSCRIBED_WEIGHT) -> Array:
    """Sections in series: 1/g = integral of 8 / (pi r(z)^4) dz between the two power centres.

    z runs along the normal of the facet. In the section at height z each grain of radius R shows a
    disc of radius sqrt(R^2 - z^2), and r(z) = weight r_inscribed(z) + (1 - weight) r_effective(z).
    The weight, 0.35, was fitted to resolved Stokes flow in five lattices and three packs of equal
    grains. A facet that is closed at z = 0 is closed.
    """
    low, height = -network.throat_heights[:, 0], _height(network)
    points, weights = np.polynomial.legendre.leggauss(SERIES_POINTS)
    corner, radius = network.throat_corner, network.throat_corner_radius
    resistance = np.zeros(len(height))
    with np.errstate(divide="ignore"):
        for point, share in zip(points, weights, strict=True):
            z = low + 0.5 * (1.0 + point) * height
            disc = np.sqrt(np.maximum(radius**2 - z[:, None] ** 2, 0.0))
            resistance += (
                0.5 * share * height * 8.0 / (np.pi * _section_radius(corner, disc, weight) ** 4)
            )
    return np.where(network.throat_radius > 0, 1.0 / resistance, 0.0)


def lubrication_law(network: Network) -> Array:
    """One over the resistance between the nodes of pores, by extended lubrication theory.

    No constant is fitted; see `lubrication` for the theory and its sources.
    """
    return 1.0 / half_resistances(network).sum(axis=1)


def _section_radius(triangle: Array, disc: Array, weight: float) -> Array:
    """Weighted radius (T,) m of sections: triangles (T, 3, 3) m with discs (T, 3) m."""
    inscribed = np.nan_to_num(geometry.touching_circle(triangle, disc), nan=0.0)
    area = np.maximum(geometry.open_area(triangle, disc), 0.0)
    mixed = weight * inscribed + (1.0 - weight) * np.sqrt(area / np.pi)
    return np.where((inscribed > 0) & (area > 0), mixed, 0.0)


def _height(network: Network) -> Array:
    """Distance (T,) m of the two power centres, at least the shortest length of a throat."""
    return np.maximum(network.throat_heights.sum(axis=1), LENGTH_FLOOR * network.grain_radius)
