"""One free fine by fdnet's own invasion: each force of the fluid brings it to a known velocity.

- Gravity and buoyancy in any direction: v_T = 2 r^2 (rho_p - rho_f) g / (9 mu) (Stokes 1851).
- The force of the pressure gradient: the fine outruns the fluid by V G / (6 pi mu r), with the
  gradient G = mu u phi / k of the pack.
- Drag at a finite Reynolds number: the slip s of a fine that falls has s (1 + 0.15 Re^0.687) =
  v_T (Schiller and Naumann 1933), found by bisection.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from, set_keys
from fdnet.dem.deck import specimen_box
from fdnet.dem.invasion import invade
from fdnet.dem.liggghts import Launch
from fdnet.scales.scales import invasion_scales
from fdnet.spheres.snapshot import Array, Kind, resting
from validation.dem.runs import the_binary
from validation.engine.error_rows import sizes
from validation.engine.study import DONE, Measured, Point, Row
from validation.outside.answers import EXACT, Answer

SERIES, KNOB, ERROR = "free fine", "force", "error of the velocity"
OBLIQUE, GRADIENT, INERTIA = "oblique gravity", "pressure gradient", "finite Reynolds number"
TOLERANCE = 0.01
RADIUS, DENSITY, LIQUID, VISCOSITY = 5e-5, 2146.0, 1095.0, 0.05
"""Radius of the fine, m; densities of fine and fluid, kg/m3; viscosity, Pa s."""
_SPEED, _THIN = 0.5, 0.1
"""Velocity of the fluid along x, m/s; the viscosity in the case of inertia over `VISCOSITY`."""
_PULLS: Mapping[str, tuple[float, float, float]] = {
    OBLIQUE: (1.2e4, -0.9e4, -2.0e4),
    INERTIA: (0.0, 0.0, -6.0e3),
}
_BASE = {
    "name": "free-fine",
    "box": {"size_mm": [3.0, 3.0, 3.0], "sides": "periodic"},
    "grains": {"radius_mm": 0.25, "porosity": 0.40},
    "fines": {"radius_mm": 1e3 * RADIUS, "count": 1, "density_kg_m3": DENSITY},
    "fluid": {
        "viscosity_cP": 1e3 * VISCOSITY,
        "density_kg_m3": LIQUID,
        "velocity_m_s": _SPEED,
    },
    "drag": {
        "refresh_steps": 1,
        "upstream": "interstitial",
        "pressure_gradient": False,
    },
    "gravity": {"mode": "off"},
}
_SETTINGS: Mapping[str, tuple[str, ...]] = {
    OBLIQUE: (
        "gravity.mode=on",
        f"gravity.acceleration_m_s2={list(_PULLS[OBLIQUE])}",
        "run.duration_ms=0.25",
    ),
    GRADIENT: ("drag.pressure_gradient=true", "run.duration_ms=1.0"),
    INERTIA: (
        "gravity.mode=on",
        f"gravity.acceleration_m_s2={list(_PULLS[INERTIA])}",
        "drag.inertia=schiller-naumann",
        f"fluid.viscosity_cP={1e3 * VISCOSITY * _THIN}",
        "run.duration_ms=1.0",
    ),
}


def stokes_fall(gravity: Sequence[float], viscosity: float) -> Array:
    """2 r^2 (rho_p - rho_f) g / (9 mu) along each axis, m/s."""
    return 2 * RADIUS**2 * (DENSITY - LIQUID) * np.array(gravity) / (9 * viscosity)


def slip_with_inertia(stokes: float, viscosity: float) -> float:
    """The slip s, m/s, of s (1 + 0.15 Re^0.687) = `stokes` with Re = 2 r rho_f s / mu."""
    low, high = 0.0, stokes
    for _ in range(100):
        middle = 0.5 * (low + high)
        reynolds = 2 * RADIUS * LIQUID * middle / viscosity
        low, high = (
            (middle, high) if middle * (1 + 0.15 * reynolds**0.687) < stokes else (low, middle)
        )
    return low


def expected(force: str, case: InvasionCase) -> Array:
    """Velocity (3,), m/s, at which the forces balance."""
    fluid = np.array([_SPEED, 0.0, 0.0])
    if force == OBLIQUE:
        return np.asarray(fluid + stokes_fall(_PULLS[force], VISCOSITY))
    if force == INERTIA:
        thin = VISCOSITY * _THIN
        fall = stokes_fall(_PULLS[force], thin)
        return np.asarray(fluid - [0, 0, slip_with_inertia(float(-fall[2]), thin)])
    scales = invasion_scales(case)
    share = 2 / 9 * RADIUS**2 * scales.porosity / scales.permeability
    return (1 + share) * fluid


def case_of(force: str) -> InvasionCase:
    """The case of one force."""
    data = {name: dict(part) if isinstance(part, dict) else part for name, part in _BASE.items()}
    return with_fines(case_from(set_keys(data, list(_SETTINGS[force]))))


def points(quick: bool) -> list[Point]:
    """Each force."""
    forces = [GRADIENT] if quick else list(_SETTINGS)
    return [Point(series=SERIES, knob=KNOB, value=force) for force in forces]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Distance of the last velocity from the balance, over the distance from the fluid's."""
    force, folder = str(point.value), work / point.slug
    case = case_of(force)
    lonely = resting(np.array([[2.7e-3, 3e-4, 3e-4]]), 2.5e-4, specimen_box(case), Kind.GRAIN)
    end = invade(case, invasion_scales(case), lonely, folder, Launch(binary=the_binary()))
    seen, exact = end.damaged.fines().velocity[0], expected(force, case)
    slip = exact - [_SPEED, 0.0, 0.0]
    return {ERROR: float(math.dist(seen, exact) / np.linalg.norm(slip))}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """The errors, as they are."""
    return sizes([one for one in measured if one.point.series == SERIES], ERROR)


def answers(rows: Sequence[Row]) -> list[Answer]:
    """One line for each force."""
    laws = {
        OBLIQUE: "2 r² (ρ_p − ρ_f) g / (9 μ) along each axis (Stokes 1851)",
        GRADIENT: "outruns the fluid by V G / (6πμr), G = μ u φ / k",
        INERTIA: "s (1 + 0.15 Re^0.687) = Stokes's fall (Schiller and Naumann 1933)",
    }
    return [
        Answer(
            what=f"free fine, {row.value}: velocity in the end",
            expected=laws[str(row.value)],
            measured=f"off by {100 * row.error:.1g} % of the slip"
            if row.error > EXACT
            else f"off by less than {100 * EXACT:g} % of the slip",
            holds=row.error < TOLERANCE,
            test="tests/studies/test_outside_numbers.py",
        )
        for row in rows
        if row.series == SERIES and row.status == DONE
    ]
