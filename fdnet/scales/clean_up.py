"""The scales of a clean-up: the flow of the invasion turned back, at the drawdown.

The drawdown is lost on the way on which the overbalance was, so the fluid's velocity follows from
it by the same law. The forces are those of the invasion at that velocity.
"""

import math
from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.case.clean_up import CleanUp
from fdnet.errors import CaseError
from fdnet.scales.scales import InvasionScales, scales_of

MOST_PASSAGES = 20
"""Passages of the fluid through the specimen after which a clean-up ends by default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackFlow:
    """A clean-up in numbers. Times and velocities are those of the simulation.

    Attributes:
        case: the case of the invasion with the drawdown for the overbalance.
        scales: of that case; its velocities are positive.
        choices: the table [clean_up].
        chunks: most chunks of `scales.checkpoint_steps` steps.
        quiet_chunks: chunks without a fine that comes out which end it; 0 where it has a duration.
    """

    case: InvasionCase
    scales: InvasionScales
    choices: CleanUp
    chunks: int
    quiet_chunks: int

    @property
    def step(self) -> float:
        """The time step, s."""
        return self.scales.time_step


def back_flow(case: InvasionCase) -> BackFlow:
    """The flow of the clean-up of a case.

    Raises CaseError when the case has no table [clean_up], or as `scales_of` does at the drawdown.
    """
    choices = case.clean_up
    if choices is None:
        raise CaseError(f"case {case.name}: has no table [clean_up]; add it with drawdown_MPa")
    turned = _at_drawdown(case, choices)
    try:
        scales = scales_of(turned)
    except CaseError as error:
        given = 1e-6 * choices.drawdown_Pa
        raise CaseError(f"clean_up.drawdown_MPa: {given:g}: {error}") from error
    chunk = scales.checkpoint_steps * scales.time_step * scales.force_factor
    passage = case.size_m[0] / scales.drive_velocity * scales.force_factor
    longest = choices.duration_s or choices.cap_s or MOST_PASSAGES * passage
    chunks = longest / chunk
    timed = choices.duration_s is not None
    return BackFlow(
        case=turned,
        scales=scales,
        choices=choices,
        chunks=max(1, round(chunks) if timed else math.ceil(chunks - 1e-9)),
        quiet_chunks=0 if timed else max(1, math.ceil((choices.quiet_s or passage) / chunk)),
    )


def _at_drawdown(case: InvasionCase, choices: CleanUp) -> InvasionCase:
    """The case with the drawdown for its overbalance, driven by the same factor as before.

    What its table [run] says of the length of the invasion is that of the clean-up.
    """
    fluid, run = choices.fluid_of(case.fluid), choices.run_of(case.run)
    undriven = case.drag.model_copy(update={"drive_velocity_m_s": None})
    turned = case.model_copy(update={"fluid": fluid, "run": run, "drag": undriven})
    if case.drag.drive_velocity_m_s is None:
        return turned
    driven = scales_of(turned).interstitial_velocity * scales_of(case).force_factor
    drag = case.drag.model_copy(update={"drive_velocity_m_s": driven})
    return turned.model_copy(update={"drag": drag})
