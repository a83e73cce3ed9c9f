"""Three spheres: a fine that falls around the neck of two touching grains that do not move.

The case is LAMMPS's `examples/granular/in.sync_verlet` (Vyas and others, Comput. Phys. Commun.
310, 109524): without the integrator's error the fine leaves the neck after 0.145 s.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from
from fdnet.dem.deck import contact_variables, header_variables, number, render_text, write_data
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.files import write_text
from fdnet.scales.contacts import fall_velocity, false_force, groove_slope, sphere_mass
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import COLUMNS, FORMAT, read_dump
from fdnet.spheres.snapshot import Kind, resting
from validation.dem.runs import the_binary

LEAVES_AFTER = 0.145
"""Time, s, at which the fine leaves where the integrator is mended (LAMMPS's own example)."""
PULL = 9.81
"""Acceleration of the pull, m/s2."""
GRAIN, FINE, DENSITY = 5e-3, 2.5e-4, 2500.0
"""Radii of grains and fine, m, and the density of the fine, kg/m3."""
_RESTITUTION, _FRICTION = 0.5, 0.5
_START_DEGREES, _AWAY = 1.0, 1.02
_DURATION, _LOOKS = 0.2, 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Neck:
    """Contacts of the three spheres.

    Attributes:
        stiffness: normal contact stiffness, N/m.
        shear_ratio: tangential over normal contact stiffness.
        step: time step, s.
    """

    stiffness: float
    shear_ratio: float
    step: float

    @property
    def false_force(self) -> float:
        """Force that the integrator adds in a quarter turn, over the pull."""
        mass = sphere_mass(FINE, DENSITY)
        rolling = fall_velocity(mass * PULL, mass, groove_slope(FINE / GRAIN) * GRAIN)
        return false_force(self.shear_ratio * self.stiffness, rolling, self.step) / (mass * PULL)


def factor_step(stiffness: float, factor: float) -> float:
    """`factor` sqrt(m/k) of the fine, s, for a stiffness in N/m."""
    return factor * math.sqrt(sphere_mass(FINE, DENSITY) / stiffness)


def leaving_time(neck: Neck, folder: Path) -> float:
    """When the fine is 2 % further from the axis of the neck than in contact, s.

    Infinite when it is held for 0.2 s. `folder` is that of the LIGGGHTS run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _write_inputs(neck, folder)
    run_deck(folder, "in.neck", Launch(binary=the_binary()))
    far = _AWAY * groove_slope(FINE / GRAIN) * GRAIN
    for frame in read_dump(folder / "motion.dump"):
        y, z = (float(frame.column(axis)[0]) for axis in "yz")
        if math.hypot(y, z) > far:
            return frame.step * neck.step
    return math.inf


def _case(neck: Neck) -> InvasionCase:
    """A case whose contact of grain and fine is that of the three spheres."""
    fall = -math.log(_RESTITUTION)
    material = {
        "normal_stiffness_N_m": 2 * neck.stiffness,
        "shear_stiffness_N_m": 2 * neck.shear_ratio * neck.stiffness,
        "friction": _FRICTION,
        "damping_ratio": fall / math.hypot(math.pi, fall),
    }
    fine = {"radius_mm": 1e3 * FINE, "count": 1, "density_kg_m3": DENSITY}
    return with_fines(
        case_from(
            {
                "name": "neck",
                "box": {"size_mm": [50.0, 50.0, 50.0], "sides": "walls", "wall_friction": 0.0},
                "grains": {"radius_mm": 1e3 * GRAIN, "count": 2, **material},
                "fines": {**fine, **material},
                "fluid": {"velocity_m_s": 1e-3},
                "drag": {"pressure_gradient": False},
                "run": {"stiffness_N_m": neck.stiffness},
            }
        )
    )


def _write_inputs(neck: Neck, folder: Path) -> None:
    """Grains at x = -R and R, the fine between them, one degree from the highest place."""
    case, start = _case(neck), math.radians(_START_DEGREES)
    height = groove_slope(FINE / GRAIN) * GRAIN
    place = np.array(
        [
            [-GRAIN, 0.0, 0.0],
            [GRAIN, 0.0, 0.0],
            [0.0, height * math.sin(start), height * math.cos(start)],
        ]
    )
    fallen = 0.5 * PULL * _DURATION**2
    bounds = np.array([[-3 * GRAIN, 3 * GRAIN]] * 2 + [[-3 * GRAIN - fallen, 3 * GRAIN]])
    kinds = np.array([Kind.GRAIN, Kind.GRAIN, Kind.FINE])
    spheres = resting(place, np.array([GRAIN, GRAIN, FINE]), bounds, kinds)
    write_data(folder / "neck.data", spheres, bounds=bounds, density=np.full(3, DENSITY), types=3)
    steps = math.ceil(_DURATION / neck.step)
    text = render_text(
        "neck.in.j2",
        header_variables(case, "invade", [], 1)
        | {
            "skin": number(FINE),
            "contacts": contact_variables(case, scales_of(case), "invade", friction=True),
            "time_step": number(neck.step),
            "pull": number(-sphere_mass(FINE, DENSITY) * PULL),
            "steps": steps,
            "every": max(1, steps // _LOOKS),
            "dump_columns": COLUMNS,
            "dump_format": FORMAT,
        },
    )
    write_text(folder / "in.neck", text)
