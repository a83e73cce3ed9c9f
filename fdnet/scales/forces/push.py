"""What the fluid does to a single fine in the pack: drag and the force of the pressure gradient.

F = 6 pi mu M r f (u - v) + V (-grad p), with the velocities u of the fluid and v of the fine, its
radius r and volume V, the viscosity mu, the multiplier M, and f = 1 or Schiller and Naumann's
factor. This is "model A" (Zhou and others, J. Fluid Mech. 661 (2010) 482-510): the drag holds no
part of the gradient's force.
"""

import math
from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.scales.forces import reynolds


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

    `factor` is that of a fluid that is driven faster than it is (`fdnet.scales.drive`): `velocity`
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
