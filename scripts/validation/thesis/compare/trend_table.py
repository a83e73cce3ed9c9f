"""The seven trends in one table, with verdicts and numbers."""

import math
from collections import Counter
from collections.abc import Sequence

from fdnet.case.file import QUICK
from fdnet.statistics.bands import Band
from validation.engine.markdown import figure, markdown_table
from validation.thesis.compare.trend_claims import ABOVE, TRENDS
from validation.thesis.compare.trends import (
    FAILS,
    FULL_SCALE,
    HOLDS,
    QUICK_FORMS,
    UNDECIDED,
    Comparison,
)
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR

IN_PART, NO_RUNS = "holds in part", "no runs"
BORROWED = "*"
"""Marks a difference with a spread that is borrowed from quick forms."""
_MARK = {HOLDS: "", FAILS: " (no)", UNDECIDED: " (open)"}


def trends_table(comparisons: Sequence[Comparison]) -> str:
    """One line for each trend.

    The columns are the verdict at full scale and in the quick forms by the thesis's laws, the
    verdict at full scale by fdnet's laws, and the differences with half of their 95 % intervals.
    The differences are those at full scale where there are any.
    """
    header = (
        "trend",
        "full scale",
        "quick forms",
        "full scale, fdnet's laws",
        "differences (95 %), the thesis's laws",
    )
    return markdown_table(
        header, [_line(number, text, comparisons) for number, text in enumerate(TRENDS, start=1)]
    )


def flows_table(uniform: Sequence[Comparison], followed: Sequence[Comparison]) -> str:
    """One line for each trend of the quick forms, by the thesis's laws, in both flows.

    The columns are the verdict where the flow is uniform, the one where it follows the deposit,
    and the differences there with half of their 95 % intervals.
    """
    header = ("trend", "uniform flow", "flow that follows", "differences (95 %) where it follows")
    lines = []
    for number, text in enumerate(TRENDS, start=1):
        both = [_of_trend(number, flow, QUICK_FORMS, THESIS_PAIR) for flow in (uniform, followed)]
        verdicts = [verdict_of(one) for one in both]
        lines.append([f"{number}. {text}", *verdicts, _numbers(_with_runs(both[1]))])
    return markdown_table(header, lines)


def caveats(comparisons: Sequence[Comparison], scale: str = FULL_SCALE) -> list[str]:
    """What weakens the comparisons of that scale; each remark stands once."""
    notes = [
        note for one in comparisons if one.scale == scale for note in one.note.split("; ") if note
    ]
    return list(dict.fromkeys(notes))


def verdict_of(comparisons: Sequence[Comparison]) -> str:
    """The common verdict of several comparisons, or the number of each verdict.

    Comparisons without runs count as not decided.
    """
    if all(one.runs_one == 0 for one in comparisons):
        return NO_RUNS
    count = Counter(one.verdict for one in comparisons)
    if len(count) == 1:
        word = comparisons[0].verdict
        return f"{word} ({len(comparisons)} of {len(comparisons)})"
    if not count[HOLDS]:
        return f"{FAILS} ({count[FAILS]} of {len(comparisons)}; {count[UNDECIDED]} not decided)"
    rest = [(count[FAILS], "not"), (count[UNDECIDED], "not decided")]
    others = ", ".join(f"{number} {word}" for number, word in rest if number)
    return f"{IN_PART} ({count[HOLDS]} of {len(comparisons)}; {others})"


def _line(number: int, text: str, comparisons: Sequence[Comparison]) -> list[str]:
    by_thesis, by_default = (
        _of_trend(number, comparisons, FULL_SCALE, pair) for pair in (THESIS_PAIR, DEFAULT_PAIR)
    )
    quick = _of_trend(number, comparisons, QUICK_FORMS, THESIS_PAIR)
    measured = _with_runs(by_thesis) or _with_runs(quick)
    same = not any(one.laws for one in comparisons if one.trend == number)
    other = "the same" if same else verdict_of(by_default)
    return [
        f"{number}. {text}",
        verdict_of(by_thesis),
        verdict_of(quick),
        other,
        _numbers(measured),
    ]


def _of_trend(
    number: int, comparisons: Sequence[Comparison], scale: str, pair: tuple[str, str]
) -> list[Comparison]:
    """The comparisons of a trend at a scale, by a pair of laws where laws matter."""
    return [
        one
        for one in comparisons
        if (one.trend, one.scale) == (number, scale) and one.laws in ("", ", ".join(pair))
    ]


def _with_runs(comparisons: Sequence[Comparison]) -> list[Comparison]:
    return [one for one in comparisons if not math.isnan(one.difference)]


def _numbers(comparisons: Sequence[Comparison]) -> str:
    """The differences by quantity, with half of their intervals.

    A mark stands where the comparison does not hold or is not decided.
    """
    parts = []
    for quantity in dict.fromkeys(one.quantity for one in comparisons):
        same = [one for one in comparisons if one.quantity == quantity]
        unit = f", {same[0].unit}" if same[0].unit else ""
        parts.append(f"{quantity}{unit}: " + ", ".join(_difference(one) for one in same))
    return "; ".join(parts)


def _difference(one: Comparison) -> str:
    interval = Band(mean=one.difference, low=one.low, high=one.high)
    names = " − ".join(_short(name) for name in (one.one, one.other) if name)
    if one.sense == ABOVE and one.other_value:
        names += f" − {figure(one.other_value, digits=2)} {one.unit}"
    text = f"{names}: {figure(interval.mean, digits=2)} ± {figure(interval.half_width, digits=2)}"
    borrowed = BORROWED if "quick form" in one.spread else ""
    margin = "" if math.isnan(one.margin) else f", within {figure(one.margin, digits=2)}?"
    return text + borrowed + margin + _MARK[one.verdict]


def _short(run: str) -> str:
    return run.removeprefix(QUICK).removeprefix("specimen")
