"""Whether LIGGGHTS's integrator holds fines in grooves from which the fluid should roll them.

LIGGGHTS adds to a contact's tangential spring the slip of half a step ago, but along the normal of
now. A fine that rolls around the neck of two grains turns about it, so each step adds a slip that
did not happen, of half a step times the fine's velocity times the angle turned. Both grains then
press the fine towards the neck. (The defect: Vyas and others, Comput. Phys. Commun. 310, 109524.)

The false force of a quarter turn is F' = (pi/4) k_t v dt, with the tangential stiffness k_t, the
step dt and the velocity v of the fine. The sticking number is F' over the push F of the fluid. The
fine is held when F' is not small beside F and friction exceeds tan(a) = sqrt((1 + q)^2 - 1), q the
radius of the fine over that of the grain: between steeper sides friction cannot hold it.
"""

import math
from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.scales.springs import Contact, sphere_mass

MOST_STICKING = 0.5
"""Sticking number up to which held fines were measured not to depend on the step or the stiffness
(docs/validation.md, section 10)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sticking:
    """The sticking of the fine that sticks most.

    Attributes:
        size_ratio: radius of the fine over that of the largest grain.
        friction: coefficient of friction of a fine against a grain.
        locking_friction: friction above which the groove of two touching grains can hold the fine.
        push: drag on the fine at rest over normal stiffness and radius, F / (k r).
        number: false tangential force of a quarter turn over the push.
    """

    size_ratio: float
    friction: float
    locking_friction: float
    push: float
    number: float

    @property
    def can_lock(self) -> bool:
        """Whether friction is large enough for the groove to hold the fine."""
        return self.friction > self.locking_friction


def locking_friction(size_ratio: float) -> float:
    """sqrt((1 + q)^2 - 1), slope of the sides of the groove between two touching grains."""
    return math.sqrt((1 + size_ratio) ** 2 - 1)


def false_force(shear_stiffness: float, velocity: float, step: float) -> float:
    """Tangential force, N, that the integrator adds in a quarter turn: (pi/4) k_t v dt.

    For a tangential stiffness of N/m, a fine's velocity of m/s and a time step of s.
    """
    return math.pi / 4 * shear_stiffness * velocity * step


def fall_velocity(push: float, mass: float, distance: float) -> float:
    """sqrt(2 F s / m), m/s: what a force of `push` N gives a mass of kg over a distance of m."""
    return math.sqrt(2 * push * distance / mass)


def sticking_of(case: InvasionCase, contact: Contact, velocity: float, step: float) -> Sticking:
    """The sticking of a case's fines on its grains.

    Args:
        case: the case.
        contact: of a grain and a fine.
        velocity: of the fluid, m/s; a fine rolls no faster.
        step: time step, s.
    """
    candidates = [
        _sticking(case, contact, radius, (velocity, step)) for radius in case.fines.radius_range_m
    ]
    return max(candidates, key=lambda one: (one.can_lock, one.number))


def _sticking(
    case: InvasionCase, contact: Contact, radius: float, motion: tuple[float, float]
) -> Sticking:
    velocity, step = motion
    grain = case.grains.radius_range_m[1]
    mass = sphere_mass(radius, case.fines.density_kg_m3)
    push = 6 * math.pi * case.fluid.viscosity_Pa_s * case.drag.multiplier * radius * velocity
    slope = locking_friction(radius / grain)
    rolling = min(velocity, fall_velocity(push, mass, slope * grain))
    return Sticking(
        size_ratio=radius / grain,
        friction=contact.friction,
        locking_friction=slope,
        push=push / (contact.normal_stiffness * radius),
        number=false_force(contact.shear_stiffness, rolling, step) / push,
    )


def sticking_step(case: InvasionCase, contact: Contact, velocity: float) -> float:
    """The longest step, s, of which no fine sticks; infinite where friction cannot hold one."""
    unit = sticking_of(case, contact, velocity, 1.0)
    return MOST_STICKING / unit.number if unit.can_lock else math.inf


def sticking_warnings(sticking: Sticking) -> list[str]:
    """Fines that the integrator may hold, in words; empty when it holds none."""
    if not sticking.can_lock or sticking.number <= MOST_STICKING * (1 + 1e-9):
        return []
    excess = sticking.number / MOST_STICKING
    return [
        f"fines of 1/{1 / sticking.size_ratio:.3g} of a grain with friction {sticking.friction:g} "
        f"(above {sticking.locking_friction:.2g}) and a push F/(k r) of {sticking.push:.1e} may "
        "be held between grains by LIGGGHTS's integrator alone: its false force is "
        f"{sticking.number:.2g} of the push (above {MOST_STICKING:g}); shorten the step "
        f"{excess:.2g} times (run.time_step_factor, or leave it out), or soften the contacts at "
        f"the same factor {excess**2:.2g} times (run.stiffness_N_m), as far as overlaps allow"
    ]
