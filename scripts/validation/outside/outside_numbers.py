"""The invasion against numbers from outside, on the real binary: one page, one command."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

from validation.engine.study import Measured, Point, Row, Study
from validation.outside import (
    collision,
    constriction,
    ergun,
    free_fine,
    passing,
    rolling,
    settling,
    three_spheres,
    throat,
)
from validation.outside.figure import draw
from validation.outside.page import page

CASES: Sequence[ModuleType] = (
    throat,
    passing,
    constriction,
    ergun,
    settling,
    free_fine,
    rolling,
    collision,
    three_spheres,
)
"""Modules of the cases in the order of the page; each has points, measure, judge, answers."""


def points(quick: bool) -> list[Point]:
    """The points of all cases."""
    return [point for case in CASES for point in case.points(quick)]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """What the point's case measures."""
    observed: Mapping[str, float] = _case_of(point).measure(point, work)
    return observed


def _case_of(point: Point) -> ModuleType:
    return next(
        case
        for case in CASES
        for quick in (True, False)
        if point.series in {own.series for own in case.points(quick)}
    )


def judge(measured: Sequence[Measured]) -> list[Row]:
    """The rows of all cases."""
    return [row for case in CASES for row in case.judge(measured)]


def text(rows: Sequence[Row]) -> str:
    """The page: the answers of all cases, then what the runs were."""
    return page([answer for case in CASES for answer in case.answers(rows)], rows)


STUDY = Study(
    name="outside-numbers",
    title="The invasion against numbers from outside",
    knob_label="case",
    points=points,
    measure=measure,
    judge=judge,
    panels=(),
    isolated=False,
    needs_liggghts=True,
    page=text,
    draw=draw,
)
