"""The answer of `fdnet permeability` as lines for a terminal."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fdnet.errors import Doubt
from fdnet.report.tables import MILLIDARCY, in_millidarcy

if TYPE_CHECKING:
    from fdnet.network.permeability import Analysis

Row = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the user gave, as far as the text depends on it.

    Attributes:
        sides: what each side of the box is.
        sections: whether sections are printed.
        fines: whether there are fines; without them nothing is damaged.
    """

    sides: str
    sections: bool
    fines: bool


def thesis_law_warning(chosen: "Analysis", default: "Analysis") -> str:
    """What laws that are off by factors give, with what fdnet's default laws give of the same."""
    used = default.damage_law_used
    return Doubt(
        "laws-of-the-thesis",
        f"the laws {chosen.law} and {chosen.damage_law} are kept to compare with the thesis, and "
        f"those of the thesis are wrong by factors: they give {_states(chosen)}, where fdnet's "
        f"default laws ({' and '.join(filter(None, (default.law, used)))}) give "
        f"{_states(default)}",
    )


def _states(analysis: "Analysis") -> str:
    """The permeability of an analysis in words."""
    before = f"{in_millidarcy(analysis.k_initial)} mD"
    if analysis.damage_law_used is None or analysis.k_reduction is None:
        return f"{before} without fines"
    after = f"{in_millidarcy(analysis.k_damaged)} mD"
    return f"{before} before and {after} after ({100 * analysis.k_reduction:z.1f} % lost)"


def answer_lines(results: Sequence[Row], given: Given) -> Iterator[str]:
    """The laws as a table, then the sections where there are any, and warnings.

    `results` has one row for each pair of laws, the chosen pair first.
    """
    first = results[0]
    porosity = f"porosity {first['porosity_initial']:.5f}"
    if given.fines:
        porosity += f" -> {first['porosity_damaged']:.5f}"
    yield f"{porosity}, {first['pores']} pores, {first['throats']} throats; {given.sides}"
    yield from _law_lines(results, fines=given.fines)
    if first.get("damage_law_used") not in (None, first["damage_law"]):
        yield f"{first['damage_law']}: the damage law {first['damage_law_used']} was taken"
    if first.get("k_damaged_other_m2") is not None:
        other = first["k_damaged_other_m2"]
        yield (
            f"with fines by {first['damage_law_other']}: {other:.5g} m2, {other / MILLIDARCY:.5g} "
            "mD; the difference is a measure of the error"
        )
    if given.sections:
        yield from _section_lines(first, fines=given.fines)
    for fact in first.get("assumptions", ()):
        yield f"assumed: {fact}"
    for warning in first["warnings"]:
        yield f"warning: {warning}"


def _law_lines(results: Sequence[Row], *, fines: bool) -> Iterator[str]:
    """One line for each pair of laws, or for each of its axes."""
    axes = "xyz" if "k_x_m2" in results[0] else ""
    pairs = fines or len({row["damage_law"] for row in results}) > 1
    yield (
        f"{'law':<11} "
        + (f"{'damage law':<14} " if pairs else "")
        + ("axis " if axes else "")
        + _names(fines=fines)
    )
    for row in results:
        laws = f"{row['law']:<11} " + (f"{row['damage_law']:<14} " if pairs else "")
        for axis in axes:
            values = row[f"k_{axis}_m2"], row[f"k_{axis}_damaged_m2"]
            yield f"{laws}{axis:<4} {_values(*values, fines=fines)}"
        if not axes:
            yield laws + _values(row["k_initial_m2"], row["k_damaged_m2"], fines=fines)


def _section_lines(result: Row, *, fines: bool) -> Iterator[str]:
    where = " along x" if "k_x_m2" in result else ""
    used = result.get("damage_law_used") or result["damage_law"]
    laws = f"{result['law']} and {used}" if fines else result["law"]
    yield f"sections cut out{where}, {laws}:"
    damaged = f"{'damaged':>9} " if fines else ""
    yield f"{'from m':>10} {'to m':>10} {'porosity':>9} {damaged}{_names(fines=fines)}"
    for row in result["sections"]:
        damaged = f"{row['porosity_damaged']:>9.5f} " if fines else ""
        yield (
            f"{row['x_lo_m']:>10.4g} {row['x_hi_m']:>10.4g} {row['porosity_initial']:>9.5f} "
            + damaged
            + _values(row["k_initial_m2"], row["k_damaged_m2"], fines=fines)
        )


def _names(*, fines: bool) -> str:
    damaged = f" {'k damaged m2':>13} {'k damaged mD':>13} {'k/k0':>8}" if fines else ""
    return f"{'k m2':>12} {'k mD':>12}{damaged}"


def _values(before: float, after: float, *, fines: bool) -> str:
    text = f"{before:>12.5g} {before / MILLIDARCY:>12.5g}"
    if not fines:
        return text
    return f"{text} {after:>13.5g} {after / MILLIDARCY:>13.5g} {_ratio(before, after):>8}"


def _ratio(before: float, after: float) -> str:
    return "-" if before == 0 else f"{after / before:.4f}"
