"""The time step of an invasion, the steps for which drag is held, and their bounds of stability.

`tau` is the relaxation time of the drag on the smallest fine, s.
"""

import math

from fdnet.case.case import Case
from fdnet.case.values import CONTACT_STEP_LIMIT
from fdnet.errors import CaseError
from fdnet.scales.forces.crowd import Crowd, drag_factor
from fdnet.scales.springs import Contact

HOLD_OVER_RELAXATION = 0.05
"""Share of tau for which the drag is held by default. At a share of 0.1 the error was measured to
be as large as the scatter between seeds."""
DRAG_WARNING, DRAG_LIMIT = 0.1, 1.0
"""Time for which drag is constant over tau: above the first value fdnet warns, above the second it
refuses the case."""
SAFE_FACTOR = 0.2
"""Time step over sqrt(m/k) that is accepted with any contact."""
RANDOM_CLOSE = 0.36
"""Porosity of random close packing of equal spheres (Scott and Kilgour 1969)."""
_ROUNDING = 1 + 1e-12


def relaxation_time(
    radius: float, density: float, viscosity: float, multiplier: float = 1.0
) -> float:
    """tau = m / (6 pi mu r M) = 2 r^2 rho / (9 mu M), s (Stokes 1851).

    For a sphere of `radius` m and `density` kg/m3 in a liquid of `viscosity` Pa s.
    """
    return 2 * radius**2 * density / (9 * viscosity * multiplier)


def contact_step(case: Case, contacts: dict[str, Contact]) -> float:
    """sqrt(m/k), s, of the lightest moving sphere and the stiffest of its contacts."""
    return min(contact.step_limit for contact in _moving(case, contacts))


def _moving(case: Case, contacts: dict[str, Contact]) -> list[Contact]:
    mobile = case.grains.motion == "mobile"
    return [contact for name, contact in contacts.items() if "fine" in name or mobile]


def largest_factor(case: Case, contacts: dict[str, Contact]) -> float:
    """Largest time step over sqrt(m/k) that stays stable in a deposit.

    LIGGGHTS damps with the velocity of half a step ago, so a mode of the squared frequency w^2 and
    the damping rate g is stable while w^2 dt^2 + 2 g dt < 4 (Jury's criterion of the leapfrog
    step). The fastest mode of equal spheres with 12 linear contacts each, a face-centred cubic
    lattice, has w^2 = 8 k/m and g = 8 c/m, c = 2 z sqrt(k m/2) for the damping ratio z. That gives
    f^2 + 2 sqrt(2) z f = 1/2 for the largest factor f. It is cut to `CONTACT_STEP_LIMIT`. Hertz
    contacts and rolling friction stiffen with the force; they keep `SAFE_FACTOR`.
    """
    if case.contact.model != "hooke" or case.contact.rolling_friction is not None:
        return SAFE_FACTOR
    damping = max(contact.damping_ratio for contact in _moving(case, contacts))
    stable = math.sqrt(2 * damping**2 + 0.5) - math.sqrt(2) * damping
    return max(SAFE_FACTOR, min(stable, CONTACT_STEP_LIMIT))


def time_step(case: Case, contacts: dict[str, Contact], tau: float) -> float:
    """The step, s: the one given, or `run.time_step_factor` of sqrt(m/k).

    With explicit drag the derived step is at most 0.1 tau. Raises CaseError when the step or its
    factor breaks the contact bound, or a given step exceeds tau while drag is explicit.
    """
    bound, given = contact_step(case, contacts), case.run.time_step_s
    largest = largest_factor(case, contacts)
    if given is None:
        if case.run.time_step_factor > largest:
            most = math.floor(largest * 1e3) / 1e3
            raise CaseError(
                f"run.time_step_factor: {case.run.time_step_factor:g} is above {largest:.3g}, the "
                "largest that is stable with the damping_ratio, contact.model and "
                f"contact.rolling_friction of this case; take at most {most:g}"
            )
        derived = case.run.time_step_factor * bound
        return derived if case.drag.scheme == "implicit" else min(derived, DRAG_WARNING * tau)
    if given > largest * bound * _ROUNDING:
        raise CaseError(
            f"run.time_step_s: {given:g} s is above the contact bound {largest:.3g} "
            f"sqrt(m/k) = {largest * bound:.3g} s; lower it or run.stiffness_N_m"
        )
    if case.drag.scheme != "implicit" and given > DRAG_LIMIT * tau * _ROUNDING:
        raise CaseError(
            f"run.time_step_s: {given:g} s is above the drag relaxation time {tau:.3g} s, "
            "explicit drag would overshoot; lower it, or take drag.scheme = 'implicit'"
        )
    return given


def hold_steps(case: Case, step: float, tau: float, longest: float) -> int:
    """Steps for which drag is held; 1 in every scheme but "held".

    `longest` is the time between checkpoints, s, which the held time must fit into. Raises
    CaseError when the refresh that the case gives is longer than tau or than that.
    """
    if case.drag.scheme != "held":
        return 1
    given, most = case.drag.refresh_steps, math.ceil(longest / step)
    if given is None:
        return max(1, min(math.floor(HOLD_OVER_RELAXATION * tau / step), most))
    if given * step > DRAG_LIMIT * tau * _ROUNDING:
        raise CaseError(
            f"drag.refresh_steps: {given} steps of {step:.3g} s exceed the drag relaxation time "
            f"{tau:.3g} s; at most {math.floor(DRAG_LIMIT * tau / step * _ROUNDING)} steps are "
            "stable"
        )
    if given > most:
        raise CaseError(
            f"drag.refresh_steps: {given} steps of {step:.3g} s are longer than the "
            f"{longest:.3g} s between checkpoints; expected at most {most}"
        )
    return given


def densest_factor(case: Case) -> float:
    """Factor on the drag of a fine in a random close packing of fines; 1 without a crowd."""
    if case.drag.crowd == "none":
        return 1.0
    crowd = Crowd(porosity=RANDOM_CLOSE)
    return float(drag_factor(crowd, gradient_apart=False)) / RANDOM_CLOSE


def drag_warnings(case: Case, held: float) -> list[str]:
    """What a drag that is constant for `held` tau costs in accuracy, in words.

    Empty up to 0.1 tau, with the implicit scheme up to 1 tau.
    """
    implicit = case.drag.scheme == "implicit"
    limit = DRAG_LIMIT if implicit else DRAG_WARNING
    if held <= limit * _ROUNDING:
        return []
    if implicit:
        return [
            f"implicit drag with a time step of {held:.3g} relaxation times (above {limit:g}): "
            "the difference of a fine's velocity to the fluid's turns into "
            f"{(2 - held) / (2 + held):.2g} of it each step instead of {math.exp(-held):.2g}; "
            "lower run.time_step_s to resolve it"
        ]
    remedy = "drag.refresh_steps or " if case.drag.scheme == "held" else ""
    return [
        f"drag is held for {held:.2g} of the relaxation time (above {limit:g}: a fine's velocity "
        f"is off by over 2 %): lower {remedy}run.time_step_s"
    ]
