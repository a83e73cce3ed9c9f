"""Whether fines lock in the groove between two grains, from which the fluid should roll them.

A fine that rolls around the neck of two grains sits in a groove whose sides have the slope
t = sqrt((1 + q)^2 - 1), q the radius of the fine over that of the grain. Friction f can hold it
there only if f > t. Two things press it in. Both need a stiff tangential spring:

- The spring itself. The normal springs throw back a fine that ran into the groove, until the
  tangential ones hold it. Where both balance, the fine is still pressed in if k_t / k_n > f t
  (derived in docs/physics.md, section 1).
- LIGGGHTS's integrator. It adds the slip of half a step ago along the normal of now, so a fine
  that turns about the neck gains a slip that did not happen (Vyas and others, Comput. Phys.
  Commun. 310, 109524). In a quarter turn the force of it is F' = (pi/4) k_t v dt, with the time
  step dt and the velocity v of the fine.
"""

import math
from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.scales.forces.push import Push
from fdnet.scales.springs import Contact, sphere_mass

MOST_FALSE_FORCE = 0.5
"""False force of the integrator over the push of the fluid, up to which no fine was seen to be
held by it (docs/validation.md, section 10)."""
_ROUNDING = 1 + 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Sticking:
    """How far a fine may lock between two touching grains.

    Attributes:
        size_ratio: radius of the fine over that of the largest grain.
        friction: coefficient of friction of a fine against a grain.
        slope: of the sides of the groove; friction below it holds no fine.
        shear_ratio: tangential over normal contact stiffness, force over overlap.
        push: force of the fluid on the fine at rest over normal stiffness and radius, F / (k r).
        false_force: tangential force that the integrator adds in a quarter turn, over the push.
        linear: whether the tangential stiffness can be chosen (Hertz-Mindlin's cannot).
    """

    size_ratio: float
    friction: float
    slope: float
    shear_ratio: float
    push: float
    false_force: float
    linear: bool = True

    @property
    def by_springs(self) -> bool:
        """Whether the tangential springs can lock the fine."""
        return self.friction > self.slope and self.shear_ratio > self.friction * self.slope

    @property
    def by_integrator(self) -> bool:
        """Whether the integrator may press the fine in."""
        too_large = self.false_force > MOST_FALSE_FORCE * _ROUNDING
        return self.friction > self.slope and too_large


def groove_slope(size_ratio: float) -> float:
    """sqrt((1 + q)^2 - 1), slope of the sides of the groove between two touching grains."""
    return math.sqrt((1 + size_ratio) ** 2 - 1)


def false_force(shear_stiffness: float, velocity: float, step: float) -> float:
    """Tangential force, N, that the integrator adds in a quarter turn: (pi/4) k_t v dt.

    For a tangential stiffness in N/m, the velocity of the fine in m/s and a time step in s.
    """
    return math.pi / 4 * shear_stiffness * velocity * step


def fall_velocity(push: float, mass: float, distance: float) -> float:
    """sqrt(2 F s / m), m/s: what a force of `push` N gives a mass in kg over a distance in m."""
    return math.sqrt(2 * push * distance / mass)


def sticking_of(case: InvasionCase, contact: Contact, push: Push, step: float) -> Sticking:
    """Of the smallest fine between two of the largest grains, which locks most easily.

    Args:
        case: the case.
        contact: of a grain and a fine.
        push: of the fluid; a fine rolls no faster than it drifts freely.
        step: time step, s.
    """
    radius, grain = case.fines.radius_range_m[0], case.grains.radius_range_m[1]
    mass = sphere_mass(radius, min(one.density for one in case.fines.components))
    force, slope = push.force(radius), groove_slope(radius / grain)
    drift = push.velocity + push.drift(radius)
    rolling = min(drift, fall_velocity(force, mass, slope * grain))
    return Sticking(
        size_ratio=radius / grain,
        friction=contact.friction,
        slope=slope,
        shear_ratio=contact.shear_stiffness / contact.normal_stiffness,
        push=force / (contact.normal_stiffness * radius),
        false_force=false_force(contact.shear_stiffness, rolling, step) / force,
        linear=contact.elastic is None,
    )


def sticking_warnings(sticking: Sticking) -> list[str]:
    """Fines that may lock between grains, in words; empty when none do."""
    if not (sticking.by_springs or sticking.by_integrator):
        return []
    who = (
        f"fines of 1/{1 / sticking.size_ratio:.3g} of a grain may lock between grains: friction "
        f"{sticking.friction:g} (above the slope {sticking.slope:.2g} of the groove), "
        f"push F/(k r) {sticking.push:.1e}"
    )
    if sticking.by_springs:
        most = sticking.friction * sticking.slope
        remedy = (
            "leave out grains.shear_stiffness_N_m and fines.shear_stiffness_N_m"
            if sticking.linear
            else "take contact.model = 'hooke'"
        )
        return [
            f"{who}, tangential over normal stiffness {sticking.shear_ratio:.2g} (above "
            f"{most:.2g}): {remedy}, or lower friction to {sticking.slope:.2g}"
        ]
    excess = sticking.false_force / MOST_FALSE_FORCE
    return [
        f"{who}, false force of the integrator over the push {sticking.false_force:.2g} (above "
        f"{MOST_FALSE_FORCE:g}): divide run.time_step_factor by {excess:.2g}, or "
        f"run.stiffness_N_m by {excess**2:.2g} as far as overlaps allow, or lower friction to "
        f"{sticking.slope:.2g}"
    ]
