"""Fines that a constant force and viscous drag push past grains that do not move.

These are the forces of fdnet's invasion in a uniform velocity field: of Stokes drag c (u - v) the
part c u is constant and the rest is viscous.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fdnet.case.case import InvasionCase, with_fines
from fdnet.case.file import case_from
from fdnet.dem.deck import (
    contact_variables,
    header_variables,
    number,
    render_text,
    wall_law,
    write_data,
)
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.files import write_text
from fdnet.scales.contacts import sphere_mass
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import Frame, read_dump
from fdnet.spheres.snapshot import Snapshot
from validation.dem.runs import the_binary

DENSITY = 2146.0
"""Density of the fines, kg/m3: fdnet's default."""
VISCOSITY = 0.05
"""Dynamic viscosity, Pa s: fdnet's default."""
_COLUMNS = "id type xu yu zu vx vy vz radius"
_FORMAT = "%d %d %.17g %.17g %.17g %.9g %.9g %.9g %.17g"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pushed:
    """Spheres, what pushes them, and how long they are followed.

    Attributes:
        case: whose contacts count.
        spheres: grains, which stay where they are, and fines; the box is that of the simulation.
        push: constant force on every fine (x, y, z), N.
        damping: viscous drag on every fine, N s/m; 0 for none.
        step: time step, s.
        chunk_steps: steps from one look at the kinetic energy to the next.
        chunks: most looks.
        boundary: of the box along x, y, z, as LIGGGHTS names it.
        rest_energy: kinetic energy, J, below which the run ends; 0 to go on.
        walls: planes that touch the fines, as `_walls.in.j2` takes them.
        settle_steps: steps before the first look, after which the fines are seen once.
        density: of all spheres, kg/m3.
    """

    case: InvasionCase
    spheres: Snapshot
    push: tuple[float, float, float]
    damping: float
    step: float
    chunk_steps: int
    chunks: int
    boundary: str = "f f f"
    rest_energy: float = 0.0
    walls: Sequence[Mapping[str, Any]] = field(default=())
    settle_steps: int = 0
    density: float = DENSITY


def case_of(
    *,
    fine: float,
    stiffness: float,
    friction: float,
    damping_ratio: float,
    density: float = DENSITY,
    contact: Mapping[str, Any] | None = None,
) -> InvasionCase:
    """A case with contacts of one normal stiffness, N/m, for fines of radius `fine`, m."""
    grain, law = 2 * fine, dict(contact or {})
    material = {"friction": friction, "damping_ratio": damping_ratio}
    if law.get("model", "hooke") == "hooke":
        material["normal_stiffness_N_m"] = 2 * stiffness
    return with_fines(
        case_from(
            {
                "name": "outside",
                "box": {
                    "size_mm": [1e5 * grain] * 3,
                    "sides": "walls",
                    "wall_friction": friction,
                },
                "grains": {"radius_mm": 1e3 * grain, "count": 2, **material},
                "fines": {
                    "radius_mm": 1e3 * fine,
                    "count": 1,
                    "density_kg_m3": density,
                    **material,
                },
                "fluid": {"velocity_m_s": 1e-3, "viscosity_cP": 1e3 * VISCOSITY},
                "run": {"stiffness_N_m": stiffness},
                "contact": law,
            }
        )
    )


def stokes_drag(radius: float) -> float:
    """6 pi mu r, N s/m, for a radius in m (Stokes 1851)."""
    return 6 * math.pi * VISCOSITY * radius


def contact_step(
    radius: float, stiffness: float, factor: float, *, density: float = DENSITY
) -> float:
    """`factor` sqrt(m/k) of a fine, s, for its radius in m and a stiffness in N/m."""
    return factor * math.sqrt(sphere_mass(radius, density) / stiffness)


def plane_wall(case: InvasionCase, position: float) -> dict[str, Any]:
    """A rough plane x = `position` m that touches the fines, as `_walls.in.j2` takes it."""
    place = {"id": "plane", "group": "fines", "plane": "xplane", "position": number(position)}
    return place | wall_law(case, "invade", friction=True)


def run_pushed(pushed: Pushed, folder: Path) -> Frame:
    """The fines at the end: unwrapped places `xu`, `yu`, `zu`, m, and velocities.

    Those after the settling, if there is one, are in `folder`/settled.dump.

    Raises LiggghtsError when the run does not finish.
    """
    folder.mkdir(parents=True, exist_ok=True)
    spheres, case = pushed.spheres, pushed.case
    write_data(
        folder / "pushed.data",
        spheres,
        bounds=spheres.box,
        density=np.full(len(spheres), pushed.density),
        types=3,
    )
    text = render_text(
        "pushed.in.j2",
        header_variables(case, "invade", [], 1)
        | {
            "boundary": pushed.boundary,
            "skin": number(case.fines.mean_radius_m),
            "contacts": contact_variables(case, scales_of(case), "invade", friction=True),
            "time_step": number(pushed.step),
            "push": " ".join(number(force) for force in pushed.push),
            "damping": number(pushed.damping) if pushed.damping else "",
            "walls": pushed.walls,
            "settle_steps": pushed.settle_steps,
            "chunk_steps": pushed.chunk_steps,
            "chunks": pushed.chunks,
            "rest_energy": number(pushed.rest_energy) if pushed.rest_energy else "",
            "dump_columns": _COLUMNS,
            "dump_format": _FORMAT,
        },
    )
    write_text(folder / "in.pushed", text)
    run_deck(folder, "in.pushed", Launch(binary=the_binary()))
    return read_dump(folder / "motion.dump")[-1]
