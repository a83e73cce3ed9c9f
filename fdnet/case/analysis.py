"""How permeability is computed: the table [analysis] of a case, and the same choices without a case."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypedDict

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationError

from fdnet.case.names import (
    DEFAULT_DAMAGE_LAW,
    DEFAULT_LAW,
    MOST_SECTIONS,
    DamageLawName,
    LawName,
    WallName,
)
from fdnet.case.parts import Finite, Fraction, Part, Positive
from fdnet.errors import CaseError


def _count_or_edges(value: Any) -> str:
    """A case file gives a count; only Python gives edges, as a tuple."""
    return "[edges]" if isinstance(value, tuple) else "[count]"


Count = Annotated[int, Field(ge=1, le=MOST_SECTIONS), Tag("[count]")]
Edges = Annotated[tuple[Finite, ...], Tag("[edges]")]
Sections = Annotated[Count | Edges, Discriminator(_count_or_edges)]


class AnalysisKeys(TypedDict, total=False):
    """The keywords of `AnalysisChoices.of_pack` and of `fdnet.analyse`; see `AnalysisChoices`."""

    sections: int | Sequence[float]
    law: str
    damage_law: str
    clogging_threshold: float | None
    middle_band: str
    throat_overlap: str
    profile_bin_mm: float | None
    walls: str


class AnalysisChoices(Part):
    """How permeability is computed; the default laws are fdnet's most accurate pair.

    Attributes:
        sections: number of equal slabs across the flow; in Python also their edges (S+1,), m.
        law: conductance law of clean throats, a key of `fdnet.LAWS`.
        damage_law: law of throats with fines, a key of `fdnet.DAMAGE_LAWS`.
        clogging_threshold: throat porosity below which the thesis's laws take a throat as clogged;
            without a value the law's own (0.40 `thesis`, 0.36 `thesis-code`).
        middle_band: how the thesis's laws decide between deposition and clogging: by the threshold
            alone, or between porosities 0.36 and 0.80 by the position of the fines.
        throat_overlap: volume of a fine inside a throat, exact or by the thesis's two planes.
        profile_bin_mm: thickness of the bins of the depth profile, mm; None (Python only): the mean
            radius of the grains.
        walls: whether side walls hold the fluid (`no-slip`) or it slips along them (`slip`).
    """

    sections: Sections = 8
    law: LawName = DEFAULT_LAW
    damage_law: DamageLawName = DEFAULT_DAMAGE_LAW
    clogging_threshold: Fraction | None = None
    middle_band: Literal["threshold", "position"] = "threshold"
    throat_overlap: Literal["exact", "two-plane"] = "exact"
    profile_bin_mm: Positive | None = 0.25
    walls: WallName = "no-slip"

    @classmethod
    def of_pack(cls, **keys: Any) -> "AnalysisChoices":
        """Choices for spheres without a case: one section and bins of a mean grain radius, or as given.

        `keys` are those of `AnalysisKeys`. Raises CaseError that names every key with a bad value.
        """
        given = {"sections": 1, "profile_bin_mm": None} | keys
        given["sections"] = _plain_sections(given["sections"])
        try:
            return cls.model_validate(given)
        except ValidationError as error:
            raise CaseError("; ".join(map(_refusal, error.errors()))) from error

    def changed(self, **keys: Any) -> "AnalysisChoices":
        """The same choices with `keys` changed. Raises CaseError as `of_pack` does."""
        return type(self).of_pack(**self.model_dump() | keys) if keys else self


def _plain_sections(value: Any) -> Any:
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, list | tuple | np.ndarray):
        return tuple(np.asarray(value, dtype=float).ravel().tolist())
    return value


def _refusal(item: Any) -> str:
    key = str(item["loc"][0])
    if item["type"] == "extra_forbidden":
        known = ", ".join(AnalysisChoices.model_fields)
        return f"analysis.{key}: unknown key; choose some of {known}"
    what = (
        item["msg"].replace("Input should be", "should be").replace("should be a valid", "is no")
    )
    return f"analysis.{key}: {item['input']!r} {what}"
