"""Tables in markdown, and numbers as they are told."""

import math
from collections.abc import Iterable, Sequence

from fdnet.studies.engine.bands import ROUNDING, Band

NONE = "–"


def markdown_table(header: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """A header, a rule and one line each."""
    return "\n".join(
        "| " + " | ".join(line) + " |" for line in [header, ["---"] * len(header), *lines]
    )


def figure(value: float, *, digits: int = 3) -> str:
    """A number with so many significant digits, or all those before the point; a dash for nan."""
    if math.isnan(value):
        return NONE
    if abs(value) < ROUNDING:
        return "0"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{decimals}f}".replace("-", "−")


def as_told(value: float) -> str:
    """A number with the digits that it was told with."""
    return f"{round(value, 6):.6g}"


def with_band(found: Band) -> str:
    """A mean, with half of its 95 % band when that is known."""
    if math.isnan(found.half_width):
        return figure(found.mean)
    return f"{figure(found.mean)} ± {figure(found.half_width, digits=2)}"
