"""The scales of a case in closed form; `scale_rows` has each formula and its source."""

import math
from dataclasses import dataclass, fields, replace

from fdnet.case.case import Case, InvasionCase
from fdnet.case.tables import CleanUp
from fdnet.errors import CaseError, Doubt
from fdnet.scales import clock
from fdnet.scales.contacts import (
    Contact,
    Sticking,
    cohesion_warnings,
    contacts_of,
    overlap_warnings,
    overlaps_of,
    sticking_of,
    sticking_warnings,
    stiffness_factor,
)
from fdnet.scales.drag import Push, push_of, reynolds_warnings, throat_warnings, throat_width
from fdnet.scales.flow import Velocity, velocity_of, velocity_warnings
from fdnet.scales.pack import size_warnings, target_porosity

MOST_STEPS = 2**31 - 1  # LIGGGHTS counts the steps of a run in 32 bits


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """What follows from any case, in SI units."""

    porosity: float  # of the pack, as the case asks for it
    permeability: float  # m2, of the intact pack by Carman and Kozeny
    darcy_velocity: float  # m/s, flow rate over the whole cross-section
    interstitial_velocity: float  # m/s, mean velocity of the fluid in the pores
    pressure_gradient: float  # Pa/m, that drives this flow through the intact pack
    inertial_loss: float  # share by which Ergun's inertial term lowers the velocity of Darcy's law
    stiffness_factor: float  # factor from the materials' stiffness, or moduli, to those used
    contacts: dict[str, Contact]  # contact of each pair of materials, such as "grain-fine"
    warnings: tuple[Doubt, ...] = ()  # doubts about the case, one sentence each


@dataclass(frozen=True, slots=True, kw_only=True)
class InvasionScales(Scales):
    """What follows from a case with fines as well, in SI units."""

    drive_velocity: float  # m/s, of the fluid in the pores, as simulated
    # drive velocity, forces on a fine, and physical time, over the fluid's own
    force_factor: float
    upstream_velocity: float  # m/s, upstream of the formation face, as simulated
    supplied_count: int  # number of fines in the slab; the most that come where the mud has no end
    slab_length: float  # m, along the flow
    relaxation_time: tuple[float, float]  # s, of the drag on the smallest and on the largest fine
    time_step: float  # s, of the invasion
    hold_steps: int  # steps for which the drag is held
    plug_time: float  # s of the simulation without a crossing that count as plugged
    cap_time: float  # s of the simulation, when the invasion ends at the latest
    checkpoint_steps: int  # steps between two checkpoints
    reynolds: float  # particle Reynolds number of the largest fine that is held
    stokes: float  # Stokes number of the largest fine at a grain, as simulated
    impact_stokes: float  # impact Stokes number of the largest fine, as simulated
    gravity_over_drag: float  # weight less buoyancy over drag, of the largest fine
    gradient_over_drag: float  # pressure gradient over Stokes's drag, of the largest fine at rest
    push: Push  # drag and pressure gradient on fines in the pack, as simulated
    drift_velocity: float  # m/s, of the largest fine carried freely in the pores, as simulated
    throat_ratio: float  # diameter of the largest fine over that of the pack's throats
    impact_overlap: float  # predicted overlap by impact, over the diameter of the largest fine
    drag_overlap: float  # the same by drag and pressure gradient
    # the same by the whole pressure, where the flow follows the deposit; else 0
    deposit_overlap: float
    sticking: Sticking  # how far a fine may lock between two grains

    @property
    def stiffness(self) -> float:
        """Of the stiffest contact, N/m, as `run.stiffness_N_m` has it."""
        some = (one for one in self.contacts.values() if not one.elastic or "fine" in one.pair)
        return max(one.normal_stiffness for one in some)


def scales_of(case: Case) -> Scales:
    """All scales of a case; InvasionScales when it has fines.

    Raises CaseError when a step or drag refresh breaks a stability bound, when drag would press
    contacts shut, or when a formula overflows.
    """
    try:
        rising, case = clock.rises(case), clock.stiff_enough(case)
        porosity = target_porosity(case)
        flow = velocity_of(case, porosity)
        shared = _shared(case, porosity, flow)
        if not isinstance(case, InvasionCase):
            return shared
        return _invasion(case, flow, shared, chain=clock.STARTING if rising else 1.0)
    except (OverflowError, ZeroDivisionError) as error:
        raise CaseError(
            f"case {case.name}: a formula leaves the range of numbers ({error}); check units and "
            "magnitudes of fluid, fines and run"
        ) from error


def packing_scales(case: Case) -> Scales:
    """The scales of packing, at a stiffness of its own whatever the invasion needs."""
    run = case.run.model_copy(update={"stiffness_N_m": case.grains.packing_stiffness_N_m})
    case, porosity = case.model_copy(update={"run": run}), target_porosity(case)
    return _shared(case, porosity, velocity_of(case, porosity))


def _shared(case: Case, porosity: float, flow: Velocity) -> Scales:
    return Scales(
        porosity=porosity,
        permeability=flow.permeability,
        darcy_velocity=flow.darcy,
        interstitial_velocity=flow.interstitial,
        pressure_gradient=flow.pressure_gradient,
        inertial_loss=flow.inertial_loss,
        stiffness_factor=stiffness_factor(case),
        contacts=contacts_of(case, flow.interstitial),
        warnings=tuple(size_warnings(case)),
    )


def invasion_scales(case: InvasionCase) -> InvasionScales:
    """`scales_of` a case that is known to have fines."""
    scales = scales_of(case)
    assert isinstance(scales, InvasionScales)
    return scales


def stiffened(case: InvasionCase, scales: InvasionScales, steps: int) -> InvasionScales:
    """The scales of a chunk in `steps` steps: the stiffness goes with their square."""
    if steps == scales.checkpoint_steps:
        return scales
    run, ratio = clock.stiff_enough(case).run, steps / scales.checkpoint_steps
    assert not isinstance(run.stiffness_N_m, str)
    run = run.model_copy(update={"stiffness_N_m": run.stiffness_N_m * ratio**2})
    stiff = case.model_copy(update={"run": run})
    return replace(
        scales,
        stiffness_factor=stiffness_factor(stiff),
        contacts=contacts_of(stiff, scales.interstitial_velocity),
        time_step=scales.time_step / ratio,
        checkpoint_steps=steps,
    )


def _invasion(
    case: InvasionCase, flow: Velocity, shared: Scales, *, chain: float
) -> InvasionScales:
    fines, fluid, multiplier = case.fines, case.fluid, case.drag.multiplier
    small, large = fines.radius_range_m
    speed, viscosity = flow.interstitial, fluid.viscosity_Pa_s
    throat = 2 * large / throat_width(shared.porosity, flow.permeability)
    slab, relaxation = clock.slab_of(case, throat), clock.relaxation_times(case)
    drive = clock.drive_in(case, flow)
    push = push_of(case, drive.velocity, flow.pressure_gradient, factor=drive.factor)
    upstream = flow.darcy * drive.factor if case.drag.upstream == "darcy" else drive.velocity
    shortest = relaxation[0] * push.relaxation_share(small)
    times = clock.stop_times(case, slab, drive, upstream=upstream)
    step, hold, chunk_steps = times.chunk, 1, 1
    if not case.by_classes:  # which has no steps of LIGGGHTS, and no limits on them
        step = clock.time_step(case, shared.contacts, shortest)
        hold = clock.hold_steps(case, step, shortest, times.chunk)
        chunk_steps = clock.chunk_refreshes(case, times.chunk, step * hold) * hold
    contact = shared.contacts["grain-fine"]
    borne = clock.deposit_pressure(case, flow, shared.porosity)
    overlaps = overlaps_of(case, contact, flow, drive, shared.porosity, chain * borne)
    sticking = sticking_of(case, contact, push, step)
    if chunk_steps > MOST_STEPS:
        raise CaseError(
            f"run.time_step_s: {step:.3g} s needs {chunk_steps:.3g} steps between checkpoints "
            f"(limit {MOST_STEPS:.3g}); raise the step or shorten run.checkpoint_ms"
        )
    reynolds = fluid.density_kg_m3 * speed * 2 * large / viscosity
    displaced = fluid.density_kg_m3 * case.gravity.buoyancy
    excess = max(abs(one.density - displaced) for one in fines.components)
    weight = math.hypot(*case.gravity.acceleration_m_s2) * excess
    # 2 r^2 (-grad p) / (9 mu u M), by Darcy's law (2/9) r^2 phi / (k M)
    pushed = 2 / 9 * large**2 * flow.pressure_gradient
    warnings = [*shared.warnings, *velocity_warnings(case, shared.porosity, flow)]
    if not case.by_classes:
        warnings += [
            *reynolds_warnings(case, push, reynolds, throat_ratio=throat),
            *throat_warnings(case, throat),
            *overlap_warnings(case, overlaps),
            *cohesion_warnings(case, contact),
            *clock.slab_warnings(case, slab),
            *clock.drag_warnings(case, hold * step / shortest),
            *clock.plug_warnings(case, times.plug, drive, upstream),
            *sticking_warnings(sticking),
        ]
    return InvasionScales(
        **{item.name: getattr(shared, item.name) for item in fields(shared)}
        | {"warnings": tuple(warnings)},
        drive_velocity=drive.velocity,
        force_factor=drive.factor,
        upstream_velocity=upstream,
        supplied_count=slab.count,
        slab_length=slab.length,
        relaxation_time=relaxation,
        time_step=step,
        hold_steps=hold,
        plug_time=times.plug,
        cap_time=times.cap,
        checkpoint_steps=chunk_steps,
        reynolds=reynolds,
        stokes=relaxation[1] * drive.velocity / (2 * case.grains.mean_radius_m),
        impact_stokes=drive.impact_stokes,
        # 2 r^2 (rho - rho_fluid) g / (9 mu u M), of the material that weighs most in the fluid
        gravity_over_drag=2 * large**2 * weight / (9 * viscosity * speed * multiplier),
        gradient_over_drag=pushed / (viscosity * speed * multiplier),
        push=push,
        drift_velocity=drive.velocity + push.drift(large),
        throat_ratio=throat,
        impact_overlap=overlaps.impact,
        drag_overlap=overlaps.drag,
        deposit_overlap=overlaps.deposit,
        sticking=sticking,
    )


# ------------------------------------------------------------------------------------------------
# The scales of a clean-up: the flow of the invasion turned back, at the drawdown.
#
# The drawdown is lost on the way on which the overbalance was, so the fluid's velocity follows
# from it by the same law. The forces are those of the invasion at that velocity.


MOST_PASSAGES = 20
"""Passages of the fluid through the specimen after which a clean-up ends by default."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackFlow:
    """A clean-up in numbers. Times and velocities are those of the simulation."""

    case: InvasionCase  # that of the invasion with the drawdown for the overbalance
    scales: InvasionScales  # of that case; its velocities are positive
    choices: CleanUp  # the table [clean_up]
    chunks: int  # most chunks of `scales.checkpoint_steps` steps
    quiet_chunks: int  # chunks without a fine that comes out which end it; 0 with a duration

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
        scales = invasion_scales(turned)
    except CaseError as error:
        given = 1e-6 * choices.drawdown_Pa
        raise CaseError(f"clean_up.drawdown_MPa: {given:g}: {error}") from error
    chunk = scales.checkpoint_steps * scales.time_step * scales.force_factor
    passage = case.size_m[0] / scales.drive_velocity * scales.force_factor
    longest = choices.duration_s or MOST_PASSAGES * passage
    chunks = longest / chunk
    timed = choices.duration_s is not None
    return BackFlow(
        case=turned,
        scales=scales,
        choices=choices,
        chunks=max(1, round(chunks) if timed else math.ceil(chunks - 1e-9)),
        quiet_chunks=0 if timed else max(1, math.ceil(passage / chunk)),
    )


def _at_drawdown(case: InvasionCase, choices: CleanUp) -> InvasionCase:
    """The case with the drawdown for its overbalance, driven by no larger factor than before."""
    fluid, run = choices.fluid_of(case.fluid), choices.run_of(case.run)
    turned, asked = case.model_copy(update={"fluid": fluid, "run": run}), case.drag
    if asked.drive_velocity_m_s != "fluid":
        porosity = target_porosity(case)
        before, flow = velocity_of(case, porosity), velocity_of(turned, porosity)
        driven = flow.interstitial * clock.drive_in(case, before).factor
        if asked.drive_velocity_m_s == "auto":
            driven = min(driven, clock.drive_in(turned, flow).velocity)
        drive = driven if driven > flow.interstitial else "fluid"
        drag = asked.model_copy(update={"drive_velocity_m_s": drive})
        turned = turned.model_copy(update={"drag": drag})
    return clock.stiff_enough(turned, start=False)
