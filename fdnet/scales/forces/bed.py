"""Pressure drop and fluidisation of a bed of equal spheres (Ergun, Chem. Eng. Prog. 48, 1952).

All functions take SI units. U is the superficial velocity, phi the porosity of the bed.
"""

import math
from dataclasses import dataclass

CARMAN_KOZENY, ERGUN_VISCOUS, ERGUN_INERTIAL = 180.0, 150.0, 1.75
"""Constants of the laws: viscous by Carman (1937), viscous and inertial by Ergun (1952)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bed:
    """A bed of equal spheres in a liquid.

    Attributes:
        diameter: of the spheres, m.
        porosity: volume fraction of the liquid.
        viscosity: Pa s.
        density: of the liquid, kg/m3.
    """

    diameter: float
    porosity: float
    viscosity: float
    density: float


def ergun_gradient(bed: Bed, velocity: float) -> float:
    """Fall of pressure with length at the superficial `velocity` m/s, Pa/m.

    150 mu s^2 U / (phi^3 d^2) + 1.75 rho s U^2 / (phi^3 d), s = 1 - phi.
    """
    linear, square = _coefficients(bed)
    return linear * velocity + square * velocity**2


def kozeny_gradient(bed: Bed, velocity: float) -> float:
    """180 mu s^2 U / (phi^3 d^2), Pa/m: Darcy's law with Carman and Kozeny's permeability."""
    return CARMAN_KOZENY / ERGUN_VISCOUS * _coefficients(bed)[0] * velocity


def ergun_velocity(bed: Bed, gradient: float) -> float:
    """Superficial velocity, m/s, at which the pressure falls by `gradient` Pa/m."""
    linear, square = _coefficients(bed)
    return 2 * gradient / (linear + math.sqrt(linear**2 + 4 * square * gradient))


def fluidisation_velocity(bed: Bed, density: float, gravity: float = 9.81) -> float:
    """Superficial velocity, m/s, whose pressure drop carries the weight of the bed.

    The weight is s (rho_p - rho) g a volume; `density` is rho_p, that of the spheres, kg/m3.
    """
    return ergun_velocity(bed, (1 - bed.porosity) * (density - bed.density) * gravity)


def _coefficients(bed: Bed) -> tuple[float, float]:
    """Those of U and U^2 in Ergun's law."""
    solid, pores = 1 - bed.porosity, bed.porosity**3
    linear = ERGUN_VISCOUS * bed.viscosity * solid**2 / (pores * bed.diameter**2)
    return linear, ERGUN_INERTIAL * bed.density * solid / (pores * bed.diameter)
