"""A fine on an inclined plane: it rolls, or slides while it rolls, as closed forms say.

A sphere that rolls without slip down a slope of the angle a gains g sin(a) 5/7; it slips where
tan(a) > 7/2 f, f the friction, and then gains g (sin(a) - f cos(a)). With rolling friction m it
rests where tan(a) < m, and else gains g (sin(a) - m cos(a)) 5/7.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fdnet.scales.contacts import sphere_mass
from fdnet.spheres.dump import read_dump
from fdnet.spheres.snapshot import Kind, resting
from validation.engine.error_rows import against_exact
from validation.engine.study import DONE, Measured, Point, Row, ladder
from validation.outside.answers import Answer, percent_error
from validation.outside.pushed import (
    DENSITY,
    Pushed,
    case_of,
    contact_step,
    plane_wall,
    run_pushed,
)

SERIES, KNOB, GAIN = "fine on a slope", "slope, degrees", "acceleration over g"
FRICTION = 0.3
SLOPES = (5.0, 20.0, 40.0, 60.0, 75.0)
RESISTED = "fine on a slope with rolling friction"
ROLLING_FRICTION, RESISTED_SLOPES = 0.2, (8.0, 11.0, 12.0, 15.0, 20.0)
RESTS = 1e-3
"""Acceleration over g below which a fine rests: it rocks on the spring of its contact."""
TOLERANCE = 0.01
GRAVITY = 9.81
FINE = 5e-5
"""Radius of the fine, m."""
STIFFNESS = 10.0
"""Normal stiffness of the contact, N/m: weight bends it by 1e-5 radii."""
_STEPS, _STEP = 40_000, 0.1


def rolling_gain(slope: float, friction: float) -> float:
    """Acceleration over g, down a slope in degrees, of a sphere that starts at rest."""
    angle = math.radians(slope)
    if math.tan(angle) <= 3.5 * friction:
        return 5 / 7 * math.sin(angle)
    return math.sin(angle) - friction * math.cos(angle)


def resisted_gain(slope: float, resistance: float) -> float:
    """Acceleration over g down a slope, degrees, with a coefficient of rolling friction."""
    angle = math.radians(slope)
    return 5 / 7 * max(0.0, math.sin(angle) - resistance * math.cos(angle))


def gain_on(slope: float, folder: Path, *, resistance: float | None = None) -> float:
    """Acceleration over g of a fine that started at rest on the plane x = 0, once it is steady.

    The weight is a constant force into the plane and along y. `slope` is in degrees, `resistance`
    the coefficient of rolling friction.
    """
    law = {} if resistance is None else {"rolling_friction": resistance}
    case = case_of(
        fine=FINE, stiffness=STIFFNESS, friction=FRICTION, damping_ratio=0.5, contact=law
    )
    angle, mass = math.radians(slope), sphere_mass(FINE, DENSITY)
    weight = mass * GRAVITY
    sunk = weight * math.cos(angle) / STIFFNESS
    step = contact_step(FINE, STIFFNESS, _STEP)
    far = 0.5 * GRAVITY * (_STEPS * step) ** 2 + 20 * FINE
    place = np.array([[6 * FINE, -8 * FINE, 0.0], [FINE - sunk, 0.0, 0.0]])
    bounds = np.array([[-10 * FINE, 10 * FINE], [-12 * FINE, far], [-10 * FINE, 10 * FINE]])
    end = run_pushed(
        Pushed(
            case=case,
            spheres=resting(place, FINE, bounds, np.array([Kind.GRAIN, Kind.FINE])),
            push=(-weight * math.cos(angle), weight * math.sin(angle), 0.0),
            damping=0.0,
            step=step,
            settle_steps=_STEPS // 2,
            chunk_steps=_STEPS // 2,
            chunks=1,
            walls=(plane_wall(case, 0.0),),
        ),
        folder,
    )
    settled = read_dump(folder / "settled.dump")[-1]
    first, last = (
        float(frame.column("vy")[frame.column("type") == Kind.FINE][0]) for frame in (settled, end)
    )
    return (last - first) / ((end.step - settled.step) * step * GRAVITY)


def points(quick: bool) -> list[Point]:
    """Slopes below and above those where the fine begins to slip, or to roll."""
    free = ladder(SERIES, KNOB, SLOPES[1:4:2] if quick else SLOPES, seeds=1, settings={})
    slopes = RESISTED_SLOPES[::4] if quick else RESISTED_SLOPES
    return [*free, *ladder(RESISTED, KNOB, slopes, seeds=1, settings={})]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """The acceleration over g."""
    resistance = ROLLING_FRICTION if point.series == RESISTED else None
    return {GAIN: gain_on(float(point.value), work / point.slug, resistance=resistance)}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Relative errors of the acceleration; of a fine that rests, the acceleration itself."""
    free = [one for one in measured if one.point.series == SERIES]
    resisted = [one for one in measured if one.point.series == RESISTED]
    return [
        *against_exact(free, GAIN, lambda one: rolling_gain(float(one.point.value), FRICTION)),
        *against_exact(
            resisted,
            GAIN,
            lambda one: resisted_gain(float(one.point.value), ROLLING_FRICTION),
            scale=lambda one: resisted_gain(float(one.point.value), ROLLING_FRICTION) or 1.0,
        ),
    ]


def answers(rows: Sequence[Row]) -> list[Answer]:
    """The slopes on which the fine rolls, slips, or rests; the worst of each."""
    slips_from = math.degrees(math.atan(3.5 * FRICTION))
    own = [row for row in rows if row.series == SERIES and row.status == DONE]
    lines = []
    for what, formula, group in (
        ("rolls", "5/7 g sin a", [row for row in own if float(row.value) < slips_from]),
        ("slips", "g (sin a − f cos a)", [row for row in own if float(row.value) > slips_from]),
    ):
        if group:
            worst = max(group, key=lambda row: abs(row.error))
            slopes = ", ".join(f"{row.value:g}" for row in group)
            lines.append(
                Answer(
                    what=f"fine {what} down a plane of {slopes} degrees, friction {FRICTION:g}: "
                    "acceleration",
                    expected=f"{formula}, {rolling_gain(float(worst.value), FRICTION):.4f} g at "
                    f"{worst.value:g} degrees (rigid sphere, slips from {slips_from:.1f})",
                    measured=f"{worst.observed:.4f} g, {percent_error(worst.error)}, the worst",
                    holds=abs(worst.error) < TOLERANCE,
                    test="tests/studies/test_outside_numbers.py",
                )
            )
    return lines + _resisted(rows)


def _resisted(rows: Sequence[Row]) -> list[Answer]:
    own = [row for row in rows if row.series == RESISTED and row.status == DONE]
    angle = math.degrees(math.atan(ROLLING_FRICTION))
    lines = []
    for what, formula, bound, group in (
        ("rests", "0", RESTS, [row for row in own if float(row.value) < angle]),
        (
            "rolls",
            "5/7 g (sin a − m cos a)",
            TOLERANCE,
            [row for row in own if float(row.value) > angle],
        ),
    ):
        if group:
            worst = max(group, key=lambda row: abs(row.error))
            slopes = ", ".join(f"{row.value:g}" for row in group)
            lines.append(
                Answer(
                    what=f"fine {what} on a plane of {slopes} degrees, rolling friction "
                    f"{ROLLING_FRICTION:g}: acceleration",
                    expected=f"{formula} (rolls from {angle:.1f} degrees)",
                    measured=f"{worst.observed:.2g} g at {worst.value:g} degrees, the worst"
                    + (f": {percent_error(worst.error)}" if what == "rolls" else ""),
                    holds=abs(worst.error) < bound,
                    test="tests/dem/test_contacts.py",
                )
            )
    return lines
