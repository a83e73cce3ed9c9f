"""What the figures are drawn from: examined runs, the thesis's numbers, and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from validation.thesis.figures.tables import FigureTables
from validation.thesis.numbers.examine import Examined
from validation.thesis.numbers.values import ThesisSpecimen

NO_NUMBERS = ThesisSpecimen(id="")
"""Stands for a specimen of which the thesis reports nothing."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Sources:
    """Everything that a figure may show.

    Attributes:
        examined: examined runs by specimen, one a seed.
        thesis: the thesis's numbers by specimen, and "table3".
        tables: tables of scans, tetrahedra, distances and the growth of a pack.
    """

    examined: Mapping[str, Sequence[Examined]]
    thesis: Mapping[str, ThesisSpecimen] = field(default_factory=dict)
    tables: FigureTables = field(default_factory=FigureTables)

    def numbers(self, specimen: str) -> ThesisSpecimen:
        """The thesis's numbers of a specimen."""
        return self.thesis.get(specimen, NO_NUMBERS)
