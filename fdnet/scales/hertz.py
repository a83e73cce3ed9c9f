"""Hertz-Mindlin contacts in closed form, for pairs of spheres and for a sphere and a plane.

Sources: Hertz (1882) and Johnson, Contact Mechanics (1985), chapters 4 and 11, for force, impact
and duration; Mindlin (1949) for the tangential stiffness; Antypov and Elliott (EPL 94, 50004,
2011) for the damped collision.
"""

import math
from dataclasses import dataclass

REFERENCE_OVERLAP = 0.01
"""Overlap over the smaller diameter at which a Hertz contact has the stiffness that is asked."""
STEP_OVERLAP = 0.04
"""Overlap over the smaller diameter whose tangent stiffness sets the time step. It is three times
the stiffness at `REFERENCE_OVERLAP`."""
_COLLISION = 0.8 * math.sqrt(math.pi) * math.gamma(0.4) / math.gamma(0.9)
"""Duration of a collision times v over the largest overlap, 2.943; times (15/16)^(2/5) it is the
2.87 of the textbooks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Elastic:
    """Elastic constants of a pair of materials, as they are used.

    Attributes:
        modulus: E* = 1 / ((1 - nu1^2) / E1 + (1 - nu2^2) / E2), Pa.
        shear: G* = 1 / ((2 - nu1) / G1 + (2 - nu2) / G2), Pa, with G = E / 2 (1 + nu).
    """

    modulus: float
    shear: float


def elastic(first: tuple[float, float], second: tuple[float, float]) -> Elastic:
    """Of two materials, each with Young's modulus in Pa and Poisson's ratio."""
    (e1, nu1), (e2, nu2) = first, second
    return Elastic(
        modulus=1 / ((1 - nu1**2) / e1 + (1 - nu2**2) / e2),
        shear=1 / (2 * (2 - nu1) * (1 + nu1) / e1 + 2 * (2 - nu2) * (1 + nu2) / e2),
    )


def joint_radius(first: float, second: float) -> float:
    """R* = 1 / (1/r1 + 1/r2), m; a plane has the radius infinity."""
    return 1 / (1 / first + 1 / second)


def secant_stiffness(modulus: float, radius: float, overlap: float) -> float:
    """F / delta = 4/3 E* sqrt(R* delta), N/m; the tangent stiffness is 1.5 times that."""
    return 4 / 3 * modulus * math.sqrt(radius * overlap)


def tangential_stiffness(shear: float, radius: float, overlap: float) -> float:
    """8 G* sqrt(R* delta), N/m (Mindlin 1949), without slip."""
    return 8 * shear * math.sqrt(radius * overlap)


def overlap_under(force: float, modulus: float, radius: float) -> float:
    """(3 F / (4 E* sqrt(R*)))^(2/3), m, at rest under a force in N."""
    return float((0.75 * force / (modulus * math.sqrt(radius))) ** (2 / 3))


def overlap_of_impact(
    mass: float, velocity: float, modulus: float, radius: float, *, damping: float = 0.0
) -> float:
    """Largest overlap, m, of a collision of effective mass in kg at a velocity in m/s.

    Undamped (15 m v^2 / (16 E* sqrt(R*)))^(2/5). With a force of damping that goes with
    delta^(1/4), as in LIGGGHTS, delta^(5/4) is the way of a linear oscillator of the ratio
    `damping`, so that the factor is that of the oscillator to the power 4/5.
    """
    free = float((15 * mass * velocity**2 / (16 * modulus * math.sqrt(radius))) ** 0.4)
    if damping == 0:
        return free
    s = math.sqrt(1 - damping**2)
    return free * math.exp(-0.8 * damping / s * math.atan2(s, damping))


def collision_time(mass: float, velocity: float, modulus: float, radius: float) -> float:
    """2.87 (m^2 / (R* E*^2 v))^(1/5), s, of an undamped collision."""
    return _COLLISION * overlap_of_impact(mass, velocity, modulus, radius) / velocity


def rayleigh_time(radius: float, density: float, young: float, poisson: float) -> float:
    """pi r sqrt(rho / G) / (0.1631 nu + 0.8766), s: a Rayleigh wave along half a sphere.

    Of a sphere of `radius` m and `density` kg/m3, with Young's modulus in Pa (Thornton and
    Randall 1988).
    """
    shear = young / (2 * (1 + poisson))
    return math.pi * radius * math.sqrt(density / shear) / (0.1631 * poisson + 0.8766)


def restitution_of(damping: float) -> float:
    """exp(-pi z / sqrt(1 - z^2)), of a contact of the damping ratio z < 1 that may pull.

    It holds for linear and, with the damping of LIGGGHTS, for Hertz contacts.
    """
    return math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
