"""Steps, times and the supply of fines: what the clock of an invasion follows from."""

import math
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from fdnet.case.case import Case, InvasionCase, with_fines
from fdnet.case.tables import CONTACT_STEP_LIMIT, DEFAULT_STIFFNESS, MOST_SLAB
from fdnet.errors import CaseError, Doubt
from fdnet.scales.contacts import (
    MOST_FALSE_FORCE,
    SAFE_FACTOR,
    Contact,
    contacts_of,
    overlaps_of,
    sticking_of,
    two_digits_up,
)
from fdnet.scales.drag import BRIDGING, crowd_drag_factor, push_of, throat_width
from fdnet.scales.flow import (
    Drive,
    Velocity,
    carman_kozeny,
    drive_of,
    driving_pressure,
    path_of,
    velocity_of,
)
from fdnet.scales.pack import target_porosity

PLUG_SOLIDS = 0.6
"""Volume of fines a unit of face, over the median diameter of the grains, that is ample to plug
it: the shipped specimens and the well took 0.1 to 0.25 until they did, and go on a plug time."""
TAKEN_SOLIDS = 0.25  # The same, of what has come when the face plugs
FIRST_BATCHES = 0.3
"""Share of the slab that is there before it is needed, where it comes in batches."""
MUD_SOLIDS, MUD_PORES, MUD_FINES = 10 * TAKEN_SOLIDS, 2.0, 200_000
"""Where neither `fines.count` nor `fines.slab_mm` is given the mud comes until the stop rule, but
no more than ten times the solids that plugged the shipped cases. Fines that are too small to
bridge end after two volumes of the pores, and no mud has more fines than the last number."""


def present_share(case: InvasionCase, *, duration: float, feeding: float) -> float:
    """Mean number of fines in the simulation over the number supplied.

    The slab arrives evenly over `feeding` s of `duration` s, in batches ahead of what arrives; mud
    without an end comes in short ones.
    """
    if case.fines.supply == "slab":
        return 1.0
    if case.fines.endless:
        return min(1.0, 0.5 * duration / feeding)
    full = (1 - FIRST_BATCHES) * feeding
    if duration <= full:
        return FIRST_BATCHES + 0.5 * (1 - FIRST_BATCHES) * duration / full
    return 1 - 0.5 * (1 - FIRST_BATCHES) * full / duration


# ---- Times in words.
def spoken_time(seconds: float) -> str:
    """A time as one says it: "40 s", "12 min", "3 h 20 min", "2.1e+03 h (2.4 years)"."""
    minutes = seconds / 60
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    if minutes < 90:
        return f"{round(minutes)} min"
    hours = minutes / 60
    if hours < 10:
        whole, rest = divmod(5 * round(minutes / 5), 60)
        return f"{whole} h {rest} min" if rest else f"{whole} h"
    years = hours / (24 * 365.25)
    return f"{hours:.2g} h ({years:.2g} years)" if years > 1 else f"{hours:.0f} h"


# ---- The slab of suspension that is supplied: how many fines, how long, how often one arrives.
@dataclass(frozen=True, slots=True, kw_only=True)
class Slab:
    """The suspension upstream of the formation face."""

    count: int  # number of fines in it
    length: float  # m, along the flow; never shorter than the largest fine


def slab_of(case: InvasionCase, throat_ratio: float) -> Slab:
    """Number of fines n and length l of the slab, n v = c A l.

    v is the mean volume of a fine, c the share of those that are placed, A the cross-section. A
    case gives n, l or neither: then it is the most mud that may come (`MUD_SOLIDS`).
    """
    fines = case.fines
    if fines.endless:
        return _most_mud(case, throat_ratio)
    area, volume = case.size_m[1] * case.size_m[2], fines.mean_volume_m3
    least = 2 * fines.radius_range_m[1]
    if fines.count is not None:
        length = max(fines.count * volume / (fines.placed_fraction * area), least)
        return Slab(count=fines.count, length=length)
    length = max(fines.slab_m or 0.0, least)
    return Slab(count=max(1, round(fines.placed_fraction * area * length / volume)), length=length)


def _most_mud(case: InvasionCase, throat_ratio: float) -> Slab:
    """The slab of mud that comes until the stop rule; its last fine is that of the bound."""
    share, area = case.fines.placed_fraction, case.size_m[1] * case.size_m[2]
    length = MUD_SOLIDS * case.grains.curve.size_at(0.5) / case.solids_fraction
    if throat_ratio < BRIDGING:
        length = min(length, MUD_PORES * target_porosity(case) * case.size_m[0])
    per_length = share * area / case.fines.mean_volume_m3
    length = max(length, 2 * case.fines.radius_range_m[1], ARRIVALS / per_length)
    most = math.inf if case.by_classes else MUD_FINES / per_length
    length = min(length, most, MOST_SLAB * case.size_m[0])
    return Slab(count=max(1, round(per_length * length)), length=length)


def arrival_time(case: InvasionCase, upstream: float) -> float:
    """Mean time between two fines that arrive at the face, v / (c A u), s; u = `upstream` m/s."""
    fines, (_, width, height) = case.fines, case.size_m
    return fines.mean_volume_m3 / (fines.placed_fraction * width * height * upstream)


def slab_warnings(case: InvasionCase, slab: Slab) -> list[Doubt]:
    """The slab was lengthened to the largest fine; empty when it was not."""
    diameter = 2 * case.fines.radius_range_m[1]
    text = (
        f"the slab is lengthened to one fine's diameter, {1e3 * diameter:.3g} mm, so it is "
        "thinner than fines.concentration"
    )
    return [] if slab.length > diameter else [Doubt("slab-lengthened", text)]


# ---- When an invasion ends, and how often it is looked at until then.
ARRIVALS = 10
"""The default plug time lets at least this many fines of the undisturbed suspension arrive."""
REST = 0.01
"""Mean velocity of the fines inside over the fluid's first one at which they rest in any case."""


class StopTimes(NamedTuple):
    """Times of the stop rule, s of the simulation."""

    plug: float  # the face counts as plugged when no fine has crossed it for this time
    cap: float  # the invasion ends at this time at the latest
    chunk: float  # time between two checkpoints


def stop_times(case: InvasionCase, slab: Slab, drive: Drive, *, upstream: float) -> StopTimes:
    """The times that the case gives, or those that follow from the velocities.

    In a chunk the fluid passes about one grain; a given duration is cut into equal ones. Times of
    a case are physical, `upstream` m/s is simulated.
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


def plug_warnings(case: InvasionCase, plug: float, drive: Drive, upstream: float) -> list[Doubt]:
    """The `plug` time, s as simulated, is too short for the suspension; empty when it is not."""
    if plug >= ARRIVALS * arrival_time(case, upstream):
        return []
    text = (
        f"run.plug_time_ms: in {1e3 * plug * drive.factor:.3g} ms fewer than {ARRIVALS} fines of "
        "the suspension arrive at the face: the invasion may be called plugged too early"
    )
    return [Doubt("short-plug-time", text)]


# ------------------------------------------------------------------------------------------------
# The time step of an invasion, the steps for which drag is held, and their bounds of stability.
#
# `tau` is the relaxation time of the drag on the smallest fine, s.


HOLD_OVER_RELAXATION = 0.05
"""Share of tau for which the drag is held by default. At a share of 0.1 the error was measured to
be as large as the scatter between seeds."""
DRAG_WARNING, DRAG_LIMIT = 0.1, 1.0
"""Time for which drag is constant over tau: above the first value fdnet warns, above the second it
refuses the case."""
LEAST_FACTOR = 0.1
"""Least time step over sqrt(m/k) that is taken so that small fines do not lock between grains."""
RANDOM_CLOSE = 0.36  # Porosity of random close packing of equal spheres (Scott and Kilgour 1969)
_ROUNDING = 1 + 1e-12


def relaxation_time(
    radius: float, density: float, viscosity: float, multiplier: float = 1.0
) -> float:
    """tau = m / (6 pi mu r M) = 2 r^2 rho / (9 mu M), s (Stokes 1851)."""
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


def step_factor(case: Case, contacts: dict[str, Contact]) -> float:
    """Time step over sqrt(m/k): the one given, or `SAFE_FACTOR`.

    Where springs grow with the load it is the largest that is stable.
    """
    usual = largest_factor(case, contacts) if rises(case) else SAFE_FACTOR
    return usual if case.run.time_step_factor is None else case.run.time_step_factor


def time_step(case: Case, contacts: dict[str, Contact], tau: float) -> float:
    """The step, s: the one given, or `run.time_step_factor` of sqrt(m/k).

    With explicit drag the derived step is at most 0.1 tau. Raises CaseError when the step or its
    factor breaks the contact bound, or a given step exceeds tau while drag is explicit.
    """
    bound, given = contact_step(case, contacts), case.run.time_step_s
    largest, explicit = largest_factor(case, contacts), case.drag.scheme != "implicit"
    if given is None:
        factor = step_factor(case, contacts)
        if factor > largest:
            raise CaseError(
                f"run.time_step_factor: {factor:g} is above {largest:.3g}, the largest that is "
                "stable with the damping_ratio, contact.model and contact.rolling_friction of the "
                f"case; take at most {math.floor(largest * 1e3) / 1e3:g}"
            )
        return min(factor * bound, DRAG_WARNING * tau) if explicit else factor * bound
    if given > largest * bound * _ROUNDING:
        raise CaseError(
            f"run.time_step_s: {given:g} s is above the contact bound {largest:.3g} "
            f"sqrt(m/k) = {largest * bound:.3g} s; lower it or run.stiffness_N_m"
        )
    if explicit and given > DRAG_LIMIT * tau * _ROUNDING:
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
    stable = math.floor(DRAG_LIMIT * tau / step * _ROUNDING)
    if given > min(stable, most):
        raise CaseError(
            f"drag.refresh_steps: {given} steps of {step:.3g} s exceed the drag relaxation time "
            f"{tau:.3g} s or the {longest:.3g} s between checkpoints; expected at most "
            f"{min(stable, most)}"
        )
    return given


def drag_warnings(case: Case, held: float) -> list[Doubt]:
    """What a drag that is constant for `held` tau costs in accuracy, in words.

    Empty up to 0.1 tau, with the implicit scheme up to 1 tau.
    """
    implicit = case.drag.scheme == "implicit"
    limit = DRAG_LIMIT if implicit else DRAG_WARNING
    if held <= limit * _ROUNDING:
        return []
    if implicit:
        text = (
            f"implicit drag with a time step of {held:.3g} relaxation times (above {limit:g}): "
            f"each step leaves {(2 - held) / (2 + held):.2g} of a fine's slip instead of "
            f"{math.exp(-held):.2g}; lower run.time_step_s to resolve it"
        )
        return [Doubt("implicit-drag", text)]
    remedy = "drag.refresh_steps or " if case.drag.scheme == "held" else ""
    text = (
        f"drag is held for {held:.2g} of the relaxation time (above {limit:g}: a fine's velocity "
        f"is off by over 2 %): lower {remedy}run.time_step_s"
    )
    return [Doubt("drag-held", text)]


# ---- How fast the simulation is driven, how deep it presses fines, and the stiffness it needs.
PRESSED = 0.03
"""Largest predicted overlap of a fine over its diameter with `run.stiffness_N_m` = "auto"."""

STARTING = 0.2
"""Stiffness over that of the largest chain of forces with which an invasion starts whose springs
may be stiffened at a checkpoint."""

AnyCase = TypeVar("AnyCase", bound=Case)


def drive_in(case: InvasionCase, velocity: Velocity) -> Drive:
    """How fast the simulation is driven; a free fine outruns the fluid by its drift.

    Where the flow follows the deposit, drag stops a fine as in the crowd of its own mud.
    """
    own = push_of(case, velocity.interstitial, velocity.pressure_gradient)
    free = own.velocity + own.drift(case.fines.radius_range_m[1])
    time = relaxation_times(case)[1]
    if case.drag.coupled:
        mud = 1 - case.fines.placed_fraction
        time /= float(crowd_drag_factor(mud)) / mud
    return drive_of(case, own.velocity, time, free)


def relaxation_times(case: InvasionCase) -> tuple[float, float]:
    """The shortest and the longest of the fines, s; with one material smallest and largest."""
    viscosity, multiplier = case.fluid.viscosity_Pa_s, case.drag.multiplier
    times = [relaxation_time(*end, viscosity, multiplier) for end in case.fines.ends]
    return min(times), max(times)


def deposit_pressure(case: InvasionCase, flow: Velocity, porosity: float) -> float:
    """Largest pressure, Pa, that pack, deposit and cake can bear until the invasion ends.

    They lie in series with the rest of the way. In lengths of the intact pack, of the length L and
    the permeability k, the fines that can come until then, packed closely by Carman and Kozeny,
    resist by

        r = k h 180 (1 - e) / (d^2 e^3),

    h their volume a unit of face, d their Sauter diameter, e = `RANDOM_CLOSE`. On the way w the
    overbalance leaves them p (L + r) / (w + r), and a constant rate p (L + r) / w. A rate that
    may fall to the share s (`run.stop_rate`) lets r grow to w (1 / s - 1).
    """
    run, fines, length = case.run, case.fines, case.size_m[0]
    pressure = driving_pressure(case, flow.pressure_gradient)
    way, inside = length, length
    if case.fluid.velocity_m_s is None:
        given = None if case.well is None else case.well.formation_permeability_m2
        way, inside = path_of(case).viscous, min(length, path_of(case).viscous)
        way = inside + (way - inside) * flow.permeability / (given or flow.permeability)
    throat = 2 * fines.radius_range_m[1] / throat_width(porosity, flow.permeability)
    mud = [slab_of(case, throat).length]
    if fines.endless:
        mud.append(PLUG_SOLIDS * case.grains.curve.size_at(0.5) / fines.placed_fraction)
    lasts = run.duration_s or run.cap_s
    mud += [] if lasts is None else [lasts * flow.darcy]
    mud += [] if run.stop_pore_volumes is None else [run.stop_pore_volumes * porosity * length]
    bed = carman_kozeny(RANDOM_CLOSE, fines.sauter_diameter_m)
    added = flow.permeability * fines.placed_fraction * min(mud) / ((1 - RANDOM_CLOSE) * bed)
    if run.stop_rate is not None:
        added = min(added, way * (1 / run.stop_rate - 1))
    slowed = way + added if case.drag.slowed else way
    return pressure * (inside + added) / slowed


def rises(case: Case) -> bool:
    """Whether the springs of an invasion are stiffened when the deposit asks for it."""
    auto = case.run.stiffness_N_m == "auto" and case.run.time_step_s is None
    return isinstance(case, InvasionCase) and case.drag.coupled and auto


def stiff_enough(case: AnyCase, *, start: bool = True) -> AnyCase:
    """The case with a number for `run.stiffness_N_m` = "auto"; any other case as it is.

    It is the least number of two digits at which every predicted overlap is at most `PRESSED`;
    in the uniform field at least the default. Where the springs may be stiffened later, and the
    `start` is asked for, a deposit gets `STARTING` of what it needs.
    """
    if case.run.stiffness_N_m != "auto":
        return case

    def stiff(value: float, **more: float) -> AnyCase:
        run = case.run.model_copy(update={"stiffness_N_m": value, **more})
        return case.model_copy(update={"run": run})

    own = case.run.time_step_factor
    longest = own or (CONTACT_STEP_LIMIT if start and rises(case) else SAFE_FACTOR)
    soft = stiff(DEFAULT_STIFFNESS, time_step_factor=longest)
    if not isinstance(soft, InvasionCase):
        return soft
    porosity = target_porosity(soft)
    flow = velocity_of(soft, porosity)
    contacts = contacts_of(soft, flow.interstitial)
    contact, factor = contacts["grain-fine"], step_factor(case, contacts)
    borne = deposit_pressure(soft, flow, porosity)
    deep = overlaps_of(soft, contact, flow, drive_in(soft, flow), porosity, borne)
    # F / k and w sqrt(m / k) of linear contacts; by Hertz the powers -2/3 and -2/5 of the modulus
    held, struck = (1.5, 2.5) if soft.contact.model == "hertz" else (1.0, 2.0)
    raised = max(
        0.0 if soft.drag.coupled else 1.0,
        (deep.drag / PRESSED) ** held,
        (deep.deposit / PRESSED) ** held * (STARTING if start and rises(case) else 1.0),
        (deep.impact / PRESSED) ** struck,
    )
    number = two_digits_up(raised * DEFAULT_STIFFNESS)
    if not start or not rises(case):
        return stiff(number)
    if case.run.time_step_factor is None:
        factor = _unlocked(with_fines(stiff(number)), flow, factor)
    return stiff(number, time_step_factor=factor)


def _unlocked(case: InvasionCase, flow: Velocity, factor: float) -> float:
    """The largest time step over sqrt(m/k), up to `factor`, at which no fine locks by it.

    At least `LEAST_FACTOR`.
    """
    contacts, drive = contacts_of(case, flow.interstitial), drive_in(case, flow)
    push = push_of(case, drive.velocity, flow.pressure_gradient, factor=drive.factor)
    locks = sticking_of(case, contacts["grain-fine"], push, factor * contact_step(case, contacts))
    if not locks.by_integrator:
        return factor
    return max(LEAST_FACTOR, factor * MOST_FALSE_FORCE / locks.false_force)
