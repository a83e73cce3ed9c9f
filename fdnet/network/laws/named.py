"""Three laws of clean throats, and all laws by name.

Each law of clean throats takes a Network and returns the conductance g (T,) m3 of its throats.
Viscosity is factored out: flux = g dp / mu, with the pressure drop dp along the throat and the
viscosity mu.
"""

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from fdnet.names import SECTION_ARCHIE
from fdnet.network.laws.damage import CODE_THRESHOLD, TEXT_THRESHOLD, DamageLaw, thesis_damage
from fdnet.network.laws.deposit_resistances import grain_resistances
from fdnet.network.laws.section_archie import section_archie_damage
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


# ---- The laws by the names that a case or the command line gives them.
LAWS: Mapping[str, Law] = {
    "thesis": thesis_law,
    "effective": effective_law,
    "lubrication": lubrication_law,
}
"""Conductance laws of clean throats by name: functions of a network that return (T,) m3.

Examples:
    >>> import fdnet
    >>> sorted(fdnet.LAWS)
    ['effective', 'lubrication', 'thesis']
"""

DAMAGE_LAWS: Mapping[str, DamageLaw] = {
    "thesis": thesis_damage,
    "thesis-code": partial(thesis_damage, clogging_threshold=CODE_THRESHOLD),
    SECTION_ARCHIE: section_archie_damage,
}
"""Damage laws by name: functions that lower the clean conductance (T,) m3 of throats with fines.

Examples:
    >>> import fdnet
    >>> sorted(fdnet.DAMAGE_LAWS)
    ['section-archie', 'thesis', 'thesis-code']
"""


def damage_law(
    name: str, *, clogging_threshold: float | None = None, middle_band: str = "threshold"
) -> DamageLaw:
    """The damage law of this name, made with the options that it has.

    Args:
        name: a key of `DAMAGE_LAWS`.
        clogging_threshold: throat porosity below which the thesis laws take a throat as clogged;
            None for the threshold of the law. Only these two laws have options.
        middle_band: see `thesis_damage`.
    """
    if name == SECTION_ARCHIE:
        return section_archie_damage
    own = CODE_THRESHOLD if name == "thesis-code" else TEXT_THRESHOLD
    threshold = own if clogging_threshold is None else clogging_threshold
    return partial(thesis_damage, clogging_threshold=threshold, middle_band=middle_band)
