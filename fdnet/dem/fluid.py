"""What the fluid does to each fine, and how it is handed to LIGGGHTS: files of one value an atom.

The force on a fine of velocity v is F = C (u - v) + P: C its drag coefficient, u the velocity of
the fluid at it, and P a force that does not depend on v, such as its volume times the fall of
pressure. LIGGGHTS is given C and w = u + P / C, since F = C (w - v).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from fdnet.case.case import InvasionCase
from fdnet.spheres.arrays import Array
from fdnet.spheres.binary_dump import read_binary_frame
from fdnet.spheres.dump import COLUMNS, Frame
from fdnet.spheres.snapshot import Kind, Snapshot

STATE = "post/fluid.bin"
"""File in which LIGGGHTS shows the spheres when it asks for the fluid, all digits of them."""
_FILES = ("cd", "ux", "uy", "uz")
_GIVEN = ("f_uf[1]", "f_uf[2]", "f_uf[3]")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FluidForces:
    """What acts on N fines until they are looked at again.

    Attributes:
        coefficient: (N,) N s/m, C; above 0.
        velocity: (N, 3) m/s, u.
        push: (N, 3) N, P.
        pace: m/s, speed with which the fines move on; it decides when they are looked at again.
        measures: what the record of updates keeps, by the names of `Fluid.measured`.
    """

    coefficient: Array
    velocity: Array
    push: Array
    pace: float
    measures: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Moment:
    """When the fines are looked at.

    Attributes:
        step: of the simulation.
        time: s, since the start.
        before: the row of the update before this one; None for the first.
        first: the row of the first update; None for the first.
        fresh: whether a chunk begins. What is answered then must follow from the spheres and the
            two rows alone, so that a run that was cut gives the same.
        left: s, until the chunk ends, when they are looked at again in any case.
        given: (N,) m/s, speed w at which each of the N fines would go by the forces that it has
            now, in their order; 0 where it has none yet. None where it is not known.
        density: (N,) kg/m3 of each of the N fines, in their order. None where all have that of the
            case.
    """

    step: int
    time: float
    before: Mapping[str, float] | None
    first: Mapping[str, float] | None
    fresh: bool
    left: float = math.inf
    given: Array | None = None
    density: Array | None = None


def shown_columns(case: InvasionCase) -> str:
    """The columns that LIGGGHTS shows; where the flow follows the deposit with the w given."""
    given = _GIVEN if case.drag.field == "network" else ()
    return " ".join((COLUMNS, "density", *given))


def read_state(folder: Path, case: InvasionCase) -> Frame:
    """The spheres that LIGGGHTS shows. Raises DumpError when it did not write all of them."""
    return read_binary_frame(folder / STATE, tuple(shown_columns(case).split()))


def given_speed(frame: Frame) -> Array | None:
    """The speed w (N,) m/s that each sphere of a state was given, None where that is not shown."""
    if _GIVEN[0] not in frame.columns:
        return None
    return np.linalg.norm([frame.column(name) for name in _GIVEN], axis=0)


def fine_density(frame: Frame) -> Array:
    """The density (N,) kg/m3 of each fine of a state."""
    return frame.column("density")[frame.column("type") == Kind.FINE]


class Fluid(Protocol):
    """A fluid that answers for all fines of a state."""

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of the measures, in the order of the columns."""

    def forces(self, spheres: Snapshot, moment: Moment) -> FluidForces:
        """What acts on the fines of `spheres`, in their order."""


def write_forces(folder: Path, spheres: Snapshot, forces: FluidForces) -> None:
    """Write the files that the deck reads: the number of rows, then id and value of a fine each.

    Values have twelve digits. To LIGGGHTS the value of a fine that has no row is 0.
    """
    fines = spheres.fines()
    carried = forces.velocity + forces.push / forces.coefficient[:, None]
    for name, value in zip(_FILES, (forces.coefficient, *carried.T), strict=True):
        some = value != 0.0
        form = f"{np.sum(some)}\n" + "".join([f"{one} %.12g\n" for one in fines.id[some].tolist()])
        (folder / "post" / f"fluid.{name}").write_text(form % tuple(value[some].tolist()))


def largest_share(spheres: Snapshot, forces: FluidForces, density: Array, time: float) -> float:
    """`time` s over the shortest relaxation time m / C of a fine of `density` (N,) kg/m3."""
    if not len(forces.coefficient):
        return 0.0
    return float(np.max(drag_rate(spheres.fines(), forces.coefficient, density))) * time


def drag_rate(fines: Snapshot, coefficient: Array, density: Array | float) -> Array:
    """C / m (N,) 1/s, at which drag takes up the slip of N `fines`.

    `coefficient` (N,) N s/m is C. `density` kg/m3 is that of each fine (N,), or of all.
    """
    return coefficient / (density * 4.0 / 3.0 * np.pi * fines.radius**3)
