"""Spheres as a file gives them: the names of columns that every format shares."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from fdnet.errors import CaseError
from fdnet.spheres.snapshot import KIND_NAMES, UNITS, Array, Kind, frozen, metres_per

PLACES = tuple(tuple(f"{axis}{end}" for axis in "xyz") for end in ("", "u", "s", "su"))
PLACES += (("points:0", "points:1", "points:2"),)
"""Columns of the centres: as they are, unwrapped across periods, both in parts of the box, and as
ParaView writes them."""
SCALED = PLACES[2:4]
RADII = {"radius": 1.0, "radii": 1.0, "r": 1.0, "diameter": 0.5, "diameters": 0.5, "d": 0.5}
"""Columns of the size, with the factor that makes a radius of it."""
OTHERS = ("kind", "type", "id")
_LENGTHS = {name for names in PLACES for name in names} | set(RADII)
_UNIT = re.compile(r"(.+?)(?:_|\s*[(\[]\s*)(m|cm|mm|um|[µμ]m)\s*[)\]]?")
_ROUNDING = 1e-3
"""Most relative difference of two columns that give the same radius, by the digits printed."""
_LARGEST_WHOLE = 2.0**53


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SphereRows:
    """N spheres of a file, in metres."""

    source: str  # name of the file
    scale: float  # metres in the unit of the file
    position: Array  # (N, 3) centres, m
    radius: Array  # (N,) m
    # (N,) int64 of `Kind`, atom types and numbers, where the file has them
    kind: Array | None = None
    type: Array | None = None
    id: Array | None = None
    box: Array | None = None  # (3, 2) bounds that the file gives, m, else None
    # what the file says of the sides across x, y and z ("pp", "ff"), else empty
    boundary: tuple[str, ...] = ()
    step: int = 0  # time step of the simulation, 0 without one
    notes: tuple[str, ...] = ()  # what the reader assumed, one sentence each
    warnings: tuple[str, ...] = ()  # what of the file could not be read, one sentence each


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Which columns of a file say what."""

    names: tuple[str, ...]  # names of all columns as the file has them
    place: tuple[int, ...]  # indices of the centres along x, y, z
    scaled: bool  # whether the centres are in parts of the box
    # indices of the columns of sizes, each with the factor that makes radii of it
    radius: dict[int, float]
    others: dict[str, int]  # index of each of kind, type and id that is there
    unit: str | None  # unit of length that the names carry, None without one

    @property
    def needed(self) -> tuple[int, ...]:
        """Indices of all columns that are read, in their order."""
        return tuple(sorted({*self.place, *self.radius, *self.others.values()}))

    @property
    def ignored(self) -> tuple[str, ...]:
        """Names of the columns that are not read."""
        return tuple(name for k, name in enumerate(self.names) if k not in self.needed)


def columns_of(names: Sequence[str], where: str, *, dump: bool = False) -> Columns:
    """The columns of a file by their names, in which capitals do not matter.

    Those of a `dump` may be centres in parts of its box, those of other files may end in the unit
    of length ("x_mm", "radius (um)"). Raises CaseError where a centre or a size is missing, a
    column that is needed occurs twice, or units differ.
    """
    known: dict[str, list[int]] = {}
    unit_of: dict[int, str | None] = {}
    for index, name in enumerate(names):
        plain, unit = (name.strip().lower(), None) if dump else named(name)
        known.setdefault(plain, []).append(index)
        unit_of[index] = unit
    given = [one for one in PLACES if all(name in known for name in one)]
    radii = [name for name in RADII if name in known]
    sought = [name for name in given if dump or name not in SCALED]
    shown = ",".join(names)[:200]
    if not sought or not radii:
        wanted = [name for name in "xyz" if name not in known] if not sought else []
        lacking = [*wanted, *([] if radii else ["radius"])] or ["x", "y", "z"]
        near = [one for name in lacking for one in get_close_matches(name, known, 1, 0.7)]
        hint = f" (is {near[0]!r} meant?)" if near else ""
        raise CaseError(
            f"{where}: no column {', '.join(lacking)} among {shown!r}{hint}; expected x,y,z and "
            "radius or diameter, and, if there, kind, type and id"
            + ("" if dump else " (or the same with their unit, x_mm)")
        )
    for name in (*sought[0], *radii, *OTHERS):
        if len(known.get(name, ())) > 1:
            raise CaseError(f"{where}: column {name!r} occurs twice in {shown!r}; remove one")
    place = tuple(known[name][0] for name in sought[0])
    radius = {known[name][0]: RADII[name] for name in radii}
    written = {unit_of[index] for index in (*place, *radius)}
    if len(written) > 1:
        shown = ", ".join(sorted(str(unit or "none") for unit in written))
        raise CaseError(f"{where}: its columns are in different units ({shown}); give all one")
    return Columns(
        names=tuple(names),
        place=place,
        scaled=sought[0] in SCALED,
        radius=radius,
        others={name: known[name][0] for name in OTHERS if name in known},
        unit=written.pop(),
    )


def named(text: str) -> tuple[str, str | None]:
    """A name in small letters without its unit of length, and that unit."""
    plain = text.strip()
    match = _UNIT.fullmatch(plain)
    if match is None or match[1].lower() not in _LENGTHS:
        return plain.lower(), None
    return match[1].lower(), match[2].replace("µ", "u").replace("μ", "u")


def scale_of(columns: Columns, units: str | None, where: str) -> float | None:
    """Metres in the unit of the columns; None where neither they nor `units` say it.

    Raises CaseError on an unknown unit, and where both say it.
    """
    given = None if units is None else metres_per(units)
    if columns.unit is None:
        return given
    if units not in (None, columns.unit):
        name = columns.names[next(iter(columns.radius))].strip()
        raise CaseError(f"{where}: its {name} is in {columns.unit}; leave out --units {units}")
    return UNITS[columns.unit]


def rows_from(
    columns: Columns,
    values: Mapping[int, Array],
    where: Callable[[int], str],
    *,
    scale: float,
    box: Array | None = None,
    **more: Any,
) -> SphereRows:
    """The spheres of a file from the `values` (N,) of its columns.

    `where` names a row in messages, `box` (3, 2) is in the unit of the file, `more` are fields of
    SphereRows. Raises CaseError where a value is impossible.
    """
    position = np.column_stack([values[index] for index in columns.place]).astype(float)
    sizes = {index: factor * values[index] for index, factor in columns.radius.items()}
    first = next(iter(sizes))
    radius = sizes[first].astype(float)

    def refuse(bad: Array, index: int, expected: str) -> None:
        """Raise CaseError on the first value of a column that is `bad`."""
        for row in np.flatnonzero(bad)[:1]:
            name, value = columns.names[index].strip(), values[index][row]
            raise CaseError(f"{where(row)}: {name} is {value:g}, expected {expected}")

    for index in columns.place:
        refuse(~np.isfinite(values[index]), index, "a finite number")
    for index in columns.radius:
        refuse(~(np.isfinite(values[index]) & (values[index] > 0)), index, "a number above 0")
    other = f"what {columns.names[first]} says; remove the column that is wrong"
    for index, size in sizes.items():
        refuse(np.abs(size - radius) > _ROUNDING * radius, index, other)
    if columns.scaled and box is not None:
        position = box[:, 0] + position * np.ptp(box, axis=1)
    whole: dict[str, Any] = {name: values[index] for name, index in columns.others.items()}
    for name, one in whole.items():
        allowed = (one == np.round(one)) & (np.abs(one) <= _LARGEST_WHOLE)
        expected = "a whole number, none too large"
        if name == "kind":
            allowed, expected = np.isin(one, list(Kind)), f"{' or '.join(KIND_NAMES)} (1 or 2)"
        refuse(~allowed, columns.others[name], expected)
    return SphereRows(
        scale=scale,
        position=frozen(scale * position),
        radius=frozen(scale * radius),
        box=None if box is None else frozen(scale * box),
        **{name: frozen(one, np.int64) for name, one in whole.items()} | more,
    )
