"""One row of the table of scales."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One row of the table of scales.

    Attributes:
        name: what it is, in words.
        symbol: as in the formulas.
        value: in `unit`.
        unit: SI; "-" for a number without a unit.
        formula: how it follows from the case.
        source: author and year, or where it was measured.
    """

    name: str
    symbol: str
    value: float
    unit: str
    formula: str
    source: str


def row(name: str, symbol: str, value: float, unit: str, formula: str, source: str) -> Quantity:
    return Quantity(
        name=name, symbol=symbol, value=value, unit=unit, formula=formula, source=source
    )
