"""When an invasion ends, and how often it is looked at until then."""

import math
from dataclasses import dataclass

from fdnet.case.case import InvasionCase
from fdnet.scales.drive import Drive
from fdnet.scales.slab import Slab, arrival_time

ARRIVALS = 10
"""The default plug time lets at least this many fines of the undisturbed suspension arrive."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StopTimes:
    """Times of the stop rule, s of the simulation.

    Attributes:
        plug: the face counts as plugged when no fine has crossed it for this time.
        cap: the invasion ends at this time at the latest.
        chunk: time between two checkpoints.
    """

    plug: float
    cap: float
    chunk: float


def stop_times(case: InvasionCase, slab: Slab, drive: Drive, *, upstream: float) -> StopTimes:
    """The times that the case gives, or those that follow from the velocities.

    In a chunk the fluid passes about one grain diameter. A given duration is cut into equal
    chunks, so that it is met within one drag refresh a chunk. The times of a case are physical:
    they are divided by the factor of the drive. `upstream` is the velocity there, m/s, simulated.
    """
    run, clock = case.run, 1 / drive.factor
    passage = 2 * case.grains.mean_radius_m / drive.velocity
    plug = max(4 * passage, ARRIVALS * arrival_time(case, upstream))
    if run.plug_time_s is not None:
        plug = run.plug_time_s * clock
    cap = 3 * slab.length / upstream + 4 * plug + 2 * case.size_m[0] / drive.velocity
    given = run.duration_s or run.cap_s
    cap = cap if given is None else given * clock
    chunk = min(passage, plug / 4) if run.checkpoint_s is None else run.checkpoint_s * clock
    chunk = min(chunk, cap)
    if run.duration_s is not None:
        chunk = cap / math.ceil(cap / chunk)
    return StopTimes(plug=plug, cap=cap, chunk=chunk)


def chunk_refreshes(case: InvasionCase, chunk: float, refresh: float) -> int:
    """Drag refreshes of `refresh` s in a chunk: rounded where a duration must be met, else up."""
    refreshes = chunk / refresh
    return max(1, math.ceil(refreshes) if case.run.duration_s is None else round(refreshes))


def plug_warnings(case: InvasionCase, plug: float, drive: Drive, upstream: float) -> list[str]:
    """The plug time is too short for the suspension; empty when it is not.

    `plug` is in s and `upstream` in m/s, both as simulated.
    """
    if plug >= ARRIVALS * arrival_time(case, upstream):
        return []
    physical_ms = 1e3 * plug * drive.factor
    return [
        f"run.plug_time_ms: in {physical_ms:.3g} ms fewer than {ARRIVALS} fines of the suspension "
        "arrive at the face: the invasion may be called plugged too early"
    ]
