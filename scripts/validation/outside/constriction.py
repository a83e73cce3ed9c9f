"""What fines do at one constriction, by its diameter over theirs and by friction.

Fines of low friction clog below three diameters and flow above, even crowded (Marin and others,
arXiv 1711.06119). With R from 3.03 to 5.26 the flow of another suspension is intermittent (Souzy
and Marin, J. Fluid Mech. 2022, arXiv 2205.04354). The probability of a clog falls as
ln P = a + b (R^2 - 1) (see `clogs`).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from validation.engine.error_rows import sizes
from validation.engine.study import DONE, Measured, Point, Row, ladder
from validation.outside.answers import Answer
from validation.outside.clogs import (
    FEWEST,
    Clogging,
    Line,
    after_first,
    clogging,
    fitted_line,
    geometric_chance,
)
from validation.outside.orifice import discharge, stokes_number

KNOB, ESCAPED, FLOWING = "hole over fine", "escaped before a clog", "escaped, no clog"
LOW, HIGH = 0.1, 0.5
LONG, SHORT = 800.0, 300.0
"""Longest run at narrow and wide holes, in times in which the fluid passes a fine's diameter."""
RUNS: Mapping[float, Mapping[float, int]] = {
    LOW: {2.0: 40, 2.125: 30, 2.25: 30, 2.375: 24, 2.5: 20, 2.75: 8, 3.0: 8, 3.5: 4},
    HIGH: {2.0: 40, 2.125: 40, 2.25: 36, 2.375: 30, 2.5: 60, 2.625: 48, 2.75: 40}
    | {2.875: 24, 3.0: 10, 3.25: 3},
}
"""Number of runs by friction and R."""
QUICK = ((LOW, 3.0, 1, 20.0), (HIGH, 1.5, 1, 200.0))
WIDE, BELOW, ABOVE = 2.25, 3.0, 3.03
"""Diameters above which fines of low friction clog rarely, below which fines clog, and where the
intermittent range begins."""
_SIGNIFICANT = 0.05
_EXPLAINED = 0.9
_TEST = "tests/studies/test_outside_numbers.py"
_MARIN = "[Marin et al.](https://arxiv.org/abs/1711.06119)"
_SOUZY = "[Souzy and Marin 2022](https://arxiv.org/abs/2205.04354)"
_LAFOND = (
    "[AIChE 2013, 172h](https://aiche.org/conferences/aiche-annual-meeting/2013/"
    "proceeding/paper/172h-orifice-jamming-fluid-driven-granular-flow-1)"
)


def series_of(friction: float) -> str:
    """Name of the runs of that friction."""
    return f"constriction, friction {friction:g}"


def longest(friction: float, ratio: float) -> float:
    """`SHORT` at holes that hardly clog: above 3 diameters, with low friction from 2.5 on."""
    return SHORT if ratio > (WIDE if friction == LOW else BELOW) else LONG


def points(quick: bool) -> list[Point]:
    """Every hole with its number of seeds, for both frictions."""
    plan = (
        list(QUICK)
        if quick
        else [
            (f, r, runs, longest(f, r)) for f, holes in RUNS.items() for r, runs in holes.items()
        ]
    )
    return [
        point
        for friction, ratio, runs, most in plan
        for point in ladder(
            series_of(friction),
            KNOB,
            (ratio,),
            seeds=runs,
            settings={"friction": friction, "most": most},
        )
    ]


def measure(point: Point, work: Path) -> Mapping[str, float]:
    """Fines that escaped, under a name that says whether the hole clogged."""
    settings = point.settings
    end = discharge(
        float(point.value),
        float(settings["friction"]),
        work / point.slug,
        seed=point.seed,
        most=float(settings["most"]),
    )
    name = ESCAPED if end.clogged else FLOWING
    return {name: float(end.escaped), "steps": float(end.steps)}


def judge(measured: Sequence[Measured]) -> list[Row]:
    """Numbers that escaped, as they are."""
    own = [one for one in measured if one.point.series in map(series_of, RUNS)]
    rows = []
    for one in own:
        name = FLOWING if FLOWING in one.observed else ESCAPED
        rows += sizes([one], name)
    return rows


def runs_of(rows: Sequence[Row], friction: float) -> dict[float, list[tuple[int, bool]]]:
    """Runs (escaped, clogged) of a friction by R."""
    own = [row for row in rows if row.series == series_of(friction) and row.status == DONE]
    return {
        ratio: [
            (round(row.observed), row.quantity == ESCAPED) for row in own if row.value == ratio
        ]
        for ratio in sorted({float(row.value) for row in own})
    }


def cloggings_of(rows: Sequence[Row], friction: float) -> dict[float, Clogging]:
    """The probability of a clog of a friction by R."""
    return {ratio: clogging(runs, ratio) for ratio, runs in runs_of(rows, friction).items()}


def line_of(rows: Sequence[Row], friction: float) -> Line:
    """The fitted line of a friction. Raises ValueError below three holes that clogged enough."""
    cloggings = cloggings_of(rows, friction)
    return fitted_line(list(cloggings), list(cloggings.values()))


def least_chance(rows: Sequence[Row], friction: float) -> tuple[float, int]:
    """The least chance of the geometric law over the holes with clogs enough, and their number."""
    chances = []
    for ratio, runs in runs_of(rows, friction).items():
        kept, _ = after_first(runs, ratio)
        if len(kept) >= FEWEST and all(clogged for _, clogged in kept):
            chances.append(geometric_chance([escaped for escaped, _ in kept], seed=1))
    return min(chances, default=float("nan")), len(chances)


def answers(rows: Sequence[Row]) -> list[Answer]:
    """Below and above three diameters, the intermittent range, and the law of the probability."""
    below = {r: runs for r, runs in runs_of(rows, LOW).items() if r < BELOW}
    above = {r: one for r, one in cloggings_of(rows, LOW).items() if r >= BELOW}
    between = {r: one for r, one in cloggings_of(rows, HIGH).items() if r >= ABOVE}
    return [
        *([_below(below)] if below else []),
        *([_above(above)] if above else []),
        *([_between(between)] if between else []),
        *_laws(rows),
    ]


def _below(runs: Mapping[float, Sequence[tuple[int, bool]]]) -> Answer:
    free = {r: ends for r, ends in runs.items() if not all(stopped for _, stopped in ends)}
    clogged = sum(stopped for ends in runs.values() for _, stopped in ends)
    flowing = "; ".join(
        f"at R {r:g} {sum(n for n, _ in ends):,} fines escaped"
        + ("" if any(stopped for _, stopped in ends) else " without a clog")
        for r, ends in free.items()
    )
    return Answer(
        what=f"hole below 3 fine diameters, friction {LOW:g}",
        expected=f"clogs ({_MARIN})",
        measured=f"{clogged} of {sum(map(len, runs.values()))} runs clogged, R {min(runs):g} to "
        f"{max(runs):g}" + (f"; {flowing}" if free else ""),
        holds=None if free else True,
        verdict="partly: clogs become too rare to be seen before R is 3" if free else "",
        test=_TEST,
    )


def _above(holes: Mapping[float, Clogging]) -> Answer:
    clogs, escapes = (
        sum(one.clogs + one.early for one in holes.values()),
        sum(one.escapes for one in holes.values()),
    )
    return Answer(
        what=f"hole of 3 diameters and more, friction {LOW:g}, under a heap that never runs out",
        expected=f"flows without a clog ({_MARIN})",
        measured=f"{clogs} clogs, {escapes:,} fines escaped, R {min(holes):g} to {max(holes):g}; "
        + "; ".join(f"P below {one.high:.1g} at {r:g}" for r, one in holes.items())
        + " (95 %)",
        holds=clogs == 0,
        test=_TEST,
    )


def _between(holes: Mapping[float, Clogging]) -> Answer:
    words = "; ".join(f"R {r:g}: {one.clogs} clogs in {one.escapes:,}" for r, one in holes.items())
    return Answer(
        what=f"hole of 3.03 to 5.26 diameters, friction {HIGH:g}",
        expected=f"flows and stops by turns ({_SOUZY})",
        measured=words,
        holds=None,
        verdict="open: a steady push breaks no arch, so a flow cannot stop by turns",
        test=_TEST,
    )


def _laws(rows: Sequence[Row]) -> list[Answer]:
    lines = []
    for friction in (LOW, HIGH):
        try:
            line = line_of(rows, friction)
        except ValueError:
            continue
        chance, holes = least_chance(rows, friction)
        lines += [
            Answer(
                what=f"fines that escape before a clog, friction {friction:g}",
                expected=f"geometric ({_LAFOND})",
                measured=f"least chance of the sample under its own geometric law {chance:.2g} "
                f"of {holes} holes",
                holds=chance > _SIGNIFICANT / holes,
                test=_TEST,
            ),
            Answer(
                what=f"ln of the probability of a clog over R² − 1, friction {friction:g}",
                expected=f"linear ({_LAFOND})",
                measured=f"slope {line.slope:.2f} ± {line.slope_error:.2f} (95 %) over "
                f"{line.holes} holes, R {line.least:g} to {line.most:g}; it explains "
                f"{100 * line.explained:.0f} % of the variance, and chance alone scatters more in "
                f"{100 * line.chance:.2g} % of cases",
                holds=line.explained > _EXPLAINED and line.chance > _SIGNIFICANT,
                test=_TEST,
            ),
        ]
    return lines


def regime() -> str:
    """The Stokes number of the runs, for the page."""
    return f"{stokes_number():.2g}"
