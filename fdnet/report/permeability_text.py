"""The answer of `fdnet permeability` as lines for a terminal."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

Row = Mapping[str, Any]


def answer_lines(results: Sequence[Row], *, sections: bool) -> Iterator[str]:
    """The laws as a table, then the three axes and the sections where there are any, and warnings.

    `results` has one row for each pair of laws, the chosen pair first.
    """
    first = results[0]
    yield (
        f"porosity {first['porosity_initial']:.5f} -> {first['porosity_damaged']:.5f}, "
        f"{first['pores']} pores, {first['throats']} throats"
    )
    if "k_x_m2" in first:
        yield from _axis_lines(results)
    else:
        yield from _law_lines(results)
    if sections:
        yield from _section_lines(first)
    for warning in first["warnings"]:
        yield f"warning: {warning}"


def _law_lines(results: Sequence[Row]) -> Iterator[str]:
    yield f"{'law':<11} {'damage law':<11} {'k m2':>12} {'k damaged m2':>13} {'k/k0':>8}"
    for row in results:
        yield (
            f"{row['law']:<11} {row['damage_law']:<11} {row['k_initial_m2']:>12.5g} "
            f"{row['k_damaged_m2']:>13.5g} {_ratio(row['k_initial_m2'], row['k_damaged_m2']):>8}"
        )


def _axis_lines(results: Sequence[Row]) -> Iterator[str]:
    yield (
        f"{'law':<11} {'damage law':<11} {'axis':<4} {'k m2':>12} {'k damaged m2':>13} {'k/k0':>8}"
    )
    for row in results:
        for axis in "xyz":
            before, after = row[f"k_{axis}_m2"], row[f"k_{axis}_damaged_m2"]
            yield (
                f"{row['law']:<11} {row['damage_law']:<11} {axis:<4} {before:>12.5g} "
                f"{after:>13.5g} {_ratio(before, after):>8}"
            )


def _section_lines(result: Row) -> Iterator[str]:
    where = " along x" if "k_x_m2" in result else ""
    yield f"sections cut out{where}, {result['law']} and {result['damage_law']}:"
    yield (
        f"{'from m':>10} {'to m':>10} {'porosity':>9} {'damaged':>9} {'k m2':>12} "
        f"{'k damaged m2':>13} {'k/k0':>8}"
    )
    for row in result["sections"]:
        before, after = row["k_initial_m2"], row["k_damaged_m2"]
        yield (
            f"{row['x_lo_m']:>10.4g} {row['x_hi_m']:>10.4g} {row['porosity_initial']:>9.5f} "
            f"{row['porosity_damaged']:>9.5f} {before:>12.5g} {after:>13.5g} "
            f"{_ratio(before, after):>8}"
        )


def _ratio(before: float, after: float) -> str:
    return "-" if before == 0 else f"{after / before:.4f}"
