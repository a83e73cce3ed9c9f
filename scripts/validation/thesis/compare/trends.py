"""Whether the thesis's trends hold, at full scale and in the quick forms.

Every comparison has a 95 % interval, Welch's over seeds. A specimen of fewer than three seeds
borrows the spread of its quick form's seeds, unscaled. This is cautious, for the quick form has a
sixth of the cross-section and scatters more. Of n comparisons about n / 40 would come out on each
side of 0 by chance; a trend holds only if all its comparisons do.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from fdnet.statistics.bands import Band
from validation.engine.bands import ROUNDING, Sample, band, difference
from validation.engine.csv_rows import write_flat
from validation.thesis.compare.trend_claims import ALIKE, MARGIN, Claim, claims
from validation.thesis.compare.trend_quantities import (
    QUANTITIES,
    RESPONSES,
    Quantity,
    drag_sample,
    multipliers_of,
    runs_of,
    sample_of,
)
from validation.thesis.numbers.examine import DEFAULT_PAIR, THESIS_PAIR
from validation.thesis.numbers.results import ResultRow
from validation.thesis.runs.plan import QUICK, SPECIMENS

FULL_SCALE, QUICK_FORMS = "full scale", "quick forms"
HOLDS, FAILS, UNDECIDED = "holds", "does not hold", "not decided"
OVERLAP = 0.05
"""Overlap over a diameter above which a remark is made, for squeezed fines pass narrow throats."""
PASSED = 0.05
"""Share of fines passed through above which a remark is made.

The depth of the fines inside is then too small a measure of how deep they went.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """One comparison of one trend; each field is a column of trends.csv.

    Attributes:
        trend: number of the trend, from 1.
        scale: FULL_SCALE or QUICK_FORMS.
        laws: "law, damage law"; empty when the laws do not matter.
        quantity: what is compared.
        unit: unit of all its values.
        sense: what is claimed: "more", "alike" (within `margin`) or "above".
        one: the run that has more.
        other: the run that it is compared with; empty for a bound.
        one_value: mean over the seeds of `one`.
        other_value: mean over the seeds of `other`, or the bound.
        difference: `one_value` less `other_value`.
        low: low end of the 95 % interval of the difference; nan when it is not known.
        high: high end of that interval.
        margin: largest difference that counts as alike; nan for another sense.
        verdict: HOLDS, FAILS or UNDECIDED.
        runs_one: number of seeds of `one`.
        runs_other: number of seeds of `other`.
        spread: whose spread the interval is from, "seeds" or "quick form".
        note: what weakens the comparison.
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
    """All comparisons in the order of the trends.

    Those whose runs are missing are not decided, and their note names the runs.
    """
    comparisons = []
    for scale, prefix in ((FULL_SCALE, ""), (QUICK_FORMS, QUICK)):
        for claim in claims([name for name in SPECIMENS if _scanned(rows, prefix + name)]):
            pairs = (THESIS_PAIR, DEFAULT_PAIR) if _quantity(claim).by_law else (THESIS_PAIR,)
            comparisons += [_compared(rows, claim, scale, prefix, laws=laws) for laws in pairs]
    return sorted(comparisons, key=lambda one: one.trend)


def write_trends(path: Path, comparisons: Sequence[Comparison]) -> Path:
    """Write the comparisons as trends.csv."""
    return write_flat(path, Comparison, comparisons)


def verdict(sense: str, gap: Band, margin: float = 0.0) -> str:
    """What the 95 % interval of a difference decides.

    Args:
        sense: MORE, ALIKE or ABOVE.
        gap: the difference and its interval.
        margin: largest difference that counts as alike.

    Returns:
        HOLDS, FAILS or UNDECIDED. A difference of 0 without scatter does not decide which is more.
    """
    if math.isnan(gap.low) or math.isnan(gap.high) or math.isnan(margin):
        return UNDECIDED
    if sense == ALIKE:
        if -margin <= gap.low and gap.high <= margin:
            return HOLDS
        return FAILS if gap.low > margin or gap.high < -margin else UNDECIDED
    if gap.low > ROUNDING:
        return HOLDS
    return FAILS if gap.high < -ROUNDING else UNDECIDED


def _compared(
    rows: Sequence[ResultRow], claim: Claim, scale: str, prefix: str, *, laws: tuple[str, str]
) -> Comparison:
    names = [prefix + name for name in (claim.one, claim.other) if name]
    samples = [_sample(rows, name, claim.quantity, laws) for name in names]
    gap = difference(*samples) if claim.other else band(samples[0]).less(claim.bound)
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
        difference=gap.mean,
        low=gap.low,
        high=gap.high,
        margin=margin,
        verdict=verdict(claim.sense, gap, margin if claim.sense == ALIKE else 0.0),
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
    """What weakens the comparison: missing runs, runs that did not plug, fines that passed."""
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
