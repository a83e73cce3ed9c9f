"""The knee of an error over its cost: the cheapest setting that is nearly as good as the best."""

from collections.abc import Sequence

from validation.engine.levels import Level, order, percent
from validation.engine.study import Value, shown

NEARLY = 2.0
"""The error of the knee over the least one, bands included."""
ALIKE = 1.5
"""Costs within this factor count as about the same."""
FALLS = 0.2
"""Errors fall with cost when the exponent is above this one."""
FEW_SEEDS = 2
"""Levels of so many seeds or fewer have bands that say nothing."""


def knee(levels: Sequence[Level]) -> Level | None:
    """The cheapest level whose error, band included, is at most twice the least one.

    Levels of two seeds, whose bands say nothing, are passed over, and so are single runs where
    others have seeds. None when errors go on falling with cost, or when there is nothing but the
    reference.
    """
    own = _with_bands(levels)
    if not own:
        return None
    best, costliest = min(level.bound for level in own), max(own, key=lambda level: level.cost)
    if order(own) > FALLS and costliest.bound == best:
        return None
    return min(
        (level for level in own if level.bound <= NEARLY * best), key=lambda level: level.cost
    )


def _with_bands(levels: Sequence[Level]) -> list[Level]:
    """Levels that a knee can be taken from: those of more than two seeds, or all single runs."""
    own = [level for level in levels if not level.reference]
    alone = all(level.runs == 1 for level in own)
    return [level for level in own if alone or level.runs > FEW_SEEDS]


def knee_sentence(levels: Sequence[Level], *, default: Value | None, unit: str = "s") -> str:
    """What the levels show, in one sentence.

    The sentence names the knee, the exponent where the error falls with cost, fdnet's default and
    the reference. `unit` is that of the cost.
    """
    own = [level for level in levels if not level.reference]
    if not own:
        return (
            f"only the reference, {shown(levels[0].value)}, was run"
            if levels
            else "no run was done"
        )
    parts = [_knee_words(own, unit), *_order_words(own)]
    parts += [
        f"the default is {_cost_words(level, unit)}"
        for level in levels
        if level.value == default and len(levels) > 1
    ]
    parts += [
        f"errors are relative to {shown(level.value)}, which costs {level.cost:.3g} {unit}"
        for level in levels
        if level.reference
    ]
    return "; ".join(parts)


def _knee_words(own: Sequence[Level], unit: str) -> str:
    least, most = min(own, key=lambda level: level.cost), max(own, key=lambda level: level.cost)
    if len(own) == 1:
        return f"only one setting was run: {_cost_words(own[0], unit)}"
    if most.cost < ALIKE * least.cost:
        low, high = min(own, key=lambda level: level.size), max(own, key=lambda level: level.size)
        return (
            f"all settings cost about the same ({least.cost:.3g} to {most.cost:.3g} {unit}), "
            f"and the error goes from {percent(low)} at {shown(low.value)} "
            f"to {percent(high)} at {shown(high.value)}"
        )
    judged = _with_bands(own)
    if not judged:
        return f"too few seeds were run; the costliest setting is {_cost_words(most, unit)}"
    at, last = knee(own), max(judged, key=lambda level: level.cost)
    if at is None:
        return f"the error falls up to the costliest setting, {_cost_words(last, unit)}"
    if at is last:
        return f"only the costliest setting is good enough, {_cost_words(last, unit)}"
    return (
        f"the cheapest good setting is {_cost_words(at, unit)}; "
        f"the costliest is {_cost_words(most, unit)}"
    )


def _order_words(own: Sequence[Level]) -> list[str]:
    power = order(own)
    return [f"the error falls as the cost to the power of -{power:.2g}"] if power > FALLS else []


def _cost_words(level: Level, unit: str) -> str:
    return f"{shown(level.value)} (error {percent(level)}, {level.cost:.3g} {unit})"
