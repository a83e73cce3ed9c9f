"""The numbers of the thesis (Shi 2011), read from values.toml.

Lengths are in mm, volumes in mm3; everything else is a fraction or a count.
"""

import math
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, SupportsFloat

VALUES = Path(__file__).with_name("values.toml")
TABLE3 = "table3"
DEPOSITION_SPECIMEN = "5"
"""The specimen of which Figures 56 and 57 show where fines sit in the throats."""
_SPECIMEN = re.compile(r"specimen([1-8])(?![0-9])")


@dataclass(frozen=True, slots=True, kw_only=True)
class Statistic:
    """One number of the thesis about the pores and throats of a specimen's first millimetre.

    Attributes:
        specimen: number of the specimen, "1" to "8".
        quantity: what is measured, a name of `numbers/statistics.py`.
        value: the value of the quantity, or with `between` the share of it in that range.
        sense: "exact", "about", "at least" or "at most".
        source: figure, table or section of the thesis.
        between: (low, high) of the range [low, high), mm or mm3; None for the quantity itself.
        note: a remark on how the thesis's words are read.
    """

    specimen: str
    quantity: str
    value: float
    sense: str = "about"
    source: str = ""
    between: tuple[float, float] | None = None
    note: str = ""

    @property
    def words(self) -> str:
        """The value in words, such as "about 70 %"."""
        return _in_words(self.sense, self.value)

    @property
    def subject(self) -> str:
        """What the value is of, such as "throat radius 0 to 0.05 mm"."""
        if self.between is None:
            return self.quantity
        unit = "mm³" if self.quantity.endswith("volume") else "mm"
        return f"{self.quantity} {self.between[0]:g} to {self.between[1]:g} {unit}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DepositionClaim:
    """Where the thesis says that the fines sit in throats of one class of porosity.

    Attributes:
        throat_porosity: (low, high) of the class [low, high).
        source: figure or section of the thesis.
        nearer: "axis" or "wall"; empty where the thesis gives no share.
        value: share of the fines that lie nearer the axis or the wall; nan where none is given.
        sense: "exact", "about", "at least" or "at most"; empty where none is given.
    """

    throat_porosity: tuple[float, float]
    source: str = ""
    nearer: str = ""
    value: float = math.nan
    sense: str = ""

    @property
    def words(self) -> str:
        """The claim in words, such as "at least 80 % nearer the wall"."""
        return f"{_in_words(self.sense, self.value)} nearer the {self.nearer}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisSpecimen:
    """What the thesis reports of one specimen; None or empty where it reports nothing.

    Attributes:
        id: "1" to "8", or "table3".
        porosity: initial porosity.
        damaged_porosity: porosity after the invasion, one value a table; results are compared
            with the first.
        invaded_depth_mm: depth of the invasion.
        fine_diameter_mm: diameter of the fines, from Table 4.
        fine_radius_mm: (low, high) radius of the fines, from the tables that give radii.
        grain_radius_mm: (low, high) radius of the grains.
        invaded_count: number of fines in the specimen.
        count_first_mm: number of fines in the first millimetre.
        fraction_first_bin: share of the invaded fines in the first bin of the figure.
        fraction_beyond_0p5mm: share of the invaded fines deeper than 0.5 mm.
        face_porosity_loss: loss of porosity at the formation face.
        section_reduction: 1 - k/k0 of the eight sections of 1 mm, from a table.
        first_section_reduction: 1 - k/k0 of the first section, read off a figure.
        size_classes_mm: (low, high) radii of the fines that the figure colours.
        statistics: numbers about the pores and throats of the first millimetre.
        deposition: where fines sit in the throats, one claim a class of throat porosity.
        sources: figure, table or section of the thesis, by field.
        senses: "about", "at least" or "at most", by field; fields that are exact are left out.
    """

    id: str
    porosity: float = math.nan
    damaged_porosity: tuple[float, ...] = ()
    invaded_depth_mm: float | None = None
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
    size_classes_mm: tuple[tuple[float, float], ...] = ()
    statistics: tuple[Statistic, ...] = ()
    deposition: tuple[DepositionClaim, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict)
    senses: Mapping[str, str] = field(default_factory=dict)

    @property
    def reductions(self) -> tuple[float, ...]:
        """1 - k/k0 by section: the table's values, or the first section's alone, or none."""
        if self.section_reduction is not None:
            return self.section_reduction
        return () if self.first_section_reduction is None else (self.first_section_reduction,)

    @property
    def porosity_loss(self) -> float | None:
        """Initial less damaged porosity; None where the thesis gives no damaged porosity."""
        return self.porosity - self.damaged_porosity[0] if self.damaged_porosity else None

    def deposition_in(self, throat_porosity: tuple[float, float]) -> DepositionClaim | None:
        """The claim on throats of that class (low, high) of porosity; None when there is none."""
        return next(
            (one for one in self.deposition if one.throat_porosity == throat_porosity), None
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ThesisValues:
    """All numbers of the thesis that the study uses.

    Attributes:
        first_section_mm: length of the section that the thesis examines in detail.
        table1: grains and box, by name.
        table2: fines and fluid, by name.
        conductance: parameters of the thesis's conductance laws, by name.
        specimens: the specimens by id, "1" to "8" and "table3".
        statistics: numbers about pores and throats of all specimens.
        deposition: classes of throat porosity, with the thesis's claim where it makes one.
    """

    first_section_mm: float
    table1: Mapping[str, Any]
    table2: Mapping[str, Any]
    conductance: Mapping[str, float]
    specimens: Mapping[str, ThesisSpecimen]
    statistics: tuple[Statistic, ...]
    deposition: tuple[DepositionClaim, ...]

    @property
    def by_case(self) -> dict[str, ThesisSpecimen]:
        """The specimens by the names of their cases, "specimen1" to "specimen8" and "table3"."""
        return {
            key if key == TABLE3 else f"specimen{key}": one for key, one in self.specimens.items()
        }


@cache
def thesis_values() -> ThesisValues:
    """The numbers in values.toml."""
    tables = tomllib.loads(VALUES.read_text(encoding="utf-8"))
    statistics = tuple(Statistic(**_frozen(one)) for one in tables["statistic"])
    deposition = tuple(DepositionClaim(**_frozen(one)) for one in tables["deposition"])
    specimens = {}
    for one in [*tables["specimen"], tables["table3"] | {"id": TABLE3}]:
        specimens[one["id"]] = ThesisSpecimen(
            **_frozen(one),
            statistics=tuple(each for each in statistics if each.specimen == one["id"]),
            deposition=tuple(
                each for each in deposition if each.nearer and one["id"] == DEPOSITION_SPECIMEN
            ),
        )
    return ThesisValues(
        first_section_mm=tables["first_section_mm"],
        table1=_frozen(tables["table1"]),
        table2=_frozen(tables["table2"]),
        conductance=_frozen(tables["conductance"]),
        specimens=MappingProxyType(specimens),
        statistics=statistics,
        deposition=deposition,
    )


def specimen_number(run: str) -> str | None:
    """The specimen that a run is compared with.

    "5" for "specimen5", "specimen5-5to6" and "quick-specimen5"; "table3" for runs whose name
    begins so; None for any other.
    """
    if run.startswith(TABLE3):
        return TABLE3
    match = _SPECIMEN.search(run)
    return match[1] if match else None


def thesis_of(run: str) -> ThesisSpecimen | None:
    """The thesis's specimen that a run is compared with; None where there is none."""
    number = specimen_number(run)
    return None if number is None else thesis_values().specimens[number]


def percent(value: SupportsFloat) -> str:
    """A fraction in per cent with two digits, such as "3.3 %"."""
    whole = 100 * float(value)
    return f"{whole:.2g} %" if whole < 99.5 else f"{whole:.0f} %"


def _in_words(sense: str, value: float) -> str:
    return percent(value) if sense == "exact" else f"{sense} {percent(value)}"


def _frozen(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """The table read-only, with tuples in place of lists; tables within it likewise."""
    frozen: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, list):
            frozen[name] = tuple(tuple(one) if isinstance(one, list) else one for one in value)
        else:
            frozen[name] = _frozen(value) if isinstance(value, dict) else value
    return MappingProxyType(frozen)
