"""Conductance of clean throats: five laws side by side. Viscosity is factored out, so g is in m3 (flux = g dp / mu).

Each law takes a Network and returns (T,) m3.
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
INSCRIBED_WEIGHT = 0.35
HYDRAULIC_FACTOR = 0.5


def thesis_law(network: Network) -> Array:
    """Hagen-Poiseuille of the inscribed radius, g = pi r^4 / (8 L). Shi 2011, section 3.1.3."""
    return np.pi * network.throat_radius**4 / (8.0 * network.throat_length)


def effective_law(network: Network) -> Array:
    """Hagen-Poiseuille of the radius of equal open area, r = sqrt(S / pi). Shi 2011, section 3.1.2, figure 26."""
    return np.pi * network.throat_radius_effective**4 / (8.0 * network.throat_length)


def hydraulic_law(network: Network) -> Array:
    """g = S R_h^2 / (2 L), R_h = void / wall of the two pyramids from the facet to the power centres.

    Chareyre et al. 2012 (Transp. Porous Media 92, 473, alpha = 1/2; the factor makes a cylinder Poiseuille's). Signed
    heights; overlap of grain pairs counted once. Equal radii: power centres are circumcentres.
    """
    heights = network.throat_heights
    void, wall = (both.sum(axis=1) for both in side_voids(network))
    speck = 1e-12 * network.grain_radius**2
    hydraulic_radius = np.where(wall > speck, void / np.where(wall > speck, wall, 1.0), 0.0)
    # slivers between coinciding centres: their radius is that of no domain at all; the facet's own stands in
    thin = heights.sum(axis=1) < LENGTH_FLOOR * network.grain_radius
    hydraulic_radius = np.where(
        thin, 0.5 * network.throat_radius_effective, np.maximum(hydraulic_radius, 0.0)
    )
    return HYDRAULIC_FACTOR * network.throat_area * hydraulic_radius**2 / _height(network)


def series_law(network: Network, *, weight: float = INSCRIBED_WEIGHT) -> Array:
    """1/g = integral of 8 / (pi r(z)^4) dz between the power centres along the facet's normal.

    r(z) = weight r_inscribed(z) + (1 - weight) r_effective(z) of the section at height z, where each grain shows a
    disc of radius sqrt(R^2 - z^2). The weight, 0.35, was fitted to resolved Stokes flow in five lattices and three
    packs of equal grains. A facet closed at z = 0 is closed.
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
    """One over the resistance between the power centres, by extended lubrication theory; see `lubrication`."""
    return 1.0 / half_resistances(network).sum(axis=1)


def _section_radius(triangle: Array, disc: Array, weight: float) -> Array:
    inscribed = np.nan_to_num(geometry.touching_circle(triangle, disc), nan=0.0)
    area = np.maximum(geometry.open_area(triangle, disc), 0.0)
    mixed = weight * inscribed + (1.0 - weight) * np.sqrt(area / np.pi)
    return np.where((inscribed > 0) & (area > 0), mixed, 0.0)


def _height(network: Network) -> Array:
    return np.maximum(network.throat_heights.sum(axis=1), LENGTH_FLOOR * network.grain_radius)
