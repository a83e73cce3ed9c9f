"""What a run will cost, from rates measured on one core, and the limit on it."""

import math
from dataclasses import dataclass

from fdnet.case.case import Case, InvasionCase
from fdnet.names import MOST_SPHERES
from fdnet.scales.clock import TAKEN_SOLIDS, contact_step, present_share, spoken_time, step_factor
from fdnet.scales.drag import BRIDGING
from fdnet.scales.pack import PACK_RELAX_STEPS, PACK_STAGE_STEPS, PACK_STAGES, grain_count
from fdnet.scales.scales import InvasionScales, Scales

STEP_SECONDS = 2.0e-6  # Seconds of one step with nothing to do
FIXED_GRAIN_SECONDS, MOVING_GRAIN_SECONDS = 1.3e-8, 1.0e-7  # Seconds of one grain in one step
FINE_SECONDS = {"held": 1.4e-7, "implicit": 1.4e-7, "viscous": 1.35e-7}
"""Seconds of one fine in one step, contacts and drag, by `drag.scheme`."""
CACHED_FINES = 8000
"""Fines n cost (1 + n / (n + CACHED_FINES)) times as much each: their neighbours leave the
cache."""
UPDATE_SECONDS = (0.03, 9.0e-5)
"""Seconds of one update of the flow that follows the deposit: at least, and for each grain and
fine."""
BESIDE_CLASSES = 5
"""Steps beside finer classes over those without: springs are stiffened for what presses the
spheres."""
CLASSES_PLUG = 0.25
"""What a volume of finer classes plugs over what it would as spheres: about 1 where these are as
coarse as the throats (filtrates of docs/validation/cuts.csv). A mud with 83 % of finer solids had
no plug when 1,198 spheres had come, so that it is at most 0.33 there (by a former law)."""
FALLING_RATE = 0.6  # Mean rate over the first, where the deposit slows the flow
WAITING, TRICKLING = 2.0, 1.4
"""Plug times that the face is watched when what plugs it has come; passages of the fluid through
the box in which single fines still enter, where these count (`run.plug_rate` = 0)."""
START_SECONDS, REPORT_SECONDS, SPHERE_SECONDS = 3.0, 8.0, 6.0e-4
"""Seconds of the Python half: to start, for the report, for each sphere that is analysed."""
REPORT_BYTES, NETWORK_BYTES = 6.0e8, 8.0e3
"""Memory of the report, and of the network for each of up to `MOST_SPHERES` spheres."""

CLASS_SECONDS = 1.3e-3
"""s for each grain of the fast model, in 26 to 43 steps (docs/validation/class_costs.csv)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cost:
    """What a run is expected to take on one core, within a factor of about 2."""

    pack_seconds: float  # s, of one attempt at the pack
    invade_seconds: float = 0.0  # s, of the invasion; 0 when the case has no fines
    update_seconds: float = 0.0  # s of these, for forces that fdnet computes while LIGGGHTS waits
    analyse_seconds: float = 0.0  # s, of analysis and report
    steps: float = 0.0  # of the invasion
    duration: float = 0.0  # s of the simulation, of the invasion

    @property
    def seconds(self) -> float:
        """Of the whole run."""
        return self.pack_seconds + self.invade_seconds + self.analyse_seconds


def cost_of(case: Case, scales: Scales) -> Cost:
    """The cost of a case; how long its invasion lasts is that of `expected_duration`."""
    grains = grain_count(case)
    pack = grains * (PACK_STAGES * PACK_STAGE_STEPS + PACK_RELAX_STEPS) * MOVING_GRAIN_SECONDS
    python = START_SECONDS + REPORT_SECONDS
    if not isinstance(case, InvasionCase) or not isinstance(scales, InvasionScales):
        return Cost(pack_seconds=pack, analyse_seconds=python + grains * SPHERE_SECONDS)
    if case.by_classes:
        fast, known = grains * CLASS_SECONDS, python + grains * SPHERE_SECONDS
        return Cost(pack_seconds=pack, invade_seconds=fast, analyse_seconds=known)
    duration, drag = expected_duration(case, scales), case.drag
    steps = math.ceil(duration / scales.time_step)
    feeding = scales.slab_length / scales.upstream_velocity
    fines = scales.supplied_count * present_share(case, duration=duration, feeding=feeding)
    updates = 0.0
    if drag.coupled:  # the travel of the fluid over that of one update
        way = FALLING_RATE * scales.drive_velocity * duration
        count = way / (drag.travel_diameters * 2 * case.fines.radius_range_m[0])
        least, each = UPDATE_SECONDS
        updates = count * (least + each * (grains + fines))
    grain = MOVING_GRAIN_SECONDS if case.grains.motion == "mobile" else FIXED_GRAIN_SECONDS
    fine = FINE_SECONDS[drag.scheme] * (1 + fines / (fines + CACHED_FINES))
    steps *= BESIDE_CLASSES if case.with_classes else 1
    return Cost(
        pack_seconds=pack,
        invade_seconds=steps * (STEP_SECONDS + grains * grain + fines * fine) + updates,
        update_seconds=updates,
        analyse_seconds=python + (grains + fines) * SPHERE_SECONDS,
        steps=steps,
        duration=duration,
    )


def expected_duration(case: InvasionCase, scales: InvasionScales) -> float:
    """How long the invasion is expected to last, s of the simulation.

    It is the duration that is given. Else what plugs the face must come (`TAKEN_SOLIDS`), or the
    whole slab where the fines are too small to bridge, and then the face is watched for some
    plug times. At a constant pressure the flow slows down, and with it all that comes. Finer
    classes count by `CLASSES_PLUG`.
    """
    if case.run.duration_s is not None:
        return scales.cap_time
    feeding = scales.slab_length / scales.upstream_velocity
    plugging = case.fines.placed_fraction
    plugging += CLASSES_PLUG * (case.solids_fraction - plugging)
    share = TAKEN_SOLIDS * case.grains.curve.size_at(0.5) / (scales.slab_length * plugging)
    if scales.throat_ratio < BRIDGING:
        share = 1.0
        feeding += case.size_m[0] / scales.drive_velocity
    slower = 1 / FALLING_RATE if case.drag.coupled else 1.0
    trickle = 0.0 if case.run.plug_rate > 0 else TRICKLING
    watched = max(WAITING * scales.plug_time, trickle * case.size_m[0] / scales.drive_velocity)
    return min(scales.cap_time, slower * feeding * min(1.0, share) + watched)


def expected_fines(case: Case, scales: Scales) -> float:
    """Spheres supplied; of mud that comes until the stop rule, those that come until then."""
    if not isinstance(scales, InvasionScales) or not isinstance(case, InvasionCase):
        return 0
    if case.by_classes:
        return 0
    come = expected_duration(case, scales) * scales.upstream_velocity / scales.slab_length
    return scales.supplied_count * (min(1.0, come) if case.fines.endless else 1)


def peak_memory(case: Case, scales: Scales) -> float:
    """Memory of the largest process of a run, bytes: that of the report, or of the network.

    The network of all spheres takes most, up to the number that it is used for.
    """
    spheres = grain_count(case) + expected_fines(case, scales)
    return REPORT_BYTES + NETWORK_BYTES * min(spheres, MOST_SPHERES)


def over_limit(case: Case, scales: Scales, *, pack: bool = True, invade: bool = True) -> str:
    """Why the stages named do not fit into `run.max_hours`, in words; empty when they fit."""
    cost = cost_of(case, scales)
    seconds = pack * cost.pack_seconds + invade * cost.invade_seconds
    if seconds <= 3600 * case.run.max_hours:
        return ""
    refusal = (
        f"run.max_hours: {case.run.max_hours:g} h, but this case is expected to take "
        f"{spoken_time(seconds)} on one core"
    )
    grains = grain_count(case)
    mostly_pack = not invade or cost.pack_seconds > cost.invade_seconds
    if mostly_pack or not isinstance(scales, InvasionScales):
        return (
            f"{refusal}, most of it packing {grains:.3g} grains: take a smaller box, or raise "
            "run.max_hours"
        )
    sound = step_factor(case, scales.contacts) * contact_step(case, scales.contacts)
    reason = f"set by contacts of {scales.stiffness:.3g} N/m"
    remedy = "lower run.stiffness_N_m (the time goes with its square root)"
    if case.run.time_step_s is not None:
        reason, remedy = "as given", "raise run.time_step_s"
    elif scales.time_step < 0.999 * sound:
        reason, remedy = "a tenth of the drag relaxation time", "take drag.scheme = 'implicit'"
    return (
        f"{refusal}: {cost.steps:.3g} steps of {scales.time_step:.3g} s ({reason}) with "
        f"{expected_fines(case, scales):.0f} fines and {grains} {case.grains.motion} grains: "
        f"{remedy}, supply fewer fines, shorten run.duration_ms or run.cap_ms, or raise "
        "run.max_hours"
    )
