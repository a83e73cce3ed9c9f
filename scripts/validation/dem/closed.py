"""Closed systems: spheres with a case's contacts, without fluid or gravity.

Their energy and momentum are known.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.case.case import Case
from fdnet.dem.deck import (
    contact_variables,
    header_variables,
    number,
    render_text,
    snapshot_of,
    wall_variables,
    write_data,
)
from fdnet.dem.liggghts import Launch, run_deck
from fdnet.files import write_text
from fdnet.scales.scales import Scales, scales_of
from fdnet.spheres.dump import COLUMNS, read_dump
from fdnet.spheres.geometry import touching_pairs
from fdnet.spheres.snapshot import Array, Kind, Snapshot
from validation.dem.runs import the_binary

TEMPLATES = Path(__file__).parents[1] / "templates"
"""Folder of the decks that only comparisons use."""
_EXACT = "%d %d " + " ".join(["%.17g"] * 7)


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """How long to follow a closed system.

    Attributes:
        step: time step, s.
        steps: steps that are observed.
        every: steps from one observation to the next.
        rest: further steps, which are not observed.
    """

    step: float
    steps: int
    every: int = 1
    rest: int = 0


def closed_run(
    case: Case, start: Snapshot, density: float, watch: Watch, folder: Path
) -> list[Snapshot]:
    """The spheres at every observation, the start included.

    Contacts are without friction, and walls enclose grains and fines.

    Args:
        case: whose contacts count.
        start: the spheres with their velocities.
        density: of all spheres, kg/m3.
        watch: how long to follow them.
        folder: of the LIGGGHTS run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scales = scales_of(case)
    write_data(
        folder / "closed.data",
        start,
        bounds=start.box,
        density=np.full(len(start), density),
        types=3,
    )
    rows = [
        f"{atom} " + " ".join(number(v) for v in velocity) + " 0.0 0.0 0.0"
        for atom, velocity in zip(start.id, start.velocity, strict=True)
    ]
    data = (folder / "closed.data").read_text()
    write_text(folder / "closed.data", data + "\nVelocities\n\n" + "\n".join(rows) + "\n")
    write_text(folder / "in.closed", _deck(case, scales, start, watch))
    run_deck(folder, "in.closed", Launch(binary=the_binary()))
    return [
        snapshot_of(frame, case, time_s=frame.step * watch.step)
        for frame in read_dump(folder / "motion.dump")
    ]


def _deck(case: Case, scales: Scales, start: Snapshot, watch: Watch) -> str:
    walls = [wall | {"group": "all"} for wall in wall_variables(case, "invade", friction=False)]
    return render_text(
        "closed.in.j2",
        header_variables(case, "invade", [], 1)
        | {
            "skin": number(float(start.radius.min())),
            "contacts": contact_variables(case, scales, "invade", friction=False),
            "walls": walls,
            "time_step": number(watch.step),
            "steps": watch.steps,
            "every": watch.every,
            "rest": watch.rest,
            "dump_columns": COLUMNS,
            "dump_format": _EXACT,
        },
        folder=TEMPLATES,
    )


def kinetic_energy(spheres: Snapshot, density: float) -> float:
    """Sum of m v^2 / 2, J; frictionless spheres do not spin."""
    return float(0.5 * np.sum(_masses(spheres, density) * np.sum(spheres.velocity**2, axis=1)))


def momentum(spheres: Snapshot, density: float) -> Array:
    """Sum of m v (3,), kg m/s."""
    return np.asarray(_masses(spheres, density) @ spheres.velocity)


def _masses(spheres: Snapshot, density: float) -> Array:
    return np.asarray(4 / 3 * np.pi * spheres.radius**3 * density)


def spring_energy(spheres: Snapshot, scales: Scales) -> float:
    """Sum of k delta^2 / 2, J, over grains in contact with each other or with one of six walls."""
    assert np.all(spheres.kind == Kind.GRAIN)
    _, overlap = touching_pairs(spheres, (False, False, False))
    below = spheres.radius[:, None] - (spheres.position - spheres.box[:, 0])
    above = spheres.radius[:, None] - (spheres.box[:, 1] - spheres.position)
    at_walls = np.sum(np.maximum(below, 0.0) ** 2) + np.sum(np.maximum(above, 0.0) ** 2)
    between = scales.contacts["grain-grain"].normal_stiffness * np.sum(overlap**2)
    return float(0.5 * (between + scales.contacts["grain-wall"].normal_stiffness * at_walls))


def restitution_of(damping_ratio: float) -> float:
    """Coefficient of restitution of a damped linear contact that ends at zero force.

    exp(-z/s (pi - atan2(2 s z, 1 - 2 z^2))) with s^2 = 1 - z^2, for a damping ratio z below
    1/sqrt(2) (Schwager and Poeschel 2007, eq. 20).
    """
    s = math.sqrt(1 - damping_ratio**2)
    return math.exp(
        -damping_ratio
        / s
        * (math.pi - math.atan2(2 * damping_ratio * s, 1 - 2 * damping_ratio**2))
    )


def deepest_overlap_of(damping_ratio: float, speed: float, stiffness: float, mass: float) -> float:
    """Largest overlap of that contact, m: v / w exp(-z/s atan(s/z)) with w = sqrt(k/m).

    Without damping it is v / w. `speed` in m/s, `stiffness` in N/m, `mass` in kg.
    """
    frequency = math.sqrt(stiffness / mass)
    if damping_ratio == 0:
        return speed / frequency
    s = math.sqrt(1 - damping_ratio**2)
    return speed / frequency * math.exp(-damping_ratio / s * math.atan2(s, damping_ratio))
