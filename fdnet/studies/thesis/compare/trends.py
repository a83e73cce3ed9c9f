"""Whether the thesis's trends hold: every comparison with its 95 % interval, at full scale and in the quick forms.

The interval is Welch's over seeds. A specimen of fewer than three seeds borrows the spread of its quick form's seeds,
unscaled, which is the cautious choice: the quick form is a sixth as wide. Of n comparisons about n / 40 would come out
on each side of 0 by chance; a trend holds only if all do.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.studies.engine.bands import ROUNDING, Band, Sample, band, difference
from fdnet.studies.engine.csv_rows import write_flat
from fdnet.studies.thesis.compare.trend_claims import ALIKE, MARGIN, Claim, claims
from fdnet.studies.thesis.compare.trend_quantities import (
    QUANTITIES,
    RESPONSES,
    Quantity,
    drag_sample,
    multipliers_of,
    runs_of,
    sample_of,
)
from fdnet.studies.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR
from fdnet.studies.thesis.numbers.results import ResultRow
from fdnet.studies.thesis.runs.plan import QUICK, SPECIMENS

FULL_SCALE, QUICK_FORMS = "full scale", "quick forms"
HOLDS, FAILS, UNDECIDED = "holds", "does not hold", "not decided"
OVERLAP = 0.05
"""Largest overlap over a diameter from which it is told: squeezed fines pass where others would not."""
PASSED = 0.05
"""Share passed through from which the depth of those inside says too little: the depth of 95 % is beyond the end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One comparison of one trend. `laws` is "law, damage law" or "" when they do not matter.

    `difference` in [low, high] is the mean of `one` less that of `other` (or less the bound `other_value`); its sense
    "more", "alike" (within `margin`) or "above". `runs_one`, `runs_other` count seeds; `spread` tells whose they vary.
    """

    trend: int
    scale: str
    laws: str
    quantity: str
    unit: str
    sense: str
    one: str
    other: str
    one_value: float
    other_value: float
    difference: float
    low: float
    high: float
    margin: float
    verdict: str
    runs_one: int
    runs_other: int
    spread: str
    note: str


def compare_trends(rows: Sequence[ResultRow]) -> list[Comparison]:
    """All comparisons, by trend; those whose runs are missing are not decided, and their note says so."""
    found = []
    for scale, prefix in ((FULL_SCALE, ""), (QUICK_FORMS, QUICK)):
        for claim in claims([name for name in SPECIMENS if _scanned(rows, prefix + name)]):
            pairs = (THESIS_PAIR, DEFAULT_PAIR) if _quantity(claim).by_law else (THESIS_PAIR,)
            found += [_compared(rows, claim, scale, prefix, laws=laws) for laws in pairs]
    return sorted(found, key=lambda one: one.trend)


def write_trends(path: Path, comparisons: Sequence[Comparison]) -> Path:
    """The comparisons as CSV."""
    return write_flat(path, Comparison, comparisons)


def verdict(sense: str, found: Band, margin: float = 0.0) -> str:
    """What the interval says: that a difference is above 0 (or within the margin), that it is not, or neither.

    A difference of none, without scatter, does not decide which is more.
    """
    if math.isnan(found.low) or math.isnan(found.high) or math.isnan(margin):
        return UNDECIDED
    if sense == ALIKE:
        if -margin <= found.low and found.high <= margin:
            return HOLDS
        return FAILS if found.low > margin or found.high < -margin else UNDECIDED
    if found.low > ROUNDING:
        return HOLDS
    return FAILS if found.high < -ROUNDING else UNDECIDED


def _compared(
    rows: Sequence[ResultRow], claim: Claim, scale: str, prefix: str, *, laws: tuple[str, str]
) -> Comparison:
    names = [prefix + name for name in (claim.one, claim.other) if name]
    samples = [_sample(rows, name, claim.quantity, laws) for name in names]
    found = difference(*samples) if claim.other else band(samples[0]).less(claim.bound)
    values = [sample.mean for sample in samples] if claim.other else [samples[0].mean, claim.bound]
    margin = MARGIN * max(values) if claim.sense == ALIKE else math.nan
    return Comparison(
        trend=claim.trend,
        scale=scale,
        laws=", ".join(laws) if _quantity(claim).by_law else "",
        quantity=claim.quantity,
        unit=_unit(claim),
        sense=claim.sense,
        one=names[0],
        other=names[1] if claim.other else "",
        one_value=values[0],
        other_value=values[1],
        difference=found.mean,
        low=found.low,
        high=found.high,
        margin=margin,
        verdict=verdict(claim.sense, found, margin if claim.sense == ALIKE else 0.0),
        runs_one=len(samples[0].values),
        runs_other=len(samples[1].values) if claim.other else 0,
        spread="; ".join(
            dict.fromkeys(sample.spread_of for sample in samples if sample.spread_of)
        ),
        note=_note(rows, names, claim),
    )


def _quantity(claim: Claim) -> Quantity:
    response = RESPONSES.get(claim.quantity)
    return QUANTITIES[response.quantity if response else claim.quantity]


def _unit(claim: Claim) -> str:
    return (
        RESPONSES[claim.quantity].unit
        if claim.quantity in RESPONSES
        else QUANTITIES[claim.quantity].unit
    )


def _sample(rows: Sequence[ResultRow], run: str, quantity: str, laws: tuple[str, str]) -> Sample:
    if quantity in RESPONSES:
        return drag_sample(rows, run, RESPONSES[quantity])
    return sample_of(rows, run, QUANTITIES[quantity], laws)


def _scanned(rows: Sequence[ResultRow], run: str) -> bool:
    """Whether the case was run with at least three multipliers of the drag."""
    return max((len(runs) for runs in multipliers_of(rows, run).values()), default=0) >= 3


def _note(rows: Sequence[ResultRow], names: Sequence[str], claim: Claim) -> str:
    """What weakens the comparison: runs that are missing, that did not plug, whose fines passed through."""
    if claim.quantity in RESPONSES:
        scans = multipliers_of(rows, names[0]).values()
        names = list(dict.fromkeys(row.id for runs in scans for _, row in runs))
    notes = []
    for name in names:
        runs = runs_of(rows, name)
        if not runs:
            notes.append(f"no run of {name}")
        ends = sorted({row.stop_reason for row in runs} - {"plugged"})
        if ends:
            notes.append(f"{name} ended by {', '.join(ends)}")
        deepest = max((row.max_overlap for row in runs), default=0.0)
        if deepest > OVERLAP:
            notes.append(f"fines of {name} overlap by up to {deepest:.0%} of a diameter")
        inside, passed = (
            sum(row.invaded_count for row in runs),
            sum(row.passed_count for row in runs),
        )
        if _quantity(claim).deep and passed > PASSED * (inside + passed):
            share = passed / (inside + passed)
            notes.append(
                f"{share:.0%} of the fines passed through {name}, so they went deeper still"
            )
    return "; ".join(notes)
