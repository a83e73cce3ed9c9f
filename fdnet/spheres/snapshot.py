"""Spheres of one moment, their read-only arrays, units and axes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from enum import IntEnum
from typing import Any

import numpy as np

from fdnet.errors import CaseError

Array = np.ndarray[Any, np.dtype[Any]]

SKEWED = 1e-9  # Most that a cell may lean, over its longest side, and still count as right-angled
MOST_SHOWN = 60  # Longest text of one field in `one_line`, characters


def frozen(values: Any, dtype: Any = None) -> Array:
    """A read-only copy of `values` as an array."""
    array = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


def one_line(owner: Any) -> str:
    """The data class `owner` on one line: numbers as they are, arrays by their shape alone."""
    shown = (f"{field.name}={_short(getattr(owner, field.name))}" for field in fields(owner))
    return f"{type(owner).__name__}({', '.join(shown)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"array{value.shape}"
    if isinstance(value, float):
        return f"{value:.6g}"
    text = " ".join(repr(value).split())
    if len(text) <= MOST_SHOWN:
        return text
    many = isinstance(value, tuple | list | dict)
    return f"{len(value)} items" if many else f"{type(value).__name__}(...)"


# ---- Units of length, and the axes x, y, z, given by letters or as truth values.
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
"""Metres in each unit of length that spheres may be given in."""


def metres_per(units: str) -> float:
    """Metres in one of `UNITS`. Raises CaseError on an unknown unit."""
    if units not in UNITS:
        raise CaseError(f"units {units!r}: expected one of {', '.join(UNITS)}")
    return UNITS[units]


Directions = str | bool | Sequence[bool]
"""Some of the three axes: letters such as "yz", three truth values (x, y, z), or one for all."""


def periodic_axes(periodic: Directions) -> tuple[bool, bool, bool]:
    """Which of x, y, z are periodic, from letters ("yz", "" for none) or truth values.

    Raises CaseError on other letters, on a repeated letter and on another number of values.
    """
    if isinstance(periodic, bool | np.bool_):
        return (bool(periodic),) * 3
    if isinstance(periodic, str):
        if not set(periodic) <= set("xyz") or len(set(periodic)) != len(periodic):
            raise CaseError(
                f"periodic: {periodic!r}, expected any of x, y, z together, for example 'yz'"
            )
        return "x" in periodic, "y" in periodic, "z" in periodic
    values = tuple(periodic) if isinstance(periodic, Iterable) else ()
    if len(values) != 3 or not all(isinstance(value, bool | np.bool_) for value in values):
        raise CaseError(
            f"periodic: {periodic!r}, expected letters such as 'yz', or truth values: one, or "
            "three for x, y, z"
        )
    return bool(values[0]), bool(values[1]), bool(values[2])


def sides_of(spheres: "Snapshot", periodic: Directions | None) -> tuple[bool, bool, bool]:
    """Which of x, y, z are periodic: as given, else as the file of the spheres says, else none."""
    if periodic is None:
        return spheres.periodic or (False, False, False)
    return periodic_axes(periodic)


# ---- All spheres of a specimen at one step, in SI units.
class Kind(IntEnum):
    """What a sphere is; the number is its LIGGGHTS atom type."""

    GRAIN = 1
    FINE = 2


KIND_NAMES = {"grain": Kind.GRAIN, "fine": Kind.FINE}  # How files and users name the kinds


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Snapshot:
    """N spheres at one step, grains and fines; the arrays are read-only.

    Attributes:
        step: time step of the simulation, 0 for spheres that come from no simulation.
        time_s: time, s.
        box: (3, 2) lower and upper bound of the specimen along x, y, z, m; the formation face is
            the lower bound of x.
        id: (N,) int64 number of each sphere.
        kind: (N,) int64 of `Kind`, 1 a grain, 2 a fine.
        position: (N, 3) centres, m.
        radius: (N,) m.
        velocity: (N, 3) m/s.
        periodic: which of the sides across x, y and z repeat, by the file that the spheres come
            from; None where no file says it.

    Raises CaseError when shapes disagree, values are not finite, or a kind is neither grain nor
    fine.

    Examples:
        Four grains of 0.25 mm and a fine of 50 um between them:

        >>> import fdnet
        >>> places = [[0, 0, 0], [0.5, 0, 0], [0, 0.5, 0], [0, 0, 0.5], [0.16] * 3]
        >>> radii = [0.25] * 4 + [0.05]
        >>> kinds = ["grain"] * 4 + ["fine"]
        >>> spheres = fdnet.Snapshot.from_arrays(places, radii, kind=kinds, units="mm")
        >>> spheres
        Snapshot(4 grains, 1 fine, step 0, box 1 x 1 x 1 mm)
        >>> spheres.fines().radius.tolist()
        [5e-05]
    """

    step: int
    time_s: float
    box: Array
    id: Array
    kind: Array
    position: Array
    radius: Array
    velocity: Array
    periodic: tuple[bool, bool, bool] | None = None

    def __post_init__(self) -> None:
        count = len(self.id)
        shapes = {
            "box": (3, 2),
            "id": (count,),
            "kind": (count,),
            "position": (count, 3),
            "radius": (count,),
            "velocity": (count, 3),
        }
        for name, shape in shapes.items():
            value = frozen(getattr(self, name), np.int64 if name in ("id", "kind") else np.float64)
            where = f"snapshot at step {self.step}: {name}"
            if value.shape != shape:
                raise CaseError(f"{where} has shape {value.shape}, expected {shape}")
            if not np.all(np.isfinite(value)):
                raise CaseError(f"{where} holds values that are not finite")
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.id)

    def __repr__(self) -> str:
        fines = int(np.sum(self.kind == Kind.FINE))
        counts = {"grain": len(self) - fines, "fine": fines}
        own = ", ".join(f"{count} {name}{'s' * (count != 1)}" for name, count in counts.items())
        size = " x ".join(f"{1e3 * side:.4g}" for side in np.ptp(self.box, axis=1))
        return f"Snapshot({own}, step {self.step}, box {size} mm)"

    @classmethod
    def from_arrays(
        cls,
        position: Any,
        radius: Any,
        *,
        box: Any = None,
        kind: Any = Kind.GRAIN,
        periodic: Directions | None = None,
        units: str = "m",
    ) -> "Snapshot":
        """Spheres at rest from plain arrays, at step 0 and numbered from 1.

        Args:
            position: (N, 3) centres.
            radius: (N,) radii, or one for all.
            box: the specimen: its three lengths from 0 on, (3, 2) lower and upper bounds, the six
                numbers x0, x1, y0, y1, z0, z1, or a (3, 3) cell whose sides lie along x, y and z,
                as ASE has it. Without it, the box around all grains.
            kind: "grain" or "fine", a `Kind`, or (N,) of either.
            periodic: sides that repeat, as for `fdnet.analyse`; ASE's `pbc` as well.
            units: unit of all lengths given: "m", "cm", "mm" or "um".

        Returns:
            The spheres in SI units.

        Raises:
            CaseError: shapes disagree, a value is not finite, a radius is not above 0, a kind or a
                unit is unknown, the cell is skewed, or there is neither a box nor a grain.
        """
        scale, place = metres_per(units), np.asarray(position, dtype=float)
        if place.ndim != 2 or place.shape[1] != 3:
            raise CaseError(f"position has shape {place.shape}, expected (N, 3)")
        count = len(place)
        radii, kinds = _for_each(radius, count, "radius"), _for_each(_kinds(kind), count, "kind")
        if np.any(~(radii > 0)):
            bad = radii[~(radii > 0)][0]
            raise CaseError(f"radius holds {bad}, expected numbers above 0, {units}")
        bounds = grain_box(place, radii, kinds) if box is None else checked_box(box)
        made = resting(scale * place, scale * radii, scale * bounds, kinds)
        return made if periodic is None else replace(made, periodic=periodic_axes(periodic))

    def turned(self, axis: str) -> "Snapshot":
        """The same spheres with `axis` ("x", "y" or "z") as the new x.

        They are moved so that the box starts at x = 0. The order of the axes stays cyclic: the new
        x, y, z are `axis` and the two that follow it.
        """
        if axis not in ("x", "y", "z"):
            raise CaseError(f"axis: {axis!r}, expected x, y or z")
        turn = [("xyz".index(axis) + k) % 3 for k in range(3)]
        start = np.array([self.box[turn[0], 0], 0.0, 0.0])
        sides = self.periodic
        return replace(
            self,
            box=self.box[turn] - start[:, None],
            position=self.position[:, turn] - start,
            velocity=self.velocity[:, turn],
            periodic=sides and (sides[turn[0]], sides[turn[1]], sides[turn[2]]),
        )

    def where(self, mask: Array) -> "Snapshot":
        """The spheres for which `mask` (N,) is true, or those of the indices `mask`."""
        own: dict[str, Any] = {name: getattr(self, name)[mask] for name in _OF_EACH}
        return replace(self, **own)

    def grains(self) -> "Snapshot":
        """The big spheres, by kind."""
        return self.where(self.kind == Kind.GRAIN)

    def fines(self) -> "Snapshot":
        """The small spheres, by kind."""
        return self.where(self.kind == Kind.FINE)

    def joined(self, other: "Snapshot") -> "Snapshot":
        """These spheres followed by those of `other`, at the step and time of `other`."""
        both: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in _OF_EACH
        }
        return replace(self, step=other.step, time_s=other.time_s, **both)


_OF_EACH = ("id", "kind", "position", "radius", "velocity")  # What a snapshot holds of each sphere


def resting(
    position: Array, radius: Array | float, box: Array, kind: Array | int = Kind.GRAIN
) -> Snapshot:
    """Spheres at rest at `position` (N, 3) m, at step 0 and numbered from 1, unchecked.

    `radius` m and `kind` are of each sphere or of all; `box` (3, 2) m.
    """
    count = len(position)
    return Snapshot(
        step=0,
        time_s=0.0,
        box=box,
        id=np.arange(1, count + 1),
        kind=np.broadcast_to(kind, count),
        position=position,
        radius=np.broadcast_to(radius, count),
        velocity=np.zeros((count, 3)),
    )


def _for_each(values: Any, count: int, name: str) -> Array:
    array = np.asarray(values)
    if array.shape not in ((), (count,)):
        raise CaseError(f"{name} has shape {array.shape}, expected one value or ({count},)")
    return np.broadcast_to(array, count)


def _kinds(kind: Any) -> Array:
    """Kinds as numbers, from names or numbers. Raises CaseError on one that is neither."""
    names = np.asarray(kind, dtype=object)
    flat = [KIND_NAMES.get(one, one) for one in names.ravel()]
    for one in flat:
        if one not in (Kind.GRAIN, Kind.FINE):
            raise CaseError(f"kind holds {one!r}, expected grain or fine (1 or 2)")
    return np.array(flat, dtype=np.int64).reshape(names.shape)


def checked_box(box: Any) -> Array:
    """(3, 2) bounds of a box, from them, from six numbers, three lengths or a (3, 3) cell.

    Raises CaseError unless they are finite numbers, the lower ones first, and the sides of a cell
    lie along x, y and z.
    """
    try:
        bounds = np.asarray(box, dtype=float)
    except (TypeError, ValueError):
        bounds = np.empty(0)
    if bounds.shape == (3, 3):
        skewed = bounds - np.diag(np.diag(bounds))
        if np.max(np.abs(skewed)) > SKEWED * np.max(np.abs(bounds)):
            raise CaseError(
                f"box: the cell {bounds.tolist()} is skewed (triclinic), expected sides along x, "
                "y and z; repeat or cut the pack so that it fills a right-angled box"
            )
        bounds = np.diag(bounds)
    if bounds.shape == (3,):
        bounds = np.column_stack([np.zeros(3), bounds])
    good = bounds.shape in ((3, 2), (6,)) and np.all(np.isfinite(bounds))
    if not good or np.any(np.diff(bounds.reshape(3, 2)) <= 0):
        raise CaseError(
            f"box: {box!r}, expected three lengths above 0, or six numbers x0,x1,y0,y1,z0,z1 with "
            "each lower bound below the upper"
        )
    return bounds.reshape(3, 2)


def grain_box(position: Array, radius: Array, kind: Array) -> Array:
    """(3, 2) box around all grains, m. Raises CaseError where there is no grain."""
    grains = kind == Kind.GRAIN
    if not grains.any():
        raise CaseError("box: missing, and there is no grain to take it from; give the box")
    place, reach = position[grains], radius[grains][:, None]
    return np.column_stack([np.min(place - reach, axis=0), np.max(place + reach, axis=0)])


def unmoved(now: tuple[Array, Array], before: tuple[Array, Array]) -> tuple[Array, Array]:
    """Indices of the spheres that are where they were: among those of `now`, and of `before`.

    Each is the numbers (N,) of spheres and their places (N, 3) m.
    """
    _, new, old = np.intersect1d(now[0], before[0], assume_unique=True, return_indices=True)
    same = np.all(now[1][new] == before[1][old], axis=1)
    return new[same], old[same]
