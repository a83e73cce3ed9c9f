"""How fast the simulation is driven, how deep it presses fines, and the stiffness it needs."""

from typing import TypeVar

from fdnet.case.case import Case, InvasionCase
from fdnet.case.control import DEFAULT_STIFFNESS
from fdnet.scales.contacts import contacts_of
from fdnet.scales.drive import Drive, drive_of
from fdnet.scales.forces.push import push_of
from fdnet.scales.forces.throat import throat_width
from fdnet.scales.grain_pack import target_porosity
from fdnet.scales.overlaps import Overlaps, deposit_force, overlaps_of, two_digits_up
from fdnet.scales.springs import Contact
from fdnet.scales.time_step import relaxation_time
from fdnet.scales.velocity import Velocity, driving_pressure, velocity_of

PRESSED = 0.03
"""Largest predicted overlap of a fine over its diameter with `run.stiffness_N_m` = "auto"; the
default of `run.max_overlap`."""

AnyCase = TypeVar("AnyCase", bound=Case)


def drive_in(case: InvasionCase, velocity: Velocity) -> Drive:
    """How fast the simulation is driven; a free fine outruns the fluid by its drift."""
    own = push_of(case, velocity.interstitial, velocity.pressure_gradient)
    free = own.velocity + own.drift(case.fines.radius_range_m[1])
    return drive_of(case, own.velocity, relaxation_times(case)[1], free=free)


def relaxation_times(case: InvasionCase) -> tuple[float, float]:
    """The shortest and the longest of the fines, s; with one material smallest and largest."""
    viscosity, multiplier = case.fluid.viscosity_Pa_s, case.drag.multiplier
    if not case.fines.measured:
        ends = [(radius, case.fines.density_kg_m3) for radius in case.fines.radius_range_m]
    else:
        ends = [
            (0.5 * diameter, one.density)
            for one in case.fines.components
            for diameter in (one.curve.low, one.curve.high)
        ]
    times = [relaxation_time(radius, density, viscosity, multiplier) for radius, density in ends]
    return min(times), max(times)


def pressed_in(case: InvasionCase, velocity: Velocity, drive: Drive, contact: Contact) -> Overlaps:
    """The overlaps of fines in the `contact` of a grain and a fine, as simulated."""
    push = push_of(case, drive.velocity, velocity.pressure_gradient, factor=drive.factor)
    porosity = target_porosity(case)
    pressure = drive.factor * driving_pressure(case, velocity.pressure_gradient)
    plug = deposit_force(case, pressure, throat_width(porosity, velocity.permeability))
    return overlaps_of(case, contact, push, porosity, deposit=plug)


def stiff_enough(case: AnyCase) -> AnyCase:
    """The case with a number for `run.stiffness_N_m` = "auto"; any other case as it is.

    It is the least number of two digits at which every predicted overlap is at most `PRESSED`, and
    at least the default. A force presses a linear contact in by F / k and an impact by
    w sqrt(m / k); by Hertz they go with the powers -2/3 and -2/5 of the modulus.
    """
    if case.run.stiffness_N_m != "auto":
        return case
    soft = _with(case, DEFAULT_STIFFNESS)
    if not isinstance(soft, InvasionCase):
        return soft
    velocity = velocity_of(soft, target_porosity(soft))
    contact = contacts_of(soft, velocity.interstitial)["grain-fine"]
    deep = pressed_in(soft, velocity, drive_in(soft, velocity), contact)
    held, struck = (1.5, 2.5) if soft.contact.model == "hertz" else (1.0, 2.0)
    raised = max(
        1.0,
        (max(deep.drag, deep.deposit) / PRESSED) ** held,
        (deep.impact / PRESSED) ** struck,
    )
    return _with(case, two_digits_up(raised * DEFAULT_STIFFNESS))


def _with(case: AnyCase, stiffness: float) -> AnyCase:
    return case.model_copy(
        update={"run": case.run.model_copy(update={"stiffness_N_m": stiffness})}
    )
