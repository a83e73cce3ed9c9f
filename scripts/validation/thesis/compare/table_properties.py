"""The properties that the tables compare, with the thesis's number and ours."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from validation.engine.markdown import NONE, as_told
from validation.thesis.numbers.results import ResultRow
from validation.thesis.numbers.values import ThesisSpecimen

SIGNS = {"about": "about ", "at least": "above ", "at most": "below "}


@dataclass(frozen=True, slots=True, kw_only=True)
class Property:
    """A line of a property table, or a column of a settings table.

    Attributes:
        name: its name, with the unit.
        ours: gives our value from a result row.
        thesis: gives the thesis's value as text.
        scale: factor of our value, 100 for per cent.
    """

    name: str
    ours: Callable[[ResultRow], float]
    thesis: Callable[[ThesisSpecimen], str] = lambda _: NONE
    scale: float = 100.0


def thesis_number(thesis: ThesisSpecimen, field: str, scale: float = 1.0) -> str:
    """A field of the thesis's specimen times `scale`, as text.

    "about", "above" or "below" stand before it as in the thesis; None becomes a dash.
    """
    value = getattr(thesis, field)
    return (
        NONE
        if value is None
        else SIGNS.get(thesis.senses.get(field, ""), "") + as_told(scale * value)
    )


def _losses(thesis: ThesisSpecimen) -> Iterator[float]:
    return (100 * (thesis.porosity - damaged) for damaged in thesis.damaged_porosity)


INITIAL, DAMAGED, LOSS = "initial porosity, %", "damaged porosity, %", "porosity loss, points"
FIRST_LOSS, DEPTH = "porosity loss of the first mm, points", "invaded depth, mm"
DEPTH_95, RUNS, ENDED = "depth of 95 %, mm", "runs", "ended by"
IN_SETTINGS = (INITIAL, DAMAGED, LOSS, FIRST_LOSS, DEPTH, DEPTH_95)
OURS_ONLY = (FIRST_LOSS, DEPTH_95)
PROPERTIES = (
    Property(
        name=INITIAL,
        ours=lambda row: row.porosity_initial,
        thesis=lambda one: as_told(100 * one.porosity),
    ),
    Property(
        name=DAMAGED,
        ours=lambda row: row.porosity_damaged,
        thesis=lambda one: " or ".join(as_told(100 * value) for value in one.damaged_porosity),
    ),
    Property(
        name=LOSS,
        ours=lambda row: row.porosity_initial - row.porosity_damaged,
        thesis=lambda one: " or ".join(as_told(value) for value in _losses(one)),
    ),
    Property(name=FIRST_LOSS, ours=lambda row: row.porosity_loss_first_mm),
    Property(
        name=DEPTH,
        ours=lambda row: row.invasion_depth_mm,
        thesis=lambda one: thesis_number(one, "invaded_depth_mm"),
        scale=1.0,
    ),
    Property(name=DEPTH_95, ours=lambda row: row.invasion_depth_p95_mm, scale=1.0),
    Property(
        name="invaded fines",
        ours=lambda row: float(row.invaded_count),
        thesis=lambda one: thesis_number(one, "invaded_count"),
        scale=1.0,
    ),
    Property(
        name="invaded fines in the first mm",
        ours=lambda row: float(row.count_first_mm),
        thesis=lambda one: thesis_number(one, "count_first_mm"),
        scale=1.0,
    ),
    Property(
        name="invaded fines in the first 0.25 mm, %",
        ours=lambda row: row.fraction_first_0p25mm,
        thesis=lambda one: thesis_number(one, "fraction_first_bin", 100),
    ),
    Property(
        name="invaded fines beyond 0.5 mm, %",
        ours=lambda row: row.fraction_beyond_0p5mm,
        thesis=lambda one: thesis_number(one, "fraction_beyond_0p5mm", 100),
    ),
)
