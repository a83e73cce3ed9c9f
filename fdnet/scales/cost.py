"""What a run will cost, from rates measured on one core, and the limit on it."""

import math
from dataclasses import dataclass

from fdnet.case.case import Case
from fdnet.errors import CaseError
from fdnet.scales.grain_pack import (
    PACK_RELAX_STEPS,
    PACK_STAGE_STEPS,
    PACK_STAGES,
    grain_count,
)
from fdnet.scales.scales import InvasionScales, Scales
from fdnet.scales.time_step import contact_step

STEP_SECONDS = 2.0e-6
"""Seconds of one step with nothing to do."""
FIXED_GRAIN_SECONDS, MOVING_GRAIN_SECONDS = 1.3e-8, 1.0e-7
"""Seconds of one grain in one step."""
FINE_SECONDS = {"every_step": 1.8e-7, "held": 1.5e-7, "implicit": 1.5e-7, "viscous": 1.45e-7}
"""Seconds of one fine in one step, contacts and drag, by `drag.scheme`."""
BYTES_PER_SPHERE = 600


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a run is expected to take on one core, within a factor of about 3.

    Attributes:
        pack_seconds: s, of one attempt at the pack.
        invade_seconds: s, of the invasion; 0 when the case has no fines.
        steps: of the invasion.
    """

    pack_seconds: float
    invade_seconds: float = 0.0
    steps: float = 0.0


def cost_of(case: Case, scales: Scales) -> Cost:
    """The cost of a case.

    An invasion without a duration is expected to last until the slab is fed, the fluid has passed
    through the box once and one plug time is over, or until its cap.
    """
    pack = (
        grain_count(case)
        * (PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS)
        * MOVING_GRAIN_SECONDS
    )
    if not isinstance(scales, InvasionScales):
        return Cost(pack_seconds=pack)
    steps = math.ceil(_expected_duration(case, scales) / scales.time_step)
    grain = MOVING_GRAIN_SECONDS if case.grains.motion == "mobile" else FIXED_GRAIN_SECONDS
    fines = scales.supplied_count * FINE_SECONDS[case.drag.scheme]
    return Cost(
        pack_seconds=pack,
        invade_seconds=steps * (STEP_SECONDS + grain_count(case) * grain + fines),
        steps=steps,
    )


def _expected_duration(case: Case, scales: InvasionScales) -> float:
    if case.run.duration_s is not None:
        return scales.cap_time
    passage = case.size_m[0] / scales.drive_velocity
    feeding = scales.slab_length / scales.upstream_velocity
    return min(scales.cap_time, feeding + passage + scales.plug_time)


def memory_bytes(case: Case, scales: Scales) -> float:
    """Memory of LIGGGHTS."""
    fines = scales.supplied_count if isinstance(scales, InvasionScales) else 0
    return 9e6 + BYTES_PER_SPHERE * (grain_count(case) + fines)


def over_limit(case: Case, scales: Scales, *, pack: bool = True, invade: bool = True) -> str:
    """Why the stages named do not fit into `run.max_hours`, in words; empty when they fit."""
    cost = cost_of(case, scales)
    seconds = pack * cost.pack_seconds + invade * cost.invade_seconds
    if seconds <= 3600 * case.run.max_hours:
        return ""
    refusal = (
        f"run.max_hours: {case.run.max_hours:g} h, but this case is expected to take "
        f"{_hours(seconds)} on one core"
    )
    mostly_pack = not invade or cost.pack_seconds > cost.invade_seconds
    if mostly_pack or not isinstance(scales, InvasionScales):
        return (
            f"{refusal}, most of it packing {grain_count(case):.3g} grains: take a smaller box, "
            "or raise run.max_hours"
        )
    reason, remedy = _step_reason(case, scales)
    return (
        f"{refusal}: {cost.steps:.3g} steps of {scales.time_step:.3g} s ({reason}) with "
        f"{scales.supplied_count} fines and {grain_count(case)} {case.grains.motion} grains: "
        f"{remedy}, supply fewer fines, shorten run.duration_ms or run.cap_ms, or raise "
        "run.max_hours"
    )


def refuse_long(case: Case, scales: Scales, *, pack: bool, invade: bool) -> None:
    """Raises CaseError when the stages named do not fit into `run.max_hours`."""
    refusal = over_limit(case, scales, pack=pack, invade=invade)
    if refusal:
        raise CaseError(refusal)


def _hours(seconds: float) -> str:
    years = f" ({seconds / (365.25 * 86400):.2g} years)" if seconds > 365.25 * 86400 else ""
    return f"{seconds / 3600:.3g} h{years}"


def _step_reason(case: Case, scales: InvasionScales) -> tuple[str, str]:
    """What sets the time step, and what would make it longer."""
    if case.run.time_step_s is not None:
        return "as given", "raise run.time_step_s"
    if scales.time_step < 0.999 * case.run.time_step_factor * contact_step(case, scales.contacts):
        return "a tenth of the drag relaxation time", "take drag.scheme = 'implicit'"
    stiffness = max(contact.normal_stiffness for contact in scales.contacts.values())
    return (
        f"set by contacts of {stiffness:.3g} N/m",
        "lower run.stiffness_N_m (the time goes with its square root)",
    )
