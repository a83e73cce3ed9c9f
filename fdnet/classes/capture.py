"""What holds a class back: straining, bridging, and what carries it to the surface of grains.

The laws, their sources and ranges are on docs/theory/size_classes.md.
"""

import math
from dataclasses import dataclass

import numpy as np

from fdnet.case.spheres import Fines
from fdnet.network.compiled import loops_inside
from fdnet.spheres.snapshot import Array, one_line

BOLTZMANN, GRAVITY = 1.380649e-23, 9.81
TEMPERATURE, HAMAKER = 293.0, 1e-20
"""K, and J of a mineral on quartz in water, which Tufenkji and Elimelech take."""
JAMMED = 0.546
"""Cover by discs that land at random, when none fits any more (Hinrichsen et al. 1986)."""
TIGHT = 0.1547
"""Largest sphere that passes three equal touching spheres, over their diameter: 2 / sqrt(3) - 1.
A bed of spheres holds what is larger than this of its own."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SizeClasses:
    """Deposits of a mud as classes (C), from fine to coarse."""

    low: Array  # (C,) m, smallest diameter of each
    high: Array  # (C,) m, largest diameter
    diameter: Array  # (C,) m, with which a class acts: that of its mean volume by number
    concentration: Array  # (C,) volume over that of the mud
    density: Array  # (C,) kg/m3

    __repr__ = one_line

    @property
    def volume(self) -> Array:
        """Volume (C,) m3 of one fine of each class."""
        return np.pi / 6.0 * self.diameter**3


def mud_classes(fines: Fines, count: int, *, below: float = math.inf) -> SizeClasses:
    """All solids of a mud in `count` classes, equal over ln d; one where all are of one size.

    What the case leaves out of the simulation with spheres is in them: `fines.cut_um` is passed
    over, and the tails that `cut_percent` cuts off go to the first and the last class. Those finer
    than `below` m alone where it is given, without a class where nothing is.
    """
    whole = type(fines).model_validate(fines.model_dump() | {"cut_um": None})
    parts = whole.components
    low, top = min(one.curve.low for one in parts), max(one.curve.high for one in parts)
    high = max(low, min(top, below))
    edges = np.geomspace(low, high, count + 1) if high > low else np.array([low, high])
    edges[[0, -1]] = low, high
    volume, number, mass = (np.zeros(len(edges) - 1) for _ in range(3))
    for one in parts:
        shares = one.curve.kept * np.diff(one.curve.share_finer(edges)) if high > low else [1.0]
        shares = np.array(shares, float)
        shares[0] += one.curve.below
        shares[-1] += one.curve.above if high == top else 0.0
        volume += one.share * shares
        mass += one.share * shares * one.density
        by_number = np.diff(one.curve.share_finer(edges, 0)) if high > low else np.ones(1)
        number += one.share * by_number / one.curve.mean(3)
    used = (volume > 0) & (high == top or high > low)
    middle = np.sqrt(edges[:-1] * edges[1:])
    size = np.cbrt(np.divide(volume, number, out=middle**3, where=number > 0))
    return SizeClasses(
        low=edges[:-1][used],
        high=edges[1:][used],
        diameter=np.clip(size, edges[:-1], edges[1:])[used],
        concentration=(fines.volume_fraction * volume / sum(one.share for one in parts))[used],
        density=(mass[used] / volume[used]),
    )


# ---- Straining and bridging in throats.
def wider_share(classes: SizeClasses, passage: Array) -> Array:
    """Share (K, C) of each class that is wider than passages (K,) m; even over ln d in a class."""
    low, high = np.log(classes.low), np.log(classes.high)
    way = np.log(np.maximum(passage, 1e-30))[:, None]
    width = np.maximum(high - low, 1e-12)
    return np.clip((high - way) / width, 0.0, 1.0)


BRIDGED = ((0.65, 0.0), (0.725, 0.03), (0.9, 0.07))
"""Chance per arrival that an empty throat stops a fine, by diameter over passage."""


@loops_inside
def bridging_chance(ratio: float) -> float:
    """Chance per arrival that an empty throat stops a fine narrower than it, by d over passage.

    0 from 1 on, where `wider_share` holds all.
    """
    (none, _), (low, few), (high, most) = BRIDGED
    if ratio <= none or ratio >= 1.0:
        return 0.0
    if ratio < low:
        return few * (ratio - none) / (low - none)
    return few + (most - few) * min((ratio - low) / (high - low), 1.0)


# ---- Attachment to the surface of grains.
@dataclass(frozen=True, slots=True, kw_only=True)
class Bed:
    """A bed of grains and the fluid in it, SI units."""

    diameter: float  # m, of the grains
    porosity: float  # of the bed
    velocity: float  # m/s, superficial
    viscosity: float  # Pa s
    density: float  # kg/m3, of the fluid


def collector_efficiency(diameter: Array, density: Array, bed: Bed) -> Array:
    """Single-collector contact efficiency (C,) of spheres of `diameter` (C,) m.

    eta = 2.4 A_s^(1/3) N_R^-0.081 N_Pe^-0.715 N_vdW^0.052 + 0.55 A_s N_R^1.675 N_A^0.125
        + 0.22 N_R^-0.24 N_G^1.11 N_vdW^0.053

    (Tufenkji and Elimelech 2004, Environ. Sci. Technol. 38, 529), for N_R up to 0.02 and N_Pe from
    1e2 on. Fines lighter than the fluid do not settle.
    """
    gamma = (1.0 - bed.porosity) ** (1.0 / 3.0)
    happel = 2.0 * (1.0 - gamma**5) / (2.0 - 3.0 * gamma + 3.0 * gamma**5 - 2.0 * gamma**6)
    thermal, radius = BOLTZMANN * TEMPERATURE, 0.5 * diameter
    diffusion = thermal / (6.0 * np.pi * bed.viscosity * radius)
    size, peclet = diameter / bed.diameter, bed.velocity * bed.diameter / diffusion
    waals = HAMAKER / thermal
    attraction = HAMAKER / (12.0 * np.pi * bed.viscosity * radius**2 * bed.velocity)
    heavier = np.maximum(density - bed.density, 0.0)
    settling = 2.0 / 9.0 * radius**2 * heavier * GRAVITY / (bed.viscosity * bed.velocity)
    return np.asarray(
        2.4 * happel ** (1.0 / 3.0) * size**-0.081 * peclet**-0.715 * waals**0.052
        + 0.55 * happel * size**1.675 * attraction**0.125
        + 0.22 * size**-0.24 * settling**1.11 * waals**0.053
    )


def filter_coefficient(classes: SizeClasses, bed: Bed, sticking: float) -> Array:
    """lambda (C,) 1/m of each class on clean grains (Yao, Habibian and O'Melia 1971)."""
    if sticking == 0.0 or bed.velocity <= 0.0:
        return np.zeros(len(classes.diameter))
    eta = collector_efficiency(classes.diameter, classes.density, bed)
    return np.asarray(1.5 * (1.0 - bed.porosity) / bed.diameter * sticking * eta)


def covered(deposit: Array, classes: SizeClasses, surface: Array) -> Array:
    """Cover (N,) over `JAMMED` of surfaces (N,) m2 by attached solids (N, C) m3, at most 1.

    A fine covers its own section, 3 / (2 d) for each volume (Johnson and Elimelech 1995).
    """
    section = np.einsum("nc,c->n", deposit, 1.5 / classes.diameter)
    full = JAMMED * np.where(surface > 0, surface, math.inf)
    return np.minimum(section / full, 1.0)
