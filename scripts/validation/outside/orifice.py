"""One round constriction in a wall of held spheres: how many fines escape before a clog.

The fines lie as a heap on the wall, driven through the hole by Stokes drag in a uniform velocity
along x, which is a body force with viscous damping. The box is periodic: those that escape come
back on top of the heap, so that it stays crowded. All is scaled by the fine's diameter d.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fdnet.scales.clock import relaxation_time
from fdnet.scales.contacts import sphere_mass
from fdnet.spheres.dump import Frame, read_dump
from fdnet.spheres.snapshot import Array, Kind, Snapshot, resting
from validation.outside.pushed import (
    DENSITY,
    VISCOSITY,
    Pushed,
    case_of,
    contact_step,
    run_pushed,
    stokes_drag,
)

FINE = 5e-5
"""Radius of the fines, m."""
STIFFNESS = 1e3
"""Normal stiffness of the contacts, N/m."""
PUSH = 1e-3
"""Drag on a fine at rest over stiffness and radius."""
_WALL = 0.5
"""Radius of the wall's spheres over that of the fines."""
_MARGIN, _HEAP, _LOOSE = 3.0, 4.0, 0.25
"""Side of the box less the hole and depth of the heap, diameters; volume fraction at the start."""
_DENSE = 0.6
_BELOW = 2.0
_DAMPING, _STEP = 0.5, 0.2
_REST, _LOOK = 1e-7, 2.0
_CLEAR = 1.02
_TRIES = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class Discharge:
    """One run until a clog.

    Attributes:
        escaped: number of fines that went through the hole.
        clogged: whether they came to rest.
        steps: of the run.
    """

    escaped: int
    clogged: bool
    steps: int


def velocity() -> float:
    """Velocity of the fluid, m/s, that pushes a fine at rest with `PUSH` k r."""
    return PUSH * STIFFNESS * FINE / stokes_drag(FINE)


def stokes_number() -> float:
    """Relaxation time over the time in which the fluid passes a fine's diameter."""
    return relaxation_time(FINE, DENSITY, VISCOSITY) * velocity() / (2 * FINE)


def wall_spheres(ratio: float) -> tuple[Array, float, float]:
    """A wall in the plane x = 0 with a hole of `ratio` fine diameters around the origin.

    A ring of spheres that leaves a circle of just that diameter, and a square lattice of spheres
    that touch around it. No gap lets a fine through.

    Returns:
        Centres (N, 3) m, radius of the spheres m, side of the periodic square m.
    """
    small = _WALL * FINE
    reach = ratio * FINE + small
    ring = math.floor(math.pi / math.asin(small / reach))
    angle = 2 * math.pi * np.arange(ring) / ring
    cells = math.ceil((ratio + _MARGIN) * 2 * FINE / (2 * small))
    side = cells * 2 * small
    along = (np.arange(cells) + 0.5) * 2 * small - 0.5 * side
    y, z = (grid.ravel() for grid in np.meshgrid(along, along))
    outside = np.hypot(y, z) >= reach + 0.5 * small
    y = np.concatenate([reach * np.cos(angle), y[outside]])
    z = np.concatenate([reach * np.sin(angle), z[outside]])
    return np.column_stack([np.zeros_like(y), y, z]), small, side


def _scattered(count: int, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Places (count, 3) of fines that touch none, periodic in y and z, by random addition."""
    size, placed = high - low, np.empty((0, 3))
    reach = (2 * FINE * _CLEAR) ** 2
    for _ in range(_TRIES * count):
        if len(placed) == count:
            return placed
        gap = placed - (new := low + size * rng.random(3))
        gap[:, 1:] -= size[1:] * np.round(gap[:, 1:] / size[1:])
        if np.all(np.sum(gap**2, axis=1) > reach):
            placed = np.vstack([placed, new])
    raise RuntimeError(f"{count} fines find no room")


def start_of(ratio: float, seed: int) -> Snapshot:
    """The wall, and fines scattered upstream of it."""
    wall, small, side = wall_spheres(ratio)
    fine = sphere_mass(FINE, 1.0)
    count = round(_HEAP * 2 * FINE * side**2 * _DENSE / fine)
    height = count * fine / (_LOOSE * side**2)
    half = 0.5 * side
    low = np.array([-height - 3 * FINE, -half, -half])
    high = np.array([-3 * FINE, half, half])
    fines = _scattered(count, low, high, np.random.default_rng([seed, 11]))
    kinds = np.array([Kind.GRAIN] * len(wall) + [Kind.FINE] * count)
    radius = np.array([small] * len(wall) + [FINE] * count)
    box = np.column_stack([low - [2 * FINE, 0, 0], [_BELOW * 2 * FINE, half, half]])
    return resting(np.vstack([wall, fines]), radius, box, kinds)


def discharge(ratio: float, friction: float, folder: Path, *, seed: int, most: float) -> Discharge:
    """A heap that runs out through a hole until it clogs, on the real binary.

    The fines rain on the wall until all that were scattered have come down; counting begins then.
    `most` is the longest time after that, in times in which the fluid passes a fine's diameter.
    """
    start = start_of(ratio, seed)
    drag, step, fast = stokes_drag(FINE), contact_step(FINE, STIFFNESS, _STEP), velocity()
    passage = 2 * FINE / fast / step
    look, chunks = math.ceil(_LOOK * passage), math.ceil(most / _LOOK)
    settling = math.ceil(passage * float(np.ptp(start.box[0])) / (2 * FINE))
    moving = 0.5 * sphere_mass(FINE, DENSITY) * fast**2
    end = run_pushed(
        Pushed(
            case=case_of(
                fine=FINE, stiffness=STIFFNESS, friction=friction, damping_ratio=_DAMPING
            ),
            spheres=start,
            push=(drag * fast, 0.0, 0.0),
            damping=drag,
            step=step,
            chunk_steps=look,
            chunks=chunks,
            boundary="p p p",
            rest_energy=_REST * moving,
            settle_steps=settling,
        ),
        folder,
    )
    before = read_dump(folder / "settled.dump")[-1]
    return Discharge(
        escaped=_escaped(end, start.box) - _escaped(before, start.box),
        clogged=end.step < settling + chunks * look,
        steps=end.step,
    )


def _escaped(end: Frame, box: Array) -> int:
    """Passages through the hole: of unwrapped places beyond the wall, one for each period."""
    fines = end.column("type") == Kind.FINE
    beyond = end.column("xu")[fines] - 1.6 * FINE
    return int(np.sum(np.floor(beyond / np.ptp(box[0])) + 1))
