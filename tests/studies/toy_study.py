"""A small study: midpoint sums of x^2, whose error is known, and points that go wrong."""

from pathlib import Path

from fdnet.errors import FlowError
from validation.engine.error_rows import against_exact
from validation.engine.study import Panel, Point, Study


def points(quick: bool) -> list[Point]:
    counts = (4, 8, 16) if quick else (4, 8, 16, 32)
    return [Point(series="midpoint", knob="cells", value=float(n)) for n in counts]


def measure(point: Point, work: Path) -> dict[str, float]:
    assert isinstance(point.value, float)
    (work / "visited").open("a").write(f"{point.key}\n")
    n = int(point.value)
    total = sum(((i + 0.5) / n) ** 2 for i in range(n)) / n
    return {"integral": total, "steps": n, "core_s": 1e-6 * n}


def failing(point: Point, work: Path) -> dict[str, float]:
    if point.value == 8.0:
        raise FlowError("no path at 8")
    if point.value == 16.0:
        while True:
            pass
    if point.value == 32.0:
        raise MemoryError
    return measure(point, work)


def judge(measured):
    return against_exact(measured, "integral", lambda _: 1 / 3)


def toy(**changes) -> Study:
    parts = {
        "name": "toy",
        "title": "Midpoint rule",
        "knob_label": "cells",
        "points": points,
        "measure": measure,
        "judge": judge,
        "panels": (Panel(quantity="integral", title="integral of x²"),),
        "defaults": {"midpoint": 8.0},
        "isolated": False,
    }
    return Study(**(parts | changes))
