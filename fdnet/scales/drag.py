"""Laws of the fluid's forces on fines: drag in a crowd, at speed, in a throat; pressure gradient.

A run applies them in the deck (`_drag.in.j2`), or in `fdnet.run.fluid` where the drag is coupled.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdnet.case.case import Case, InvasionCase
from fdnet.errors import CaseError, Doubt

CARMAN_KOZENY, ERGUN_VISCOUS, ERGUN_INERTIAL = 180.0, 150.0, 1.75
"""Constants of the laws: viscous by Carman (1937), viscous and inertial by Ergun (1952)."""

# ------------------------------------------------------------------------------------------------
# Drag on a sphere in a crowd of others: Beetstra, van der Hoef and Kuipers.
#
# Monodisperse law F(phi, Re): R. Beetstra, M. A. van der Hoef, J. A. M. Kuipers, AIChE J. 53
# (2007) 489-501 (solid fractions 0.1 to 0.6, Reynolds numbers up to 1000). Mixtures: the same
# authors, Chem. Eng. Sci. 62 (2007) 246-255, and van der Hoef, Beetstra and Kuipers, J. Fluid
# Mech. 528 (2005) 233-254. Here every factor is over Stokes's drag 6 pi mu r u at the interstitial
# slip u, and Y F is the total force of the fluid, that of the pressure gradient in it
# (docs/physics.md). The published size factor Y has a third term, 0.064 phi y^3, a fit to
# mixtures; it breaks their sum, and the drag on a lone sphere by 6.4 %, and is left out.


Array = NDArray[np.float64]
MOST_CROWD_REYNOLDS = 1000.0
"""Reynolds number (superficial slip, Sauter mean diameter) up to which the law was fitted."""


def bed_factor(porosity: Array | float, reynolds: Array | float = 0.0) -> Array:
    """F of spheres of one size: drag without the gradient's force over 3 pi mu d U.

    F = 10 s / phi^2 + phi^2 (1 + 1.5 sqrt(s))
      + 0.413 Re / (24 phi^2) (1/phi + 3 s phi + 8.4 Re^-0.343) / (1 + 10^(3 s) Re^-(1 + 4 s)/2),
    phi the porosity, s = 1 - phi (Beetstra and others 2007, AIChE J. 53, 489). F is 1 for a lone
    sphere that creeps. Raises CaseError for a porosity outside of (0, 1] or a Reynolds number
    below 0 or above `MOST_CROWD_REYNOLDS`.
    """
    phi, moving = np.asarray(porosity, float), np.asarray(reynolds, float)
    most = f"0 to {MOST_CROWD_REYNOLDS:g}"
    for name, value, good, expected in (
        ("porosity", phi, (phi > 0) & (phi <= 1), "above 0 and at most 1"),
        ("Reynolds number", moving, (moving >= 0) & (moving <= MOST_CROWD_REYNOLDS), most),
    ):
        if not np.all(good):
            raise CaseError(
                f"drag in a crowd: {name} {value[~good].flat[0]:.4g}, expected {expected}, the "
                "range of the law; take another law of drag"
            )
    solid = 1 - phi
    creeping = 10 * solid / phi**2 + phi**2 * (1 + 1.5 * np.sqrt(solid))
    speed = np.where(moving > 0, moving, 1.0)
    shape = 1 / phi + 3 * solid * phi + 8.4 * speed**-0.343
    damped = 1 + 10 ** (3 * solid) * speed ** (-(1 + 4 * solid) / 2)
    return creeping + np.where(moving > 0, 0.413 * moving / (24 * phi**2) * shape / damped, 0.0)


def size_factor(porosity: Array | float, size_ratio: Array | float) -> Array:
    """Y = phi y + (1 - phi) y^2 of a sphere of size ratio y in a mixture.

    Summed over any mixture it gives the pressure drop of the bed of the Sauter mean diameter (van
    der Hoef and others 2005).
    """
    phi, ratio = np.asarray(porosity, float), np.asarray(size_ratio, float)
    return np.asarray(phi * ratio + (1 - phi) * ratio**2)


def crowd_drag_factor(
    porosity: Array | float, size_ratio: Array | float = 1.0, reynolds: Array | float = 0.0
) -> Array:
    """All that the fluid does to spheres over Stokes's drag on lone ones, 6 pi mu r u; (N,).

    u is the interstitial velocity of the fluid at the sphere. The factor is 1 for a lone sphere
    that creeps. Each argument is a number or one a sphere, (N,): the volume fraction of the fluid
    around it, its diameter over the Sauter mean diameter d around it, and
    rho_f phi |u - v| d / mu with the slip u - v. Raises CaseError as `bed_factor` does.
    """
    return size_factor(porosity, size_ratio) * bed_factor(porosity, reynolds)


# ------------------------------------------------------------------------------------------------
# Drag of a lone sphere at a finite Reynolds number, by Schiller and Naumann.
#
# L. Schiller and A. Naumann, Z. Ver. Dtsch. Ing. 77 (1933) 318-320. The Reynolds number is that of
# the slip: rho_f |u - v| 2r / mu.


COEFFICIENT, EXPONENT = 0.15, 0.687
MOST_REYNOLDS = 800.0  # Reynolds number up to which the correlation holds


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
    """Change of drag with slip over Stokes's, 1 + 0.15 (1 + 0.687) Re^0.687."""
    return 1 + COEFFICIENT * (1 + EXPONENT) * reynolds**EXPONENT


def balanced_slip(stokes_slip: float, reynolds: float) -> float:
    """Slip at which this drag is the Stokes drag of `stokes_slip`, in the unit of it.

    `reynolds` is the Reynolds number of `stokes_slip`. Newton's method on the convex function
    s f(Re s / s0) - s0, from s0 down, whose iterates fall to the only root.
    """
    slip = 1.0
    for _ in range(60):
        excess = slip * (1 + COEFFICIENT * (reynolds * slip) ** EXPONENT) - 1
        step = excess / slope_factor(reynolds * slip)
        slip -= step
        if math.isclose(slip, slip + step, rel_tol=1e-13):
            break
    return slip * stokes_slip


# ------------------------------------------------------------------------------------------------
# Drag on a sphere between the walls of a throat: on the axis of a straight tube.
#
# The problem is that of W. L. Haberman and R. M. Sayre, David Taylor Model Basin Report 1143
# (1958). Their approximate formula is up to 1.3 % too low at a ratio of 0.5 and 13 % at 0.7. The
# values here are solved anew by boundary collocation (tests/forces/test_forces.py does it again)
# and agree with the formula where that is good.


SOLVED = {
    0.0: 1.0,
    0.1: 1.254795,
    0.2: 1.634786,
    0.3: 2.228977,
    0.4: 3.215737,
    0.5: 4.995339,
    0.6: 8.613007,
    0.7: 17.474034,
    0.8: 47.620235,
    0.9: 266.433063,
}
"""By diameter of the sphere over that of the tube: force on a sphere at rest over 6 pi mu a V, V
the velocity of the undisturbed flow on the axis."""
MOST_RATIO = 0.9  # Ratio of diameters up to which the factor is known
_GAP_POWER = 2.5  # The factor grows with this power of 1 / (1 - ratio) in a narrow gap


def held_factor(ratio: float) -> float:
    """Force of the flow on a sphere at rest on the axis over 6 pi mu a V, V the axis velocity.

    `ratio` is that of the diameters of sphere and tube. By a cubic spline of the logarithm of
    K (1 - ratio)^2.5, exact to 3e-5. Raises CaseError outside of 0 to `MOST_RATIO`.
    """
    from scipy.interpolate import CubicSpline

    if not 0 <= ratio <= MOST_RATIO:
        raise CaseError(
            f"walls of a throat: a sphere of {ratio:.4g} of its diameter, expected 0 to "
            f"{MOST_RATIO:g}; a wider one closes the throat"
        )
    place = np.array([*SOLVED])
    smooth = np.log([*SOLVED.values()]) + _GAP_POWER * np.log1p(-place)
    return math.exp(float(CubicSpline(place, smooth)(ratio))) / (1 - ratio) ** _GAP_POWER


def throat_width(porosity: float, permeability: float) -> float:
    """Diameter, m, of straight tubes with the pack's porosity and permeability, sqrt(32 k / phi).

    By Poiseuille. In packs of grains of 0.5 mm at 0.40 it is 0.141 mm, the median throat 0.157 mm.
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
    """The forces on a fine in the pack, as the case asks for them."""

    coefficient: float  # 6 pi mu M, Pa s: Stokes's drag over radius and slip
    velocity: float  # of the fluid in the pores, m/s
    gradient: float  # fall of pressure with x that acts on fines, Pa/m; 0 where it is left out
    # Reynolds number over radius and slip, 2 rho_f / mu, s/m2; 0 where drag is Stokes's at any
    # speed
    reynolds_slope: float

    def gradient_force(self, radius: float) -> float:
        """V (-grad p), N, on a sphere of a radius in m."""
        return 4 / 3 * math.pi * radius**3 * self.gradient

    def force(self, radius: float) -> float:
        """Drag and gradient force, N, on a fine of `radius` m that is held."""
        factor = drag_factor(self.reynolds_slope * radius * self.velocity)
        return self.coefficient * radius * self.velocity * factor + self.gradient_force(radius)

    def drift(self, radius: float) -> float:
        """Velocity by which a free fine of `radius` m outruns the fluid, m/s: forces balance."""
        slip = self.gradient_force(radius) / (self.coefficient * radius)
        return balanced_slip(slip, self.reynolds_slope * radius * slip)

    def largest_slip(self, radius: float) -> float:
        """The larger of the slips of a fine that is held and of one that drifts freely, m/s."""
        return max(self.velocity, self.drift(radius))

    def relaxation_share(self, radius: float) -> float:
        """Relaxation time at the largest slip over that of Stokes's drag, at most 1."""
        return 1 / slope_factor(self.reynolds_slope * radius * self.largest_slip(radius))


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

    It gains speed by the gradient alone over `distance` m, up to its free drift.
    """
    gained = math.sqrt(push.velocity**2 + 2 * push.gradient / density * distance)
    return min(push.velocity + push.drift(radius), gained)


def pore_width(porosity: float, diameter: float) -> float:
    """Hydraulic diameter of the pores between spheres, 2 d phi / (3 (1 - phi)), m."""
    return 2 * diameter * porosity / (3 * (1 - porosity))


# ---- What is doubtful about the forces of the fluid on the fines, in words.
BRIDGING = 0.5
"""Largest fine over the width of the throats, above which geometry decides where fines stop."""

STOKES_REYNOLDS = 1.0  # Reynolds number above which Stokes's drag is more than 15 % too small

THROAT_FACTOR = 2.0  # Drag in a throat over that of a lone sphere, from which fdnet warns


def reynolds_warnings(
    case: InvasionCase, push: Push, reynolds: float, *, throat_ratio: float
) -> list[Doubt]:
    """Drag at the Reynolds number of the largest fine that is held; empty where Stokes's holds.

    `throat_ratio` is its diameter over that of the throats: six times the force moved no count of
    fines of 1/3 of a grain; of fines of 1/10 more passed (docs/physics.md, section 3).
    """
    if case.drag.inertia != "none":
        fastest = reynolds * push.largest_slip(case.fines.radius_range_m[1]) / push.velocity
        text = (
            f"particle Reynolds number {fastest:.3g} of a fine that drifts freely is outside the "
            f"range of Schiller and Naumann's drag (below {MOST_REYNOLDS:g})"
        )
        return [Doubt("reynolds-number", text)] if fastest > MOST_REYNOLDS else []
    if reynolds <= STOKES_REYNOLDS:
        return []
    text = f"particle Reynolds number {reynolds:.2g} is outside the range of Stokes drag (below 1)"
    if reynolds > MOST_REYNOLDS:
        text += f" and of Schiller and Naumann's (below {MOST_REYNOLDS:g})"
    else:
        matters = "little here: such wide fines stop where they no longer fit"
        if throat_ratio < BRIDGING:
            matters = "here: such narrow fines would go deeper with it"
        scheme = "" if case.drag.scheme == "held" else ' with drag.scheme = "held"'
        text += (
            f": the drag on a fine at rest is {drag_factor(reynolds):.3g} times as large by "
            f"Schiller and Naumann, which matters {matters}; set drag.inertia = "
            f'"schiller-naumann"{scheme}'
        )
    return [Doubt("reynolds-number", text)]


def throat_warnings(case: InvasionCase, ratio: float) -> list[Doubt]:
    """By how much the drag of a lone sphere is too small between the walls of a throat.

    `ratio` is the diameter of the largest fine over that of the throats. Where the flow follows
    the deposit a fine that stands feels the pressures of the network instead.
    """
    if case.drag.coupled:
        return []
    what = "it closes them, and there the pressure drop across it is its force, not this drag"
    if ratio <= MOST_RATIO:
        factor = held_factor(ratio)
        if factor < THROAT_FACTOR:
            return []
        what = f"at rest on the axis of one it feels {factor:.2g} times the drag of a lone sphere"
    text = (
        f"the largest fine ({2e3 * case.fines.radius_range_m[1]:.3g} mm) is {ratio:.2g} of the "
        f"width of the throats (tubes of the pack's permeability): {what}"
    )
    return [Doubt("walls-of-a-throat", text)]
