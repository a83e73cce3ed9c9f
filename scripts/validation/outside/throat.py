"""The throat of three grains that overlap: the largest fine that passes, by bisection.

Three equal grains of diameter D, each pair of which overlaps by delta D, have their centres at
the distance D (1 - delta) / sqrt(3) from the axis of the throat. A fine of diameter d passes if
d/D < 2 (1 - delta) / sqrt(3) - 1.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from fdnet.scales.contacts import sphere_mass
from fdnet.spheres.snapshot import Kind, Snapshot, resting
from validation.engine.error_rows import against_exact
from validation.engine.study import DONE, Measured, Point, Row, ladder
from validation.outside.answers import Answer, percent_error
from validation.outside.pushed import (
    DENSITY,
    Pushed,
    case_of,
    contact_step,
    run_pushed,
    stokes_drag,
)

SERIES, KNOB, PASSING = "throat of three grains", "overlap", "passing ratio"
TOLERANCE = 5e-3
"""Relative error that is asked for."""
ASKED = (0.0, 0.03, 0.05)
OVERLAPS = (0.0, 0.015, 0.03, 0.04, 0.05, 0.065)
SEEDS = 3
GRAIN = 2.5e-4
"""Radius of the grains, m."""
VELOCITY = 0.1
"""Velocity of the fluid that pushes the fine, m/s."""
FRICTION = 0.1
STIFFNESS = 1e4
"""Normal stiffness of the contacts, N/m."""
WITHIN, QUICK_WITHIN = 1e-3, 6e-3
"""Relative width at which the bisection ends."""
_BRACKET = 0.02
_DAMPING, _STEP = 0.5, 0.2
_START, _BEYOND, _PATIENCE = 0.6, 0.6, 3.0
_OFF_AXIS = 0.3
_LOOKS, _REST, _STILL = 100, 1e-6, 0.01


def passing_ratio(overlap: float) -> float:
    """2 (1 - delta) / sqrt(3) - 1: diameter over that of the grains of the largest fine."""
    return 2 * (1 - overlap) / math.sqrt(3) - 1


def bisected(passing: Callable[[float], bool], low: float, high: float, within: float) -> float:
    """The value between `low`, which passes, and `high`, which does not, to a relative `within`.

    Raises ValueError when the ends do not bracket it.
    """
    if not passing(low) or passing(high):
        raise ValueError(f"{low:g} should pass and {high:g} should not")
    while high - low > within * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if passing(middle) else (low, middle)
    return 0.5 * (low + high)


def passes(ratio: float, overlap: float, folder: Path, *, seed: int) -> bool:
    """Whether a fine of `ratio` grain diameters gets through the throat, on the real binary.

    It starts upstream, off the axis by a random offset of the `seed`, and is pushed along x by
    Stokes drag. Raises RuntimeError when it is neither through nor at rest in the end.
    """
    fine = ratio * GRAIN
    drag, step = stokes_drag(fine), contact_step(fine, STIFFNESS, _STEP)
    steps = math.ceil(_PATIENCE * (_START + _BEYOND) * GRAIN / VELOCITY / step)
    end = run_pushed(
        Pushed(
            case=case_of(
                fine=fine, stiffness=STIFFNESS, friction=FRICTION, damping_ratio=_DAMPING
            ),
            spheres=_start(fine, overlap, seed),
            push=(drag * VELOCITY, 0.0, 0.0),
            damping=drag,
            step=step,
            chunk_steps=math.ceil(steps / _LOOKS),
            chunks=_LOOKS,
            rest_energy=_REST * 0.5 * sphere_mass(fine, DENSITY) * VELOCITY**2,
        ),
        folder,
    )
    place, speed = float(end.column("xu")[0]), float(end.column("vx")[0])
    if place > 0.5 * _BEYOND * GRAIN:
        return True
    if abs(speed) > _STILL * VELOCITY:
        raise RuntimeError(f"{folder}: the fine still moves at {speed:g} m/s, raise the patience")
    return False


def _start(fine: float, overlap: float, seed: int) -> Snapshot:
    """Three grains around the axis x, and the fine (radius m) upstream, off the axis."""
    rng = np.random.default_rng([seed, 5])
    turn = rng.uniform(0, 2 * math.pi)
    off = _OFF_AXIS * passing_ratio(overlap) * GRAIN * math.sqrt(rng.uniform())
    angle = 2 * math.pi * np.arange(3) / 3
    far = 2 * GRAIN * (1 - overlap) / math.sqrt(3)
    corners = far * np.column_stack([np.zeros(3), np.cos(angle), np.sin(angle)])
    place = np.vstack([corners, [-_START * GRAIN, off * math.cos(turn), off * math.sin(turn)]])
    kinds = np.array([Kind.GRAIN] * 3 + [Kind.FINE])
    bounds = np.array([[-6 * GRAIN, 6 * GRAIN]] * 3)
    return resting(place, np.array([GRAIN] * 3 + [fine]), bounds, kinds)


def points(quick: bool) -> list[Point]:
    """Every overlap with several starts off the axis."""
    overlaps = ASKED[-1:] if quick else OVERLAPS
    settings = {"within": QUICK_WITHIN if quick else WITHIN}
    return ladder(SERIES, KNOB, overlaps, seeds=1 if quick else SEEDS, settings=settings)


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """The passing ratio, bisected from 2 % to either side of the closed form."""
    overlap, folder = float(point.value), work / point.slug
    exact = passing_ratio(overlap)
    bisection = bisected(
        lambda ratio: passes(ratio, overlap, folder, seed=point.seed),
        (1 - _BRACKET) * exact,
        (1 + _BRACKET) * exact,
        float(point.settings["within"]),
    )
    return {PASSING: bisection}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Relative errors of the passing ratio."""
    own = [one for one in measured if one.point.series == SERIES]
    return against_exact(own, PASSING, lambda one: passing_ratio(float(one.point.value)))


def answers(rows: Sequence[Row]) -> list[Answer]:
    """One line for each overlap that was asked for: the start with the largest error."""
    lines = []
    for overlap in ASKED:
        own = [row for row in rows if row.series == SERIES and row.value == overlap]
        own = [row for row in own if row.status == DONE]
        if own:
            worst = max(own, key=lambda row: abs(row.error))
            lines.append(
                Answer(
                    what=f"largest fine through a throat of three grains that overlap by "
                    f"{100 * overlap:g} %, d/D",
                    expected=f"{passing_ratio(overlap):.4f} (2(1 − δ)/√3 − 1)",
                    measured=f"{worst.observed:.4f}, {percent_error(worst.error)}; the worst of "
                    f"{len(own)} starts, bisected to {100 * WITHIN:g} %",
                    holds=abs(worst.error) < TOLERANCE,
                    test="tests/studies/test_outside_numbers.py",
                )
            )
    return lines
