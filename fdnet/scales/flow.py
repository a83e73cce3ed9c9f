"""How fast the fluid moves: Carman and Kozeny, Darcy, Ergun, straight and radial; the drive."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from fdnet.case.case import Case, InvasionCase
from fdnet.errors import CaseError, Doubt
from fdnet.scales.drag import CARMAN_KOZENY, ERGUN_INERTIAL, ERGUN_VISCOUS

ERGUN_RATIO = ERGUN_INERTIAL / ERGUN_VISCOUS
"""Loss by inertia over viscous loss, for each rho q d / (mu (1 - phi)) (Ergun 1952)."""


class Path(NamedTuple):
    """The way on which the overbalance is lost, as the lengths that count for each loss."""

    viscous: float  # m, the integral of q(s) / q over the way; q is the velocity at the face
    inertial: float  # m, the integral of (q(s) / q)^2


@dataclass(frozen=True, slots=True, kw_only=True)
class Losses:
    """Pressure gradient viscous q + inertial q^2 of a Darcy velocity q (Forchheimer 1901)."""

    viscous: float  # Pa s/m2, viscosity over permeability
    inertial: float = 0.0  # Pa s2/m3; 0 by Darcy's law

    def gradient(self, velocity: float) -> float:
        """Pressure gradient, Pa/m, of a Darcy velocity in m/s."""
        return self.viscous * velocity + self.inertial * velocity**2

    def velocity(self, pressure: float, path: Path) -> float:
        """Darcy velocity at the face, m/s, that loses `pressure` Pa on the way.

        The positive root of a q + b q^2 = p as 2 p / (a + sqrt(a^2 + 4 b p)), also for b = 0.
        """
        first, second = self.viscous * path.viscous, self.inertial * path.inertial
        return 2 * pressure / (first + math.sqrt(first**2 + 4 * second * pressure))


def carman_kozeny(porosity: float, diameter: float) -> float:
    """k = d^2 phi^3 / (180 (1 - phi)^2), m2 (Carman 1937; 180 = 72 x tortuosity 2.5)."""
    return diameter**2 * porosity**3 / (CARMAN_KOZENY * (1 - porosity) ** 2)


def ergun_inertia(permeability: float, porosity: float, diameter: float, density: float) -> float:
    """Inertial coefficient in Pa s2/m3: Ergun's share of the viscous loss of this permeability.

    `permeability` m2, `diameter` m of the grains, `density` kg/m3 of the fluid. The ratio of his
    two losses is kept, so that the viscous one is that of the permeability in use.
    """
    return ERGUN_RATIO * density * diameter / (permeability * (1 - porosity))


def straight(length: float) -> Path:
    """A plug of `length` m: the velocity is the same all along."""
    return Path(viscous=length, inertial=length)


def radial(radius: float, outer: float) -> Path:
    """From a well of `radius` m out to `outer` m: r_w ln(r_e / r_w), r_w^2 (1 / r_w - 1 / r_e)."""
    return Path(
        viscous=radius * math.log(outer / radius), inertial=radius**2 * (1 / radius - 1 / outer)
    )


# ---- The velocity of the fluid at the formation face: given, or driven by the overbalance.
INERTIA_WARNING = 0.05  # Share of Darcy's velocity that inertia takes, from which "darcy" warns
USUAL_WELL = (0.108, 100.0)
"""Radius of a well of 8 1/2 inches and a drainage radius, m: the example that warnings give."""


class Velocity(NamedTuple):
    """Velocity of the fluid along x."""

    permeability: float  # m2, of the intact pack by Carman and Kozeny
    darcy: float  # m/s, flow rate over the whole cross-section
    interstitial: float  # m/s, mean velocity in the pores
    pressure_gradient: float  # Pa/m, that drives this flow through the pack
    # share by which Ergun's inertial term lowers the velocity of Darcy's law at the same pressure
    inertial_loss: float


def velocity_of(case: Case, porosity: float) -> Velocity:
    """The velocity that the case gives, or that of Darcy's or Ergun's law in the case."""
    permeability = carman_kozeny(porosity, case.grains.sauter_diameter_m)
    pack, given = _losses(case, porosity, permeability), case.fluid.velocity_m_s
    if given is not None:
        way, path, darcy = pack, straight(1.0), given * porosity
        pressure = Losses(viscous=pack.viscous).gradient(darcy)
    else:
        around = None if case.well is None else case.well.formation_permeability_m2
        way = _losses(case, porosity, permeability if around is None else around)
        path, pressure = path_of(case), case.fluid.overbalance_Pa
        darcy = _by_law(case, way).velocity(pressure, path)
    without_inertia = Losses(viscous=way.viscous).velocity(pressure, path)
    return Velocity(
        permeability=permeability,
        darcy=darcy,
        interstitial=darcy / porosity if given is None else given,
        pressure_gradient=_by_law(case, pack).gradient(darcy),
        inertial_loss=1 - way.velocity(pressure, path) / without_inertia,
    )


def darcy_through(case: Case, porosity: float, permeability: float) -> float:
    """Darcy velocity at the face, m/s, that the overbalance drives through a specimen.

    `permeability` m2 is that of the specimen itself, and of the rest of the way too unless the
    case gives that of the formation.
    """
    given = None if case.well is None else case.well.formation_permeability_m2
    own, around = (
        _by_law(case, _losses(case, porosity, one))
        for one in (permeability, given or permeability)
    )
    path, length = path_of(case), case.size_m[0]
    viscous = min(length, path.viscous) / path.viscous
    inertial = min(length, path.inertial) / path.inertial
    mean = Losses(
        viscous=own.viscous * viscous + around.viscous * (1 - viscous),
        inertial=own.inertial * inertial + around.inertial * (1 - inertial),
    )
    return mean.velocity(case.fluid.overbalance_Pa, path)


def driving_pressure(case: Case, gradient: float) -> float:
    """The overbalance, Pa; where the case gives a velocity, `gradient` Pa/m times the length."""
    given = case.fluid.velocity_m_s
    return case.fluid.overbalance_Pa if given is None else gradient * case.size_m[0]


def path_of(case: Case) -> Path:
    """The way on which the case's overbalance is lost: around the well, or along a plug."""
    if case.well is not None:
        return radial(case.well.radius_m, case.well.drainage_radius_m)
    given = case.fluid.darcy_length_m
    return straight(case.size_m[0] if given is None else given)


def _losses(case: Case, porosity: float, permeability: float) -> Losses:
    """The losses with inertia, whatever law the case names."""
    diameter, density = case.grains.sauter_diameter_m, case.fluid.density_kg_m3
    return Losses(
        viscous=case.fluid.viscosity_Pa_s / permeability,
        inertial=ergun_inertia(permeability, porosity, diameter, density),
    )


def _by_law(case: Case, losses: Losses) -> Losses:
    return losses if case.fluid.darcy_law == "ergun" else Losses(viscous=losses.viscous)


def velocity_warnings(case: InvasionCase, porosity: float, velocity: Velocity) -> Iterator[Doubt]:
    """Doubts about the velocity: nothing says what drives it, or inertia is left out."""
    fluid = case.fluid
    if (case.well, fluid.velocity_m_s, fluid.darcy_length_m) == (None, None, None):
        radius, outer = USUAL_WELL
        losses = _by_law(case, _losses(case, porosity, velocity.permeability))
        at_well = losses.velocity(fluid.overbalance_Pa, radial(radius, outer)) / porosity
        gradient = fluid.overbalance_Pa / case.size_m[0] / 1e6
        yield Doubt(
            "overbalance-over-the-box",
            f"the whole overbalance is lost over the {1e3 * case.size_m[0]:.3g} mm of the box "
            f"({gradient:.3g} MPa/m), which gives the fluid {velocity.interstitial:.3g} m/s; at "
            f"the face of a well of {1e3 * radius:.0f} mm it would be {at_well:.2g} m/s: add the "
            "table [well] with radius_mm, or give fluid.darcy_length_mm for a plug, or "
            "fluid.velocity_m_s",
        )
    loss, darcy = velocity.inertial_loss, fluid.darcy_law == "darcy"
    if loss >= INERTIA_WARNING and darcy and fluid.velocity_m_s is None:
        yield Doubt(
            "inertia-of-the-fluid",
            f"the velocity of {velocity.interstitial:.3g} m/s is Darcy's; the fluid's inertia "
            f"would lower it by {100 * loss:.0f} % (Ergun): take fluid.darcy_law = 'ergun'",
        )


# ------------------------------------------------------------------------------------------------
# Fines that are driven faster than the fluid moves them, with the same ratios of forces.
#
# Where the inertia of a fine does not matter, its way depends on the ratios of the forces alone:
# drag, pressure gradient, weight. A simulation may then multiply the fluid's velocity, and with it
# every force, by one factor s = u_DEM / u, and every fine goes the same way in 1 / s of the time.
# That is so well below an impact Stokes number of 1, the share of its radius within which a fine
# stops.


AUTO_STOKES = 0.1  # Impact Stokes number to which "auto" drives the largest fine
STOKES_LIMIT = 0.3
"""Impact Stokes number from which the inertia of fines may matter: no case is driven above it."""
_ROUNDING = 1 + 1e-9


class Drive(NamedTuple):
    """How fast the simulated fluid moves."""

    velocity: float  # m/s, in the pores
    # velocity over the fluid's own: the factor on all forces on a fine, and physical time over
    # simulated time
    factor: float
    impact_stokes: float  # impact Stokes number of the largest fine, free in this fluid


def impact_stokes(relaxation_time: float, velocity: float, radius: float) -> float:
    """tau v / r = m v / (6 pi mu r^2): the way on which drag stops a sphere, over its radius.

    Source: Joseph and others, J. Fluid Mech. 433, 329 (2001).
    """
    return relaxation_time * velocity / radius


def drive_of(case: InvasionCase, velocity: float, relaxation_time: float, free: float) -> Drive:
    """The velocity that the case asks for, or the fluid's own `velocity` in the pores, m/s.

    "auto" never drives slower, and not where fines cohere: cohesion is not scaled with the forces.
    `relaxation_time` s is that of the largest fine, `free` its velocity in this fluid, m/s.

    Raises CaseError for a given velocity with an impact Stokes number above `STOKES_LIMIT`, as
    simulated or in the fluid itself.
    """
    asked, driven = case.drag.drive_velocity_m_s, velocity
    own = impact_stokes(relaxation_time, free, case.fines.radius_range_m[1])
    if asked == "auto" and case.contact.cohesion_J_m3 is None:
        driven = velocity * max(1.0, AUTO_STOKES / own)
    elif not isinstance(asked, str):
        driven = asked
    stokes = own * (driven / velocity)
    if not isinstance(asked, str) and max(own, stokes) > STOKES_LIMIT * _ROUNDING:
        do = "leave the key out"
        if own <= STOKES_LIMIT * _ROUNDING:
            do = f"expected at most {driven * STOKES_LIMIT / stokes:.2g} m/s"
        raise CaseError(
            f"drag.drive_velocity_m_s: at {driven:g} m/s the impact Stokes number of the fines is "
            f"{stokes:.2g}, in the fluid itself {own:.2g} (limit {STOKES_LIMIT:g}): their inertia "
            f"would matter; {do}"
        )
    return Drive(velocity=driven, factor=driven / velocity, impact_stokes=stokes)


# ------------------------------------------------------------------------------------------------
# The filter press of the API (RP 13I): 30 minutes at 100 psi through 45.8 cm2 of paper.
#
# The solids c of the mud make a cake of the porosity p and the thickness h = V c / (1 - p - c), V
# being the filtrate per area. Darcy's law through it, V dV = k dp / mu (1 - p - c) / c dt, gives
# V^2 = 2 k dp t (1 - p - c) / (mu c). The paper resists nothing, and there is no spurt.


API_PRESSURE, API_TIME, API_AREA = 690e3, 1800.0, 45.8e-4  # Pa, s and m2


def api_filtrate(
    permeability: float, *, viscosity: float, solids: float, porosity: float
) -> float:
    """Filtrate, m3, of the API's press by a cake of this `permeability` m2 and `porosity`.

    `viscosity` Pa s is that of the filtrate, `solids` the share of the mud by volume.
    """
    room = 2.0 * API_PRESSURE * API_TIME * (1.0 - porosity - solids) / (viscosity * solids)
    return API_AREA * math.sqrt(permeability * room)


def api_permeability(
    filtrate: float, *, viscosity: float, solids: float, porosity: float
) -> float:
    """Permeability, m2, of the cake that lets `filtrate` m3 through the API's press."""
    one = api_filtrate(1.0, viscosity=viscosity, solids=solids, porosity=porosity)
    return (filtrate / one) ** 2
