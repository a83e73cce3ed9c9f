"""Runs gathered by variant: means with bands, differences, and the order of the variants."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

from fdnet.campaign.result.entry import Entry
from fdnet.campaign.result.pairs import Pair, compare_pair, holm, student_band
from fdnet.errors import CaseError
from fdnet.statistics.bands import Band

RANKED_BY = "k_reduction"
SHARES = re.compile(r"(^|\.)(k_reduction|.*porosity.*|.*_fraction|.*_share|\w*over_initial)$")
"""Quantities that are shares of one: a reader sees them in percent."""
_FURTHER_SHARES = re.compile(r"(^|\.)(share_\w+|\w+_loss)$")
_NEVER_NEGATIVE = re.compile(r"((?<!\bb_s)_m|_m2|_m3|_s|_count|_over_k0)$|^seconds\.")
"""Lengths (but for the coefficient b_s_m), permeabilities, volumes, times and counts."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Comparison:
    """Runs and what they say together.

    Attributes:
        title: what is compared.
        path: the folder of the results.
        keys: the keys that are varied.
        entries: all runs, also those that are not done.
        ranked_by: quantity of the order; the smallest is first.
        left_out: folders of planned runs that are not among the entries, for want of a result.
    """

    title: str
    path: Path
    keys: tuple[str, ...]
    entries: tuple[Entry, ...]
    ranked_by: str = RANKED_BY
    left_out: tuple[str, ...] = ()

    @property
    def done(self) -> list[Entry]:
        """The runs that have a result."""
        return [entry for entry in self.entries if entry.status == "done"]

    @property
    def failed(self) -> list[Entry]:
        """The runs that have none, failed or not run."""
        return [entry for entry in self.entries if entry.status != "done"]

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, in their order."""
        return tuple(dict.fromkeys(entry.variant for entry in self.entries))

    @property
    def quantities(self) -> list[str]:
        """Every quantity of which some run has a number."""
        names: dict[str, None] = {}
        for entry in self.done:
            names |= {key: None for key, value in entry.numbers.items() if is_number(value)}
        return list(names)

    def values(self, variant: str, quantity: str) -> dict[int, float]:
        """The quantity of the finished runs of a variant, by seed; those without one left out."""
        return {
            entry.seed: float(entry.numbers[quantity])
            for entry in self.done
            if entry.variant == variant and is_number(entry.numbers.get(quantity))
        }

    def keys_of(self, variant: str) -> Mapping[str, Any]:
        """The varied keys of a variant."""
        return next(entry.keys for entry in self.entries if entry.variant == variant)

    def band(self, variant: str, quantity: str) -> Band:
        """Mean over the seeds of a variant with its 95 % band, cut at the quantity's bounds."""
        values = list(self.values(variant, quantity).values())
        return student_band(values).within(*self.bounds(quantity))

    def bounds(self, quantity: str) -> tuple[float, float]:
        """Least and largest value that the quantity can have: 0 and 1 of a share, 0 of a count.

        They are infinite of any other quantity, and of one that some run has beyond them.
        """
        values: list[Any] = [entry.numbers.get(quantity) for entry in self.done]
        values = [value for value in values if is_number(value)]
        least, most = -math.inf, math.inf
        if SHARES.search(quantity) or _FURTHER_SHARES.search(quantity):
            least, most = 0.0, 1.0
        elif _NEVER_NEGATIVE.search(quantity) or all(type(value) is int for value in values):
            least = 0.0
        return (least, most) if all(least <= v <= most for v in values) else (-math.inf, math.inf)

    def overall(self, quantity: str) -> tuple[Band, int]:
        """Mean over all variants with its band, and the number of seeds that it rests on.

        Of each seed that all variants have, the mean over the variants is one value; the band is
        Student's over these. For one variant this is `band`.
        """
        by_variant = [self.values(variant, quantity) for variant in self.variants]
        seeds = [seed for seed in by_variant[0] if all(seed in one for one in by_variant)]
        means = [math.fsum(one[seed] for one in by_variant) / len(by_variant) for seed in seeds]
        return student_band(means).within(*self.bounds(quantity)), len(seeds)

    def ranking(self) -> list[str]:
        """Variants by the mean of `ranked_by`, smallest first; those without a value last."""
        means = {one: self.band(one, self.ranked_by).mean for one in self.variants}
        return sorted(means, key=lambda one: (math.isnan(means[one]), means[one]))

    def pairs(self, quantity: str | None = None) -> list[Pair]:
        """Every two variants that both have values, in the order of the ranking."""
        name = quantity or self.ranked_by
        having = [one for one in self.ranking() if self.values(one, name)]
        least, most = self.bounds(name)
        pairs = holm(
            [
                compare_pair(
                    (one, other),
                    self.values(one, name),
                    self.values(other, name),
                    paired=self._share_packs(one, other),
                )
                for one, other in combinations(having, 2)
            ]
        )
        return [
            replace(pair, difference=pair.difference.within(least - most, most - least))
            for pair in pairs
        ]

    def _share_packs(self, one: str, other: str) -> bool:
        """Whether runs of the same seed have the same grains in both variants."""
        packs = [{e.seed: e.pack for e in self.done if e.variant == name} for name in (one, other)]
        both = packs[0].keys() & packs[1].keys()
        return bool(both) and all(packs[0][seed] == packs[1][seed] != "" for seed in both)


def is_number(value: Any) -> bool:
    """A finite number, and no yes or no."""
    sound = isinstance(value, int | float) and not isinstance(value, bool)
    return sound and math.isfinite(value)


def refuse_unknown(comparison: Comparison, quantity: str, option: str) -> None:
    """Raises CaseError, with the nearest names, when no finished run has this quantity."""
    import difflib

    names = comparison.quantities
    if names and quantity not in names:
        near = difflib.get_close_matches(quantity, names, n=3, cutoff=0.3)
        raise CaseError(
            f"{option}: {quantity!r} is no number of the summaries; did you mean "
            f"{', '.join(near) or 'k_reduction'}?"
        )


def described(keys: Mapping[str, Any]) -> str:
    """Varied keys in words: `fines.radius_mm = 0.04, fluid.viscosity = 10 cP`."""
    return ", ".join(f"{key} = {value}" for key, value in keys.items())


def total(entries: Sequence[Entry], quantity: str) -> float:
    """Sum of a quantity over the runs that have it."""
    values: list[Any] = [entry.numbers.get(quantity) for entry in entries]
    return math.fsum(value for value in values if is_number(value))
