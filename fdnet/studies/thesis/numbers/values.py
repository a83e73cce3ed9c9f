"""The numbers of the thesis (Shi 2011), read from values.toml: lengths mm, everything else as a fraction or a count."""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

VALUES = Path(__file__).with_name("values.toml")
TABLE3 = "table3"
_SPECIMEN = re.compile(r"specimen([1-8])(?![0-9])")


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisSpecimen:
    """What the thesis tells of one specimen, None where it tells nothing.

    `fine_diameter_mm` of Table 4, `fine_radius_mm` and `grain_radius_mm` (low, high) of the tables that give radii;
    `damaged_porosity` one value a table, the one the results are compared with first; `section_reduction` of the
    permeability of eight sections of 1 mm; `first_section_reduction` read off a figure; `fraction_first_bin` of the
    invaded fines in the figure's first bin; `face_porosity_loss` at x = 0; `size_classes_mm` radii of the fines
    it shows by size. `sources` by field; `senses` by field, of
    those not "exact".
    """

    id: str
    porosity: float
    damaged_porosity: tuple[float, ...]
    invaded_depth_mm: float
    fine_diameter_mm: float | None = None
    fine_radius_mm: tuple[float, float] | None = None
    grain_radius_mm: tuple[float, float] | None = None
    invaded_count: int | None = None
    count_first_mm: int | None = None
    fraction_first_bin: float | None = None
    fraction_beyond_0p5mm: float | None = None
    face_porosity_loss: float | None = None
    section_reduction: tuple[float, ...] | None = None
    first_section_reduction: float | None = None
    size_classes_mm: tuple[tuple[float, float], ...] | None = None
    sources: Mapping[str, str] = field(default_factory=dict)
    senses: Mapping[str, str] = field(default_factory=dict)

    @property
    def reductions(self) -> tuple[float, ...]:
        """Permeability reduction by section as far as told: a table's, or the one of the first section, or none."""
        if self.section_reduction is not None:
            return self.section_reduction
        return () if self.first_section_reduction is None else (self.first_section_reduction,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistic:
    """One number about the first section of `specimen`: `value` of `quantity`, or with `between` its share in
    [low, high). `sense` "exact", "about", "at least" or "at most"; `source` a figure, table or section."""

    specimen: str
    quantity: str
    value: float
    sense: str
    source: str
    between: tuple[float, float] | None = None
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DepositionTold:
    """Share `value` (nan: none told) of the fines in throats of `throat_porosity` [low, high) that lie `nearer` the
    "axis" or the "wall"."""

    throat_porosity: tuple[float, float]
    source: str
    nearer: str = ""
    value: float = math.nan
    sense: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisValues:
    """All of them: `specimens` by "1" to "8" and "table3"; `table1`, `table2`, `conductance` by name."""

    first_section_mm: float
    table1: Mapping[str, Any]
    table2: Mapping[str, Any]
    conductance: Mapping[str, float]
    specimens: Mapping[str, ThesisSpecimen]
    statistics: tuple[Statistic, ...]
    deposition: tuple[DepositionTold, ...]


@cache
def thesis_values() -> ThesisValues:
    """The project's own values file."""
    told = tomllib.loads(VALUES.read_text(encoding="utf-8"))
    specimens = [*told["specimen"], told["table3"] | {"id": TABLE3}]
    return ThesisValues(
        first_section_mm=told["first_section_mm"],
        table1=_frozen(told["table1"]),
        table2=_frozen(told["table2"]),
        conductance=_frozen(told["conductance"]),
        specimens=MappingProxyType(
            {one["id"]: ThesisSpecimen(**_frozen(one)) for one in specimens}
        ),
        statistics=tuple(Statistic(**_frozen(one)) for one in told["statistic"]),
        deposition=tuple(DepositionTold(**_frozen(one)) for one in told["deposition"]),
    )


def specimen_number(run: str) -> str | None:
    """Which specimen a run is compared with: "5" for "specimen5", "specimen5-5to6", "quick-specimen5"; "table3" for
    runs that begin so; None for any other."""
    if run.startswith(TABLE3):
        return TABLE3
    found = _SPECIMEN.search(run)
    return found[1] if found else None


def thesis_of(run: str) -> ThesisSpecimen | None:
    """The thesis's specimen that a run is compared with, None where there is none."""
    number = specimen_number(run)
    return None if number is None else thesis_values().specimens[number]


def _frozen(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """The table with tuples for lists, read-only, tables within likewise."""
    frozen: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, list):
            frozen[name] = tuple(tuple(one) if isinstance(one, list) else one for one in value)
        else:
            frozen[name] = _frozen(value) if isinstance(value, dict) else value
    return MappingProxyType(frozen)
