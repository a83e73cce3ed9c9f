"""Two fines that collide head on: linear and Hertz contacts against their closed forms."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fdnet.scales.contacts import collision_time, overlap_of_impact, pair_elastic, sphere_mass
from fdnet.scales.scales import scales_of
from fdnet.spheres.snapshot import Kind, resting
from validation.dem.closed import Watch, closed_run
from validation.dem.collisions import collision_run
from validation.engine.error_rows import sizes
from validation.engine.study import DONE, Measured, Point, Row
from validation.outside.answers import Answer
from validation.outside.pushed import DENSITY, case_of

SERIES, KNOB = "head-on collision", "contacts"
LINEAR, HERTZ = "linear, damped", "Hertz, undamped"
FIRST, SECOND = "error of the overlap", "error of restitution or duration"
TOLERANCE = 0.01
FINE = 5e-5
"""Radius of the fines, m."""
SPEED = 1.0
"""Closing speed, m/s, of the fines with Hertz contacts."""
_STIFFNESS, _FACTOR = 1e4, 0.02
_STEPS = 1500


def points(quick: bool) -> list[Point]:
    """Both contact laws; none in the quick form, as the DEM's own tests have them."""
    names = [] if quick else [LINEAR, HERTZ]
    return [Point(series=SERIES, knob=KNOB, value=name) for name in names]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Relative errors of the overlap, and of the restitution or the duration."""
    if point.value == HERTZ:
        return _hertz(work / point.slug)
    seen = collision_run(
        work, point.slug, stiffness=_STIFFNESS, factor=_FACTOR, phase=0.5, span=0.0
    )
    return {FIRST: seen["overlap_error"], SECOND: seen["restitution_error"]}


def _hertz(folder: Path) -> dict[str, float]:
    """Undamped: (15 m v^2 / (16 E* sqrt(R*)))^(2/5) and 2.87 (m^2 / (R* E*^2 v))^(1/5)."""
    radius, density = FINE, DENSITY
    case = case_of(
        fine=radius,
        stiffness=_STIFFNESS,
        friction=0.0,
        damping_ratio=0.0,
        contact={"model": "hertz"},
    )
    scales = scales_of(case)
    step = _FACTOR * scales.contacts["fine-fine"].step_limit
    apart, middle = 2 * radius + 2.5 * SPEED * step, 20 * radius
    place = np.full((3, 3), middle)
    place[0], place[1, 0], place[2, 0] = 2 * radius, middle - 0.5 * apart, middle + 0.5 * apart
    kinds = np.array([Kind.GRAIN, Kind.FINE, Kind.FINE])
    start = resting(place, radius, np.array([[0.0, 2 * middle]] * 3), kinds)
    velocity = np.zeros((3, 3))
    velocity[1:, 0] = 0.5 * SPEED, -0.5 * SPEED
    watch = Watch(step=step, steps=_STEPS)
    states = closed_run(case, replace(start, velocity=velocity), density, watch, folder)
    gap = np.array([np.ptp(state.fines().position[:, 0]) for state in states])
    modulus = pair_elastic(case, ("fine", "fine"), scales.stiffness_factor).modulus
    mass = 0.5 * sphere_mass(radius, density)
    deepest = overlap_of_impact(mass, SPEED, modulus, 0.5 * radius)
    lasts = collision_time(mass, SPEED, modulus, 0.5 * radius)
    return {
        FIRST: float(2 * radius - gap.min()) / deepest - 1,
        SECOND: step * int(np.count_nonzero(gap < 2 * radius)) / lasts - 1,
    }


def judge(measured: Sequence[Measured]) -> list[Row]:
    """The magnitudes of both errors."""
    own = [one for one in measured if one.point.series == SERIES]
    return [row for name in (FIRST, SECOND) for row in sizes(own, name)]


def answers(rows: Sequence[Row]) -> list[Answer]:
    """One line for each contact law."""
    texts = {
        LINEAR: (
            "largest overlap and restitution",
            "v/ω exp(−ζ/s atan(s/ζ)), s² = 1 − ζ², and Schwager and Pöschel 2007, eq. 20",
        ),
        HERTZ: (
            "largest overlap and duration",
            "(15 m v²/(16 E√R))^(2/5), 2.87 (m²/(R E² v))^(1/5) (Hertz 1882)",
        ),
    }
    lines = []
    for law, (what, formula) in texts.items():
        own = {row.quantity: row for row in rows if row.series == SERIES and row.value == law}
        if own and all(row.status == DONE for row in own.values()):
            first, second = own[FIRST].error, own[SECOND].error
            lines.append(
                Answer(
                    what=f"head-on collision of two fines, {law}: {what}",
                    expected=formula,
                    measured=f"off by {100 * first:.2g} % and {100 * second:.2g} %",
                    holds=max(first, second) < TOLERANCE,
                    test="tests/dem/test_contacts.py",
                )
            )
    return lines
