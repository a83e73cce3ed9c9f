"""Spheres as a file gives them, before it is settled which are grains and which are fines."""

from dataclasses import dataclass

from fdnet.errors import CaseError
from fdnet.spheres.arrays import Array, one_line

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
"""Metres in each unit of length that a file may be in."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SphereRows:
    """N spheres of a file, in metres.

    Attributes:
        source: name of the file.
        scale: metres in the unit of the file.
        position: (N, 3) centres, m.
        radius: (N,) m.
        kind: (N,) int64 of `Kind` where the file names kinds, else None.
        type: (N,) int64 atom types where the file has them, else None.
        id: (N,) int64 numbers where the file has them, else None.
        box: (3, 2) bounds that the file gives, m, else None.
        step: time step of the simulation, 0 without one.
        notes: what the reader assumed, one sentence each.
    """

    source: str
    scale: float
    position: Array
    radius: Array
    kind: Array | None = None
    type: Array | None = None
    id: Array | None = None
    box: Array | None = None
    step: int = 0
    notes: tuple[str, ...] = ()

    __repr__ = one_line


def metres_per(units: str) -> float:
    """Metres in one of `units`. Raises CaseError on an unknown unit."""
    if units not in UNITS:
        raise CaseError(f"units {units!r}: expected one of {', '.join(UNITS)}")
    return UNITS[units]
