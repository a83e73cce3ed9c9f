"""The time step of an invasion and the steps for which drag is held, with the bounds that keep both stable."""

import math

from fdnet.case.case import Case
from fdnet.case.values import CONTACT_STEP_LIMIT
from fdnet.errors import CaseError
from fdnet.scales.springs import Contact

HOLD_OVER_RELAXATION = 0.05
"""Share of the drag relaxation time for which the drag is held by default (held 0.1 tau: at the seed scatter)."""
DRAG_WARNING, DRAG_LIMIT = 0.1, 1.0
"""Explicit or held drag over its relaxation time: above the first it warns, above the second it is refused."""
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
    mobile = case.grains.motion == "mobile"
    return min(c.step_limit for name, c in contacts.items() if "fine" in name or mobile)


def time_step(case: Case, contacts: dict[str, Contact], tau: float) -> float:
    """The step, s: given, or `time_step_factor` of sqrt(m/k), and with explicit drag at most 0.1 tau.

    Raises CaseError when a given step breaks the contact bound, or exceeds tau while drag is explicit.
    """
    bound, given = contact_step(case, contacts), case.run.time_step_s
    if given is None:
        derived = case.run.time_step_factor * bound
        return derived if case.drag.scheme == "implicit" else min(derived, DRAG_WARNING * tau)
    if given > CONTACT_STEP_LIMIT * bound * _ROUNDING:
        raise CaseError(
            f"run.time_step_s: {given:g} s is above the contact bound {CONTACT_STEP_LIMIT:g} sqrt(m/k) = "
            f"{CONTACT_STEP_LIMIT * bound:.3g} s; lower it or run.stiffness_N_m"
        )
    if case.drag.scheme != "implicit" and given > DRAG_LIMIT * tau * _ROUNDING:
        raise CaseError(
            f"run.time_step_s: {given:g} s is above the drag relaxation time {tau:.3g} s, explicit drag would "
            "overshoot; lower it, or take drag.scheme = 'implicit'"
        )
    return given


def hold_steps(case: Case, step: float, tau: float, longest: float) -> int:
    """Steps for which drag is held; 1 in every scheme but "held". `longest` (s) is the chunk it must fit into.

    Raises CaseError when the given refresh is longer than tau or than the chunk.
    """
    if case.drag.scheme != "held":
        return 1
    given, most = case.drag.refresh_steps, math.ceil(longest / step)
    if given is None:
        return max(1, min(math.floor(HOLD_OVER_RELAXATION * tau / step), most))
    if given * step > DRAG_LIMIT * tau * _ROUNDING:
        raise CaseError(
            f"drag.refresh_steps: {given} steps of {step:.3g} s exceed the drag relaxation time {tau:.3g} s; at most "
            f"{math.floor(DRAG_LIMIT * tau / step * _ROUNDING)} steps are stable"
        )
    if given > most:
        raise CaseError(
            f"drag.refresh_steps: {given} steps of {step:.3g} s are longer than the {longest:.3g} s between "
            f"checkpoints; expected at most {most}"
        )
    return given


def drag_warnings(case: Case, held: float) -> list[str]:
    """What a drag interval of `held` relaxation times costs in accuracy; empty up to 0.1 (implicit: 1)."""
    limit = DRAG_LIMIT if case.drag.scheme == "implicit" else DRAG_WARNING
    if held <= limit * _ROUNDING:
        return []
    if case.drag.scheme == "implicit":
        return [
            f"implicit drag with a time step of {held:.3g} relaxation times (above {limit:g}): what a fine's velocity "
            f"is off the fluid's turns into {(2 - held) / (2 + held):.2g} of it each step instead of "
            f"{math.exp(-held):.2g}; lower run.time_step_s to resolve it"
        ]
    return [
        f"drag is held for {held:.2g} of the relaxation time (above {limit:g}: a fine's velocity is off by over "
        "2 %): lower "
        + (
            "drag.refresh_steps or run.time_step_s"
            if case.drag.scheme == "held"
            else "run.time_step_s"
        )
    ]
