"""The invasion of classes through time: flow, transport and deposit, step by step.

Each step solves the flow with what the deposit left of the throats, carries all classes, and lets
the deposit grow. What the deposit holds back in a step is what it would in the middle of it. The
length of a step is that in which the resistance of the pack changes by `CHANGE`, or that of all
that the fluid passes.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.classes.capture import Bed, SizeClasses, filter_coefficient
from fdnet.classes.deposit import (
    PACKED,
    Deposits,
    Release,
    Sieve,
    advanced,
    bed_diameter,
    holding,
    kept_shares,
    no_solids,
    released,
    thickness_of_cake,
)
from fdnet.classes.transport import Streams, streams_of
from fdnet.network.fines.occupancy import ratio
from fdnet.network.flow.flow import Flow, solve_flow
from fdnet.network.network import Network
from fdnet.scales.flow import api_permeability, carman_kozeny, darcy_through, path_of
from fdnet.scales.scales import InvasionScales
from fdnet.spheres.snapshot import Array

CHANGE = 0.1  # Relative change of the resistance of the pack, or of the whole way, in one step
LEAST_STEP, FIRST_STEP = 1e-6, 0.02
"""m3 of fluid over the pores of the specimen: in the shortest step, and in the first."""
MOST_STEPS = 5000


class PackState(NamedTuple):
    """The flow through the pack as its deposit left it; `energy` (T,) is the share that each
    throat spends."""

    streams: Streams
    energy: Array
    k_over_k0: float
    flow: Flow


def flows_through(network: Network, sieve: Sieve, clean: Array, intact: Flow) -> "PackStateOf":
    """How the fluid flows through a network when the sides of its throats keep some of `clean`.

    `clean` (T,) m3 are the conductances without solids, `intact` is the flow by them.
    Raises FlowError as `solve_flow` does.
    """
    first = np.unique(network.pore_group, return_index=True)[1]
    whole = sieve.halves.sum(axis=1)

    def state(kept: Array, near: Flow | None) -> PackState:
        conductance = clean * ratio(whole, np.sum(sieve.halves / kept, axis=1))
        flow = solve_flow(network, conductance, near=near or intact)
        streams = streams_of(
            sieve.ends,
            flow.throat_flux,
            flow.pore_pressure[first],
            inlet=sieve.inlet,
            outlet=sieve.outlet,
        )
        spent = ratio(flow.throat_flux**2, conductance)
        return PackState(
            streams=streams,
            energy=spent / max(float(spent.sum()), 1e-300),
            k_over_k0=flow.inflow / intact.inflow if intact.inflow > 0 else 0.0,
            flow=flow,
        )

    return state


PackStateOf = Callable[[Array, Flow | None], PackState]
"""The flow, from the share (T, 2) of its conductance that each side of a throat keeps, and a flow
near it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """What drives an invasion and what ends it, SI units."""

    velocity: float  # m/s, superficial, through the intact pack
    resistance: float  # 1/m, of the intact pack
    rest: float  # resistance of the way beyond it, over that
    at_rate: bool  # whether the velocity stays, and not the pressure
    cake_permeability: float | None  # m2; None: by Carman and Kozeny of what is in it
    duration: float | None  # s; None: until the stop rule holds
    plug_rate: float  # share of the first supply that may enter while the face counts as plugged
    plug_time: float  # s, for which that must hold
    cap_time: float  # s, when the invasion ends at the latest
    stop_rate: float = 0.0  # share of the first velocity below which the face is plugged
    stop_volume: float = math.inf  # m3 of filtrate, with which it ends
    supply: float  # m3 of solids that come at most
    sticking: float  # share of contacts with grains that stick
    release: Release | None  # what the flow lifts; None: nothing
    bed: Bed  # grains and fluid, for what sticks


def release_of(case: InvasionCase) -> Release | None:
    """What the flow lifts; None where the case does not ask for it."""
    one = case.invasion
    if one is None or one.release_stress_Pa is None or one.release_time_s is None:
        return None
    return Release(one.release_stress_Pa, one.release_time_s)


def bed_of(case: InvasionCase, scales: InvasionScales, velocity: float) -> Bed:
    """The grains of a case as a bed, in a fluid of the superficial `velocity` m/s."""
    return Bed(
        diameter=case.grains.sauter_diameter_m,
        porosity=scales.porosity,
        velocity=velocity,
        viscosity=case.fluid.viscosity_Pa_s,
        density=case.fluid.density_kg_m3,
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ClassInvasion:
    """The end of an invasion and its history."""

    solids: Deposits  # where they are
    kept: Array  # (T, 2) share of its conductance that each side of a throat keeps
    rows: tuple[Mapping[str, float], ...]  # one a step: time, rate, filtrate, solids, cake
    by_class: Array  # (S, 3, C) m3 inside, passed and in the cake at each of these steps
    # "plugged", "duration", "supply_exhausted" or "cap"; "" where `MOST_STEPS` did not reach it
    stop_reason: str = ""


class FirstFlow(NamedTuple):
    """Superficial velocity at the start, m/s, and the resistance of the way beyond the specimen
    over that of the intact specimen."""

    velocity: float
    rest: float


def first_flow(case: InvasionCase, scales: InvasionScales, permeability: float) -> FirstFlow:
    """What drives the fluid through a pack of `permeability` m2, by its network.

    A velocity that is given says nothing of the way: the specimen is all of it.
    """
    if case.fluid.velocity_m_s is not None:
        return FirstFlow(scales.darcy_velocity, 0.0)
    given = None if case.well is None else case.well.formation_permeability_m2
    share = 1.0 if given is None else permeability / given
    length = case.size_m[0]
    beyond = max(0.0, path_of(case).viscous - length) / length
    return FirstFlow(darcy_through(case, scales.porosity, permeability), beyond * share)


def velocity_in(
    first: float, rest: float, k_over_k0: float, more: float, gain: float = 0.0
) -> float:
    """Superficial velocity U, m/s, at constant pressure; U0 is the `first`.

    With the resistance R0 = mu L / k0 of the intact pack, the way beyond it resists with `rest`,
    cake and moving fines with `more`, over R0, and fines that move give back `gain`, over R0:

        U = (U0 (1 + rest) + gain) / (k0 / k + rest + more).
    """
    if k_over_k0 <= 0:
        return 0.0
    return (first * (1.0 + rest) + gain) / (1.0 / k_over_k0 + rest + more)


def cake_resistance(
    given: float | None, sieve: Sieve, solids: Deposits, classes: SizeClasses
) -> float:
    """1/m, of the cake: its thickness over its permeability, `given` in m2 or that of its bed."""
    thickness = thickness_of_cake(sieve, solids)
    if thickness <= 0:
        return 0.0
    size = float(bed_diameter(solids.cake, classes))
    return thickness / (given or carman_kozeny(PACKED, size))


def invade_classes(
    sieve: Sieve,
    classes: SizeClasses,
    course: Course,
    flow_with: PackStateOf,
    watch: Callable[[int, Deposits, Flow], None] = lambda *_: None,
) -> ClassInvasion:
    """Let the mud in until the course ends; `watch` sees each row's state."""
    solids, pores = no_solids(sieve, classes), float(sieve.void.sum())
    kept, rows, by_class, time, filtrate = np.ones(sieve.ends.shape), [], [], 0.0, 0.0
    wanted, quiet, reason, mud = FIRST_STEP * pores, 0.0, "", float(classes.concentration.sum())
    state = flow_with(kept, None)
    for _ in range(MOST_STEPS):
        cake = cake_resistance(course.cake_permeability, sieve, solids, classes)
        velocity = course.velocity
        if not course.at_rate:
            more = cake / course.resistance
            velocity = velocity_in(velocity, course.rest, state.k_over_k0, more)
        by_class.append([solids.inside_by_class, solids.passed, solids.cake])
        supplied = float(solids.supplied.sum())
        inside, passed, in_cake = np.sum(by_class[-1], axis=1)
        viscosity = course.bed.viscosity
        drop = viscosity * velocity * course.resistance / max(state.k_over_k0, 1e-300)
        rows.append(
            {
                "time_s": time,
                "rate_m3_s": velocity * sieve.area,
                "rate_over_initial": velocity / course.velocity,
                "k_over_k0": state.k_over_k0,
                "filtrate_m3": filtrate,
                "supplied_m3": supplied,
                "invaded_m3": float(inside),
                "passed_m3": float(passed),
                "cake_m3": float(in_cake),
                "cake_thickness_m": thickness_of_cake(sieve, solids),
                "pressure_cake_Pa": viscosity * velocity * cake,
                "pressure_pack_Pa": drop,
            }
        )
        watch(len(rows) - 1, solids, state.flow)
        least = course.stop_rate * course.velocity
        reason = reason or ("plugged" if velocity <= 0 or velocity < least else "")
        if reason:
            break
        bed = replace(course.bed, velocity=velocity)
        filtering = filter_coefficient(classes, bed, course.sticking)
        first = holding(sieve, solids, classes, state.streams, filtering)
        rate, bounds = velocity * sieve.area, [max(0.5 * pores, 0.1 * filtrate)]
        bounds += [(course.supply - supplied) / mud, course.stop_volume - filtrate]
        bounds.append(((course.duration or course.cap_time) - time) * rate)
        if course.duration is None:
            bounds.append(0.25 * course.plug_time * rate)
        volume = min(wanted, *bounds)
        while True:
            loose, streams = solids, state.streams
            if course.release:
                loose = released(sieve, solids, streams, drop, volume / rate, course.release)
            half = advanced(sieve, loose, classes, streams, first, 0.5 * volume)
            middle = holding(sieve, half, classes, streams, filtering)
            del half  # which is large, as is `after`
            after = advanced(sieve, loose, classes, streams, middle, volume)
            new = kept_shares(sieve, after, classes)
            change = _change(sieve, state.energy, kept, new)
            if not course.at_rate:  # the rate falls with the cake too
                beyond = 1.0 / max(state.k_over_k0, 1e-300) + course.rest
                grown = cake_resistance(course.cake_permeability, sieve, after, classes) - cake
                change = max(change, grown / (cake + course.resistance * beyond))
            if change <= 2.0 * CHANGE or volume <= LEAST_STEP * pores:
                break
            volume *= max(0.2, CHANGE / change)
            del after
        wanted = volume * min(max(CHANGE / max(change, 1e-9), 0.3), 2.0)
        come = volume * mud * float(state.streams.fed.sum())
        entered = come - float(np.sum(after.cake - solids.cake))
        time, filtrate = time + volume / rate, filtrate + volume
        crossing = entered / (mud * volume) * velocity / course.velocity
        quiet = quiet + volume / rate if crossing <= course.plug_rate else 0.0
        solids, kept = after, new
        del loose, after
        state = flow_with(kept, state.flow)
        reason = _ended(course, time, filtrate, quiet, float(solids.supplied.sum()))
    return ClassInvasion(
        solids=solids, kept=kept, rows=tuple(rows), by_class=np.array(by_class), stop_reason=reason
    )


def _change(sieve: Sieve, energy: Array, before: Array, after: Array) -> float:
    """Relative change of the resistance of the pack, by the energy that each throat spends."""
    old, new = (np.sum(sieve.halves / kept, axis=1) for kept in (before, after))
    grown = np.divide(new, old, out=np.ones_like(old), where=old > 0)
    return float(np.sum(energy * np.abs(1.0 - 1.0 / np.maximum(grown, 1e-12))))


def _ended(course: Course, time: float, filtrate: float, quiet: float, supplied: float) -> str:
    """Why the invasion ends now; "" where it goes on."""
    near, given = 1.0 - 1e-9, course.duration is not None
    if not given and quiet >= near * course.plug_time:
        return "plugged"
    if supplied >= near * course.supply:
        return "supply_exhausted"
    if time >= near * (course.duration or course.cap_time):
        return "duration" if given else "cap"
    return "duration" if filtrate >= near * course.stop_volume else ""


def cake_permeability(case: InvasionCase) -> float | None:
    """Permeability, m2, of the cake that the case gives, or its API filtrate; None without."""
    if case.cake is None or case.cake.api_filtrate_m3 is None:
        return None if case.cake is None else case.cake.permeability_m2
    return api_permeability(
        case.cake.api_filtrate_m3,
        viscosity=case.fluid.viscosity_Pa_s,
        solids=case.fines.volume_fraction,
        porosity=PACKED,
    )
