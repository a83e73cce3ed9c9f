"""The velocity of the fluid at the formation face: given, or driven by the overbalance."""

from dataclasses import dataclass

from fdnet.case.case import Case, InvasionCase
from fdnet.scales.darcy import Losses, Path, carman_kozeny, ergun_inertia, radial, straight

INERTIA_WARNING = 0.05
"""Share of Darcy's velocity that inertia takes, from which "darcy" warns."""
USUAL_WELL = (0.108, 100.0)
"""Radius of a well of 8 1/2 inches and a drainage radius, m: the example that warnings give."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Velocity:
    """Velocity of the fluid along x.

    Attributes:
        permeability: m2, of the intact pack by Carman and Kozeny.
        darcy: m/s, flow rate over the whole cross-section.
        interstitial: m/s, mean velocity in the pores.
        pressure_gradient: Pa/m, that drives this flow through the pack.
        inertial_loss: share by which Ergun's inertial term lowers the velocity of Darcy's law at
            the same overbalance; where the velocity is given, at the gradient that Darcy's law
            needs for it.
    """

    permeability: float
    darcy: float
    interstitial: float
    pressure_gradient: float
    inertial_loss: float


def velocity_of(case: Case, porosity: float) -> Velocity:
    """The velocity that the case gives, or that of Darcy's or Ergun's law in the case."""
    permeability = carman_kozeny(porosity, case.grains.sauter_diameter_m)
    pack = _losses(case, porosity, permeability)
    given = case.fluid.velocity_m_s
    if given is not None:
        darcy = given * porosity
        loss = _inertial_loss(pack, Losses(viscous=pack.viscous).gradient(darcy), straight(1.0))
    else:
        path, pressure = path_of(case), case.fluid.overbalance_Pa
        way = _losses(case, porosity, _permeability_of_way(case, permeability))
        darcy = _by_law(case, way).velocity(pressure, path)
        loss = _inertial_loss(way, pressure, path)
    return Velocity(
        permeability=permeability,
        darcy=darcy,
        interstitial=darcy / porosity if given is None else given,
        pressure_gradient=_by_law(case, pack).gradient(darcy),
        inertial_loss=loss,
    )


def driving_pressure(case: Case, gradient: float) -> float:
    """Pressure, Pa, that drives the fluid: over its whole way, or over the specimen alone.

    The latter is the `gradient`, Pa/m, times the length, where the case gives a velocity.
    """
    given = case.fluid.velocity_m_s
    return case.fluid.overbalance_Pa if given is None else gradient * case.size_m[0]


def path_of(case: Case) -> Path:
    """The way on which the case's overbalance is lost: around the well, or along a plug."""
    if case.well is not None:
        return radial(case.well.radius_m, case.well.drainage_radius_m)
    given = case.fluid.darcy_length_m
    return straight(case.size_m[0] if given is None else given)


def _permeability_of_way(case: Case, pack: float) -> float:
    given = None if case.well is None else case.well.formation_permeability_m2
    return pack if given is None else given


def _losses(case: Case, porosity: float, permeability: float) -> Losses:
    """The losses with inertia, whatever law the case names."""
    diameter, density = case.grains.sauter_diameter_m, case.fluid.density_kg_m3
    return Losses(
        viscous=case.fluid.viscosity_Pa_s / permeability,
        inertial=ergun_inertia(permeability, porosity, diameter, density),
    )


def _by_law(case: Case, losses: Losses) -> Losses:
    return losses if case.fluid.darcy_law == "ergun" else Losses(viscous=losses.viscous)


def _inertial_loss(losses: Losses, pressure: float, path: Path) -> float:
    darcy = Losses(viscous=losses.viscous).velocity(pressure, path)
    return 1 - losses.velocity(pressure, path) / darcy


def velocity_warnings(case: InvasionCase, porosity: float, velocity: Velocity) -> list[str]:
    """Doubts about the velocity: nothing says what drives it, or inertia is left out."""
    return [*_plug_warning(case, porosity, velocity), *_inertia_warning(case, velocity)]


def _plug_warning(case: InvasionCase, porosity: float, velocity: Velocity) -> list[str]:
    """The whole overbalance is lost over the box because the case names no other way."""
    fluid = case.fluid
    if (case.well, fluid.velocity_m_s, fluid.darcy_length_m) != (None, None, None):
        return []
    radius, outer = USUAL_WELL
    losses = _by_law(case, _losses(case, porosity, velocity.permeability))
    at_well = losses.velocity(fluid.overbalance_Pa, radial(radius, outer)) / porosity
    gradient = fluid.overbalance_Pa / case.size_m[0] / 1e6
    return [
        f"the whole overbalance is lost over the {1e3 * case.size_m[0]:.3g} mm of the box "
        f"({gradient:.3g} MPa/m), which gives the fluid {velocity.interstitial:.3g} m/s; at the "
        f"face of a well of {1e3 * radius:.0f} mm with a drainage radius of {outer:.0f} m it "
        f"would be {at_well:.2g} m/s: add the table [well] with radius_mm and drainage_radius_m, "
        "or give fluid.darcy_length_mm for a plug, or fluid.velocity_m_s"
    ]


def _inertia_warning(case: InvasionCase, velocity: Velocity) -> list[str]:
    loss, fluid = velocity.inertial_loss, case.fluid
    if loss < INERTIA_WARNING or fluid.darcy_law == "ergun" or fluid.velocity_m_s is not None:
        return []
    return [
        f"the velocity of {velocity.interstitial:.3g} m/s is Darcy's; the fluid's inertia would "
        f"lower it by {100 * loss:.0f} % (Ergun): take fluid.darcy_law = 'ergun'"
    ]
