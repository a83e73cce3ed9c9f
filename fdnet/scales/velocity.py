"""The velocity of the fluid in closed form."""

from dataclasses import dataclass

from fdnet.case.case import Case


@dataclass(frozen=True, slots=True, kw_only=True)
class Velocity:
    """Velocity of the fluid along x.

    Attributes:
        permeability: m2, of the intact pack by Carman and Kozeny.
        darcy: m/s, flow rate over the whole cross-section.
        interstitial: m/s, mean velocity in the pores.
    """

    permeability: float
    darcy: float
    interstitial: float


def carman_kozeny(porosity: float, diameter: float) -> float:
    """k = d^2 phi^3 / (180 (1 - phi)^2), m2 (Carman 1937; 180 = 72 x tortuosity 2.5)."""
    return diameter**2 * porosity**3 / (180 * (1 - porosity) ** 2)


def velocity_of(case: Case, porosity: float) -> Velocity:
    """The velocity that the case gives, or that of Darcy's law."""
    permeability = carman_kozeny(porosity, case.grains.sauter_diameter_m)
    interstitial = case.fluid.velocity_m_s
    if interstitial is not None:
        darcy = interstitial * porosity
    else:
        given = case.fluid.darcy_length_m
        length = case.size_m[0] if given is None else given
        darcy = case.fluid.darcy_velocity(permeability, length)
        interstitial = darcy / porosity
    return Velocity(permeability=permeability, darcy=darcy, interstitial=interstitial)
