"""What a run will cost, from rates measured on one core (+-factor 2)."""

from fdnet.case import Case
from fdnet.scales import PACK_RELAX_STEPS, PACK_STAGE_STEPS, PACK_STAGES, Scales, grain_count

FINE_STEPS_PER_SECOND = {"every_step": 5.0e6, "held": 8.0e6}
"""Fines times steps per second on one core with fixed grains (measured, +-50 %)."""
GRAIN_STEPS_PER_SECOND = 5.0e6
BYTES_PER_SPHERE = 600


def run_seconds(case: Case, scales: Scales) -> float:
    """Seconds of the invasion: fines times steps over a rate."""
    if case.fines is None:
        return 0.0
    expected = min(scales.cap_time, scales.slab_length / scales.upstream_velocity + scales.plug_time)
    steps = expected / scales.time_step
    rate = FINE_STEPS_PER_SECOND["held" if scales.hold_steps > 1 else "every_step"]
    mobile = grain_count(case) if case.grains.motion == "mobile" else 0
    return steps * (scales.supplied_count / rate + mobile / GRAIN_STEPS_PER_SECOND)


def pack_seconds(case: Case) -> float:
    """Seconds of one attempt at the pack."""
    steps = PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS
    return grain_count(case) * steps / GRAIN_STEPS_PER_SECOND


def memory_bytes(case: Case, scales: Scales) -> float:
    """Memory of LIGGGHTS."""
    return 9e6 + BYTES_PER_SPHERE * (grain_count(case) + scales.supplied_count)
