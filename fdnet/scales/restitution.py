"""Rebound in a liquid: the restitution of a contact from the impact Stokes number.

The liquid film between two spheres takes the energy of the impact. Experiments with spheres and
walls show no rebound below an impact Stokes number of about 10, and the dry restitution from about
500 on (Joseph and others, J. Fluid Mech. 433, 329, 2001; Gondret and others, Phys. Fluids 14, 643,
2002). exp(-35 / St) of the dry restitution follows them (Legendre and others, Phys. Fluids 17,
097105, 2005, and Chem. Eng. Sci. 61, 3543, 2006).
"""

import math
from collections.abc import Mapping

from fdnet.case.case import Case, InvasionCase

FILM = 35.0
"""Stokes number at which the liquid leaves exp(-1) of the dry restitution (Legendre 2005)."""
LEAST: Mapping[str, float] = {"hooke": 1e-6, "hertz": 0.0501}
"""Least restitution by contact model, below which nothing is lowered further. LIGGGHTS's Hertz
model takes 0.05 and less for an error; for linear contacts it keeps the damping ratio below 1."""


def pair_stokes(mass: float, radius: float, velocity: float, viscosity: float) -> float:
    """m_eff v / (6 pi mu R*^2), the impact Stokes number of a pair.

    For the effective mass in kg, R* in m, the velocity of approach in m/s, and the viscosity in
    Pa s. Of a sphere and a wall it is 2 r rho v / (9 mu) (Joseph and others 2001).
    """
    return mass * velocity / (6 * math.pi * viscosity * radius**2)


def wet_ratio(dry_ratio: float, stokes: float, *, least: float) -> float:
    """Damping ratio of a contact with exp(-35 / St) of the restitution of `dry_ratio`.

    z = -ln e / sqrt(ln^2 e + pi^2), with e at least `least`.
    """
    log = -math.pi * dry_ratio / math.sqrt(1 - dry_ratio**2) - FILM / stokes
    log = max(log, math.log(least))
    return -log / math.hypot(log, math.pi)


def is_wet(case: Case, pair: tuple[str, str]) -> bool:
    """Whether the liquid decides the restitution of a pair."""
    wanted = isinstance(case, InvasionCase) and case.contact.restitution == "liquid"
    return wanted and "fine" in pair
