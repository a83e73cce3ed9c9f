"""Flow through a pack in closed form: Carman and Kozeny, Darcy, Ergun, straight and radial."""

import math
from dataclasses import dataclass

from fdnet.scales.forces.bed import CARMAN_KOZENY, ERGUN_INERTIAL, ERGUN_VISCOUS

ERGUN_RATIO = ERGUN_INERTIAL / ERGUN_VISCOUS
"""Loss by inertia over viscous loss, for each rho q d / (mu (1 - phi)) (Ergun 1952)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """The way on which the overbalance is lost, as the lengths that count for each loss.

    Attributes:
        viscous: m, the integral of q(s) / q over the way; q is the velocity at the face.
        inertial: m, the integral of (q(s) / q)^2.
    """

    viscous: float
    inertial: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Losses:
    """Pressure gradient viscous q + inertial q^2 of a Darcy velocity q (Forchheimer 1901).

    Attributes:
        viscous: Pa s/m2, viscosity over permeability.
        inertial: Pa s2/m3; 0 by Darcy's law.
    """

    viscous: float
    inertial: float = 0.0

    def gradient(self, velocity: float) -> float:
        """Pressure gradient, Pa/m, of a Darcy velocity in m/s."""
        return self.viscous * velocity + self.inertial * velocity**2

    def velocity(self, pressure: float, path: Path) -> float:
        """Darcy velocity at the face, m/s, that loses `pressure` Pa on the way.

        It is the positive root of a q + b q^2 = p, written as 2 p / (a + sqrt(a^2 + 4 b p)), which
        holds for b = 0 as well.
        """
        first, second = self.viscous * path.viscous, self.inertial * path.inertial
        return 2 * pressure / (first + math.sqrt(first**2 + 4 * second * pressure))


def carman_kozeny(porosity: float, diameter: float) -> float:
    """k = d^2 phi^3 / (180 (1 - phi)^2), m2 (Carman 1937; 180 = 72 x tortuosity 2.5)."""
    return diameter**2 * porosity**3 / (CARMAN_KOZENY * (1 - porosity) ** 2)


def ergun_inertia(permeability: float, porosity: float, diameter: float, density: float) -> float:
    """Inertial coefficient in Pa s2/m3: Ergun's share of the viscous loss of this permeability.

    For a bed of `permeability` m2 and `diameter` m of its grains, and a fluid of `density` kg/m3.
    Ergun's own bed has the permeability d^2 phi^3 / (150 (1 - phi)^2). The ratio of his two losses
    is kept, so that the viscous one is that of the permeability in use.
    """
    return ERGUN_RATIO * density * diameter / (permeability * (1 - porosity))


def straight(length: float) -> Path:
    """A plug of `length` m: the velocity is the same all along."""
    return Path(viscous=length, inertial=length)


def radial(radius: float, outer: float) -> Path:
    """From a well of `radius` m out to `outer` m: the velocity falls with one over the distance.

    viscous = r_w ln(r_e / r_w), inertial = r_w^2 (1 / r_w - 1 / r_e).
    """
    return Path(
        viscous=radius * math.log(outer / radius), inertial=radius**2 * (1 / radius - 1 / outer)
    )
