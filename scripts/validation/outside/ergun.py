"""Ergun's bed: its pressure drop, and the velocity at which its spheres lift on the real binary.

The case is CFDEMcoupling's tutorial ErgunTestMPI (`CFD/octave/totalPressureDrop.m`), whose
velocity of fluidisation takes the viscous term of Ergun's law alone.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.scales.contacts import sphere_mass
from fdnet.scales.drag import ERGUN_INERTIAL, ERGUN_VISCOUS
from fdnet.spheres.snapshot import Kind, resting
from validation.engine.error_rows import against_exact
from validation.engine.study import DONE, Measured, Point, Row
from validation.outside.answers import Answer, percent_error
from validation.outside.pushed import (
    Pushed,
    case_of,
    contact_step,
    plane_wall,
    run_pushed,
)
from validation.outside.throat import bisected

SERIES, KNOB = "Ergun's bed", "quantity"
DROP, LIFT = "pressure drop, Pa", "velocity that lifts the bed, m/s"


@dataclass(frozen=True, slots=True, kw_only=True)
class Bed:
    """A bed of equal spheres in a liquid.

    Attributes:
        diameter: of the spheres, m.
        porosity: volume fraction of the liquid.
        viscosity: Pa s.
        density: of the liquid, kg/m3.
    """

    diameter: float
    porosity: float
    viscosity: float
    density: float


def ergun_gradient(bed: Bed, velocity: float) -> float:
    """Fall of pressure with length at the superficial `velocity` m/s, Pa/m.

    150 mu s^2 U / (phi^3 d^2) + 1.75 rho s U^2 / (phi^3 d), s = 1 - phi.
    """
    linear, square = _coefficients(bed)
    return linear * velocity + square * velocity**2


def ergun_velocity(bed: Bed, gradient: float) -> float:
    """Superficial velocity, m/s, at which the pressure falls by `gradient` Pa/m."""
    linear, square = _coefficients(bed)
    return 2 * gradient / (linear + math.sqrt(linear**2 + 4 * square * gradient))


def fluidisation_velocity(bed: Bed, density: float, gravity: float = 9.81) -> float:
    """Superficial velocity, m/s, whose pressure drop carries the weight of the bed.

    The weight is s (rho_p - rho) g a volume; `density` is rho_p, that of the spheres, kg/m3.
    """
    return ergun_velocity(bed, (1 - bed.porosity) * (density - bed.density) * gravity)


def _coefficients(bed: Bed) -> tuple[float, float]:
    """Those of U and U^2 in Ergun's law."""
    solid, pores = 1 - bed.porosity, bed.porosity**3
    linear = ERGUN_VISCOUS * bed.viscosity * solid**2 / (pores * bed.diameter**2)
    return linear, ERGUN_INERTIAL * bed.density * solid / (pores * bed.diameter)


BED = Bed(diameter=1e-3, porosity=0.451335, viscosity=1.5e-3, density=10.0)
LENGTH, VELOCITY, DENSITY, GRAVITY = 0.0156, 0.02, 2000.0, 9.81
"""Length of the bed, m; superficial velocity, m/s; density of the spheres, kg/m3; g, m/s2."""
TUTORIAL: Mapping[str, float] = {DROP: 230.5, LIFT: 0.01454}
"""What the tutorial's formulas give."""
TOLERANCE = 5e-3
WITHIN = 1e-3
STIFFNESS = 100.0
"""Normal stiffness of the contacts, N/m."""
_ACROSS, _LAYERS = 3, 5
_STEP, _STEPS, _RISEN = 0.2, 40_000, 0.02
_BRACKET = 0.02


def viscous_lift() -> float:
    """d^2 (rho_p - rho) g phi^3 / (150 mu (1 - phi)), m/s: the tutorial's formula."""
    solid = 1 - BED.porosity
    weight = (DENSITY - BED.density) * GRAVITY
    return BED.diameter**2 * weight * BED.porosity**3 / (150 * BED.viscosity * solid)


def forces_on(velocity: float) -> tuple[float, float]:
    """Push on a sphere at rest, N, and its drag coefficient, N s/m, in the bed's flow.

    Model A: V G of the gradient G, and the drag phi G V / (1 - phi), so that N spheres carry the
    pressure drop of their bed; the push is both less the weight in the fluid. `velocity` is the
    superficial one, m/s.
    """
    volume, solid = sphere_mass(0.5 * BED.diameter, 1.0), 1 - BED.porosity
    gradient = ergun_gradient(BED, velocity)
    drag = BED.porosity * gradient * volume / solid
    weight = volume * (DENSITY - BED.density) * GRAVITY
    return volume * gradient + drag - weight, drag * BED.porosity / velocity


def lifts(velocity: float, folder: Path) -> bool:
    """Whether spheres that lie in layers on a floor rise at this superficial velocity, m/s."""
    radius = 0.5 * BED.diameter
    push, drag = forces_on(velocity)
    grid = np.arange(_ACROSS) * 2 * radius
    layers = radius + np.arange(_LAYERS) * 2 * radius
    place = np.stack(np.meshgrid(layers, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    side, top = _ACROSS * 2 * radius, 4 * _LAYERS * radius
    marker = [[top - radius, 0.0, 0.0]]
    kinds = np.array([Kind.GRAIN] + [Kind.FINE] * len(place))
    bounds = np.array([[-4 * radius, top], [-radius, side - radius], [-radius, side - radius]])
    case = case_of(
        fine=radius, stiffness=STIFFNESS, friction=0.1, damping_ratio=0.5, density=DENSITY
    )
    end = run_pushed(
        Pushed(
            case=case,
            spheres=resting(np.vstack([marker, place]), radius, bounds, kinds),
            push=(push, 0.0, 0.0),
            damping=drag,
            step=contact_step(radius, STIFFNESS, _STEP, density=DENSITY),
            chunk_steps=_STEPS,
            chunks=1,
            boundary="f p p",
            walls=(plane_wall(case, 0.0),),
            density=DENSITY,
        ),
        folder,
    )
    fines = end.column("type") == Kind.FINE
    return float(end.column("xu")[fines].min()) > radius * (1 + 2 * _RISEN)


def points(quick: bool) -> list[Point]:
    """The pressure drop, and the velocity that lifts the bed; the quick form has the first."""
    return [Point(series=SERIES, knob=KNOB, value=n) for n in ([DROP] if quick else [DROP, LIFT])]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """The pressure drop by fdnet's formula, or the velocity bisected on the real binary."""
    if point.value == DROP:
        return {DROP: LENGTH * ergun_gradient(BED, VELOCITY)}
    folder, exact = work / point.slug, viscous_lift()
    bisection = bisected(
        lambda velocity: not lifts(velocity, folder),
        (1 - _BRACKET) * exact,
        (1 + _BRACKET) * exact,
        WITHIN,
    )
    return {LIFT: bisection}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Relative errors against the tutorial's numbers."""
    own = [one for one in measured if one.point.series == SERIES]
    return [
        row
        for one in own
        for row in against_exact(
            [one], str(one.point.value), lambda m: TUTORIAL[str(m.point.value)]
        )
    ]


def answers(rows: Sequence[Row]) -> list[Answer]:
    """Both numbers."""
    source = "CFDEMcoupling's tutorial ErgunTestMPI"
    test = "tests/studies/test_outside_numbers.py"
    texts = {
        DROP: (
            "pressure drop of Ergun's bed: d 1 mm, porosity 0.451335, 15.6 mm, U 0.02 m/s",
            "230.5 Pa",
            "{:.1f} Pa (formula of `validation.outside.ergun`)",
        ),
        LIFT: (
            "superficial velocity that lifts spheres of that bed from the floor, model A",
            "0.01454 m/s (viscous term alone)",
            f"{{:.5f}} m/s, bisected to {100 * WITHIN:g} %; Ergun's inertial term is in it",
        ),
    }
    lines = []
    for row in rows:
        if row.series == SERIES and row.status == DONE:
            what, expected, words = texts[str(row.value)]
            lines.append(
                Answer(
                    what=what,
                    expected=f"{expected} ({source})",
                    measured=f"{words.format(row.observed)}, {percent_error(row.error)}",
                    holds=abs(row.error) < TOLERANCE,
                    test=test,
                )
            )
    return lines
