"""How permeability is computed: the table [analysis] of a case, or the same without one."""

import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any, Literal, TypedDict, TypeVar

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationError, field_validator

from fdnet.case.names import (
    ALL_SPHERES,
    AUTO,
    DEFAULT_LAW,
    MOST_SECTIONS,
    MOST_SPHERES,
    REMOVED_LAWS,
    DamageLawName,
    LawName,
    WallName,
)
from fdnet.case.values import Finite, Fraction, Part, Positive, still_there
from fdnet.errors import CaseError


def _count_or_edges(value: Any) -> str:
    """A case file gives a count; only Python gives edges, as a tuple."""
    return "[edges]" if isinstance(value, tuple) else "[count]"


Function = TypeVar("Function", bound=Callable[..., Any])
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
    """How permeability is computed; the default laws are fdnet's most accurate pair."""

    sections: Sections = Field(
        8,
        description="Number of equal slabs along the flow in `sections.csv`. In Python also the "
        "edges (S+1,) of the slabs, m.",
    )
    law: LawName = Field(DEFAULT_LAW, description="Conductance of a clean throat.")
    damage_law: DamageLawName = Field(
        AUTO,
        description='How fines lower the permeability: "all-spheres", the network of grains and '
        "fines together, or a law that damages the throats between grains. "
        f'"auto" takes "all-spheres" up to {MOST_SPHERES:,} spheres and "section-archie" above.',
    )
    clogging_threshold: Fraction | None = Field(
        None,
        description="Throat porosity below which the thesis's damage laws take a throat as "
        'clogged. When absent: 0.40 ("thesis") or 0.36 ("thesis-code").',
    )
    middle_band: Literal["threshold", "position"] = Field(
        "threshold",
        description="Rule of the thesis's damage laws for a throat porosity of 0.36 to 0.80: "
        "by `clogging_threshold` alone, or by where the fines lie in the throat.",
    )
    throat_overlap: Literal["exact", "two-plane"] = Field(
        "exact",
        description="Volume of a fine inside a throat: exact, or by the thesis's two planes.",
    )
    profile_bin_mm: Positive | None = Field(
        0.25,
        description="Width of the depth bins in `profile.csv`. In Python also None, the mean "
        "radius of the grains.",
    )
    walls: WallName = Field(
        "no-slip",
        description="Whether side walls hold the fluid or let it slip; known to "
        '"lubrication", "section-archie" and "all-spheres".',
    )

    @field_validator("law", "damage_law", mode="before")
    @classmethod
    def _is_there(cls, name: Any) -> Any:
        return still_there(name, REMOVED_LAWS)

    def refusals(self) -> Iterator[str]:
        """Why laws do not go together, one sentence each."""
        if self.damage_law == ALL_SPHERES and self.law != DEFAULT_LAW:
            yield (
                f"analysis.damage_law: {self.damage_law!r} needs a network of all spheres, whose "
                f"law is {DEFAULT_LAW!r}, analysis.law is {self.law!r}; take analysis.law = "
                f"{DEFAULT_LAW!r}, or another damage law"
            )

    @property
    def profile_bin_m(self) -> float | None:
        """Width of the depth bins, m; None stands for the mean radius of the grains."""
        return None if self.profile_bin_mm is None else self.profile_bin_mm * 1e-3

    @classmethod
    def of_pack(cls, **keys: Any) -> "AnalysisChoices":
        """Choices without a case: one section and bins of a mean grain radius, or as given.

        `keys` are those of `AnalysisKeys`. Raises CaseError that names every key with a bad value.
        """
        given = {"sections": 1, "profile_bin_mm": None} | keys
        given["sections"] = _plain_sections(given["sections"])
        try:
            choices = cls.model_validate(given)
        except ValidationError as error:
            raise CaseError("; ".join(map(_refusal, error.errors()))) from None
        for refusal in choices.refusals():
            raise CaseError(refusal)
        return choices

    def changed(self, **keys: Any) -> "AnalysisChoices":
        """The same choices with `keys` changed. Raises CaseError as `of_pack` does."""
        return type(self).of_pack(**self.model_dump() | keys) if keys else self


def with_visible_choices(function: Function) -> Function:
    """The function, whose `**choices: Unpack[AnalysisKeys]` is shown as the single keywords.

    Their defaults are shown as they are without `options`.
    """
    shown = inspect.signature(function)
    usual, kinds = AnalysisChoices.of_pack(), AnalysisKeys.__annotations__
    plain = [one for one in shown.parameters.values() if one.kind is not one.VAR_KEYWORD]
    single = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=getattr(usual, name), annotation=kind
        )
        for name, kind in kinds.items()
    ]
    function.__dict__["__signature__"] = shown.replace(parameters=[*plain, *single])
    return function


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
