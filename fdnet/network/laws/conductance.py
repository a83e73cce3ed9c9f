"""Conductance of clean throats: three laws.

Each law takes a Network and returns the conductance g (T,) m3 of its throats. Viscosity is
factored out: flux = g dp / mu, with the pressure drop dp along the throat and the viscosity mu.
"""

from collections.abc import Callable

import numpy as np

from fdnet.network.laws.deposit_resistances import grain_resistances
from fdnet.network.network import Network
from fdnet.spheres.snapshot import Array

Law = Callable[[Network], Array]


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


def lubrication_law(network: Network) -> Array:
    """One over the resistance between the nodes of pores, by extended lubrication theory.

    No constant is fitted; see `lubrication` for the theory and its sources.
    """
    return 1.0 / grain_resistances(network).sum(axis=1)
