"""What a comparison says, in sentences: the ranking, the pairs, the runs that failed."""

import math
import re
from collections.abc import Sequence

from fdnet.campaign.result.comparison import SHARES, Comparison, described
from fdnet.campaign.result.pairs import MOST_SEEDS, Pair
from fdnet.report.tables import MILLIDARCY
from fdnet.statistics.bands import Band

LABELS = {
    "k_reduction": "permeability lost",
    "k_damaged_m2": "damaged permeability",
    "k_initial_m2": "intact permeability",
    "invasion_depth_m": "depth of the deepest fine",
    "invasion_depth_p95_m": "depth above which 95 % of the fines lie",
    "invaded_count": "fines that invaded",
    "passed_count": "fines that passed",
    "cake_thickness_m": "thickness of the cake",
    "porosity_damaged": "damaged porosity",
}
"""Quantities of a summary in words."""
MOST_NAMED = 3
"""Most variants that a sentence names."""
_UNITS = ((re.compile(r"_m2$"), 1 / MILLIDARCY, "mD"), (re.compile(r"_m$"), 1e3, "mm"))


def label(quantity: str) -> str:
    """A quantity in words."""
    return LABELS.get(quantity, quantity)


def unit_of(quantity: str) -> tuple[float, str]:
    """Factor from SI to the unit that a reader sees, and this unit; "" for a plain number."""
    if SHARES.search(quantity):
        return 100.0, "%"
    return next(((f, unit) for form, f, unit in _UNITS if form.search(quantity)), (1.0, ""))


def value_text(quantity: str, value: float) -> str:
    """A value for a reader, with its unit."""
    factor, unit = unit_of(quantity)
    if math.isnan(value):
        return "no value"
    return f"{_digits(factor * value)} {unit}".strip()


def _digits(value: float) -> str:
    text = f"{value:,.0f}" if abs(value) >= 1000 else f"{value:z.3g}"
    return text.replace("-", "\u2212")


def band_text(quantity: str, band: Band) -> str:
    """A mean with its band: `45 % (95 % band 0 to 92 %, cut at 0 %)`."""
    mean = value_text(quantity, band.mean)
    if math.isnan(band.low):
        return f"{mean} (no band: one run)" if not math.isnan(band.mean) else mean
    factor, unit = unit_of(quantity)
    low, high = _digits(factor * band.low), _digits(factor * band.high)
    cut = " and ".join(value_text(quantity, bound) for bound in band.cut)
    end = f", cut at {cut})" if cut else ")"
    return f"{mean} (95 % band {low} to {high} {unit}".strip() + end


def ranking_lines(comparison: Comparison) -> list[str]:
    """The ranking, one sentence for each variant with its band."""
    quantity, pairs = comparison.ranked_by, comparison.pairs()
    lines = []
    for number, name in enumerate(comparison.ranking(), start=1):
        values = list(comparison.values(name, quantity).values())
        if not values:
            lines.append(f"{number}. {name}: no finished run.")
            continue
        done = sum(entry.variant == name for entry in comparison.done)
        spread = _spread_text(quantity, values, done)
        band = band_text(quantity, comparison.band(name, quantity))
        place = f"{number}. {name}: {label(quantity)} {band}"
        lines.append(f"{place}, {spread}{_ties(name, pairs)}.")
    return lines


def _spread_text(quantity: str, values: Sequence[float], done: int) -> str:
    """The seeds that have a value, and how many of those `done` have none."""
    lack = f" ({done - len(values)} more without a value)" if done > len(values) else ""
    if len(values) == 1:
        return f"1 seed{lack}"
    low, high = (value_text(quantity, value) for value in (min(values), max(values)))
    return f"{len(values)} seeds{lack} from {low} to {high}"


def _ties(name: str, pairs: Sequence[Pair]) -> str:
    """With which variants a variant may be equal."""
    equal = [
        pair.other if pair.one == name else pair.one
        for pair in pairs
        if name in (pair.one, pair.other) and not pair.apart
    ]
    if len(equal) > MOST_NAMED:
        return f"; cannot be distinguished from {len(equal)} others"
    return f"; cannot be distinguished from {', '.join(equal)}" if equal else ""


def pair_lines(comparison: Comparison) -> list[str]:
    """Each difference with its band, and the seeds that would show one that is not shown yet."""
    quantity = comparison.ranked_by
    return [
        f"{pair.one} and {pair.other}: {_pair_text(quantity, pair)}."
        for pair in comparison.pairs()
    ]


def _pair_text(quantity: str, pair: Pair) -> str:
    gap = band_text(quantity, pair.difference)
    how = "paired by seed, same packs" if pair.paired else "packs not shared"
    text = f"difference {gap}, {how}"
    if pair.apart:
        return f"{text}; they differ"
    if math.isnan(pair.p_value):
        return f"{text}; one seed each says nothing about chance"
    if pair.seeds_needed is None:
        return f"{text}; not distinguished, and {MOST_SEEDS:,} seeds would not do it either"
    return (
        f"{text}; not distinguished: a difference of this size needs some "
        f"{pair.seeds_needed} seeds of each"
    )


def failure_lines(comparison: Comparison) -> list[str]:
    """Each run that has no result, with its reason and folder."""
    failed = [
        f"{entry.name} {entry.status}: {entry.reason} (folder {entry.folder})"
        for entry in comparison.failed
    ]
    left_out = (f"{folder}: has no result and is left out" for folder in comparison.left_out)
    return [*failed, *left_out]


def variant_text(comparison: Comparison, name: str) -> str:
    """A variant by its keys, where its name does not say them."""
    keys = comparison.keys_of(name)
    return described(keys) if keys else "as the case file says"
