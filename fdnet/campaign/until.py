"""When enough seeds have been run: `k_reduction ± 5 %`."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from fdnet.campaign.result.comparison import SHARES, Comparison
from fdnet.campaign.result.pairs import seeds_for_width, student_band
from fdnet.errors import CaseError

FEWEST = 3
"""Seeds before a band is believed; two say almost nothing of a spread."""
_FORM = re.compile(r"\s*([\w.]+)\s*(?:±|\+-|\+/-)\s*([0-9.eE+-]+)\s*(%?)\s*")


@dataclass(frozen=True, slots=True, kw_only=True)
class Until:
    """How narrow the band of a quantity is to be.

    Attributes:
        quantity: of the summaries.
        half_width: of the 95 % band, over the mean if `relative`, else in the quantity's unit.
        relative: whether `half_width` is a share of the mean.
    """

    quantity: str
    half_width: float
    relative: bool

    @property
    def words(self) -> str:
        """The goal in words."""
        if self.relative:
            return f"{self.quantity} within {100 * self.half_width:g} % of its mean"
        return f"{self.quantity} within {self.half_width:g}"


def parse_until(text: str) -> Until:
    """The goal that `--until` gives.

    Percent of a share (k_reduction, a porosity) are points: 45 % ± 5 % is 40 to 50 %. Percent of
    any other quantity are of its mean. Without percent the number has the quantity's unit.

    Raises CaseError for anything else.
    """
    match = _FORM.fullmatch(text)
    try:
        width = float(match[2]) if match else 0.0
    except ValueError:
        width = 0.0
    if match is None or not 0 < width < float("inf"):
        raise CaseError(
            f"--until {text!r}: expected a quantity and the half of its band, e.g. "
            "'k_reduction ± 5 %' or 'k_damaged_m2 +- 10 %'"
        )
    percent = match[3] == "%"
    return Until(
        quantity=match[1],
        half_width=width / 100 if percent else width,
        relative=percent and SHARES.search(match[1]) is None,
    )


def is_reached(until: Until, comparison: Comparison) -> bool:
    """Whether every variant with any result has a band as narrow."""
    return not _too_wide(until, comparison)


def _too_wide(until: Until, comparison: Comparison) -> Mapping[str, list[float]]:
    """Values of the variants whose band is still too wide, or of too few seeds."""
    wide = {}
    for name in comparison.variants:
        values = list(comparison.values(name, until.quantity).values())
        # the whole band, not what the bounds of the quantity leave of it
        if len(values) < FEWEST or student_band(values).half_width > _allowed(until, values):
            wide[name] = values
    return wide


def _allowed(until: Until, values: list[float]) -> float:
    """Half-width that is narrow enough, in the quantity's unit."""
    return until.half_width * (abs(sum(values) / len(values)) if until.relative else 1.0)


def next_seed_count(until: Until, comparison: Comparison, most: int) -> int:
    """How many seeds to have next, at most `most`: what the spread so far asks for.

    They at most double, because a spread of few seeds is itself uncertain.
    """
    have = max(len(comparison.values(n, until.quantity)) for n in comparison.variants)
    needed = FEWEST
    for values in _too_wide(until, comparison).values():
        if len(values) >= FEWEST:
            needed = max(needed, seeds_for_width(values, _allowed(until, values), most))
    return min(most, max(have + 1, min(needed, 2 * have)))
