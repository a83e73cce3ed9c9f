"""The triaxial test in LIGGGHTS itself: six smooth plates, stresses held by servo.

A servo moves each plate at a speed in proportion to the stress that is missing on it.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.deck import (
    LeftOut,
    contact_variables,
    header_variables,
    number,
    render_text,
    wall_law,
    write_data,
)
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.errors import LiggghtsError
from fdnet.files import write_text
from fdnet.scales.contacts import series, sphere_mass
from fdnet.scales.scales import scales_of
from fdnet.spheres.dump import COLUMNS, FORMAT, read_frame
from fdnet.spheres.snapshot import Array, Snapshot, resting
from validation.dem.runs import the_binary

PLATES = ("x0", "x1", "y0", "y1", "z0", "z1")
STEP = 0.1
"""Time step over sqrt(m/k) of a grain."""
_ROWS, _SLOW = 200, 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Servo:
    """One stage of the test.

    Attributes:
        stress: on the sides, Pa; also along x where the strain rate is 0.
        strain_rate: along x, 1/s.
        steps: time steps.
        friction: whether the grains have friction.
    """

    stress: float
    strain_rate: float
    steps: int
    friction: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Curve:
    """What the plates measured at M times, and the grains at the end.

    Attributes:
        side: (M, 3) lengths of the box, m.
        stress: (M, 3) on the plates, Pa, compression above 0.
        grains: at the end; their box is that of the plates.
    """

    side: Array
    stress: Array
    grains: Snapshot


def time_step(case: Case) -> float:
    """`STEP` sqrt(m/k) of the smallest grain, s, at the stiffness of a contact of two."""
    mass = sphere_mass(case.grains.radius_range_m[0], case.grains.density_kg_m3)
    return STEP * math.sqrt(mass / pair_stiffness(case))


def pair_stiffness(case: Case) -> float:
    """Normal stiffness of a contact of two grains, N/m."""
    one = case.grains.normal_stiffness_N_m
    return series(one, one)


def run_servo(case: Case, grains: Snapshot, servo: Servo, folder: Path) -> Curve:
    """One stage in `folder`; the box of the grains is where the plates start.

    The case has `run.stiffness_N_m = "nominal"` and `box.wall_friction = 0`. Raises LiggghtsError
    when the run fails.
    """
    folder.mkdir(parents=True, exist_ok=True)
    side = np.diff(grains.box, axis=1)[:, 0]
    placed = resting(grains.position - grains.box[:, 0], grains.radius, _box(side))
    room = np.column_stack([-side, 2 * side])
    density = np.full(len(grains), case.grains.density_kg_m3)
    write_data(folder / "triaxial.data", placed, bounds=room, density=density, types=2)
    for name in PLATES:
        axis = "xyz".index(name[0])
        write_text(folder / f"{name}.stl", plate_text(axis, int(name[1]) * side[axis], side))
    write_text(folder / "in.triaxial", _deck(case, servo, side))
    run_deck(folder, "in.triaxial", Launch(binary=the_binary()))
    table = np.loadtxt(folder / "curve.txt", ndmin=2)
    if table.shape[1] != 6 or not np.all(np.isfinite(table)):
        raise LiggghtsError(f"{folder}/curve.txt: not six numbers a row; run the test again")
    frame = read_frame(folder / "end.dump")
    place = np.column_stack([frame.column(axis) for axis in "xyz"])
    end = resting(place, frame.column("radius"), _box(table[-1, :3]))
    return Curve(side=table[:, :3], stress=table[:, 3:], grains=end)


def _box(side: Array) -> Array:
    return np.column_stack([np.zeros(3), side])


def plate_text(axis: int, place: float, side: Array) -> str:
    """An STL plate of two triangles across `axis` at `place` m, twice as wide as the box."""
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = []
    for a, b in ((-0.5, -0.5), (1.5, -0.5), (1.5, 1.5), (-0.5, 1.5)):
        corner = [0.0, 0.0, 0.0]
        corner[axis], corner[u], corner[v] = place, a * side[u], b * side[v]
        corners.append(" ".join(f"{value:.15g}" for value in corner))
    lines = ["solid plate"]
    for triangle in ((0, 1, 2), (0, 2, 3)):
        lines += [f"facet normal {' '.join(str(int(k == axis)) for k in range(3))}", "outer loop"]
        lines += [f"vertex {corners[k]}" for k in triangle] + ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid plate"]) + "\n"


def _deck(case: Case, servo: Servo, side: Array) -> str:
    """The deck; the servo corrects a stress in about 1 / `_SLOW` steps."""
    step, stiffness = time_step(case), pair_stiffness(case)
    mass = sphere_mass(case.grains.mean_radius_m, case.grains.density_kg_m3)
    area = float(np.prod(side)) / float(side.max())
    left_out = [LeftOut(what="fines, fluid and gravity", why="a test of the grains alone")]
    if not servo.friction:
        left_out.append(LeftOut(what="friction", why="the pack is pressed as it was made"))
    scales = scales_of(case)
    law = wall_law(case, "pack", friction=servo.friction)
    variables = header_variables(case, "pack", left_out, 1) | {
        "boundary": "f f f",
        "contacts": contact_variables(case, scales, "pack", friction=servo.friction),
        "plates": PLATES,
        "plate_names": " ".join(PLATES),
        "wall_model": f"model {law['model']}",
        "wall_settings": law["settings"],
        "skin": number(0.4 * case.grains.radius_range_m[0]),
        "time_step": number(step),
        "viscous": number(0.02 * math.sqrt(stiffness * mass)),
        "side": [number(value) for value in side],
        "axial_speed": number(servo.strain_rate * side[0]) if servo.strain_rate else "",
        "gain": number(_SLOW * area / (20 * stiffness * step)),
        "stress": number(servo.stress),
        "every": max(1, servo.steps // _ROWS),
        "steps": servo.steps,
        "dump_columns": COLUMNS,
        "dump_format": FORMAT,
    }
    return render_text("triaxial.in.j2", variables)
