"""Forces of the fluid on fines.

Pressure drop and fluidisation of a bed of equal spheres (Ergun, Chem. Eng. Prog. 48, 1952).

All functions take SI units. U is the superficial velocity, phi the porosity of the bed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdnet.case.case import Case, InvasionCase
from fdnet.errors import CaseError
from fdnet.scales import drag as reynolds

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


# ------------------------------------------------------------------------------------------------
# Drag on a sphere in a crowd of others: Beetstra, van der Hoef and Kuipers.
#
# Monodisperse law F(phi, Re): R. Beetstra, M. A. van der Hoef, J. A. M. Kuipers, AIChE J. 53
# (2007) 489-501, from lattice-Boltzmann flow through random arrays of spheres (solid fractions 0.1
# to 0.6, Reynolds numbers up to 1000). Mixtures: the same authors, Chem. Eng. Sci. 62 (2007)
# 246-255, and van der Hoef, Beetstra and Kuipers, J. Fluid Mech. 528 (2005) 233-254.
#
# In their papers F is the drag without the force of the pressure gradient ("model A"), over
# Stokes's drag 3 pi mu d U at the superficial velocity U = phi u of the slip u. The total force of
# the fluid is F / phi: with it a bed of solid fraction s obeys Carman and Kozeny's law, 10 s /
# phi^3. Here the porosity is phi, and every factor is over Stokes's drag 6 pi mu r u at the
# interstitial slip u. So
#
# - the drag part is phi Y F where V (-grad p) acts as a force of its own,
# - the total force, where no gradient acts apart, is Y F,
#
# with the size factor Y, which is 1 for spheres of one size.


Array = NDArray[np.float64]
CUBIC_TERM = 0.064
"""Coefficient of the published third term of the size factor, a fit to mixtures."""
MOST_CROWD_REYNOLDS = 1000.0
"""Reynolds number (superficial slip, Sauter mean diameter) up to which the law was fitted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crowd:
    """What surrounds a sphere. Each value is a number or an array (N,) with one entry a sphere.

    Attributes:
        porosity: volume fraction of the fluid around it, above 0 and at most 1.
        size_ratio: its diameter over the Sauter mean diameter of all spheres around it.
        reynolds: rho_f phi |u - v| d / mu with the slip u - v and the Sauter mean diameter d.
    """

    porosity: Array | float
    size_ratio: Array | float = 1.0
    reynolds: Array | float = 0.0


def bed_factor(porosity: Array | float, reynolds: Array | float = 0.0) -> Array:
    """F of spheres of one size: drag without the gradient's force over 3 pi mu d U.

    F = 10 s / phi^2 + phi^2 (1 + 1.5 sqrt(s))
      + 0.413 Re / (24 phi^2) (1/phi + 3 s phi + 8.4 Re^-0.343) / (1 + 10^(3 s) Re^-(1 + 4 s)/2),
    phi the porosity, s = 1 - phi (Beetstra and others 2007, AIChE J. 53, 489). F is 1 for a lone
    sphere that creeps. Raises CaseError for a porosity outside of (0, 1] or a Reynolds number
    below 0 or above `MOST_CROWD_REYNOLDS`.
    """
    phi, moving = np.asarray(porosity, float), np.asarray(reynolds, float)
    _refuse_outside(phi, moving)
    solid = 1 - phi
    creeping = 10 * solid / phi**2 + phi**2 * (1 + 1.5 * np.sqrt(solid))
    speed = np.where(moving > 0, moving, 1.0)
    shape = 1 / phi + 3 * solid * phi + 8.4 * speed**-0.343
    damped = 1 + 10 ** (3 * solid) * speed ** (-(1 + 4 * solid) / 2)
    return creeping + np.where(moving > 0, 0.413 * moving / (24 * phi**2) * shape / damped, 0.0)


def _refuse_outside(porosity: Array, reynolds: Array) -> None:
    for name, value, good, expected in (
        ("porosity", porosity, (porosity > 0) & (porosity <= 1), "above 0 and at most 1"),
        (
            "Reynolds number",
            reynolds,
            (reynolds >= 0) & (reynolds <= MOST_CROWD_REYNOLDS),
            f"0 to {MOST_CROWD_REYNOLDS:g}, the range of the law",
        ),
    ):
        if not np.all(good):
            raise CaseError(
                f"drag in a crowd: {name} {value[~good].flat[0]:.4g}, expected {expected}; take "
                "another law of drag"
            )


def size_factor(
    porosity: Array | float, size_ratio: Array | float, *, cubic: float = 0.0
) -> Array:
    """Y = phi y + (1 - phi) y^2 + c phi y^3 of a sphere of size ratio y in a mixture.

    The first two terms are derived (van der Hoef and others 2005): summed over any mixture they
    give the pressure drop of the bed of the Sauter mean diameter. The published law adds a fitted
    term with c = `CUBIC_TERM`. It breaks that sum, and for a lone sphere, by 6.4 %; c is 0 here
    unless it is given.
    """
    phi, ratio = np.asarray(porosity, float), np.asarray(size_ratio, float)
    return np.asarray(phi * ratio + (1 - phi) * ratio**2 + cubic * phi * ratio**3)


def crowd_drag_factor(crowd: Crowd, *, gradient_apart: bool) -> Array:
    """Drag coefficient C over that of a lone sphere, 6 pi mu r, for the force C (u - v).

    u is the interstitial velocity of the fluid at the sphere.

    Args:
        crowd: what surrounds each sphere.
        gradient_apart: True where V (-grad p) acts on the sphere as a force of its own (model A);
            False where this force is all that the fluid does to it.

    Returns:
        The factor, (N,); 1 for a lone sphere that creeps. Raises CaseError as `bed_factor` does.
    """
    total = size_factor(crowd.porosity, crowd.size_ratio) * bed_factor(
        crowd.porosity, crowd.reynolds
    )
    return total * np.asarray(crowd.porosity, float) if gradient_apart else total


# ------------------------------------------------------------------------------------------------
# Drag of a lone sphere at a finite Reynolds number, by Schiller and Naumann.
#
# L. Schiller and A. Naumann, Z. Ver. Dtsch. Ing. 77 (1933) 318-320. The Reynolds number is that of
# the slip: rho_f |u - v| 2r / mu.


COEFFICIENT, EXPONENT = 0.15, 0.687
MOST_REYNOLDS = 800.0
"""Reynolds number up to which the correlation holds."""


def drag_factor(reynolds: float) -> float:
    """Drag over Stokes's, 1 + 0.15 Re^0.687. Raises CaseError outside of 0 to `MOST_REYNOLDS`."""
    if not 0 <= reynolds <= MOST_REYNOLDS:
        raise CaseError(
            f"particle Reynolds number {reynolds:.4g}: the drag of Schiller and Naumann holds "
            f"from 0 to {MOST_REYNOLDS:g}; check fluid.velocity_m_s, fluid.viscosity_cP and "
            'fines.radius_mm, or set drag.inertia = "none"'
        )
    return 1 + COEFFICIENT * reynolds**EXPONENT


def slope_factor(reynolds: float) -> float:
    """Change of drag with slip over Stokes's, 1 + 0.15 (1 + 0.687) Re^0.687.

    It shortens the time in which a fine relaxes, and so the longest stable explicit step.
    """
    return 1 + COEFFICIENT * (1 + EXPONENT) * reynolds**EXPONENT


def balanced_slip(stokes_slip: float, reynolds: float) -> float:
    """Slip at which this drag is the Stokes drag of `stokes_slip`, in the unit of it.

    `reynolds` is the Reynolds number of `stokes_slip`. Newton's method on the convex function
    s f(Re s / s0) - s0, from s0 down, whose iterates fall to the only root.
    """
    slip = 1.0
    for _ in range(_MOST_ITERATIONS):
        excess = slip * (1 + COEFFICIENT * (reynolds * slip) ** EXPONENT) - 1
        step = excess / slope_factor(reynolds * slip)
        slip -= step
        if math.isclose(slip, slip + step, rel_tol=1e-13):
            break
    return slip * stokes_slip


_MOST_ITERATIONS = 60


# ------------------------------------------------------------------------------------------------
# Drag on a sphere between the walls of a throat: on the axis of a straight tube.
#
# The problem is that of W. L. Haberman and R. M. Sayre, David Taylor Model Basin Report 1143
# (1958). Their approximate formula is up to 1.3 % too low at a ratio of 0.5 and 13 % at 0.7. The
# values here are solved anew by boundary collocation (tests/forces/test_throat.py does it again)
# and agree with the formula where that is good. All factors are over 6 pi mu a V.


SOLVED = (
    (0.0, 1.0, 1.0),
    (0.1, 1.254795, 1.263214),
    (0.2, 1.634786, 1.679479),
    (0.3, 2.228977, 2.370095),
    (0.4, 3.215737, 3.591373),
    (0.5, 4.995339, 5.947374),
    (0.6, 8.613007, 11.091897),
    (0.7, 17.474034, 24.675984),
    (0.8, 47.620235, 74.669966),
    (0.9, 266.433063, 469.224391),
)
"""Diameter of the sphere over that of the tube; force on a sphere at rest, V the velocity of the
undisturbed flow on the axis; force on a sphere that moves with V through a liquid at rest."""
MOST_RATIO = SOLVED[-1][0]
"""Ratio of diameters up to which the factors are known."""
_GAP_POWER = 2.5
"""Both factors grow with this power of 1 / (1 - ratio) in a narrow gap."""


def held_factor(ratio: float) -> float:
    """Force of the flow on a sphere at rest on the axis over 6 pi mu a V, V the axis velocity.

    `ratio` is that of the diameters of sphere and tube. Raises CaseError outside of 0 to
    `MOST_RATIO`.
    """
    return _factor(ratio, 1)


def moving_factor(ratio: float) -> float:
    """Drag on a sphere that moves along the axis through a liquid at rest, over 6 pi mu a V.

    Arguments and errors are those of `held_factor`.
    """
    return _factor(ratio, 2)


def free_speed(ratio: float) -> float:
    """Speed of a sphere that the flow carries freely along the axis, over the axis velocity.

    Arguments and errors are those of `held_factor`.
    """
    return held_factor(ratio) / moving_factor(ratio)


def _factor(ratio: float, column: int) -> float:
    """By a cubic spline of the logarithm of K (1 - ratio)^2.5, exact to 3e-5."""
    from scipy.interpolate import CubicSpline

    if not 0 <= ratio <= MOST_RATIO:
        raise CaseError(
            f"walls of a throat: a sphere of {ratio:.4g} of its diameter, expected 0 to "
            f"{MOST_RATIO:g}; a wider one closes the throat"
        )
    table = np.array(SOLVED)
    smooth = np.log(table[:, column]) + _GAP_POWER * np.log1p(-table[:, 0])
    return math.exp(float(CubicSpline(table[:, 0], smooth)(ratio))) / (1 - ratio) ** _GAP_POWER


def throat_width(porosity: float, permeability: float) -> float:
    """Diameter, m, of straight tubes with the pack's porosity and permeability, sqrt(32 k / phi).

    By Poiseuille's law. It stands for the median throat: in packs of equal grains of 0.5 mm at a
    porosity of 0.40 it is 0.141 mm, and the median of the throats' inscribed circles 0.157 mm.
    """
    return math.sqrt(32 * permeability / porosity)


# ------------------------------------------------------------------------------------------------
# What the fluid does to a single fine in the pack: drag and the force of the pressure gradient.
#
# F = 6 pi mu M r f (u - v) + V (-grad p), with the velocities u of the fluid and v of the fine,
# its radius r and volume V, the viscosity mu, the multiplier M, and f = 1 or Schiller and
# Naumann's factor. This is "model A" (Zhou and others, J. Fluid Mech. 661 (2010) 482-510): the
# drag holds no part of the gradient's force.


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """The forces on a fine in the pack, as the case asks for them.

    Attributes:
        coefficient: 6 pi mu M, Pa s: Stokes's drag over radius and slip.
        velocity: of the fluid in the pores, m/s.
        gradient: fall of pressure with x that acts on fines, Pa/m; 0 where it is left out.
        reynolds_slope: Reynolds number over radius and slip, 2 rho_f / mu, s/m2; 0 where drag is
            Stokes's at any speed.
    """

    coefficient: float
    velocity: float
    gradient: float
    reynolds_slope: float

    def gradient_force(self, radius: float) -> float:
        """V (-grad p), N, on a sphere of a radius in m."""
        return 4 / 3 * math.pi * radius**3 * self.gradient

    def force(self, radius: float) -> float:
        """Drag and gradient force, N, on a fine of `radius` m that is held."""
        factor = reynolds.drag_factor(self.reynolds_slope * radius * self.velocity)
        return self.coefficient * radius * self.velocity * factor + self.gradient_force(radius)

    def drift(self, radius: float) -> float:
        """Velocity by which a free fine of `radius` m outruns the fluid, m/s.

        It is the slip at which drag balances the force of the gradient.
        """
        slip = self.gradient_force(radius) / (self.coefficient * radius)
        return reynolds.balanced_slip(slip, self.reynolds_slope * radius * slip)

    def largest_slip(self, radius: float) -> float:
        """The larger of the slips of a fine that is held and of one that drifts freely, m/s."""
        return max(self.velocity, self.drift(radius))

    def relaxation_share(self, radius: float) -> float:
        """Relaxation time at the largest slip over that of Stokes's drag, at most 1."""
        return 1 / reynolds.slope_factor(self.reynolds_slope * radius * self.largest_slip(radius))


def push_of(case: Case, velocity: float, gradient: float, *, factor: float = 1.0) -> Push:
    """The push at a fluid `velocity` of m/s and a fall of pressure of `gradient` Pa/m.

    `factor` is that of a fluid that is driven faster than it is (`fdnet.scales.flow`): `velocity`
    has it already, the gradient gets it, and Reynolds numbers stay those of the fluid itself.
    """
    slope = 2 * case.fluid.density_kg_m3 / case.fluid.viscosity_Pa_s / factor
    return Push(
        coefficient=case.fluid.stokes_coefficient_Pa_s * case.drag.multiplier,
        velocity=velocity,
        gradient=gradient * factor if case.drag.pressure_gradient else 0.0,
        reynolds_slope=0.0 if case.drag.inertia == "none" else slope,
    )


def arrival_velocity(push: Push, radius: float, density: float, distance: float) -> float:
    """Velocity, m/s, with which a fine of `density` kg/m3 meets a grain at the most.

    It starts with the fluid and gains speed by the gradient alone over `distance` m, but drag
    leaves it no faster than its free drift.
    """
    gained = math.sqrt(push.velocity**2 + 2 * push.gradient / density * distance)
    return min(push.velocity + push.drift(radius), gained)


def pore_width(porosity: float, diameter: float) -> float:
    """Hydraulic diameter of the pores between spheres, 2 d phi / (3 (1 - phi)), m.

    Four times the volume of the pores over their surface; d is the Sauter diameter, m.
    """
    return 2 * diameter * porosity / (3 * (1 - porosity))


# ------------------------------------------------------------------------------------------------
# What is doubtful about the forces of the fluid on the fines, in words.


BRIDGING = 0.5
"""Largest fine over the width of the throats, above which geometry decides where fines stop."""

STOKES_REYNOLDS = 1.0
"""Reynolds number above which Stokes's drag is more than 15 % too small."""

THROAT_FACTOR = 2.0
"""Drag in a throat over that of a lone sphere, from which fdnet warns."""


def reynolds_warnings(
    case: InvasionCase, push: Push, reynolds: float, *, throat_ratio: float
) -> list[str]:
    """Drag at the Reynolds number of the largest fine that is held; empty where Stokes's holds.

    `throat_ratio` is its diameter over that of the throats: it says whether the drag matters.
    """
    if case.drag.inertia != "none":
        return _beyond(case, push, reynolds)
    if reynolds <= STOKES_REYNOLDS:
        return []
    outside = (
        f"particle Reynolds number {reynolds:.2g} is outside the range of Stokes drag (below 1)"
    )
    if reynolds > MOST_REYNOLDS:
        return [f"{outside} and of Schiller and Naumann's (below {MOST_REYNOLDS:g})"]
    remedy = 'set drag.inertia = "schiller-naumann"'
    if case.drag.scheme != "held" and not case.drag.coupled:
        remedy += ' with drag.scheme = "held"'
    return [
        f"{outside}: the drag on a fine at rest is {drag_factor(reynolds):.3g} times as large by "
        f"Schiller and Naumann, which matters {_matters(throat_ratio)}; {remedy}"
    ]


def _matters(throat_ratio: float) -> str:
    """Whether a stronger push changes what the fines do, as measured (docs/physics.md, section 3).

    Six times the force moved no count of fines of 1/3 of a grain beyond chance; of fines of 1/10
    more passed, and they went deeper.
    """
    if throat_ratio >= BRIDGING:
        return "little here: such wide fines stop where they no longer fit"
    return "here: such narrow fines would go deeper with it"


def _beyond(case: InvasionCase, push: Push, reynolds: float) -> list[str]:
    """A fine drifts so fast that its slip is beyond the correlation.

    A case in which the slip of a fine at rest is beyond it is refused (`drag_factor`).
    """
    fastest = reynolds * push.largest_slip(case.fines.radius_range_m[1]) / push.velocity
    if fastest <= MOST_REYNOLDS:
        return []
    return [
        f"particle Reynolds number {fastest:.3g} of a fine that drifts freely is outside the "
        f"range of Schiller and Naumann's drag (below {MOST_REYNOLDS:g})"
    ]


def throat_warnings(case: InvasionCase, ratio: float) -> list[str]:
    """By how much the drag of a lone sphere is too small between the walls of a throat.

    `ratio` is the diameter of the largest fine over that of the throats. Where the flow follows
    the deposit a fine that stands feels the pressures of the network instead.
    """
    if case.drag.field == "network":
        return []
    diameter = 2e3 * case.fines.radius_range_m[1]
    who = f"the largest fine ({diameter:.3g} mm) is {ratio:.2g} of the width of the throats"
    if ratio > MOST_RATIO:
        return [
            f"{who} (tubes of the pack's permeability): it closes them, and there the pressure "
            "drop across it is its force, not the drag of a lone sphere"
        ]
    factor = held_factor(ratio)
    if factor < THROAT_FACTOR:
        return []
    return [
        f"{who} (tubes of the pack's permeability): at rest on the axis of one it feels "
        f"{factor:.2g} times the drag of a lone sphere, by which the drag is too small there"
    ]
