"""The seven trends in one table, a line each: verdicts and numbers."""

import math
from collections import Counter
from collections.abc import Sequence

from fdnet.studies.engine.bands import Band
from fdnet.studies.engine.markdown import figure, markdown_table
from fdnet.studies.thesis.compare.trend_claims import ABOVE, TRENDS
from fdnet.studies.thesis.compare.trends import (
    FAILS,
    FULL_SCALE,
    HOLDS,
    QUICK_FORMS,
    UNDECIDED,
    Comparison,
)
from fdnet.studies.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR
from fdnet.studies.thesis.runs.plan import QUICK

IN_PART, NO_RUNS = "holds in part", "no runs"
LENT = "*"
_MARK = {HOLDS: "", FAILS: " (no)", UNDECIDED: " (open)"}


def trends_table(comparisons: Sequence[Comparison]) -> str:
    """One line a trend: the verdict at full scale and in the quick forms by the thesis's laws, at full scale by
    fdnet's, and the differences, at full scale where there are any, with half of their 95 % intervals; LENT marks
    those with a spread lent by quick forms."""
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


def caveats(comparisons: Sequence[Comparison], scale: str = FULL_SCALE) -> list[str]:
    """What weakens the comparisons of that scale, each told once."""
    notes = [
        note for one in comparisons if one.scale == scale for note in one.note.split("; ") if note
    ]
    return list(dict.fromkeys(notes))


def verdict_of(comparisons: Sequence[Comparison]) -> str:
    """Of several comparisons: what all say, or how many say what. Those of no runs count as not decided."""
    if all(one.runs_one == 0 for one in comparisons):
        return NO_RUNS
    count = Counter(one.verdict for one in comparisons)
    if len(count) == 1:
        word = comparisons[0].verdict
        return f"{word} ({len(comparisons)} of {len(comparisons)})"
    if not count[HOLDS]:
        return f"{FAILS} ({count[FAILS]} of {len(comparisons)}; {count[UNDECIDED]} not decided)"
    rest = [(count[FAILS], "not"), (count[UNDECIDED], "not decided")]
    return f"{IN_PART} ({count[HOLDS]} of {len(comparisons)}; {', '.join(f'{n} {word}' for n, word in rest if n)})"


def _line(number: int, text: str, comparisons: Sequence[Comparison]) -> list[str]:
    trend = [one for one in comparisons if one.trend == number]
    full, quick = (
        [one for one in trend if one.scale == scale] for scale in (FULL_SCALE, QUICK_FORMS)
    )
    by_thesis = [one for one in full if one.laws in ("", ", ".join(THESIS_PAIR))]
    by_default = [one for one in full if one.laws in ("", ", ".join(DEFAULT_PAIR))]
    quick = [one for one in quick if one.laws in ("", ", ".join(THESIS_PAIR))]
    told = _with_runs(by_thesis) or _with_runs(quick)
    same = not any(one.laws for one in trend)
    other = "the same" if same else verdict_of(by_default)
    return [f"{number}. {text}", verdict_of(by_thesis), verdict_of(quick), other, _numbers(told)]


def _with_runs(comparisons: Sequence[Comparison]) -> list[Comparison]:
    return [one for one in comparisons if not math.isnan(one.difference)]


def _numbers(comparisons: Sequence[Comparison]) -> str:
    """By quantity: which specimens, the difference, half of its interval; marked when it does not hold or is open."""
    parts = []
    for quantity in dict.fromkeys(one.quantity for one in comparisons):
        same = [one for one in comparisons if one.quantity == quantity]
        unit = f", {same[0].unit}" if same[0].unit else ""
        parts.append(f"{quantity}{unit}: " + ", ".join(_difference(one) for one in same))
    return "; ".join(parts)


def _difference(one: Comparison) -> str:
    found = Band(mean=one.difference, low=one.low, high=one.high)
    names = " − ".join(_short(name) for name in (one.one, one.other) if name)
    if one.sense == ABOVE and one.other_value:
        names += f" − {figure(one.other_value, digits=2)} {one.unit}"
    text = f"{names}: {figure(found.mean, digits=2)} ± {figure(found.half_width, digits=2)}"
    lent = LENT if "quick form" in one.spread else ""
    margin = "" if math.isnan(one.margin) else f", within {figure(one.margin, digits=2)}?"
    return text + lent + margin + _MARK[one.verdict]


def _short(run: str) -> str:
    return run.removeprefix(QUICK).removeprefix("specimen")
